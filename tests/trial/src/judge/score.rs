//! Scoring: all answers first, then the seal is checked and opened.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context, Result, bail};
use rayon::prelude::*;

use crate::baseline::{Verdicts, verdicts};
use crate::generate::campaign::Truth;
use crate::generate::files::{names, seal, truth};
use crate::judge::case::{Case, judge};
use crate::judge::{bars, calibration, coverage, power, prediction, rivals, tally, uniform};
use crate::tool::{Answer, Tool};

/// What to score, and how much to say.
#[derive(Clone, Debug)]
pub struct ScoreRequest {
    /// The tool.
    pub tool: Tool,
    /// Directory that `generate` wrote.
    pub campaigns: PathBuf,
    /// Where the tool's answers go.
    pub results: PathBuf,
    /// Only these strata; all where empty. Needs the truth before the answers, so it is for development.
    pub strata: Vec<String>,
    /// Only campaigns whose truth or form holds this text; for development.
    pub only: Option<String>,
    /// Campaigns at the same time.
    pub jobs: usize,
    /// Apply the textbook baselines to the same files as well.
    pub baselines: bool,
    /// Judge the answers of an earlier call instead of calling the tool.
    pub reuse: bool,
    /// Only every n-th campaign, by its number, which says nothing of what it conceals.
    pub every: usize,
}

/// The judged trial.
#[derive(Clone, Debug)]
pub struct Report {
    pub(crate) cases: Vec<Case>,
    pub(crate) baselines: Vec<(Truth, Verdicts)>,
}

/// Has every campaign diagnosed, then opens the truth and judges.
///
/// # Errors
/// Where the campaigns cannot be read, the tool cannot be found, or the sealed truth is not what
/// was sealed.
pub fn score(request: &ScoreRequest) -> Result<Report> {
    if !request.tool.path.exists() {
        bail!("no tool at {}", request.tool.path.display());
    }
    let mut chosen = names(&request.campaigns)?;
    if !request.strata.is_empty() || request.only.is_some() {
        chosen.retain(|name| {
            truth(&request.campaigns, name).is_ok_and(|truth| {
                let words = truth
                    .concealed
                    .iter()
                    .map(|c| format!("{} {:?}", c.effect.id, c.effect.form))
                    .collect::<String>()
                    + &truth.campaign;
                (request.strata.is_empty() || request.strata.contains(&truth.stratum))
                    && request
                        .only
                        .as_ref()
                        .is_none_or(|only| only.split('|').any(|part| words.contains(part)))
            })
        });
    }
    let every = request.every.max(1);
    let mut number = 0;
    chosen.retain(|_| {
        number += 1;
        (number - 1) % every == 0
    });
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(request.jobs.max(1))
        .build()
        .context("no threads")?;
    let done = AtomicUsize::new(0);
    let answers: Vec<(String, Answer)> = pool.install(|| {
        chosen
            .par_iter()
            .map(|name| -> Result<(String, Answer)> {
                let kept = request.results.join(name).join("answer.json");
                let answer = if request.reuse && kept.exists() {
                    serde_json::from_str(&fs::read_to_string(&kept)?)?
                } else {
                    let answer = request
                        .tool
                        .answer(&request.campaigns, name, &request.results)?;
                    // Under its name only when it is whole, so that a trial that was stopped goes on from here.
                    let part = kept.with_extension("part");
                    fs::write(&part, serde_json::to_string(&answer)?)?;
                    fs::rename(&part, &kept)?;
                    answer
                };
                let count = done.fetch_add(1, Ordering::Relaxed) + 1;
                if count.is_multiple_of(25) {
                    eprintln!("{count} of {} campaigns answered", chosen.len());
                }
                Ok((name.clone(), answer))
            })
            .collect::<Result<Vec<_>>>()
    })?;
    let told = fs::read_to_string(request.campaigns.join("sealed.sha256"))
        .context("no hash of the sealed truth")?;
    if told.trim() != seal(&request.campaigns)? {
        bail!("the sealed truth is not what was sealed");
    }
    let cases = answers
        .par_iter()
        .map(|(name, answer)| {
            judge(
                &request.campaigns,
                &truth(&request.campaigns, name)?,
                answer,
            )
        })
        .collect::<Result<Vec<_>>>()?;
    let baselines = if request.baselines {
        answers
            .par_iter()
            .map(|(name, _)| {
                let truth = truth(&request.campaigns, name)?;
                verdicts(&request.campaigns, &truth).map(|verdicts| (truth, verdicts))
            })
            .collect::<Result<Vec<_>>>()?
    } else {
        Vec::new()
    };
    Ok(Report { cases, baselines })
}

impl Report {
    /// One terse line a campaign.
    pub fn lines(&self, only_failures: bool) -> String {
        self.cases
            .iter()
            .filter(|case| !only_failures || case.failed())
            .map(|case| case.line() + "\n")
            .collect()
    }

    /// All tables for a terminal.
    pub fn text(&self) -> String {
        let cases = &self.cases;
        let mut text = String::new();
        for table in [
            tally::nulls(cases),
            tally::chains(cases),
            tally::mechanisms(cases),
            tally::strengths(cases),
            tally::outside(cases),
            calibration::table(cases),
            coverage::table(cases),
            prediction::table(cases),
            uniform::table(cases),
            power::table(cases),
            tally::confusion(cases),
            tally::figures(cases, 12),
        ] {
            if !table.rows.is_empty() {
                text.push_str(&table.text());
            }
        }
        text.push_str("\nWorst cases\n");
        for case in tally::worst(cases, 20) {
            text.push_str("  ");
            text.push_str(&case.line());
            text.push('\n');
        }
        if !self.baselines.is_empty() {
            text.push_str(&rivals::baselines(cases, &self.baselines, &[]).text());
        }
        text.push_str(&bars::table("Figures and bars", &bars::figures(cases)).text());
        text
    }

    /// Everything, for programs.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        fs::write(path, serde_json::to_string_pretty(&self.cases)? + "\n")
            .with_context(|| format!("cannot write {}", path.display()))
    }
}
