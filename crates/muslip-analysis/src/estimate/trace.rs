//! The estimate after every sample, as CSV or JSON.

use std::io::{self, Write};
use std::path::Path;

use serde::Serialize;

/// One used sample and the estimate after it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TraceRow {
    /// Time in s.
    pub time_s: f64,
    /// Measured slip.
    pub slip: f64,
    /// Measured friction.
    pub friction: f64,
    /// Estimate of the peak friction after the update.
    pub peak_friction: f64,
    /// Estimate of the critical slip after the update.
    pub critical_slip: f64,
    /// Variance of the peak friction after the update.
    pub p11: f64,
    /// Covariance of the two after the update.
    pub p12: f64,
    /// Variance of the critical slip after the update.
    pub p22: f64,
    /// Measured minus predicted friction.
    pub innovation: f64,
    /// Noise variance of the measurement, with inflation and pseudonoise.
    pub noise_variance: f64,
    /// H P H' before the update.
    pub signal_before: f64,
    /// H P H' after the update.
    pub signal_after: f64,
    /// Innovation squared over its variance.
    pub nis: f64,
}

/// Who takes the estimate after every used sample.
pub trait TraceSink {
    /// Takes one row.
    ///
    /// # Errors
    /// The sink's own.
    fn row(&mut self, row: &TraceRow) -> io::Result<()>;
}

impl TraceSink for Vec<TraceRow> {
    fn row(&mut self, row: &TraceRow) -> io::Result<()> {
        self.push(*row);
        Ok(())
    }
}

/// How a trace is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TraceFormat {
    /// A header row and one row a sample.
    Csv,
    /// One JSON array of objects.
    Json,
    /// One JSON object a line.
    JsonLines,
}

impl TraceFormat {
    /// The format that a file's ending asks for: `.json`, `.jsonl` or `.ndjson`, else CSV.
    pub fn of(path: &Path) -> Self {
        match path.extension().and_then(|ending| ending.to_str()) {
            Some("json") => Self::Json,
            Some("jsonl" | "ndjson") => Self::JsonLines,
            _ => Self::Csv,
        }
    }
}

/// Writes a trace row by row.
#[derive(Debug)]
pub struct TraceWriter<W: Write> {
    sink: W,
    format: TraceFormat,
    rows: u64,
}

impl<W: Write> TraceWriter<W> {
    /// Starts a trace.
    ///
    /// # Errors
    /// What `sink` answers.
    pub fn new(mut sink: W, format: TraceFormat) -> io::Result<Self> {
        match format {
            TraceFormat::Csv => writeln!(
                sink,
                "time_s,slip,friction,peak_friction,critical_slip,p11,p12,p22,innovation,\
                 noise_variance,signal_before,signal_after,nis"
            )?,
            TraceFormat::Json => write!(sink, "[")?,
            TraceFormat::JsonLines => {}
        }
        Ok(Self {
            sink,
            format,
            rows: 0,
        })
    }

    /// Ends the trace and gives the sink back.
    ///
    /// # Errors
    /// What the sink answers.
    pub fn finish(mut self) -> io::Result<W> {
        if self.format == TraceFormat::Json {
            self.sink.write_all(b"\n]\n")?;
        }
        Ok(self.sink)
    }
}

impl<W: Write> TraceSink for TraceWriter<W> {
    /// Writes one row, every number with all its digits.
    fn row(&mut self, row: &TraceRow) -> io::Result<()> {
        match self.format {
            TraceFormat::Csv => writeln!(
                self.sink,
                "{:?},{:?},{:?},{:?},{:?},{:?},{:?},{:?},{:?},{:?},{:?},{:?},{:?}",
                row.time_s,
                row.slip,
                row.friction,
                row.peak_friction,
                row.critical_slip,
                row.p11,
                row.p12,
                row.p22,
                row.innovation,
                row.noise_variance,
                row.signal_before,
                row.signal_after,
                row.nis
            )?,
            TraceFormat::Json => {
                let separator: &[u8] = if self.rows == 0 { b"\n" } else { b",\n" };
                self.sink.write_all(separator)?;
                serde_json::to_writer(&mut self.sink, row)?;
            }
            TraceFormat::JsonLines => {
                serde_json::to_writer(&mut self.sink, row)?;
                self.sink.write_all(b"\n")?;
            }
        }
        self.rows += 1;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_of_the_name_chooses_the_format() {
        for (name, format) in [
            ("t.csv", TraceFormat::Csv),
            ("t", TraceFormat::Csv),
            ("t.json", TraceFormat::Json),
            ("t.jsonl", TraceFormat::JsonLines),
        ] {
            assert_eq!(TraceFormat::of(Path::new(name)), format);
        }
    }

    #[test]
    fn json_of_no_rows_one_and_two_is_an_array() {
        let row = TraceRow {
            time_s: 0.5,
            slip: 0.1,
            friction: 0.3,
            peak_friction: 0.35,
            critical_slip: 0.15,
            p11: 1e-4,
            p12: -1e-5,
            p22: 1e-4,
            innovation: 0.01,
            noise_variance: 0.02,
            signal_before: 0.3,
            signal_after: 0.02,
            nis: 0.5,
        };
        for count in 0..3 {
            let mut writer = TraceWriter::new(Vec::new(), TraceFormat::Json).unwrap();
            for _ in 0..count {
                writer.row(&row).unwrap();
            }
            let text = writer.finish().unwrap();
            let value: serde_json::Value = serde_json::from_slice(&text).unwrap();
            assert_eq!(value.as_array().unwrap().len(), count);
        }
    }
}
