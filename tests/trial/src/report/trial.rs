//! The whole trial: fresh seeds, sealed truth, every verdict, then the judgement and its pages.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use sha2::{Digest, Sha256};

use crate::generate::files::{generate, seal};
use crate::generate::strata::Request;
use crate::generate::{TEXT, instrument};
use crate::judge::bars;
use crate::judge::case::Case;
use crate::judge::score::{Report, ScoreRequest, score};
use crate::real;
use crate::report::pace::{self, Pace};
use crate::report::pages::{self, Rival, Telling};
use crate::report::ratchet;
use crate::report::seal::{SeedUse, Void, enter, seed_use, voids};
use crate::setup::Trial;
use crate::tool::Tool;

/// Figures that may not get worse, and seeds that were reported on, from the project's root.
const RATCHET: &str = ".ci/trial.toml";
const LEDGER: &str = "docs/trials/seeds.txt";
/// An earlier engine is tried on every n-th campaign.
const RIVAL_EVERY: usize = 6;
/// Campaigns of each stratum at full size: whole rounds of the kinds, mechanisms and effects of a chain, so that a
/// bar can be told from its neighbour.
const FULL: [(&str, bool, usize); 9] = [
    ("null", true, 208),
    ("null", false, 48),
    ("chain", false, 39),
    ("single", true, 87),
    ("single", false, 87),
    ("pair", true, 24),
    ("pair", false, 24),
    ("outside", true, 34),
    ("outside", false, 34),
];

fn requests(trial: &Trial) -> Vec<Request> {
    FULL.into_iter()
        .map(|(stratum, real_chain, count)| {
            let kinds = match stratum {
                // Every kind once, however small.
                "chain" => instrument::finding::FINDING_KINDS.len(),
                "null" if !real_chain => 8,
                _ => 1,
            };
            Request {
                stratum: stratum.to_owned(),
                real_chain,
                count: ((count as f64 * trial.scale()).ceil() as usize).max(kinds),
                mechanism: None,
                strength: None,
            }
        })
        .collect()
}

