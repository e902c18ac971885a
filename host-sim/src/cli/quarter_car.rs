//! `muslip quarter-car`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use muslip_recordings::output::{create_folder, write_file};

use super::Failure;
use super::progress::Progress;
use super::terminal::Terminal;
use crate::quarter_car::{
    SetupError, Study, StudyOptions, figures, markdown, report_page, study, work,
};
use crate::report::{FigureFormat, write_figures};

/// Brake a simulated quarter car on estimates from wheel speed: figures, comparison, Monte Carlo.
///
/// After P. Goddard's tutorial. Draws the true signals, the estimated signals and the mass of a 3 s stop
/// from 30 m/s, and holds slip control on several filters against the best stop that the brake allows, on
/// dry and wet asphalt, on snow and through a step. The same arguments give the same bytes.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
muslip quarter-car\n  \
muslip quarter-car --stops 2 --draws 2 --out quick\n  \
muslip quarter-car --json > quarter-car.json")]
pub(super) struct Arguments {
    /// Folder for the report, the figures and the tables (Markdown).
    #[arg(long, value_name = "FOLDER", default_value = "muslip-quarter-car")]
    out: PathBuf,
    /// Stops of each row of the comparison, which differ in their noise.
    #[arg(long, value_name = "N", default_value_t = StudyOptions::default().stops,
          value_parser = clap::value_parser!(u64).range(1..=100_000))]
    stops: u64,
    /// Vehicles drawn for each row of the Monte Carlo.
    #[arg(long, value_name = "N", default_value_t = StudyOptions::default().draws,
          value_parser = clap::value_parser!(u64).range(1..=100_000))]
    draws: u64,
    /// Seed of the first stop, which the figures show; the others follow it one by one.
    #[arg(long, value_name = "SEED", default_value_t = StudyOptions::default().seed)]
    seed: u64,
    /// How the figures are written, for a document.
    #[arg(long, value_enum, default_value_t = FigureFormat::Svg)]
    format: FigureFormat,
    /// Print one JSON object and nothing else; files are written all the same.
    #[arg(long)]
    json: bool,
}

impl From<SetupError> for Failure {
    fn from(error: SetupError) -> Self {
        Self::Internal(error.to_string())
    }
}

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    let options = StudyOptions {
        seed: arguments.seed,
        stops: arguments.stops,
        draws: arguments.draws,
    };
    // Before the work, so that a folder that cannot be made is told at once.
    create_folder(&arguments.out)?;
    let started = Instant::now();
    let mut progress = Progress::new("quarter-car", work());
    let study = study(options, &mut |done| progress.done(done))?;
    drop(progress);
    let seconds = started.elapsed().as_secs_f64();
    let written = write_all(&study, &arguments.out, arguments.format)?;
    if arguments.json {
        return terminal.json(&study.to_json());
    }
    tell(&study, terminal)?;
    terminal.line(&format!("Computed in {seconds:.1} s."))?;
    for path in written {
        terminal.line(&format!("Written: {}", path.display()))?;
    }
    Ok(())
}

/// Writes every file; returns those to name.
fn write_all(study: &Study, folder: &Path, format: FigureFormat) -> Result<Vec<PathBuf>, Failure> {
    let drawings = folder.join("figures");
    let named = figures(study.options.seed)?;
    let named = named
        .iter()
        .map(|named| (named.name.to_owned(), &named.figure));
    write_figures(&drawings, named, format)?;
    let [report, tables] = ["report.html", "quarter-car.md"].map(|name| folder.join(name));
    write_file(&report, report_page(study)?.to_html()?.as_bytes())?;
    write_file(&tables, markdown(study)?.as_bytes())?;
    Ok(vec![report, tables, drawings])
}

fn tell(study: &Study, terminal: &mut Terminal) -> Result<(), Failure> {
    for (heading, table) in [
        ("The best stop (e)", study.references_table()),
        ("Distance over that of (e)", study.comparison_table()),
        (
            "The best stop with another tyre law in the plant",
            study.foreign_references_table(),
        ),
        (
            "Distance over that of (e), other tyre law",
            study.foreign_table(),
        ),
        ("Other speeds, dead time", study.variants_table()),
        (
            "Monte Carlo: mass, radius ±2 %, noise × 2, one sample late",
            study.monte_carlo_table(),
        ),
        (
            "The tuned filter with what goes wrong",
            study.faults_table(),
        ),
        ("What five samples tell", study.observability_table()),
    ] {
        terminal.headline(heading)?;
        terminal.wide_table(&table)?;
    }
    terminal.paragraph(&study.foreign_verdict())?;
    terminal.verdict(&study.verdict(), study.keeps_all())
}
