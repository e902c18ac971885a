//! The whole trial: fresh seeds, sealed truth, every verdict, then the judgement and its pages.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use sha2::{Digest, Sha256};

use crate::generate::TEXT;
use crate::generate::files::{generate, seal};
use crate::generate::strata::Request;
use crate::judge::case::Case;
use crate::judge::rivals;
use crate::judge::score::{Report, ScoreRequest, score};
use crate::real;
use crate::report::pace::{self, Pace};
use crate::report::pages::{self, Telling};
use crate::table::Table;
use crate::tool::Tool;

/// What a trial is made with.
#[derive(Clone, Debug)]
pub struct Trial {
    /// The tool under trial.
    pub tool: Tool,
    /// Seed of every draw; development uses seeds below 1000, reported figures others.
    pub seed: u64,
    /// A few campaigns only, and loose bars that must hold, for continuous integration.
    pub small: bool,
    /// Campaigns of each stratum, as a share of the full trial's.
    pub scale: f64,
    /// Scratch directory for campaigns and answers; what is there of the same trial is not made again.
    pub work: PathBuf,
    /// Directory of `trials.md`, left alone where absent.
    pub pages: Option<PathBuf>,
    /// Measured recordings, `dart-coastdown` and `dart-friction` in it.
    pub data: PathBuf,
    /// Campaigns at the same time.
    pub jobs: usize,
    /// Every so manieth campaign is diagnosed again with each part of the argument left out; none where zero.
    pub ablate_every: usize,
    /// Ten million samples are diagnosed too, which takes gigabytes of disk and of memory.
    pub ten_million: bool,
}

/// Parts that `muslip diagnose --ablate` can leave out.
const PARTS: [(&str, &str); 3] = [
    ("prefilter", "no common prefilter"),
    ("errors-in-variables", "no errors-in-variables correction"),
    ("remainder", "no remainder"),
];

