//! The estimate after every sample, as CSV, JSON or Parquet.

use std::io::{self, Write};
use std::path::Path;

use muslip_formats::{Cells, ColumnKind, ParquetTable};
use serde::Serialize;

/// Rows of a Parquet trace that are written at once.
const ROWS_AT_ONCE: usize = 1 << 16;

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
    /// Parquet, one column a quantity.
    Parquet,
}

impl TraceFormat {
    /// The format that a file's ending asks for: `.json`, `.jsonl` or `.ndjson`, `.parquet`, else CSV.
    pub fn of(path: &Path) -> Self {
        match path.extension().and_then(|ending| ending.to_str()) {
            Some("json") => Self::Json,
            Some("jsonl" | "ndjson") => Self::JsonLines,
            Some("parquet") => Self::Parquet,
            _ => Self::Csv,
        }
    }
}

impl TraceRow {
    /// The names of its quantities, in the order of [`TraceRow::values`].
    const NAMES: [&str; 13] = [
        "time_s",
        "slip",
        "friction",
        "peak_friction",
        "critical_slip",
        "p11",
        "p12",
        "p22",
        "innovation",
        "noise_variance",
        "signal_before",
        "signal_after",
        "nis",
    ];

    fn values(&self) -> [f64; 13] {
        [
            self.time_s,
            self.slip,
            self.friction,
            self.peak_friction,
            self.critical_slip,
            self.p11,
            self.p12,
            self.p22,
            self.innovation,
            self.noise_variance,
            self.signal_before,
            self.signal_after,
            self.nis,
        ]
    }
}

/// Writes a trace row by row.
#[derive(Debug)]
pub struct TraceWriter<W: Write + Send>(Inner<W>);

#[derive(Debug)]
#[allow(clippy::large_enum_variant, reason = "one of it in an estimate")]
enum Inner<W: Write + Send> {
    Csv(W),
    Json {
        sink: W,
        rows: u64,
    },
    JsonLines(W),
    Parquet {
        table: ParquetTable<W>,
        /// Rows to be written, by column.
        columns: [Vec<f64>; 13],
    },
}

impl<W: Write + Send> TraceWriter<W> {
    /// Starts a trace.
    ///
    /// # Errors
    /// What `sink` answers; [`io::ErrorKind::Unsupported`] for Parquet in a build without it.
    pub fn new(mut sink: W, format: TraceFormat) -> io::Result<Self> {
        Ok(Self(match format {
            TraceFormat::Csv => {
                writeln!(sink, "{}", TraceRow::NAMES.join(","))?;
                Inner::Csv(sink)
            }
            TraceFormat::Json => {
                write!(sink, "[")?;
                Inner::Json { sink, rows: 0 }
            }
            TraceFormat::JsonLines => Inner::JsonLines(sink),
            TraceFormat::Parquet => {
                let columns = TraceRow::NAMES.map(|name| (name, ColumnKind::Numbers));
                Inner::Parquet {
                    table: ParquetTable::new(sink, &columns)?,
                    columns: Default::default(),
                }
            }
        }))
    }

    /// Ends the trace and gives the sink back.
    ///
    /// # Errors
    /// What the sink answers.
    pub fn finish(self) -> io::Result<W> {
        match self.0 {
            Inner::Csv(sink) | Inner::JsonLines(sink) => Ok(sink),
            Inner::Json { mut sink, .. } => {
                sink.write_all(b"\n]\n")?;
                Ok(sink)
            }
            Inner::Parquet {
                mut table,
                mut columns,
            } => {
                write_columns(&mut table, &mut columns)?;
                table.finish()
            }
        }
    }
}

/// Writes the rows that wait, if any do.
fn write_columns<W: Write + Send>(
    table: &mut ParquetTable<W>,
    columns: &mut [Vec<f64>; 13],
) -> io::Result<()> {
    if columns[0].is_empty() {
        return Ok(());
    }
    let cells: Vec<Cells<'_>> = columns.iter().map(|c| Cells::Numbers(c)).collect();
    table.rows(&cells)?;
    columns.iter_mut().for_each(Vec::clear);
    Ok(())
}

impl<W: Write + Send> TraceSink for TraceWriter<W> {
    /// Writes one row, every number with all its digits.
    fn row(&mut self, row: &TraceRow) -> io::Result<()> {
        match &mut self.0 {
            Inner::Csv(sink) => {
                for (place, value) in row.values().into_iter().enumerate() {
                    let separator = if place == 0 { "" } else { "," };
                    write!(sink, "{separator}{value:?}")?;
                }
                sink.write_all(b"\n")
            }
            Inner::Json { sink, rows } => {
                let separator: &[u8] = if *rows == 0 { b"\n" } else { b",\n" };
                *rows += 1;
                sink.write_all(separator)?;
                Ok(serde_json::to_writer(sink, row)?)
            }
            Inner::JsonLines(sink) => {
                serde_json::to_writer(&mut *sink, row)?;
                sink.write_all(b"\n")
            }
            Inner::Parquet { table, columns } => {
                for (column, value) in columns.iter_mut().zip(row.values()) {
                    column.push(value);
                }
                if columns[0].len() >= ROWS_AT_ONCE {
                    write_columns(table, columns)?;
                }
                Ok(())
            }
        }
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
            ("t.parquet", TraceFormat::Parquet),
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
