//! `muslip demo`.

use std::path::{Path, PathBuf};

use clap::Args;
use muslip::filter::mu_slip::Range;
use muslip_analysis::estimate::{EstimateOptions, EstimatorKind};
use muslip_analysis::wording::estimate_sentence;
use muslip_diagnose::outcome::Diagnosis;
use muslip_recordings::output::{create_folder, write_file};
use muslip_report::diagnose::files;
use muslip_report::diagnose::summary::{WIDEST_LINE, summary};

use super::diagnose::diagnosed;
use super::estimate::{Job, tell};
use super::failure::Failure;
use super::terminal::Terminal;
use crate::demo;

/// Show both main jobs on bundled recordings: estimate a curve, find a concealed effect; write reports with plots.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  muslip demo\n  muslip demo --out somewhere")]
pub(super) struct Arguments {
    /// Folder for the recordings, the rig files, the trace and the reports.
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
        format: None,
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
    ))?;
    find_concealed(folder, terminal)
}

/// Diagnoses the bundled campaign and only then opens what was concealed in it.
fn find_concealed(folder: &Path, terminal: &mut Terminal) -> Result<(), Failure> {
    let campaign = folder.join("concealed");
    let found = folder.join("found");
    create_folder(&campaign)?;
    let rig = campaign.join("rig.toml");
    write_file(&rig, demo::CONCEALED_RIG)?;
    let mut recordings = Vec::with_capacity(demo::CONCEALED_RUNS.len());
    for (name, contents) in demo::CONCEALED_RUNS {
        let path = campaign.join(name);
        write_file(&path, contents)?;
        recordings.push(path);
    }
    let (diagnosis, views) = diagnosed(&rig, &recordings, &found)?;
    let shown: Vec<String> = recordings
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    let command = format!(
        "muslip diagnose --rig {} {}",
        rig.display(),
        shown.join(" ")
    );
    files::write(&found, &diagnosis, &views, &command)?;
    terminal.line("")?;
    terminal.paragraph(
        "Four recordings of another rig, of other physics than the simulation: one effect was concealed in them. \
         What the simulation leaves out of them:",
    )?;
    terminal.line("")?;
    let summary = summary(&diagnosis, &found, terminal.width(WIDEST_LINE));
    for line in &summary.verdict {
        terminal.verdict(line, summary.good)?;
    }
    for line in &summary.lines {
        terminal.line(line)?;
    }
    terminal.line("")?;
    terminal.paragraph(&opened(&diagnosis))?;
    terminal.line("")?;
    terminal.line(&format!(
        "Before and after: {}",
        found.join("report.html").display()
    ))?;
    terminal.line("The same by hand:")?;
    terminal.line(&format!("  {command} --out found"))
}

/// The concealed truth beside what was found.
fn opened(diagnosis: &Diagnosis) -> String {
    let found: Vec<String> = diagnosis
        .mechanisms
        .iter()
        .map(|named| {
            let figures: Vec<String> = named
                .parameters
                .iter()
                .map(|figure| {
                    if figure.unit == "s" {
                        let (value, std) = (1e3 * figure.value, 1e3 * figure.std);
                        format!(" {value:.1} \u{b1} {std:.1} ms")
                    } else {
                        format!(
                            " {:.3} \u{b1} {:.3} {}",
                            figure.value, figure.std, figure.unit
                        )
                    }
                })
                .collect();
            format!("{}{}", named.id, figures.join(","))
        })
        .collect();
    let found = if found.is_empty() {
        "nothing".to_owned()
    } else {
        found.join("; ")
    };
    format!(
        "The truth, opened now: concealed: {} {:.1} ms; found: {found}.",
        demo::CONCEALED,
        1e3 * demo::CONCEALED_DELAY_S
    )
}
