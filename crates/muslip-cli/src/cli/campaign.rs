//! `muslip campaign`.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use clap::Args;
use muslip_analysis::campaign::{Campaign, Run, page_names};
use muslip_analysis::records::Record;
use muslip_recordings::output::{StagedFolder, write_file};
use muslip_recordings::recording::Recording;
use muslip_report::campaign::index;
use muslip_report::{FigureFormat, write_figures};
use rayon::prelude::*;
use serde_json::json;

use super::estimate::{Choices, Job};
use super::failure::Failure;
use super::mapping::Mapping;
use super::progress::Progress;
use super::records::write_records;
use super::rig_source::RigSource;
use super::terminal::Terminal;

/// Estimate many recordings of one rig and compare them: one overview page, one report per run.
///
/// Writes index.html, a sortable table in which the runs that stand out are marked, and the report of every
/// run.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
muslip campaign --rig rig.toml --out campaign runs/*.csv\n  \
muslip campaign --rig rig.toml --out campaign --json runs/*.csv")]
pub(super) struct Arguments {
    /// Rig file (TOML).
    #[arg(long, value_name = "RIG.toml")]
    rig: PathBuf,
    #[command(flatten)]
    mapping: Mapping,
    #[command(flatten)]
    choices: Choices,
    /// Folder for the pages; created if missing.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Also write the plots of index.html as image files, into DIR/figures.
    #[arg(long, value_enum)]
    format: Option<FigureFormat>,
    /// Write the result as Parquet as well, one row a recording: what --json prints.
    #[arg(long, value_name = "OUT.parquet")]
    parquet: Option<PathBuf>,
    /// Print one JSON object and nothing else; the files are written as well.
    #[arg(long)]
    json: bool,
    /// The recordings (CSV, or any format that `muslip channels` lists), one file per run.
    #[arg(value_name = "RUN.csv", required = true)]
    recordings: Vec<PathBuf>,
}

/// The page of them all.
const INDEX: &str = "index.html";

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    let out = &arguments.out;
    let mut bytes = 0;
    for recording in &arguments.recordings {
        bytes += 2 * Recording::announced_length_bytes(recording)?;
    }
    let pages = page_names(&arguments.recordings);
    let staged = StagedFolder::create(out)?;
    let done = AtomicU64::new(0);
    let bar = Mutex::new(Progress::bytes("estimate", bytes));
    let jobs = arguments.recordings.par_iter().zip(&pages);
    let runs: Result<Vec<Run>, Failure> = jobs
        .map(|(recording, page)| {
            let path = staged.path(page);
            let job = Job {
                rig: RigSource::File(&arguments.rig),
                map: arguments.mapping.map.as_deref(),
                recording_path: recording,
                options: arguments.choices.options(),
                model_path: None,
                trace: None,
                report: Some(&path),
                format: None,
                beside: None,
            };
            let mut before = 0;
            let result = job.run_reporting(&mut |now| {
                let sum = done.fetch_add(now - before, Ordering::Relaxed) + now - before;
                before = now;
                let mut bar = bar.lock().unwrap_or_else(PoisonError::into_inner);
                bar.done(sum);
            })?;
            Ok(Run::of(recording, page.clone(), &result))
        })
        .collect();
    drop(bar);
    let campaign = Campaign::new(runs?);
    let report = index(
        &campaign,
        &arguments.rig.display().to_string(),
        &command(arguments),
    );
    write_file(&staged.path(INDEX), report.to_html()?.as_bytes())?;
    staged.commit(pages.iter().map(String::as_str).chain([INDEX]))?;
    if let Some(format) = arguments.format {
        let figures = report.figures();
        let figures = figures.iter().map(|(name, figure)| (name.clone(), figure));
        write_figures(&out.join("figures"), figures, format)?;
    }
    let json = to_json(&campaign);
    if let Some(path) = &arguments.parquet {
        let runs = json["runs"].as_array().into_iter().flatten();
        let records: Vec<Record> = runs.filter_map(|run| run.as_object().cloned()).collect();
        write_records(path, &records, &json)?;
    }
    if arguments.json {
        return terminal.json(&json);
    }
    terminal.verdict(&campaign.verdict(), campaign.is_quiet())?;
    terminal.line("")?;
    let marked = campaign.runs.iter().zip(&campaign.stands_out);
    const MOST: usize = 15;
    for (run, words) in marked.filter(|(_, words)| !words.is_empty()).take(MOST) {
        terminal.line(&format!(
            "  {}: {}, at {}; stands out in {}",
            run.recording.display(),
            muslip_analysis::wording::plus_minus(run.peak_friction.0, run.peak_friction.1),
            muslip_analysis::wording::plus_minus(run.critical_slip.0, run.critical_slip.1),
            words.join(" and ")
        ))?;
    }
    if campaign.standing_out() > MOST {
        terminal.line(&format!("  and {} more", campaign.standing_out() - MOST))?;
    }
    terminal.line(&format!("Written: {}", out.join(INDEX).display()))?;
    if let Some(path) = &arguments.parquet {
        terminal.line(&format!("Written: {}", path.display()))?;
    }
    Ok(())
}

fn to_json(campaign: &Campaign) -> serde_json::Value {
    let quantity = |(value, std): (f64, f64)| json!({"value": value, "std": std});
    let runs: Vec<serde_json::Value> = campaign
        .runs
        .iter()
        .zip(&campaign.stands_out)
        .map(|(run, words)| {
            json!({
                "recording": run.recording.display().to_string(),
                "page": run.page,
                "peak_friction": quantity(run.peak_friction),
                "critical_slip": quantity(run.critical_slip),
                "mean_nis": run.mean_nis,
                "consistency": run.verdict.word(),
                "samples_used": run.used,
                "stands_out_in": words,
            })
        })
        .collect();
    json!({
        "schema": "muslip.campaign/1",
        "peak_friction": quantity(campaign.peak_friction),
        "critical_slip": quantity(campaign.critical_slip),
        "stand_out": campaign.standing_out(),
        "overconfident_in_common": campaign.overconfident,
        "runs": runs,
    })
}

/// The command that makes the page again, without where it goes.
fn command(arguments: &Arguments) -> String {
    let recordings: Vec<String> = arguments
        .recordings
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    format!(
        "muslip campaign --rig {} {}{}{}",
        arguments.rig.display(),
        arguments.mapping.words(),
        arguments.choices.words(),
        recordings.join(" ")
    )
}
