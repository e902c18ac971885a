//! `muslip diagnose`.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use clap::Args;
use muslip_analysis::property_file::PropertyFile;
use muslip_analysis::records::of_diagnosis;
use muslip_diagnose::outcome::Diagnosis;
use muslip_recordings::load;
use muslip_recordings::output::write_file;
use muslip_report::diagnose::files::{self, WriteError};
use muslip_report::diagnose::page;
use muslip_report::diagnose::summary::{WIDEST_LINE, summary};
use muslip_report::diagnose::views::Views;
use muslip_report::{FigureFormat, write_figures};

use super::failure::Failure;
use super::fit::tell_property_file;
use super::mapping::Mapping;
use super::progress::Progress;
use super::records::write_records;
use super::terminal::Terminal;

/// Find the effects in recordings that the simulation lacks: where, which mechanism, size, confidence.
///
/// Writes diagnosis.json, model.toml (the repaired model, for `predict` and `estimate --model`) and
/// report.html into a folder when the diagnosis is complete. Give several recordings of one rig: names and
/// model.toml come from all of them, and a second model, made without some, is scored on those. Faults in the data are
/// listed, and the other samples are used.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
muslip diagnose --rig rig.toml --out found run1.csv run2.csv run3.csv\n  \
muslip diagnose --rig rig.toml --out found --json runs/*.csv | jq .verdict")]
pub(super) struct Arguments {
    /// Rig file (TOML).
    #[arg(long, value_name = "RIG.toml")]
    rig: PathBuf,
    #[command(flatten)]
    mapping: Mapping,
    /// Folder for the three files; created if missing.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Also write the report's plots as image files, into DIR/figures.
    #[arg(long, value_enum)]
    format: Option<FigureFormat>,
    /// Also write the law that was found as a tyre property file: longitudinal coefficients of the Magic Formula 5.2, for simulations.
    #[arg(long, value_name = "OUT.tir")]
    tir: Option<PathBuf>,
    /// Write the diagnosis as Parquet as well, one row an entry of its lists.
    #[arg(long, value_name = "OUT.parquet")]
    parquet: Option<PathBuf>,
    /// Print diagnosis.json and nothing else.
    #[arg(long)]
    json: bool,
    /// The recordings (CSV, or any format that `muslip channels` lists), one file per run.
    #[arg(value_name = "RUN.csv", required = true)]
    recordings: Vec<PathBuf>,
}

/// Steps of the bar; reading takes the first of them.
const STEPS: f64 = 1000.0;
const READING: f64 = 100.0;

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    let out = &arguments.out;
    let (diagnosis, views) = diagnosed(
        &arguments.rig,
        &arguments.recordings,
        arguments.mapping.map.as_deref(),
        out,
    )?;
    let text = files::write(out, &diagnosis, &views, &command(arguments))?;
    if let Some(format) = arguments.format {
        let report = page::report(&diagnosis, &views, "");
        let figures = report.figures();
        let figures = figures.iter().map(|(name, figure)| (name.clone(), figure));
        write_figures(&out.join("figures"), figures, format)?;
    }
    if let Some(path) = &arguments.parquet {
        let whole = serde_json::to_value(&diagnosis)
            .map_err(|error| Failure::Internal(error.to_string()))?;
        write_records(path, &of_diagnosis(&whole), &whole)?;
    }
    // A law that was not fitted is no failure of the diagnosis: it is said, and nothing is written.
    let property_file = match &arguments.tir {
        Some(path) => {
            let file = PropertyFile::of_model(&diagnosis.repaired);
            if let Ok(file) = &file {
                write_file(path, file.text.as_bytes())?;
            }
            Some((path, file))
        }
        None => None,
    };
    if arguments.json {
        return terminal.bytes(text.as_bytes());
    }
    let summary = summary(&diagnosis, out, terminal.width(WIDEST_LINE));
    for line in &summary.verdict {
        terminal.verdict(line, summary.good)?;
    }
    for line in &summary.lines {
        terminal.line(line)?;
    }
    if let Some(path) = &arguments.parquet {
        terminal.line(&format!("Written: {}", path.display()))?;
    }
    match property_file {
        Some((path, Ok(file))) => tell_property_file(path, &file, terminal)?,
        Some((path, Err(error))) => {
            terminal.paragraph(&format!("{} is not written: {error}.", path.display()))?;
        }
        None => {}
    }
    Ok(())
}

/// Reads and diagnoses a campaign under a bar; the demo does too. The folder for what is found is made
/// when the input has been read, so that bad input leaves nothing behind.
pub(super) fn diagnosed(
    rig: &Path,
    recordings: &[PathBuf],
    map: Option<&Path>,
    out: &Path,
) -> Result<(Diagnosis, Views), Failure> {
    let bar = Mutex::new(Progress::new("read", STEPS as u64));
    let tell = |what: &str, steps: f64| {
        let mut bar = bar.lock().unwrap_or_else(PoisonError::into_inner);
        bar.says(what);
        bar.done(steps as u64);
    };
    let campaign = load::campaign_mapped(rig, recordings, map, &|share| {
        tell("read", READING * share);
    })?;
    files::prepare_folder(out)?;
    Ok(files::diagnosed(campaign, &|share, what| {
        tell(what, READING + (STEPS - READING) * share);
    }))
}

/// The command that makes the report again, without where it goes.
fn command(arguments: &Arguments) -> String {
    let recordings: Vec<String> = arguments
        .recordings
        .iter()
        .map(|path| shown(path))
        .collect();
    format!(
        "muslip diagnose --rig {} {}{}",
        shown(&arguments.rig),
        arguments.mapping.words(),
        recordings.join(" ")
    )
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

impl From<WriteError> for Failure {
    fn from(error: WriteError) -> Self {
        match error {
            WriteError::Output(error) => Self::Output(error),
            WriteError::Report(error) => error.into(),
            error @ WriteError::Text(_) => Self::Internal(error.to_string()),
        }
    }
}
