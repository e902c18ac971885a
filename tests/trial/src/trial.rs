//! The whole trial: fresh seeds, sealed truth, every verdict, then the judgement and its pages.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result};

use crate::files::generate;
use crate::score::{Report, ScoreRequest, score};
use crate::strata::Request;
use crate::tool::Tool;

/// What a trial is made with.
#[derive(Clone, Debug)]
pub struct Trial {
    /// The tool under trial.
    pub tool: Tool,
    /// Seed of every draw; development uses seeds below 1000, reported figures others.
    pub seed: u64,
    /// A few campaigns only, for continuous integration.
    pub small: bool,
    /// Scratch directory for campaigns and answers.
    pub work: PathBuf,
    /// Directory of the pages, left alone where absent.
    pub pages: Option<PathBuf>,
    /// Campaigns at the same time.
    pub jobs: usize,
}

/// Campaigns of each stratum: enough that a bar can be told from its neighbour, or just a taste.
fn requests(small: bool) -> Vec<Request> {
    let counts = if small {
        [8, 27, 6, 6]
    } else {
        [120, 405, 80, 85]
    };
    ["null", "single", "pair", "outside"]
        .into_iter()
        .zip(counts)
        .map(|(stratum, count)| Request {
            stratum: stratum.to_owned(),
            count,
            mechanism: None,
            strength: None,
        })
        .collect()
}

/// Plays the trial.
///
/// # Errors
/// Where a file cannot be written, no rig can show an ordered effect, or the tool is missing.
pub fn trial(trial: &Trial) -> Result<Report> {
    let campaigns = trial.work.join(format!(
        "seed-{}{}",
        trial.seed,
        if trial.small { "-small" } else { "" }
    ));
    if campaigns.exists() {
        fs::remove_dir_all(&campaigns)
            .with_context(|| format!("cannot clear {}", campaigns.display()))?;
    }
    let hash = generate(&campaigns, &requests(trial.small), trial.seed)?;
    println!("sealed truth sha256 {hash}");
    let report = score(&ScoreRequest {
        tool: trial.tool.clone(),
        results: campaigns.join("answers"),
        campaigns,
        strata: vec![],
        only: None,
        baselines: true,
        jobs: trial.jobs,
        reuse: false,
    })?;
    if let Some(pages) = &trial.pages {
        fs::create_dir_all(pages).with_context(|| format!("cannot make {}", pages.display()))?;
        let name = if trial.small {
            "small.md"
        } else {
            "sealed-trial.md"
        };
        let introduction = introduction(trial, &hash, report.cases.len());
        fs::write(pages.join(name), report.markdown(&introduction))?;
    }
    Ok(report)
}

fn introduction(trial: &Trial, hash: &str, campaigns: usize) -> String {
    format!(
        "# Sealed trial, seed {}\n\n\
         {campaigns} campaigns were written by `tests/trial`, which shares no code with the engine; the hash of their sealed truth, \
         `{hash}`, was printed before the first of them was diagnosed. Regenerate with `sealed-trial run --seed {}{}`.\n\n\
         How to read it:\n\n\
         - Size of an effect: RMS of what it leaves in the residual of its balance, without random noise and after peak friction and \
         critical slip were refitted, in units of that balance's noise (tyre: drag, load and slip noise together; wheel and vehicle: drag \
         and torque noise and that of an acceleration taken over 50 ms). The bars speak of 0.6 sigma and more.\n\
         - Floor: mean squared error, against the load cell's reading without its random noise, of the truth itself (all effects, all \
         figures) driven sample by sample with the fresh run's written inputs. Gain share: 1 - (MSE - floor)/(MSE of base - floor), on runs \
         where the base's error exceeds the floor by a quarter; a model that smooths its inputs may exceed 1.\n\
         - Location: intersection over union of the intervals in the balance of the concealed effect.\n\
         - A figure's pull: reported minus true, in its reported standard deviation; where the contract leaves the variable open, the nearer.\n\
         - Intervals of shares: Clopper and Pearson, 95 %; of means: normal; of quantiles: order statistics.\n\n\
         In the lists, `!` marks a name that is not concealed there, `~` what it was said to be confusable with, and `left(...)` the variables \
         of what was left unexplained.\n\n",
        trial.seed,
        trial.seed,
        if trial.small { " --small" } else { "" },
    )
}
