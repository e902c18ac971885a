//! `cargo run -p study-quarter-car --release`: the quarter car's stops, as report, figures and tables.
#![forbid(unsafe_code)]

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Result;
use clap::Parser;
use indicatif::ProgressBar;
use muslip_recordings::output::{create_folder, write_file};
use muslip_report::text::write_tables;
use muslip_report::{FigureFormat, write_figures};
use study_quarter_car::{Study, StudyOptions, figures, markdown, report_page, study, work};

/// Brake a simulated quarter car on estimates from wheel speed: figures, comparison, Monte Carlo.
///
/// After P. Goddard's tutorial. Draws the true signals, the estimated signals and the mass of a 3 s stop
/// from 30 m/s, and holds slip control on several filters against the best stop that the brake allows, on
/// dry and wet asphalt, on snow and through a step. The same arguments give the same bytes.
#[derive(Debug, Parser)]
#[command(name = "study-quarter-car", version, max_term_width = 100)]
struct Arguments {
    /// Folder for the report, the figures and the tables (Markdown).
    #[arg(long, value_name = "FOLDER", default_value = "study-quarter-car")]
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

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    let options = StudyOptions {
        seed: arguments.seed,
        stops: arguments.stops,
        draws: arguments.draws,
    };
    // Before the work, so that a folder that cannot be made is told at once.
    create_folder(&arguments.out)?;
    let started = Instant::now();
    let bar = ProgressBar::new(work());
    let study = study(options, &mut |done| bar.set_position(done))?;
    bar.finish_and_clear();
    let seconds = started.elapsed().as_secs_f64();
    let written = write_all(&study, &arguments.out, arguments.format)?;
    let mut out = io::stdout().lock();
    if arguments.json {
        writeln!(out, "{:#}", study.to_json())?;
        return Ok(());
    }
    tell(&study, &mut out)?;
    writeln!(out, "Computed in {seconds:.1} s.")?;
    for path in written {
        writeln!(out, "Written: {}", path.display())?;
    }
    Ok(())
}

/// Writes every file; returns those to name.
fn write_all(study: &Study, folder: &Path, format: FigureFormat) -> Result<Vec<PathBuf>> {
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

fn tell(study: &Study, out: &mut impl Write) -> Result<()> {
    let tables = [
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
    ];
    write_tables(out, &tables, &[study.foreign_verdict(), study.verdict()])?;
    Ok(())
}