/// Campaigns of each stratum: enough that a bar can be told from its neighbour, or just a taste.
fn requests(trial: &Trial) -> Vec<Request> {
    let request =
        |stratum: &str, count: usize, mechanism: Option<&str>, strength: Option<f64>| Request {
            stratum: stratum.to_owned(),
            count,
            mechanism: mechanism.map(Into::into),
            strength,
        };
    if trial.small {
        let mut requests = vec![
            request("null", 3, None, None),
            request("outside", 1, Some("out_column_zero"), Some(2.0)),
        ];
        requests.extend(
            [
                "force_delay",
                "load_sensitivity",
                "aero_drag",
                "wheel_inertia",
            ]
            .map(|id| request("single", 1, Some(id), Some(2.0))),
        );
        return requests;
    }
    // Whole rounds of the kinds of null campaign, of the mechanisms and of the effects outside the vocabulary.
    [
        ("null", 15, 8),
        ("single", 15, 27),
        ("pair", 80, 1),
        ("outside", 5, 17),
    ]
    .into_iter()
    .map(|(stratum, rounds, kinds)| {
        let rounds = (f64::from(rounds) * trial.scale).ceil().max(1.0) as usize;
        request(stratum, rounds * kinds, None, None)
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
    let plan = format!(
        "{} {} {requests:?}\n",
        digest(TEXT.iter().map(|text| text.as_bytes())),
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
/// Where a file cannot be written, no rig can show an ordered effect, or the tool is missing; of a small
/// trial also where its loose bars do not hold.
pub fn trial(trial: &Trial) -> Result<Report> {
    // The tool as it is now: a build that goes on meanwhile must not change it under way.
    let (tool, program) = frozen(trial)?;
    let trial = &Trial {
        tool,
        ..trial.clone()
    };
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
    let request = |tool: Tool, results: PathBuf, baselines: bool, every: usize| ScoreRequest {
        tool,
        campaigns: directory.clone(),
        results,
        strata: vec![],
        only: None,
        baselines,
        jobs: trial.jobs,
        reuse: true,
        every,
    };
    let measured = if trial.small {
        Vec::new()
    } else {
        real::trial(trial, &directory.join("measured"), &program[..12])?
    };
    let paces = speeds(trial, &answers)?;
    let report = score(&request(trial.tool.clone(), answers.clone(), true, 1))?;
    let ablations = ablations(trial, &report, &|tool, name| {
        request(
            tool,
            answers.with_extension(name),
            false,
            trial.ablate_every,
        )
    })?;
    if let Some(pages) = &trial.pages {
        pages::write(
            pages,
            &Telling {
                introduction: introduction(trial, &hash, &program, &report.cases),
                report: &report,
                ablations: &ablations,
                pace: &pace::table(&paces),
                measured: &measured,
                notes: &pages::notes(&pages.join("trials").join("causes.txt"), &hash),
            },
        )?;
    }
    for table in measured.iter().chain([&ablations, &pace::table(&paces)]) {
        if !table.rows.is_empty() {
            print!("{}", table.text());
        }
    }
    if trial.small {
        loose(&report, &paces)?;
    }
    Ok(report)
}

/// Plays the part with measured recordings alone; gives its tables.
///
/// # Errors
/// Where a file cannot be written or the tool is missing.
pub fn only_measured(trial: &Trial) -> Result<String> {
    let (tool, program) = frozen(trial)?;
    let trial = Trial {
        tool,
        ..trial.clone()
    };
    let directory = trial.work.join(format!("seed-{}-measured", trial.seed));
    let tables = real::trial(&trial, &directory, &program[..12])?;
    Ok(tables.iter().map(Table::text).collect())
}

/// A copy of the tool under its own hash, and the hash.
fn frozen(trial: &Trial) -> Result<(Tool, String)> {
    let program = fs::read(&trial.tool.path)
        .with_context(|| format!("no tool at {}", trial.tool.path.display()))?;
    let hash = digest([program.as_slice()]);
    let folder = trial.work.join("tools");
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let path = folder.join(format!("muslip-{}", &hash[..12]));
    if !path.exists() {
        let part = path.with_extension("part");
        fs::copy(&trial.tool.path, &part)?;
        fs::rename(&part, &path)?;
    }
    let path = fs::canonicalize(path)?;
    Ok((
        Tool {
            path,
            ..trial.tool.clone()
        },
        hash,
    ))
}

/// Speeds, kept beside the answers so that a trial that was stopped does not measure again.
fn speeds(trial: &Trial, answers: &Path) -> Result<Vec<Pace>> {
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
        &trial.tool,
        &trial.work.join("pace"),
        trial.ten_million && !trial.small,
    )?;
    fs::create_dir_all(answers)?;
    fs::write(kept, serde_json::to_string(&found)?)?;
    Ok(found)
}

fn ablations(
    trial: &Trial,
    report: &Report,
    request: &dyn Fn(Tool, &str) -> ScoreRequest,
) -> Result<Table> {
    if trial.ablate_every == 0 || trial.small {
        return Ok(Table::default());
    }
    let own: Vec<Case> = report
        .cases
        .iter()
        .step_by(trial.ablate_every)
        .cloned()
        .collect();
    let mut rows = vec![("nothing".to_owned(), Ok(own))];
    for (part, name) in PARTS {
        let mut tool = trial.tool.clone();
        tool.diagnose_arguments
            .extend(["--ablate".into(), part.into()]);
        // A tool that cannot do without a part says so before it reads anything.
        rows.push((
            name.to_owned(),
            match tool.refusal(&trial.work)? {
                Some(why) => Err(why),
                None => Ok(score(&request(tool, part))?.cases),
            },
        ));
    }
    let mut table = rivals::ablations(&rows);
    table.note = Some(format!(
        "Every {}th campaign by number, the same for all rows.",
        trial.ablate_every
    ));
    Ok(table)
}

/// Bars that a small trial must clear: loose, since it is small, but none that a broken tool would clear.
fn loose(report: &Report, paces: &[Pace]) -> Result<()> {
    let cases = &report.cases;
    let count = |stratum: &str, condition: &dyn Fn(&Case) -> bool| {
        let all: Vec<&Case> = cases
            .iter()
            .filter(|case| case.stratum == stratum)
            .collect();
        (all.iter().filter(|case| condition(case)).count(), all.len())
    };
    let mut missed = Vec::new();
    for case in cases.iter().filter(|case| !case.complaints.is_empty()) {
        missed.push(format!("{}: {}", case.campaign, case.complaints.join("; ")));
    }
    let (alarms, nulls) = count("null", &|case| case.verdict != "consistent");
    if alarms > 1 {
        missed.push(format!(
            "{alarms} of {nulls} null campaigns raised an alarm"
        ));
    }
    let (right, singles) = count("single", &|case| case.in_set);
    if right + 1 < singles {
        missed.push(format!(
            "only {right} of {singles} single effects of 2 sigma were named"
        ));
    }
    let (honest, outside) = count("outside", &|case| case.honest);
    if honest < outside {
        missed.push("an effect outside the vocabulary was passed over".to_owned());
    }
    let gains: Vec<_> = cases
        .iter()
        .filter(|case| case.stratum == "single" && case.in_set)
        .flat_map(|case| &case.gains)
        .collect();
    let worse = gains.iter().filter(|gain| gain.worse).count();
    if 4 * worse > gains.len() {
        missed.push(format!(
            "{worse} of {} fresh runs predicted worse than by the base",
            gains.len()
        ));
    }
    for pace in paces {
        if pace.complaint.is_some() || pace.cost.processor_s > 30.0 {
            missed.push(format!(
                "{}: {:.1} s of processor time {}",
                pace.what,
                pace.cost.processor_s,
                pace.complaint.clone().unwrap_or_default()
            ));
        }
    }
    if !missed.is_empty() {
        for case in cases {
            eprintln!("{}", case.line());
        }
        bail!("the small trial failed: {}", missed.join("; "));
    }
    Ok(())
}

fn introduction(trial: &Trial, hash: &str, program: &str, cases: &[Case]) -> String {
    let count = |stratum: &str| cases.iter().filter(|case| case.stratum == stratum).count();
    format!(
        "# Sealed trial of the diagnosis\n\n\
         Seed {}. {} campaigns ({} null, {} with one effect, {} with two, {} with an effect outside the vocabulary) were written by \
         `tests/trial`, which shares no code and no tyre or sensor model with the engine; the SHA-256 of their sealed truth,\n\n\
         `{hash}`,\n\n\
         was printed before the first of them was diagnosed, by the tool whose SHA-256 is `{program}`. Written by \
         `cargo xtask trial --seed {}{}{}`; none of it is edited by hand but the causes behind the worst cases (`trials/causes.txt`).\n\n\
         How to read it:\n\n\
         - Size of an effect: RMS of what it leaves in the residual of its balance, without random noise and after peak friction and \
         critical slip were refitted, in units of that balance's noise (tyre: drag, load and slip noise together; wheel and vehicle: drag \
         and torque noise and that of an acceleration taken over 50 ms). The bars speak of 0.6 sigma and more; effects were ordered at \
         0.3, 0.6, 1, 2 and 4.\n\
         - Floor: mean squared error, against the load cell's reading without its random noise, of the truth itself (all effects, all \
         figures) driven sample by sample with the fresh run's written inputs. Gain share: 1 - (MSE - floor)/(MSE of base - floor), on runs \
         where the base's error exceeds the floor by a quarter; a model that smooths its inputs may exceed 1.\n\
         - Location: intersection over union of the intervals in the balance of the concealed effect, single effects from 0.6 sigma; local \
         are patches, saturation, and whatever is off less than a quarter of the time.\n\
         - A figure's pull: reported minus true, in its reported standard deviation; where the contract leaves the variable open, the nearer.\n\
         - Intervals of shares: Clopper and Pearson, 95 %; of means: normal; of quantiles: order statistics. \"Spans the bar\" says that \
         the interval does not tell the figure from its bar.\n\n\
         In the lists, `!` marks a name that is not concealed there, `~` what it was said to be confusable with, and `left(...)` the variables \
         of what was left unexplained.\n\n",
        trial.seed,
        cases.len(),
        count("null"),
        count("single"),
        count("pair"),
        count("outside"),
        trial.seed,
        if trial.small { " --small" } else { "" },
        if (trial.scale - 1.0).abs() > 1e-12 && !trial.small {
            format!(" --scale {}", trial.scale)
        } else {
            String::new()
        },
    )
}
