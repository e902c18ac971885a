//! `muslip demo`.

use std::path::{Path, PathBuf};

use clap::Args;
use muslip_analysis::diagnose::wording::spoken;
use muslip_analysis::estimate::EstimateOptions;
use muslip_analysis::wording::estimate_sentence;
use muslip_diagnose::outcome::Diagnosis;
use muslip_recordings::output::{create_folder, write_file};
use muslip_report::diagnose::files;
use muslip_report::diagnose::summary::{WIDEST_LINE, summary};

use super::diagnose::diagnosed;
use super::estimate::{Job, tell};
use super::failure::Failure;
use super::rig_source::RigSource;
use super::terminal::Terminal;
use crate::demo;

/// Estimate a mu-slip curve and find a concealed effect, on bundled recordings; write reports with plots.
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
        rig: RigSource::File(&rig),
        map: None,
        recording_path: &recording,
        model_path: None,
        options: EstimateOptions {
            estimator: None,
            range: None,
        },
        trace: Some(&trace),
        report: Some(&report),
        format: None,
        beside: Some(demo::truth()),
    };
    let result = job.run()?;
    let truth = demo::true_peak();
    terminal.paragraph(
        "1. Estimate. One recording of a simulated rig: a car tyre at 45 m/s, braked three times through the peak \
         to a locked wheel.",
    )?;
    terminal.line("")?;
    terminal.headline(&estimate_sentence(&result))?;
    terminal.paragraph(&format!(
        "The tyre that was simulated: {:.3}, at a slip of {:.3}.",
        truth.friction, truth.slip_ratio
    ))?;
    terminal.line("")?;
    tell(&result, terminal)?;
    terminal.line("")?;
    terminal.line(&format!("Report with plots: {}", report.display()))?;
    terminal.line(&format!("Estimate after every sample: {}", trace.display()))?;
    terminal.line("")?;
    terminal
        .line("The same by hand (--estimator article: the filter of Rudd's article instead):")?;
    terminal.line(&format!(
        "  muslip estimate --rig {} --report report.html {}",
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
    let (diagnosis, views) = diagnosed(&rig, &recordings, None, &found)?;
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
        "2. Diagnose. Four recordings of another rig, in which one fault of the measuring chain is concealed. Nothing \
         in the files mentions it.",
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
        "Report with plots, before and after the repair: {}",
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
            format!("{}{}", spoken(named.id), figures.join(","))
        })
        .collect();
    let found = if found.is_empty() {
        "nothing".to_owned()
    } else {
        found.join("; ")
    };
    format!(
        "Concealed: {} {:.1} ms. Found: {found}.",
        spoken(demo::CONCEALED),
        1e3 * demo::CONCEALED_DELAY_S
    )
}
