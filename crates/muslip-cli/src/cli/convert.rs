//! `muslip convert`.

use std::io::Write as _;
use std::path::PathBuf;

use clap::Args;
use muslip_formats::SourceFile;
use muslip_formats::convert::{Converted, convert};
use muslip_recordings::input_error::{InputError, InputProblem};
use muslip_recordings::output::{OutputError, OutputFile};
use muslip_recordings::recording::{RecordingWriter, Required};

use super::failure::Failure;
use super::mapping::Mapping;
use super::terminal::Terminal;

/// Convert a file of any format into a recording: the contract's columns in SI units on one time.
///
/// Channels on other rasters are interpolated between their own readings, never beyond them or across gaps; faster ones are low-passed first. The
/// recording says how it was made: in comment lines of a CSV, in metadata of Parquet.
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
    let converted = convert(&mut file, map.as_ref()).map_err(InputError::from)?;
    if converted.guessed {
        let missing = Required::DragIncluded
            .channels()
            .find(|channel| !converted.names.iter().any(|name| name == channel.name()));
        if let Some(channel) = missing {
            let refused = converted
                .refused
                .iter()
                .find(|(role, _)| *role == channel.name());
            let problem = match refused {
                Some((_, reason)) => InputProblem::Channels(reason.clone()),
                None => InputProblem::MissingColumn(channel.name()),
            };
            return Err(InputError::whole_file(&arguments.file, problem).into());
        }
    }
    let out = &arguments.out;
    let fail = |error| OutputError::new(out, error);
    let mut sink = OutputFile::create(out)?;
    if out
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("parquet"))
    {
        muslip_formats::write_parquet(&mut sink, &converted).map_err(fail)?;
    } else {
        write_csv(&mut sink, &converted).map_err(fail)?;
    }
    sink.flush().map_err(fail)?;
    sink.commit()?;
    let rows = converted.columns.first().map_or(0, Vec::len);
    terminal.headline(&format!(
        "{}: {rows} rows of {}",
        out.display(),
        converted.names.join(", ")
    ))?;
    for note in &converted.notes {
        terminal.line(&format!("  {note}"))?;
    }
    Ok(())
}

fn write_csv(sink: &mut OutputFile, converted: &Converted) -> std::io::Result<()> {
    let names: Vec<String> = converted.names.iter().map(|name| cell(name)).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut writer = RecordingWriter::new(sink, &converted.notes, &names)?.exact();
    let rows = converted.columns.first().map_or(0, Vec::len);
    let mut row = Vec::with_capacity(names.len());
    for k in 0..rows {
        row.clear();
        row.extend(
            converted
                .columns
                .iter()
                .map(|column| column.get(k).copied().unwrap_or(f64::NAN)),
        );
        writer.row(&row)?;
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