fn digest<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> String {
    let mut hash = Sha256::new();
    for part in parts {
        hash.update(part);
    }
    hash.finalize()
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

/// Generates, or takes up what an earlier call has generated whole; gives the hash of the sealed truth.
fn campaigns(trial: &Trial, directory: &Path) -> Result<String> {
    let requests = requests(trial);
    let generator = TEXT.iter().chain(instrument::TEXT);
    let plan = format!(
        "{} {} {requests:?}\n",
        digest(generator.map(|text| text.as_bytes())),
        trial.seed
    );
    let (kept, told) = (directory.join("plan"), directory.join("sealed.sha256"));
    if fs::read_to_string(&kept).is_ok_and(|text| text == plan)
        && let Ok(hash) = fs::read_to_string(&told)
        && seal(directory)? == hash.trim()
    {
        return Ok(hash.trim().to_owned());
    }
    if directory.exists() {
        fs::remove_dir_all(directory)
            .with_context(|| format!("cannot clear {}", directory.display()))?;
    }
    let hash = generate(directory, &requests, trial.seed)?;
    fs::write(kept, plan)?;
    Ok(hash)
}

/// Plays the trial.
///
/// # Errors
/// Where a file cannot be written, no rig can show an ordered effect, the tool is missing, the seed is not for this
/// use, or figures of the small trial got worse.
pub fn trial(trial: &Trial) -> Result<Report> {
    // The tool as it is now: a build that goes on meanwhile must not change it under way.
    let (tool, program) = frozen(&trial.tool, &trial.work)?;
    let trial = &Trial {
        tool,
        ..trial.clone()
    };
    admit(trial, &program)?;
    let directory = trial.work.join(if trial.small {
        format!("seed-{}-small", trial.seed)
    } else {
        format!("seed-{}-x{}", trial.seed, trial.scale)
    });
    let hash = campaigns(trial, &directory)?;
    println!("sealed truth sha256 {hash}");
    println!("tool sha256 {program}");
    // Answers of another tool or to other campaigns are other answers.
    let answers = directory.join(format!("answers-{}-{}", &hash[..12], &program[..12]));
    let request = |tool: Tool, results: PathBuf, every: usize| ScoreRequest {
        tool,
        campaigns: directory.clone(),
        results,
        strata: vec![],
        only: None,
        baselines: every == 1,
        jobs: trial.jobs,
        reuse: true,
        every,
    };
    let measured = real::study(trial, &directory.join("measured"), &program[..12])?;
    let paces = speeds(&trial.tool, trial, &answers)?;
    let report = score(&request(trial.tool.clone(), answers.clone(), 1))?;
    let (valid, void) = without_void(&report.cases, &voids());
    let rival = trial
        .rival
        .as_ref()
        .map(|path| -> Result<Rival> {
            let tool = Tool {
                path: path.clone(),
                diagnose_arguments: vec![],
            };
            let (tool, program) = frozen(&tool, &trial.work)?;
            let results = directory.join(format!("rival-{}-{}", &hash[..12], &program[..12]));
            let paces = speeds(&tool, trial, &results)?;
            let cases = score(&request(tool, results, RIVAL_EVERY))?.cases;
            Ok(Rival {
                every: RIVAL_EVERY,
                cases: without_void(&cases, &voids()).0,
                paces,
            })
        })
        .transpose()?;
    let figures = pages::figures(&valid, &paces, &measured.headlines);
    print!("{}", bars::table("Figures and bars", &figures).text());
    for table in &measured.tables {
        print!("{}", table.text());
    }
    if trial.small {
        ratchet::hold(Path::new(RATCHET), &figures, trial.bless)?;
    }
    if let Some(pages) = &trial.pages {
        pages::write(
            pages,
            &Telling {
                introduction: introduction(trial, &hash, &program, &report.cases),
                figures: &figures,
                valid: &valid,
                void: &void,
                report: &report,
                rival: rival.as_ref(),
                paces: &paces,
                notes: &pages::notes(&pages.join("trials").join("causes.txt"), &hash),
            },
        )?;
        measured.write(pages)?;
    }
    Ok(report)
}

/// Whether the seed may be used for this, and by this tool.
fn admit(trial: &Trial, program: &str) -> Result<()> {
    let Some(used) = seed_use(trial.seed) else {
        bail!(
            "seed {} is for nothing: below 1000 to develop, 1000 to 1999 for continuous integration, from 20,000 to report",
            trial.seed
        );
    };
    if trial.commit.is_some() && used != SeedUse::Reported {
        bail!(
            "a commit is stated of what is reported, and seed {} is not for that: from 20,000",
            trial.seed
        );
    }
    if trial.commit.is_none() && trial.pages.as_deref().is_some_and(of_the_project) {
        bail!(
            "the project's pages tell of a commit and a reported seed: cargo xtask trial --report --seed N, or --out elsewhere"
        );
    }
    match (used, trial.pages.is_some(), trial.small) {
        (SeedUse::Reported, true, false) => {
            let Some(commit) = &trial.commit else {
                bail!(
                    "figures are reported of a commit: --commit says which one the tool was built from (cargo xtask trial --report does)"
                );
            };
            enter(Path::new(LEDGER), trial.seed, program, commit)
        }
        (SeedUse::Reported, _, _) => bail!(
            "seed {} is for reports: a development seed is below 1000",
            trial.seed
        ),
        (SeedUse::Integration, _, false) => {
            bail!("seed {} is continuous integration's own", trial.seed)
        }
        _ => Ok(()),
    }
}

/// Whether a directory is that of the project's own pages, or lies in it.
fn of_the_project(pages: &Path) -> bool {
    let docs = Path::new("docs");
    match (fs::canonicalize(pages), fs::canonicalize(docs)) {
        (Ok(pages), Ok(docs)) => pages.starts_with(docs),
        _ => pages.strip_prefix(".").unwrap_or(pages).starts_with(docs),
    }
}

/// Cases that count, and those of forms that a rule was made for.
fn without_void(cases: &[Case], voids: &[Void]) -> (Vec<Case>, Vec<Case>) {
    cases
        .iter()
        .cloned()
        .partition(|case| !voids.iter().any(|void| void.holds(case)))
}

/// Plays the part with measured recordings alone.
///
/// # Errors
/// Where a file cannot be written, the tool is missing, or the seed is not for this use.
pub fn only_measured(trial: &Trial) -> Result<real::Study> {
    let (tool, program) = frozen(&trial.tool, &trial.work)?;
    let trial = Trial {
        tool,
        ..trial.clone()
    };
    admit(&trial, &program)?;
    let directory = trial.work.join(format!("seed-{}-measured", trial.seed));
    real::study(&trial, &directory, &program[..12])
}

/// A copy of the tool under its own hash, and the hash.
fn frozen(tool: &Tool, work: &Path) -> Result<(Tool, String)> {
    let program =
        fs::read(&tool.path).with_context(|| format!("no tool at {}", tool.path.display()))?;
    let hash = digest([program.as_slice()]);
    let folder = work.join("tools");
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let path = folder.join(format!("muslip-{}", &hash[..12]));
    if !path.exists() {
        let part = path.with_extension("part");
        fs::copy(&tool.path, &part)?;
        fs::rename(&part, &path)?;
    }
    let path = fs::canonicalize(path)?;
    Ok((
        Tool {
            path,
            ..tool.clone()
        },
        hash,
    ))
}

/// Speeds, kept beside the answers so that a trial that was stopped does not measure again.
fn speeds(tool: &Tool, trial: &Trial, answers: &Path) -> Result<Vec<Pace>> {
    let kept = answers.join(if trial.ten_million {
        "pace.json"
    } else {
        "pace-six.json"
    });
    if let Ok(text) = fs::read_to_string(&kept)
        && let Ok(found) = serde_json::from_str(&text)
    {
        return Ok(found);
    }
    let found = pace::paces(
        tool,
        &trial.work.join("pace"),
        if trial.small { 2 } else { 20 },
        trial.ten_million && !trial.small,
    )?;
    fs::create_dir_all(answers)?;
    fs::write(kept, serde_json::to_string(&found)?)?;
    Ok(found)
}

fn introduction(trial: &Trial, hash: &str, program: &str, cases: &[Case]) -> String {
    let count = |stratum: &str, real: bool| {
        cases
            .iter()
            .filter(|case| case.stratum == stratum && case.real_chain == real)
            .count()
    };
    format!(
        "# Sealed trial of the diagnosis\n\n\
         Seed {}, {} campaigns, on ideal sensors and through real measuring chains: nothing missing {} and {}, one effect {} and {}, two {} \
         and {}, one outside the vocabulary {} and {}; one effect of the chain alone {}. All were written by `tests/trial`, which shares no code \
         and no tyre or sensor model with the engine. The SHA-256 of their sealed truth,\n\n`{hash}`,\n\n\
         was printed before the first of them was diagnosed, by the tool whose SHA-256 is `{program}`, built from commit `{}`. Printed by\n\n\
         ```\ncargo xtask trial {}\n```\n\n\
         Seeds of reported figures are used once ([trials/seeds.txt](trials/seeds.txt)), not in development (below 1000) and not in \
         continuous integration (1000 to 1999, a tenth of this trial, its figures held by `.ci/trial.toml`). Measured recordings have a page of \
         their own: [reality.md](reality.md). How the bench is built: [design/0009](design/0009-bench.md).\n\n\
         How to read it:\n\n\
         - Real chain: wheel speed by the period of a tone ring, by counts in a window or by a tachometer; vehicle speed by satellites, an \
         optical sensor, a fifth wheel or a drum's encoder; filters, coloured noise, hum, steps and drift of the analogue channels; loggers \
         out of step by up to 20 ms and 100 ppm; errors common to both speeds; runs that differ in zero, gain and peak friction. Drawn a \
         campaign, kept over its runs.\n\
         - False name: one that is neither concealed nor true of the measuring chain. A speed channel that is late by more than 1 ms \
         may be named as such, with the right sign, a load cell's channel that lags the others by more than that as well, an encoder's ripple \
         where the ring has one. A column that reproduces the drag explains nothing.\n\
         - Delays through a real chain are judged as they show: what is concealed and what the chain adds, against the drag (the drag's own \
         against the later of both speeds). One delay, lag or ripple before a chain that has its own is judged apart, by the net delay within 20 % \
         or 2 ms or by the name, and is in no other figure of single effects.\n\
         - Size of an effect: RMS of what it leaves in the residual of its balance, without random noise and after peak friction and \
         critical slip were refitted, in units of that balance's noise (tyre: drag, load and slip noise together; wheel and vehicle: drag \
         and torque noise and that of an acceleration taken over 50 ms); through a real chain, of the chain's random errors. The bars speak of \
         0.6 sigma and more; effects were ordered at 0.3, 0.6, 1, 1.5, 2 and 4.\n\
         - Floor: mean squared error, against the load cell's reading without its random errors, of the truth itself (all effects, all \
         parameters, known delays taken back) driven sample by sample with the fresh run's written inputs. Gain share: 1 - (MSE - floor)/(MSE \
         of base - floor), on runs where the base's error exceeds the floor by a quarter; a model that smooths its inputs may exceed 1. Fresh \
         runs stand first, between or last in the campaign's order.\n\
         - Location: intersection over union of the intervals in the balance of the concealed effect, single effects from 0.6 sigma; local \
         are patches, saturation, and whatever is off less than a quarter of the time.\n\
         - A parameter's attainable std: that of least squares with the true form under these recordings' own errors, coloured as they are; \
         wheel and vehicle balances integrated, so that slow information counts.\n\
         - Power: share of effects that are named first with a score (`delta_bic`) above the one that one null campaign in twenty exceeds.\n\
         - Intervals of shares: Clopper and Pearson, 95 %; of means: normal; of quantiles: order statistics; of the Brier score and the power: \
         campaigns drawn again. \"Spans the bar\" says that the interval does not tell the figure from its bar.\n\n\
         In the lists, `!` marks a name that is not concealed there, `~` what it was said to be confusable with, and `left(...)` the variables \
         of what was left unexplained.\n\n",
        trial.seed,
        cases.len(),
        count("null", false),
        count("null", true),
        count("single", false),
        count("single", true),
        count("pair", false),
        count("pair", true),
        count("outside", false),
        count("outside", true),
        count("chain", false),
        trial.commit.as_deref().unwrap_or("not stated"),
        if trial.small {
            "--small".to_owned()
        } else if trial.scale == 1.0 {
            format!("--report --seed {}", trial.seed)
        } else {
            format!("--report --seed {} --scale {}", trial.seed, trial.scale)
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(seed: u64, small: bool, pages: bool, commit: Option<&str>) -> Trial {
        Trial {
            tool: Tool {
                path: PathBuf::new(),
                diagnose_arguments: vec![],
            },
            rival: None,
            commit: commit.map(str::to_owned),
            seed,
            small,
            bless: false,
            scale: 1.0,
            work: PathBuf::new(),
            pages: pages.then(PathBuf::new),
            data: PathBuf::new(),
            jobs: 1,
            ten_million: false,
        }
    }

    #[test]
    fn seeds_are_kept_to_their_use() {
        let refused = |trial: &Trial| admit(trial, "aa").is_err();
        assert!(!refused(&asked(7, false, true, None)));
        assert!(refused(&asked(7, false, true, Some("c"))));
        assert!(refused(&asked(1500, true, false, Some("c"))));
        for docs in ["docs", "./docs/", "docs/trials"] {
            let mut into_docs = asked(7, false, true, None);
            into_docs.pages = Some(PathBuf::from(docs));
            assert!(refused(&into_docs), "{docs}");
        }
        assert!(!refused(&asked(1500, true, false, None)));
        assert!(refused(&asked(1500, false, false, None)));
        assert!(refused(&asked(20_300, false, false, None)));
        assert!(refused(&asked(20_300, true, true, Some("c"))));
        assert!(
            refused(&asked(20_300, false, true, None)),
            "of which commit?"
        );
        assert!(refused(&asked(5000, false, false, None)));
    }

    #[test]
    fn a_small_trial_has_every_stratum() {
        for request in requests(&asked(1500, true, false, None)) {
            assert!(request.count >= 2, "{request:?}");
        }
    }
}
