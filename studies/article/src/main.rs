//! `cargo run -p study-article --release`: the article reproduced, as report, animation, figures and tables.
#![forbid(unsafe_code)]

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Parser;
use indicatif::ProgressBar;
use muslip_recordings::output::{create_folder, write_file};
use muslip_report::text::write_tables;
use muslip_report::{FigureFormat, write_figures};
use study_article::{
    CONVERGENCE_PAGE, Paper, PaperOptions, article_markdown, convergence_page, figures,
    report_page, reproduce, work,
};

/// Reproduce the article that the filter comes from: its statements, its figures, its errors.
///
/// R. Rudd, "Estimating the Mu Slip Curve via Extended Kalman Filtering", The Mathematica Journal 11
/// (2011). Each statement is held against many streams of noise; errors of the filter, its second pass
/// and the batch fit stand beside the Cramér-Rao bound. The same arguments give the same bytes.
#[derive(Debug, Parser)]
#[command(name = "study-article", version, max_term_width = 100)]
struct Arguments {
    /// Folder for the report, the animation, the figures and the tables (Markdown).
    #[arg(long, value_name = "FOLDER", default_value = "study-article")]
    out: PathBuf,
    /// Streams of noise.
    #[arg(long, value_name = "N", default_value_t = PaperOptions::default().streams,
          value_parser = clap::value_parser!(u64).range(2..=1_000_000))]
    seeds: u64,
    /// Seed of the first stream, which the figures show; the others follow it one by one.
    #[arg(long, value_name = "SEED", default_value_t = PaperOptions::default().seed)]
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
    let options = PaperOptions {
        seed: arguments.seed,
        streams: arguments.seeds,
    };
    // Before the work, so that a folder that cannot be made is told at once.
    create_folder(&arguments.out)?;
    let started = Instant::now();
    let bar = ProgressBar::new(work(options));
    let paper = reproduce(options, &mut |done| bar.set_position(done));
    bar.finish_and_clear();
    let seconds = started.elapsed().as_secs_f64();
    let written = write_all(&paper, &arguments.out, arguments.format)?;
    let mut out = io::stdout().lock();
    if arguments.json {
        writeln!(out, "{:#}", paper.to_json())?;
        return Ok(());
    }
    tell(&paper, &mut out)?;
    writeln!(out, "Computed in {seconds:.1} s.")?;
    for path in written {
        writeln!(out, "Written: {}", path.display())?;
    }
    Ok(())
}

/// Writes every file; returns those to name.
fn write_all(paper: &Paper, folder: &Path, format: FigureFormat) -> Result<Vec<PathBuf>> {
    const REFUSED: &str = "the figures cannot be drawn";
    let drawings = folder.join("figures");
    let named = figures(paper.options.seed).context(REFUSED)?;
    let named = named
        .iter()
        .map(|named| (named.name.clone(), &named.figure));
    write_figures(&drawings, named, format)?;
    let [report, convergence, tables] =
        ["report.html", CONVERGENCE_PAGE, "article.md"].map(|name| folder.join(name));
    let page = report_page(paper).context(REFUSED)?;
    write_file(&report, page.to_html()?.as_bytes())?;
    let page = convergence_page(paper.options).context(REFUSED)?;
    write_file(&convergence, page.to_html()?.as_bytes())?;
    write_file(&tables, article_markdown(paper).as_bytes())?;
    Ok(vec![report, convergence, tables, drawings])
}

fn tell(paper: &Paper, out: &mut impl Write) -> Result<()> {
    let tables = [
        (
            "The article's statements beside ours",
            paper.statements_table(),
        ),
        (
            "Errors against the Cramér-Rao bound (in brackets: standard error of the last digits)",
            paper.yardstick_table(),
        ),
    ];
    write_tables(out, &tables, &[paper.missing_estimates()])?;
    Ok(())
}
