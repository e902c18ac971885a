//! `muslip convert`.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use muslip_formats::convert::convert;
use muslip_formats::map::Map;
use muslip_formats::roles::Refused;
use muslip_formats::stream::{RowSink, Stream, StreamError, Streamed};
use muslip_formats::{Cells, ColumnKind, ParquetTable, SourceFile};
use muslip_recordings::input_error::{InputError, InputProblem};
use muslip_recordings::output::{OutputError, OutputFile};
use muslip_recordings::recording::{RecordingWriter, Required, write_comments};

use super::failure::Failure;
use super::mapping::Mapping;
use super::progress::Progress;
use super::terminal::Terminal;

/// Convert a file of any format into a recording: the contract's columns in SI units on one time.
///
/// Channels on other rasters are interpolated between their own readings, never beyond them or across gaps; faster ones are low-passed first. The
/// recording says how it was made: in comment lines of a CSV, in metadata of Parquet; every command that reads it finds that again.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
muslip convert --out run.csv run.mf4\n  \
muslip convert --map map.toml --rate 100 --out run.parquet run.tdms")]
pub(super) struct Arguments {
    #[command(flatten)]
    mapping: Mapping,
    /// Rows a second, instead of the times of the fastest channel.
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// The recording: Parquet where the name ends in .parquet, CSV otherwise.
    #[arg(long, value_name = "OUT.csv")]
    out: PathBuf,
    /// The file.
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

/// Rows from which a file is converted some rows at a time, where it can be: what was done is then known when the rows are written already.
const LONG_ROWS: u64 = 1 << 20;

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    let mut map = arguments.mapping.chosen(None)?;
    if let Some(rate) = arguments.rate {
        if !(rate.is_finite() && rate > 0.0) {
            return Err(Failure::Usage("--rate must be finite and positive".into()));
        }
        let map = map.get_or_insert_default();
        map.time.rate_hz = Some(rate);
        map.time.raster = None;
    }
    let mut file = SourceFile::open(&arguments.file).map_err(InputError::from)?;
    let stream = Stream::of(&file, map.as_ref()).map_err(InputError::from)?;
    let told = match stream.filter(|stream| stream.announced_rows() >= LONG_ROWS) {
        Some(stream) => streamed(arguments, &file, &stream)?,
        None => whole(arguments, &mut file, map.as_ref())?,
    };
    let out = arguments.out.display();
    let names = told.names.join(", ");
    terminal.headline(&format!("{out}: {} rows of {names}", told.rows))?;
    for note in &told.notes {
        terminal.line(&format!("  {note}"))?;
    }
    Ok(())
}

/// What a conversion came to.
struct Told {
    names: Vec<String>,
    rows: u64,
    notes: Vec<String>,
}

/// An error where a column that every other command needs was not guessed.
fn complete(
    arguments: &Arguments,
    guessed: bool,
    names: &[String],
    refused: &[Refused],
) -> Result<(), Failure> {
    let missing = Required::DragIncluded
        .channels()
        .find(|channel| guessed && !names.iter().any(|name| name == channel.name()));
    match missing {
        Some(channel) => {
            let problem = InputProblem::missing(channel.name(), refused);
            Err(InputError::whole_file(&arguments.file, problem).into())
        }
        None => Ok(()),
    }
}

/// Converts a file that is read whole.
fn whole(arguments: &Arguments, file: &mut SourceFile, map: Option<&Map>) -> Result<Told, Failure> {
    let converted = convert(file, map).map_err(InputError::from)?;
    complete(
        arguments,
        converted.guessed,
        &converted.names,
        &converted.refused,
    )?;
    let out = &arguments.out;
    let fail = |error| OutputError::new(out, error);
    let mut sink = OutputFile::create(out)?;
    if is_parquet(out) {
        sink = muslip_formats::write_parquet(sink, &converted).map_err(fail)?;
    } else {
        let made = &converted.made;
        let above = [converted.notes.clone(), made.resampled_lines()].concat();
        let mut csv = csv(sink, &above, &converted.names).map_err(fail)?;
        write_rows(&mut csv, &converted.columns).map_err(fail)?;
        sink = csv.into_inner();
        write_comments(&mut sink, &made.fault_lines()).map_err(fail)?;
    }
    sink.flush().map_err(fail)?;
    sink.commit()?;
    Ok(Told {
        rows: converted.columns.first().map_or(0, Vec::len) as u64,
        names: converted.names,
        notes: converted.notes,
    })
}

