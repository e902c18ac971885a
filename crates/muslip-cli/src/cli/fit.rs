//! `muslip fit`.

use std::path::PathBuf;

use clap::Args;
use muslip::filter::PeakEstimate;
use muslip_analysis::fit::{DEFAULT_MAXIMUM_ITERATIONS, FitResult, fit_recordings};
use muslip_analysis::wording::verdict_sentence;
use muslip_recordings::recording::Recording;
use muslip_recordings::rig_file::RigFile;

use super::failure::Failure;
use super::mapping::Mapping;
use super::progress::Progress;
use super::terminal::Terminal;

/// Fit the two-parameter law to one or several recordings at once (Levenberg-Marquardt).
///
/// Rows are selected as in `estimate` and have equal weight. The covariance is s^2 (J'J)^-1.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
muslip fit --rig rig.toml run.csv\n  \
muslip fit --rig rig.toml --json run1.csv run2.csv run3.csv")]
pub(super) struct Arguments {
    /// Rig file (TOML).
    #[arg(long, value_name = "RIG.toml")]
    rig: PathBuf,
    #[command(flatten)]
    mapping: Mapping,
    /// Maximum number of iterations (accepted steps).
    #[arg(long, value_name = "N", default_value_t = DEFAULT_MAXIMUM_ITERATIONS)]
    max_iterations: usize,
    /// Print one JSON object and nothing else.
    #[arg(long)]
    json: bool,
    /// The recordings (CSV, or any format that `muslip channels` lists), fitted together.
    #[arg(value_name = "RUN.csv", required = true)]
    recordings: Vec<PathBuf>,
}

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    let rig = RigFile::read(&arguments.rig)?;
    let map = arguments.mapping.chosen(Some(&arguments.rig))?;
    let mut recordings = Vec::with_capacity(arguments.recordings.len());
    for path in &arguments.recordings {
        recordings.push(Recording::open_mapped(path, map.as_ref())?);
    }
    let bytes: u64 = recordings.iter().map(Recording::length_bytes).sum();
    let mut progress = Progress::bytes("fit", 2 * bytes);
    let result = fit_recordings(
        &mut recordings,
        &rig,
        arguments.max_iterations,
        &mut |bytes| progress.done(bytes),
    )?;
    drop(progress);
    if arguments.json {
        return terminal.json(&result.to_json());
    }
    tell(&result, terminal)
}

fn tell(result: &FitResult, terminal: &mut Terminal) -> Result<(), Failure> {
    let fit = &result.fit;
    let peak = PeakEstimate {
        peak_friction: fit.curve.peak_friction,
        peak_friction_std: fit.peak_friction_std(),
        critical_slip: fit.curve.critical_slip,
        critical_slip_std: fit.critical_slip_std(),
        correlation: fit.correlation(),
    };
    terminal.headline(&verdict_sentence(&peak))?;
    terminal.line("")?;
    let ended = if fit.converged {
        "converged"
    } else {
        "not converged: iteration limit reached"
    };
    let mut rows = vec![
        ("rmse of friction", format!("{:.5}", fit.rmse_friction)),
        ("iterations", format!("{}, {ended}", fit.iterations)),
    ];
    for run in &result.runs {
        let skipped = match run.skipped.total() {
            0 => String::new(),
            _ => format!(", skipped {}", run.skipped.in_words()),
        };
        rows.push((
            "recording",
            format!(
                "{}: {} used{skipped}, rmse {:.5}",
                run.path.display(),
                run.used,
                run.rmse_friction
            ),
        ));
    }
    terminal.peak_table(&peak, rows)?;
    if let Some(factor) = result.understatement() {
        terminal.line("")?;
        terminal.paragraph(&format!(
            "Neighbouring residuals are correlated ({:.2}): filtered noise, or a tyre curve of another shape. \
             The 1-sigma values assume independent samples and are too small by a factor of about {factor:.0}.",
            result.residual_correlation
        ))?;
    }
    Ok(())
}
