//! Predictions as files: `muslip predict`.

use std::io::{self, Write};

use muslip_diagnose::repaired::{Prediction, RepairedError, Which};
use muslip_recordings::load::Loaded;
use muslip_recordings::model_file::ModelFile;
use muslip_recordings::recording::push_exact;

/// Predicts a recording, row by row of the file.
///
/// # Errors
/// [`RepairedError`] where the model cannot be run.
pub fn predict(
    model: &ModelFile,
    loaded: &Loaded,
    which: Which,
) -> Result<Prediction, RepairedError> {
    let mut prediction = model.repaired.predict(&loaded.run, which)?;
    prediction.time_s = loaded.recorded_time_s();
    Ok(prediction)
}

/// Writes a prediction as CSV, every number with all its digits; a missing time is an empty cell.
///
/// # Errors
/// What `sink` answers.
pub fn write(mut sink: impl Write, prediction: &Prediction) -> io::Result<()> {
    sink.write_all(b"time_s,drag_force_n,drag_force_sigma_n,contact_force_n\n")?;
    let mut line = String::new();
    let columns = [
        &prediction.drag_force_n,
        &prediction.drag_force_sigma_n,
        &prediction.contact_force_n,
    ];
    for (row, &time) in prediction.time_s.iter().enumerate() {
        line.clear();
        push_exact(&mut line, time);
        for column in columns {
            line.push(',');
            push_exact(&mut line, column.get(row).copied().unwrap_or(f64::NAN));
        }
        line.push('\n');
        sink.write_all(line.as_bytes())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_is_read_back_as_it_was() {
        let numbers = vec![0.1 + 0.2, 1e-7, 1.0 / 3e20, -1.5e300, 0.0];
        let prediction = Prediction {
            time_s: vec![0.0, 0.1, 0.2, f64::NAN, 1e17],
            drag_force_n: numbers.clone(),
            drag_force_sigma_n: vec![1.0; 5],
            contact_force_n: vec![-0.0; 5],
        };
        let mut bytes = Vec::new();
        write(&mut bytes, &prediction).unwrap();
        let text = String::from_utf8(bytes).unwrap();
        let rows: Vec<Vec<&str>> = text
            .lines()
            .skip(1)
            .map(|l| l.split(',').collect())
            .collect();
        assert_eq!(rows.len(), 5);
        for (row, number) in rows.iter().zip(numbers) {
            assert_eq!(row[1].parse::<f64>().unwrap(), number);
            assert_eq!(&row[2..], ["1", "0"]);
        }
        assert_eq!(rows[3][0], "");
        assert_eq!(rows[4][0], "1e17");
    }
}
