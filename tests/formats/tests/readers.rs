//! What other programs wrote is read, value for value; fewer samples than written is a failure.

use formats_tests::{files, folder};
use muslip_formats::SourceFile;
use serde_json::Value;

/// Largest difference, relative to the value.
const TOLERANCE: f64 = 1e-12;

fn same(read: f64, written: f64) -> bool {
    (read.is_nan() && written.is_nan())
        || (read - written).abs() <= TOLERANCE * written.abs().max(1e-300)
}

fn numbers(list: &Value) -> Option<Vec<f64>> {
    let list = list.as_array()?;
    Some(
        list.iter()
            .map(|value| value.as_f64().unwrap_or(f64::NAN))
            .collect(),
    )
}

/// What is wrong with the reading of one file, line by line.
fn complaints(path: &std::path::Path, written: &Value) -> Vec<String> {
    let mut out = Vec::new();
    let mut file = match SourceFile::open(path) {
        Ok(file) => file,
        // A file that holds nothing for us may be refused.
        Err(error) => {
            let empty = written["channels"].as_array().is_some_and(Vec::is_empty);
            return if empty { out } else { vec![error.to_string()] };
        }
    };
    let channels = file.channels().to_vec();
    for wanted in written["channels"].as_array().into_iter().flatten() {
        let (group, name) = (
            wanted["group"].as_str().unwrap_or(""),
            wanted["name"].as_str().unwrap_or(""),
        );
        let Some(at) = channels
            .iter()
            .position(|channel| channel.group == group && channel.name == name)
        else {
            out.push(format!("{group}/{name} is not listed"));
            continue;
        };
        let unit = wanted["unit"].as_str().unwrap_or("");
        if !unit.is_empty() && channels[at].unit != unit {
            out.push(format!(
                "{group}/{name}: unit {:?} instead of {unit:?}",
                channels[at].unit
            ));
        }
        let series = match file.read(&[at]).map(|mut series| series.pop()) {
            Ok(Some(series)) => series,
            Ok(None) => continue,
            // Refused with a reason is no wrong value; only files of test generators may hold such.
            Err(error) if written["faults"].is_null() => {
                println!("refused: {error}");
                continue;
            }
            Err(error) => {
                out.push(error.to_string());
                continue;
            }
        };
        let values = numbers(&wanted["values"]).unwrap_or_default();
        if series.values.len() != values.len() {
            out.push(format!(
                "{group}/{name}: {} samples read, {} written",
                series.values.len(),
                values.len()
            ));
            continue;
        }
        let invalid: Vec<usize> = series
            .invalid
            .iter()
            .flatten()
            .enumerate()
            .filter(|(_, invalid)| **invalid)
            .map(|(k, _)| k)
            .collect();
        let wanted_invalid: Vec<usize> = wanted["invalid"]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(Value::as_u64)
            .map(|k| k as usize)
            .collect();
        if invalid != wanted_invalid {
            out.push(format!(
                "{group}/{name}: invalid {invalid:?} instead of {wanted_invalid:?}"
            ));
        }
        if let Some(k) = (0..values.len()).find(|&k| !same(series.values[k], values[k])) {
            out.push(format!(
                "{group}/{name}: {} instead of {} at {k}",
                series.values[k], values[k]
            ));
        }
        if let Some(times) = numbers(&wanted["times"]) {
            let read = series.time_s.as_deref().cloned().unwrap_or_default();
            if read.len() != times.len() {
                out.push(format!(
                    "{group}/{name}: {} time stamps read, {} written",
                    read.len(),
                    times.len()
                ));
            } else if let Some(k) = (0..times.len())
                .find(|&k| (read[k] - times[k]).abs() > 1e-12 * times[k].abs().max(1.0))
            {
                out.push(format!(
                    "{group}/{name}: time {} instead of {} at {k}",
                    read[k], times[k]
                ));
            }
        }
    }
    for refused in written["refused"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(Value::as_str)
    {
        let at = channels.iter().position(|channel| channel.name == refused);
        match at.map(|at| file.read(&[at])) {
            Some(Ok(_)) => out.push(format!("{refused} should have been refused")),
            Some(Err(error)) => assert!(error.to_string().contains(refused), "{error}"),
            None => {}
        }
    }
    match written["faults"].as_bool() {
        Some(true) if file.faults().is_empty() => out.push("no fault is told".to_owned()),
        Some(false) if !file.faults().is_empty() => {
            out.push(format!("faults: {:?}", file.faults()))
        }
        _ => {}
    }
    out
}

#[test]
fn every_value_that_was_written_is_read() {
    let Some(folder) = folder() else { return };
    let all = files(&folder);
    assert!(
        all.len() > 150,
        "{} files in {}",
        all.len(),
        folder.display()
    );
    let mut wrong = Vec::new();
    for (path, written) in &all {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        wrong.extend(
            complaints(path, written)
                .into_iter()
                .map(|line| format!("{name}: {line}")),
        );
    }
    println!("{} files, {} complaints", all.len(), wrong.len());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
