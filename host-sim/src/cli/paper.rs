//! `muslip paper`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use muslip_recordings::output::{create_folder, write_file};

use super::Failure;
use super::progress::Progress;
use super::terminal::Terminal;
use crate::paper::{
    CONVERGENCE_PAGE, Paper, PaperOptions, article_markdown, convergence_page, figures,
    report_page, reproduce, work,
};
use crate::report::{FigureFormat, write_figures};

/// Reproduce the article that the filter comes from: its statements, its figures, its errors.
///
/// R. Rudd, "Estimating the Mu Slip Curve via Extended Kalman Filtering", The Mathematica Journal 11
/// (2011). Each statement is held against many streams of noise; errors of the filter, its second pass
/// and the batch fit stand beside the Cramér-Rao bound. The same arguments give the same bytes.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
muslip paper\n  \
muslip paper --seeds 1000 --seed 7 --out quick\n  \
muslip paper --json > article.json")]
pub(super) struct Arguments {
    /// Folder for the report, the animation, the figures and the tables (Markdown).
    #[arg(long, value_name = "FOLDER", default_value = "muslip-paper")]
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

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    let options = PaperOptions {
        seed: arguments.seed,
        streams: arguments.seeds,
    };
    // Before the work, so that a folder that cannot be made is told at once.
    create_folder(&arguments.out)?;
    let started = Instant::now();
    let mut progress = Progress::new("paper", work(options));
    let paper = reproduce(options, &mut |done| progress.done(done));
    drop(progress);
    let seconds = started.elapsed().as_secs_f64();
    let written = write_all(&paper, &arguments.out, arguments.format)?;
    if arguments.json {
        return terminal.json(&paper.to_json());
    }
    tell(&paper, terminal)?;
    terminal.line(&format!("Computed in {seconds:.1} s."))?;
    for path in written {
        terminal.line(&format!("Written: {}", path.display()))?;
    }
    Ok(())
}

/// Writes every file; returns those to name.
fn write_all(paper: &Paper, folder: &Path, format: FigureFormat) -> Result<Vec<PathBuf>, Failure> {
    let refused = |error| Failure::Internal(format!("the figures cannot be drawn: {error}"));
    let drawings = folder.join("figures");
    let named = figures(paper.options.seed).map_err(refused)?;
    let named = named
        .iter()
        .map(|named| (named.name.clone(), &named.figure));
    write_figures(&drawings, named, format)?;
    let [report, convergence, tables] =
        ["report.html", CONVERGENCE_PAGE, "article.md"].map(|name| folder.join(name));
    let page = report_page(paper).map_err(refused)?;
    write_file(&report, page.to_html()?.as_bytes())?;
    let page = convergence_page(paper.options).map_err(refused)?;
    write_file(&convergence, page.to_html()?.as_bytes())?;
    write_file(&tables, article_markdown(paper).as_bytes())?;
    Ok(vec![report, convergence, tables, drawings])
}

fn tell(paper: &Paper, terminal: &mut Terminal) -> Result<(), Failure> {
    terminal.headline("The article's statements beside ours")?;
    terminal.wide_table(&paper.statements_table())?;
    terminal.headline(
        "Errors against the Cramér-Rao bound (in brackets: standard error of the last digits)",
    )?;
    terminal.wide_table(&paper.yardstick_table())?;
    terminal.paragraph(&paper.missing_estimates())?;
    terminal.line("")
}
