//! Measured recordings: what is said of them, what is said of them once what it claims is destroyed, how runs are
//! predicted that were left out, and real noise with an effect put in.
//!
//! The data are those of `sets`, none of them copied into the project. `dart-friction` is also the source of real
//! inputs and real noise: the force is the two-parameter law at the measured slip, then the effect, then noise: what
//! another measured run scatters about its own mean over two seconds, played backwards, so that it has its real size,
//! colour and tails and nothing to do with the inputs. In half of these campaigns the law is driven by the slip as
//! recorded, so that the inputs are exact; in the other half by its centred mean over 0.3 s, so that the slip as
//! recorded has whatever it does faster than that as an error, which no delay and no lag explains.

mod ask;
mod coast;
mod curve;
mod fold;
mod injected;
mod page;
mod picture;
mod placebo;
mod prediction;
mod recording;
mod sets;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use rayon::prelude::*;
use serde_json::Value;

use crate::contract::{list, number, text};
use crate::judge::headline::{Better, Headline};
use crate::setup::Trial;
use crate::share::Share;
use crate::table::Table;

use ask::{Answer, Ask};
use fold::Fold;
use placebo::{COPY, Fate, Placebo};
use sets::{Loaded, SETS, Set};

/// What a study of measured recordings found.
#[derive(Clone, Debug, Default)]
pub struct Study {
    /// For a terminal and for the page.
    pub tables: Vec<Table>,
    /// Keys start with `real.`.
    pub headlines: Vec<Headline>,
    /// Text of `reality.md`; empty where there are no recordings.
    pub page: String,
    /// Names and texts of its pictures.
    pub pictures: Vec<(String, String)>,
}

impl Study {
    /// Tables and headlines for a terminal.
    pub fn text(&self) -> String {
        let mut all: String = self.tables.iter().map(Table::text).collect();
        if !self.headlines.is_empty() {
            all.push_str(&page::figures(&self.headlines).text());
        }
        all
    }

    /// Writes `reality.md` and the pictures beside it.
    ///
    /// # Errors
    /// Where a file cannot be written.
    pub fn write(&self, docs: &Path) -> Result<()> {
        if self.page.is_empty() {
            return Ok(());
        }
        let folder = docs.join("reality");
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        fs::write(docs.join("reality.md"), &self.page)?;
        for (name, text) in &self.pictures {
            fs::write(folder.join(name), text)?;
        }
        Ok(())
    }
}

/// One thing that must come out.
#[derive(Clone, Debug)]
struct Row {
    what: String,
    must: String,
    came: String,
    /// None where nobody knows.
    holds: Option<bool>,
}

impl Row {
    fn new(what: &str, must: &str, came: String, holds: Option<bool>) -> Row {
        Row {
            what: what.to_owned(),
            must: must.to_owned(),
            came,
            holds,
        }
    }
}

/// What was found with one placebo of one set.
#[derive(Clone, Debug)]
struct Tried {
    placebo: Placebo,
    /// Why it was not tried.
    senseless: Option<&'static str>,
    told: String,
    fates: Vec<(String, Fate)>,
    /// Explanations by a column that explains nothing.
    used: Vec<String>,
    /// Whether the copy of the drag was told as one.
    copy_told: bool,
}

impl Tried {
    fn names(&self, fate: Fate) -> Vec<&str> {
        self.fates
            .iter()
            .filter(|(_, f)| *f == fate)
            .map(|(id, _)| id.as_str())
            .collect()
    }
}

/// All that was found of one set.
struct Found {
    loaded: Loaded,
    whole: Answer,
    tried: Vec<Tried>,
    folds: Vec<Fold>,
    /// What was asked beside the set's own expectations.
    further: Vec<Row>,
}

/// Everything measured: what is known, placebos, runs left out, then real noise with an effect put in.
///
/// # Errors
/// Where a file cannot be read or written; in continuous integration also where there are no recordings.
pub fn study(trial: &Trial, work: &Path, program: &str) -> Result<Study> {
    let sets: Vec<Set> = if trial.small {
        sets::small()
    } else {
        SETS.to_vec()
    };
    if let Some(set) = sets
        .iter()
        .find(|set| !trial.data.join(set.folder).is_dir())
    {
        let why = format!("no {} at {}: not tried", set.folder, trial.data.display());
        return untried(why, std::env::var_os("CI").is_some());
    }
    let ask = Ask {
        tool: &trial.tool,
        program,
        answers: work.join("answers"),
    };
    let loaded: Vec<Loaded> = sets
        .into_iter()
        .map(|set| Loaded::read(set, &trial.data))
        .collect::<Result<_>>()?;
    let found = diagnosed(trial, &ask, loaded, work)?;
    let mut tables = page::tables(&found);
    let mut headlines = headlines(&found);
    if !trial.small {
        let friction = trial.data.join("dart-friction");
        let (table, more) = injected::injected(trial, &friction, work, &ask)?;
        tables.push(table);
        headlines.extend(more);
    }
    let pictures = picture::all(&ask, &found)?;
    Ok(Study {
        page: page::page(&found, &tables, &headlines, &pictures, trial.small),
        tables,
        headlines,
        pictures,
    })
}