/// Converts a long file some rows at a time; what was done to it stands behind its rows.
fn streamed(arguments: &Arguments, file: &SourceFile, stream: &Stream) -> Result<Told, Failure> {
    let names = stream.names();
    complete(arguments, stream.guessed(), &names, stream.refused())?;
    let out = &arguments.out;
    let fail = |error| OutputError::new(out, error);
    let sink = OutputFile::create(out)?;
    let mut rows = if is_parquet(out) {
        let columns: Vec<(&str, ColumnKind)> = names
            .iter()
            .map(|name| (name.as_str(), ColumnKind::Numbers))
            .collect();
        Rows::Parquet(ParquetTable::new(sink, &columns).map_err(fail)?)
    } else {
        Rows::Csv(csv(sink, &[], &names).map_err(fail)?)
    };
    let mut progress = Progress::new("convert", stream.announced_rows());
    let streamed = stream.run(file, &mut rows, &mut |rows| progress.done(rows));
    drop(progress);
    let streamed = streamed.map_err(|error| match error {
        StreamError::Format(error) => Failure::from(InputError::from(error)),
        StreamError::Sink(error) => fail(error).into(),
    })?;
    let mut sink = rows.finish(&streamed).map_err(fail)?;
    sink.flush().map_err(fail)?;
    sink.commit()?;
    Ok(Told {
        names,
        rows: streamed.rows,
        notes: streamed.notes,
    })
}

/// Where the rows of a long file go.
#[allow(clippy::large_enum_variant, reason = "one of it in a conversion")]
enum Rows {
    Csv(RecordingWriter<OutputFile>),
    Parquet(ParquetTable<OutputFile>),
}

impl RowSink for Rows {
    fn rows(&mut self, columns: &[Vec<f64>]) -> std::io::Result<()> {
        match self {
            Self::Csv(csv) => write_rows(csv, columns),
            Self::Parquet(table) => {
                let cells: Vec<Cells<'_>> = columns.iter().map(|c| Cells::Numbers(c)).collect();
                table.rows(&cells)
            }
        }
    }
}

impl Rows {
    fn finish(self, streamed: &Streamed) -> std::io::Result<OutputFile> {
        match self {
            Self::Csv(csv) => {
                let mut sink = csv.into_inner();
                write_comments(&mut sink, &streamed.notes)?;
                write_comments(&mut sink, &streamed.made.resampled_lines())?;
                write_comments(&mut sink, &streamed.made.fault_lines())?;
                Ok(sink)
            }
            Self::Parquet(mut table) => {
                table.note_making(&streamed.notes, &streamed.made);
                if let Some(start) = &streamed.start_time {
                    table.note("start_time", start);
                }
                table.finish()
            }
        }
    }
}

fn is_parquet(out: &Path) -> bool {
    out.extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("parquet"))
}

/// A recording with its comments and header.
fn csv(
    sink: OutputFile,
    notes: &[String],
    names: &[String],
) -> std::io::Result<RecordingWriter<OutputFile>> {
    let names: Vec<String> = names.iter().map(|name| cell(name)).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    Ok(RecordingWriter::new(sink, notes, &names)?.exact())
}

fn write_rows(csv: &mut RecordingWriter<OutputFile>, columns: &[Vec<f64>]) -> std::io::Result<()> {
    let rows = columns.first().map_or(0, Vec::len);
    let mut row = Vec::with_capacity(columns.len());
    for k in 0..rows {
        row.clear();
        let values = columns.iter().map(|column| column.get(k).copied());
        row.extend(values.map(|value| value.unwrap_or(f64::NAN)));
        csv.row(&row)?;
    }
    Ok(())
}

/// A header of any name, quoted where it must be.
fn cell(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) || name.starts_with('#') {
        return format!("\"{}\"", name.replace('"', "\"\""));
    }
    name.to_owned()
}
