//! `muslip demo`.

use std::path::PathBuf;

use clap::Args;
use muslip::filter::mu_slip::Range;

use super::Failure;
use super::estimate::{Job, tell};
use super::terminal::Terminal;
use crate::demo;
use crate::estimate::{EstimateOptions, EstimatorKind};
use crate::output::{create_folder, write_file};
use crate::wording::estimate_sentence;

/// Show the main job on a bundled recording: print the estimate, write a report with plots.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  muslip demo\n  muslip demo --out somewhere")]
pub(super) struct Arguments {
    /// Folder for the recording, the rig file, the trace and the report.
    #[arg(long, value_name = "FOLDER", default_value = "muslip-demo")]
    out: PathBuf,
}

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    let folder = &arguments.out;
    create_folder(folder)?;
    let [rig, recording, trace, report] =
        ["rig.toml", "run.csv", "trace.csv", "report.html"].map(|name| folder.join(name));
    write_file(&rig, demo::RIG)?;
    write_file(&recording, demo::RECORDING)?;
    let job = Job {
        rig_path: &rig,
        recording_path: &recording,
        model_path: None,
        options: EstimateOptions {
            estimator: Some(EstimatorKind::Article),
            range: Range::Automotive,
        },
        trace: Some(&trace),
        report: Some(&report),
        beside: Some(demo::truth()),
    };
    let result = job.run()?;
    let truth = demo::true_peak();
    terminal.line(
        "A braked wheel, recorded on the simulated rig: three applications of the brake, each",
    )?;
    terminal.line("through the peak to a locked wheel. Its tyre follows a curve that the filter does not know.")?;
    terminal.line("")?;
    terminal.headline(&estimate_sentence(&result))?;
    let away = (result.peak.peak_friction - truth.friction).abs() / result.peak.peak_friction_std;
    terminal.paragraph(&format!(
        "True: {:.3}, at a slip of {:.3}. That is {away:.0} sigma away, which is what a curve of another shape \
         costs; the correlated innovations below give it away.",
        truth.friction, truth.slip_ratio
    ))?;
    terminal.line("")?;
    tell(&result, terminal)?;
    terminal.line("")?;
    terminal.line(&format!("Report with plots: {}", report.display()))?;
    terminal.line(&format!("Estimate after every sample: {}", trace.display()))?;
    terminal.line("")?;
    terminal.line("The same by hand:")?;
    terminal.line(&format!(
        "  muslip estimate --rig {} --range automotive --report report.html {}",
        rig.display(),
        recording.display()
    ))
}