/// What is said where there are no recordings; continuous integration must not pass over them.
fn untried(why: String, integration: bool) -> Result<Study> {
    if integration {
        bail!("measured recordings: {why}");
    }
    let mut table = Table::new("Measured recordings", &["what"]);
    table.row([why]);
    Ok(Study {
        tables: vec![table],
        ..Study::default()
    })
}

/// One call's worth of work.
#[derive(Clone, Copy)]
enum Job {
    Whole(usize),
    Placebo(usize, Placebo),
    Fold(usize, usize),
    Coast(usize),
    Curve(usize, usize),
}

/// What a job gave.
enum Outcome {
    Diagnosis(Answer),
    Fold(Fold),
    Rows(Vec<Row>),
}

fn diagnosed(trial: &Trial, ask: &Ask, loaded: Vec<Loaded>, work: &Path) -> Result<Vec<Found>> {
    let mut jobs = Vec::new();
    for (place, set) in loaded.iter().enumerate() {
        jobs.push(Job::Whole(place));
        for placebo in set.set.placebos {
            if placebo.senseless(&set.runs).is_none() {
                jobs.push(Job::Placebo(place, *placebo));
            }
        }
        if set.no_folds().is_none() {
            jobs.extend((0..set.runs.len()).map(|k| Job::Fold(place, k)));
        }
        match set.set.key {
            "coast-downs" => jobs.push(Job::Coast(place)),
            "circles" | "drifts" => {
                jobs.extend((0..set.runs.len()).map(|k| Job::Curve(place, k)));
            }
            _ => {}
        }
    }
    let run = |job: &Job| -> Result<Outcome> {
        Ok(match *job {
            Job::Whole(place) => {
                let set = &loaded[place];
                Outcome::Diagnosis(ask.diagnose(&set.rig, &set.paths)?)
            }
            Job::Placebo(place, placebo) => {
                let (rig, runs) = written(&loaded[place], placebo, work)?;
                Outcome::Diagnosis(ask.diagnose(&rig, &runs)?)
            }
            Job::Fold(place, out) => Outcome::Fold(prediction::fold(ask, &loaded[place], out)?),
            Job::Coast(place) => Outcome::Rows(coast::further(ask, &loaded[place], work)?),
            Job::Curve(place, k) => Outcome::Rows(curve::curves(ask, &loaded[place], k)?),
        })
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(trial.jobs.max(1))
        .build()
        .context("no threads")?;
    let outcomes: Vec<(Job, Outcome)> = pool.install(|| {
        jobs.par_iter()
            .with_max_len(1)
            .map(|job| Ok((*job, run(job)?)))
            .collect::<Result<_>>()
    })?;
    let mut found: Vec<Found> = loaded
        .into_iter()
        .map(|loaded| Found {
            loaded,
            whole: Answer::default(),
            tried: Vec::new(),
            folds: Vec::new(),
            further: Vec::new(),
        })
        .collect();
    let mut answers: Vec<(usize, Placebo, Answer)> = Vec::new();
    for (job, outcome) in outcomes {
        match (job, outcome) {
            (Job::Whole(place), Outcome::Diagnosis(answer)) => found[place].whole = answer,
            (Job::Placebo(place, placebo), Outcome::Diagnosis(answer)) => {
                answers.push((place, placebo, answer));
            }
            (Job::Fold(place, _), Outcome::Fold(fold)) => found[place].folds.push(fold),
            (Job::Coast(place) | Job::Curve(place, _), Outcome::Rows(rows)) => {
                found[place].further.extend(rows);
            }
            _ => {}
        }
    }
    for (place, set) in found.iter_mut().enumerate() {
        for placebo in set.loaded.set.placebos {
            let answer = answers.iter().find(|a| a.0 == place && a.1 == *placebo);
            let tried = judged(set, *placebo, answer.map(|a| &a.2));
            set.tried.push(tried);
        }
    }
    Ok(found)
}

fn judged(set: &Found, placebo: Placebo, answer: Option<&Answer>) -> Tried {
    let Some(answer) = answer else {
        return Tried {
            placebo,
            senseless: placebo.senseless(&set.loaded.runs),
            told: String::new(),
            fates: Vec::new(),
            used: Vec::new(),
            copy_told: false,
        };
    };
    Tried {
        placebo,
        senseless: None,
        told: told(&answer.value),
        fates: placebo.fates(&set.loaded.runs, &set.whole.value, &answer.value),
        used: placebo.used(&answer.value),
        copy_told: placebo::leaks(&answer.value, COPY),
    }
}

/// Writes the recordings of a placebo with their rig file; gives the rig file and the runs in order.
fn written(loaded: &Loaded, placebo: Placebo, work: &Path) -> Result<(PathBuf, Vec<PathBuf>)> {
    let folder = work
        .join("placebos")
        .join(format!("{}-{}", loaded.set.key, loaded.runs.len()))
        .join(placebo.key());
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let rig = folder.join("rig.toml");
    fs::write(&rig, placebo.rig(&loaded.rig_text))?;
    let mut runs = Vec::new();
    for (place, (was, run)) in placebo.apply(&loaded.runs).into_iter().enumerate() {
        // A new order is one of names too.
        let name = if placebo == Placebo::Reordered {
            format!("run{:02}.csv", place + 1)
        } else {
            format!("{}.csv", loaded.set.files[was])
        };
        let path = folder.join(name);
        fs::write(&path, run.text())?;
        runs.push(path);
    }
    Ok((rig, runs))
}

/// What must come out of a set and what came.
fn rows(found: &Found) -> Vec<Row> {
    let set = &found.loaded.set;
    let mut rows: Vec<Row> = set
        .expects
        .iter()
        .map(|expect| {
            let (came, holds) = expect.judge(&found.loaded, &found.whole.value, &found.folds);
            Row::new(set.name, &expect.must(), came, holds)
        })
        .collect();
    rows.extend(found.further.iter().cloned());
    rows
}

fn headlines(found: &[Found]) -> Vec<Headline> {
    let tried = || {
        found
            .iter()
            .flat_map(|set| &set.tried)
            .filter(|tried| tried.senseless.is_none())
    };
    let fates: Vec<Fate> = tried()
        .flat_map(|t| t.fates.iter().map(|f| f.1))
        .filter(|fate| *fate != Fate::Arises)
        .collect();
    let all: Vec<Row> = found.iter().flat_map(rows).collect();
    let share = |key: &str, what: &str, better: Better, bar: f64, share: Share| {
        Headline::share(&format!("real.{key}"), what, better, Some(bar), share)
    };
    vec![
        share(
            "expectations",
            "what is certain of the measured recordings comes out",
            Better::Higher,
            1.0,
            Share::count(all.iter().filter_map(|row| row.holds), |holds| *holds),
        ),
        share(
            "survivors",
            "names that survive a placebo which destroys what they claim, of names with such a placebo",
            Better::Lower,
            0.0,
            Share::count(&fates, |fate| **fate == Fate::Survives),
        ),
        share(
            "arisen",
            "placebos with a name of what they destroy that the original had not, of those that destroy something",
            Better::Lower,
            0.0,
            Share::count(tried().filter(|t| t.placebo.columns().is_empty()), |t| {
                !t.names(Fate::Arises).is_empty()
            }),
        ),
        share(
            "column_used",
            "placebos explained by their own column that explains nothing, random or a copy of the drag",
            Better::Lower,
            0.0,
            Share::count(tried().filter(|t| !t.placebo.columns().is_empty()), |t| {
                !t.used.is_empty()
            }),
        ),
        share(
            "copy_told",
            "copies of the drag told as such",
            Better::Higher,
            1.0,
            Share::count(tried().filter(|t| t.placebo == Placebo::CopiedDrag), |t| {
                t.copy_told
            }),
        ),
        share(
            "folds_worse",
            "runs left out that the repaired model predicts worse than the base, by 1 % of the squared error",
            Better::Lower,
            0.0,
            Share::count(found.iter().flat_map(|set| &set.folds), |fold| fold.worse()),
        ),
    ]
}

/// What a diagnosis says, in a line.
fn told(diagnosis: &Value) -> String {
    let named: Vec<String> = list(diagnosis, "mechanisms")
        .iter()
        .map(|m| format!("{} {:.2}", text(m, "id"), sets::confidence(m)))
        .collect();
    let left: Vec<&str> = list(diagnosis, "unexplained")
        .iter()
        .map(|left| text(left, "variable"))
        .collect();
    let chain: Vec<String> = list(diagnosis, "chain")
        .iter()
        .map(|f| {
            format!(
                "{} {} {:.3}",
                text(f, "channel"),
                text(f, "finding"),
                number(f, "value")
            )
        })
        .collect();
    let mut said = text(diagnosis, "verdict").to_owned();
    if !named.is_empty() {
        let _ = write!(said, ": {}", named.join(", "));
    }
    if !left.is_empty() {
        let _ = write!(said, "; left: {}", left.join(", "));
    }
    if !chain.is_empty() {
        // A finding a run and a channel is many: the first few.
        let _ = write!(
            said,
            "; chain: {}{}",
            chain[..chain.len().min(4)].join(", "),
            if chain.len() > 4 { ", ..." } else { "" }
        );
    }
    said
}

fn holds(yes: Option<bool>) -> String {
    match yes {
        Some(true) => "yes",
        Some(false) => "**no**",
        None => "-",
    }
    .to_owned()
}

/// A reported figure and its standard deviation.
fn figure(diagnosis: &Value, id: &str, name: &str) -> Option<(f64, f64)> {
    let mechanism = list(diagnosis, "mechanisms")
        .iter()
        .find(|mechanism| text(mechanism, "id") == id)?;
    let parameter = list(mechanism, "parameters")
        .iter()
        .find(|parameter| text(parameter, "name") == name)?;
    Some((number(parameter, "value"), number(parameter, "std")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_recordings_are_told_and_fail_continuous_integration() {
        let study = untried("no data".to_owned(), false).unwrap();
        assert!(study.text().contains("no data"));
        assert!(untried("no data".to_owned(), true).is_err());
        // Nothing is written over a page that was made with recordings.
        let directory = tempfile::tempdir().unwrap();
        study.write(directory.path()).unwrap();
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 0);
    }

    fn found(whole: Value, tried: Vec<Tried>, folds: Vec<Fold>) -> Found {
        Found {
            loaded: Loaded {
                set: SETS[6],
                rig: PathBuf::new(),
                rig_text: String::new(),
                paths: vec![],
                runs: vec![],
            },
            whole: Answer {
                value: whole,
                ..Answer::default()
            },
            tried,
            folds,
            further: vec![],
        }
    }

    #[test]
    fn the_figures_count_failures_over_what_was_tried() {
        let tried = |placebo, fates: &[(&str, Fate)], used: &[&str]| Tried {
            placebo,
            senseless: None,
            told: String::new(),
            fates: fates.iter().map(|f| (f.0.to_owned(), f.1)).collect(),
            used: used.iter().map(|u| (*u).to_owned()).collect(),
            copy_told: true,
        };
        let fates = [
            ("force_lag", Fate::Survives),
            ("force_delay", Fate::Gone),
            ("thermal_fade", Fate::Arises),
        ];
        let mut skipped = tried(Placebo::DragSwapped, &[], &[]);
        skipped.senseless = Some("no drag");
        let set = found(
            serde_json::json!({"verdict": "undecided", "mechanisms": []}),
            vec![
                tried(Placebo::Reversed, &fates, &[]),
                tried(
                    Placebo::RandomColumns(placebo::Draws::First),
                    &[],
                    &["regions: random_walk"],
                ),
                tried(Placebo::CopiedDrag, &[], &[]),
                skipped,
            ],
            vec![
                Fold {
                    repaired: 2.0,
                    base: 1.0,
                    ..Fold::default()
                },
                Fold::default(),
            ],
        );
        let counts: Vec<(String, Option<usize>, usize)> = headlines(&[set])
            .into_iter()
            .map(|h| (h.key, h.hits, h.of))
            .collect();
        let count = |key: &str| {
            let key = format!("real.{key}");
            let found = counts.iter().find(|c| c.0 == key).unwrap();
            (found.1.unwrap(), found.2)
        };
        // Undecided and nothing named, but not for the right reason.
        assert_eq!(count("expectations"), (2, 3));
        assert_eq!(count("survivors"), (1, 2));
        assert_eq!(count("arisen"), (1, 1));
        assert_eq!(count("column_used"), (1, 2));
        assert_eq!(count("copy_told"), (1, 1));
        assert_eq!(count("folds_worse"), (1, 2));
    }
}
