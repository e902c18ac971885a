//! `muslip fit`.

use std::path::{Path, PathBuf};

use clap::Args;
use muslip::filter::PeakEstimate;
use muslip_analysis::fit::{DEFAULT_MAXIMUM_ITERATIONS, FitResult, fit_recordings};
use muslip_analysis::property_file::PropertyFile;
use muslip_analysis::records::of_result;
use muslip_analysis::wording::verdict_sentence;
use muslip_recordings::output::write_file;
use muslip_recordings::recording::Recording;

use super::failure::Failure;
use super::mapping::Mapping;
use super::progress::Progress;
use super::records::write_records;
use super::rig_source::RigOrRadius;
use super::terminal::Terminal;

/// Fit the two-parameter law to one or several recordings at once (Levenberg-Marquardt).
///
/// Rows are selected as in `estimate` and have equal weight. The covariance is s^2 (J'J)^-1.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
muslip fit --rig rig.toml run.csv\n  \
muslip fit --radius 0.31 run.mf4\n  \
muslip fit --rig rig.toml --json run1.csv run2.csv run3.csv\n  \
muslip fit --rig rig.toml --tir tyre.tir run.csv")]
pub(super) struct Arguments {
    #[command(flatten)]
    wheel: RigOrRadius,
    #[command(flatten)]
    mapping: Mapping,
    /// Maximum number of iterations (accepted steps).
    #[arg(long, value_name = "N", default_value_t = DEFAULT_MAXIMUM_ITERATIONS)]
    max_iterations: usize,
    /// Write the law as a tyre property file: longitudinal coefficients of the Magic Formula 5.2, for simulations.
    #[arg(long, value_name = "OUT.tir")]
    tir: Option<PathBuf>,
    /// Write the result as Parquet as well, one row: what --json prints.
    #[arg(long, value_name = "OUT.parquet")]
    parquet: Option<PathBuf>,
    /// Print one JSON object and nothing else.
    #[arg(long)]
    json: bool,
    /// The recordings (CSV, or any format that `muslip channels` lists), fitted together.
    #[arg(value_name = "RUN.csv", required = true)]
    recordings: Vec<PathBuf>,
}

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    let source = arguments.wheel.source()?;
    let rig = source.read()?;
    let map = arguments.mapping.chosen(source.path())?;
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
    let file = match &arguments.tir {
        Some(path) => {
            let file = PropertyFile::of_fit(&result, rig.wheel.radius_m)
                .map_err(|error| Failure::Usage(format!("{}: {error}", path.display())))?;
            write_file(path, file.text.as_bytes())?;
            Some((path, file))
        }
        None => None,
    };
    let json = result.to_json();
    if let Some(path) = &arguments.parquet {
        let names: Vec<String> = arguments
            .recordings
            .iter()
            .map(|recording| recording.display().to_string())
            .collect();
        write_records(path, &[of_result(&names.join(", "), &json)], &json)?;
    }
    if arguments.json {
        return terminal.json(&json);
    }
    tell(&result, terminal)?;
    if let Some(path) = &arguments.parquet {
        terminal.line(&format!("Written: {}", path.display()))?;
    }
    if let Some((path, file)) = file {
        tell_property_file(path, &file, terminal)?;
    }
    Ok(())
}

/// Where the law was written, how well its coefficients hold it, and what they cannot.
pub(super) fn tell_property_file(
    path: &Path,
    file: &PropertyFile,
    terminal: &mut Terminal,
) -> Result<(), Failure> {
    terminal.line("")?;
    terminal.line(&format!("Written: {}", path.display()))?;
    terminal.paragraph(&format!("Of the tyre property file: {}.", file.sentence()))?;
    for left_out in &file.left_out {
        terminal.paragraph(&format!("It cannot hold: {left_out}."))?;
    }
    Ok(())
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
