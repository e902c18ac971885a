//! `cargo xtask constants`: each constant by which the diagnosis decides, halved and doubled, on the same campaigns.

#[cfg_attr(
    not(test),
    allow(dead_code, reason = "its text goes into the changed engine")
)]
#[allow(
    clippy::expect_used,
    reason = "what cannot be told there must not pass for nothing"
)]
mod kept;
mod moved;
mod tunable;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};

use crate::step::{cargo, command, program, program_in, root, run, target};
use crate::trial::clean_commit;
use kept::{SET, TOLD, WORDS};
use moved::{Answers, Moved, Others, Row};
use tunable::Constant;

/// The page.
const PAGE: &str = "docs/trials/constants.md";
/// The first seed that is not for development.
const REPORTED: u64 = 1_000;

/// What is played.
pub struct Study {
    /// Campaigns of each sort.
    pub count: usize,
    /// Seed of the campaigns, below 999.
    pub seed: u64,
    /// Only constants whose name holds this, or whose path begins with it.
    pub only: Option<String>,
    /// Most campaigns that are diagnosed again for a constant halved, or doubled; of more in which it may change something so
    /// many stand for all.
    pub most: Option<usize>,
    /// Write the page.
    pub write: bool,
}

impl Study {
    /// Builds the engine so that its constants can be set, plays all of them, and prints what each moves.
    ///
    /// # Errors
    /// Where something is not committed, or cannot be built, or a campaign cannot be judged.
    pub fn play(&self) -> Result<()> {
        ensure!(
            self.seed + 1 < REPORTED,
            "development campaigns have seeds below {REPORTED}, two of them are used: --seed {}",
            self.seed
        );
        let commit = clean_commit()?[..7].to_owned();
        let folder = target().join("constants").join(&commit);
        let constants = tunable::write(&folder.join("source"))?;
        let bench = Bench {
            tunable: build(&folder)?,
            campaigns: folder.join(format!("campaigns-{}-{}", self.seed, self.count)),
        };
        self.generate(&bench.campaigns)?;
        let (as_it_is, told) = bench.as_it_is()?;
        let mut rows = Vec::new();
        for (place, constant) in constants.iter().enumerate() {
            if !self.wants(constant) {
                continue;
            }
            let moved = |at: usize| -> Result<Moved> {
                let touched = told.touched(constant, at);
                let played = evenly(&touched, self.most.unwrap_or(usize::MAX), place);
                as_it_is.moved(&Others {
                    touched: touched.len(),
                    answers: bench.varied(constant, at, &played)?,
                })
            };
            // Side by side: what is left to diagnose of most constants would keep one processor.
            let both = std::thread::scope(|scope| {
                let doubled = scope.spawn(|| moved(1));
                [Ok(moved(0)), doubled.join()]
            });
            let [halved, doubled] =
                both.map(|joined| joined.unwrap_or_else(|_| bail!("a thread panicked")));
            let row = Row {
                constant,
                moved: [halved?, doubled?],
            };
            println!("{}", row.line());
            rows.push(row);
        }
        if self.write {
            let page = moved::page(&self.command(), &commit, &as_it_is, &rows);
            fs::write(root().join(PAGE), page).context(PAGE)?;
            println!("{PAGE}");
        }
        Ok(())
    }

    fn wants(&self, constant: &Constant) -> bool {
        let only = self.only.as_ref();
        only.is_none_or(|only| constant.is_called(only))
    }

    /// What prints the same again.
    fn command(&self) -> String {
        let only = self.only.as_ref();
        let only = only.map_or_else(String::new, |only| format!(" --only {only}"));
        let most = self
            .most
            .map_or_else(String::new, |most| format!(" --most {most}"));
        format!(
            "cargo xtask constants --seed {} --count {}{only}{most} --write",
            self.seed, self.count
        )
    }

    /// Writes the campaigns: nothing missing and one effect, on ideal sensors and through real chains, and one effect of the
    /// chain alone.
    fn generate(&self, campaigns: &Path) -> Result<()> {
        if campaigns.exists() {
            return Ok(());
        }
        // Under its name only when it is whole.
        let part = campaigns.with_extension("part");
        if part.exists() {
            fs::remove_dir_all(&part)?;
        }
        for (seed, strata, chain) in [
            (self.seed, "null,single,chain", None),
            (self.seed + 1, "null,single", Some("--real-chain")),
        ] {
            let mut generate = command(&judge(), &["generate", "--stratum", strata]);
            generate.arg("--out").arg(&part);
            generate.args(["--seed", &seed.to_string()]);
            generate.args(["--count", &self.count.to_string()]);
            generate.args(chain);
            run(&format!("campaigns of seed {seed}"), generate)?;
        }
        fs::rename(&part, campaigns).context("campaigns")
    }
}

/// The program that generates and judges.
fn judge() -> String {
    program("release", "sealed-trial")
}

/// Builds the judge, and the command with constants that can be set.
fn build(folder: &Path) -> Result<String> {
    let release = ["build", "--release", "--locked", "--quiet"];
    let mut trial = cargo(&release);
    trial.args(["--package", "sealed-trial"]);
    run("judge, in release", trial)?;
    // One folder for all engines: their dependencies are the same.
    let built = target().join("constants").join("build");
    let mut tuned = cargo(&release);
    tuned.args(["--package", "muslip-cli", "--manifest-path"]);
    tuned.arg(folder.join("source").join("Cargo.toml"));
    tuned.arg("--target-dir").arg(&built);
    run("engine with constants that can be set, in release", tuned)?;
    let program = folder.join("muslip");
    fs::copy(program_in(&built, "release", "muslip"), &program).context("muslip")?;
    Ok(program.display().to_string())
}

/// What campaigns are diagnosed with and judged by.
struct Bench {
    tunable: String,
    campaigns: PathBuf,
}

impl Bench {
    /// All campaigns diagnosed with the constants as they are, and what those tell of other values.
    fn as_it_is(&self) -> Result<(Answers, Told)> {
        let told = self.answers().join("told");
        let judged = self.answers().join("as-it-is.json");
        if !judged.exists() {
            // What a run that was stopped has told of campaigns that it has answered stays true.
            fs::create_dir_all(&told)?;
            self.judge(&judged, |score| score.env(TOLD, &told))?;
        }
        let answers = Answers::read(&judged)?;
        answers.ensure_answered()?;
        Ok((answers, Told::read(&told)?))
    }

    /// Some campaigns diagnosed with one constant halved or doubled. Answers that are there already are not asked for again.
    fn varied(&self, constant: &Constant, at: usize, played: &[&str]) -> Result<Answers> {
        if played.is_empty() {
            return Ok(Answers::none());
        }
        let setting = format!("{}={:e}", constant.path(), constant.varied()[at]);
        let name = format!("{}-of-{}.json", setting.replace("::", "-"), played.len());
        let judged = self.answers().join(name);
        if !judged.exists() {
            self.judge(&judged, |score| {
                score.args(["--jobs", "1", "--only", &played.join("|")]);
                score.env(SET, &setting)
            })?;
        }
        Answers::read(&judged)
    }

    fn answers(&self) -> PathBuf {
        self.campaigns.join("answers")
    }

    /// Campaigns diagnosed and judged, into a file that is there when it is whole.
    fn judge(
        &self,
        judged: &Path,
        with: impl FnOnce(&mut std::process::Command) -> &mut std::process::Command,
    ) -> Result<()> {
        let (results, part) = (
            judged.with_extension("results"),
            judged.with_extension("part"),
        );
        let mut score = command(&judge(), &["score", "--terse", "--reuse"]);
        score.args(["--muslip", &self.tunable]);
        score.arg("--campaigns").arg(&self.campaigns);
        score.arg("--results").arg(&results);
        score.arg("--out").arg(&part);
        with(&mut score);
        score.stdout(std::process::Stdio::null());
        let name = judged.file_stem().unwrap_or_default();
        run(&name.to_string_lossy(), score)?;
        fs::rename(&part, judged)?;
        // Only what is judged of them is of use, and it is a hundredth of them.
        fs::remove_dir_all(&results)?;
        Ok(())
    }
}

/// What constants tell of other values: path and word, with the campaigns.
struct Told(BTreeMap<String, BTreeSet<String>>);

impl Told {
    /// Reads what is told, one file a campaign.
    fn read(folder: &Path) -> Result<Self> {
        let mut all = BTreeMap::<String, BTreeSet<String>>::new();
        for file in fs::read_dir(folder)? {
            let file = file?;
            let campaign = file.file_name().to_string_lossy().into_owned();
            for line in fs::read_to_string(file.path())?.lines() {
                all.entry(line.to_owned())
                    .or_default()
                    .insert(campaign.clone());
            }
        }
        Ok(Self(all))
    }

    /// Campaigns in which a constant halved, or doubled, may change something.
    fn touched(&self, constant: &Constant, at: usize) -> Vec<&str> {
        let path = constant.path();
        let of = |word: &str| self.0.get(&format!("{path} {word}"));
        let touched: BTreeSet<&String> = [of(WORDS[at]), of(WORDS[2])]
            .into_iter()
            .flatten()
            .flatten()
            .collect();
        touched.into_iter().map(String::as_str).collect()
    }
}

/// At most so many of these, evenly, from another place on for each constant: so that not all are played on the same few.
fn evenly<'a>(all: &[&'a str], most: usize, place: usize) -> Vec<&'a str> {
    let count = all.len().min(most);
    let nth = |i: usize| all[((2 * i + 1) * all.len() / (2 * count) + place) % all.len()];
    (0..count).map(nth).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_of_many_are_taken_evenly() {
        let all: Vec<String> = (0..10).map(|i| i.to_string()).collect();
        let all: Vec<&str> = all.iter().map(String::as_str).collect();
        assert_eq!(evenly(&all, 2, 0), ["2", "7"]);
        assert_eq!(evenly(&all, 2, 4), ["6", "1"]);
        assert_eq!(evenly(&all, 20, 0), all);
        assert!(evenly(&all, 0, 1).is_empty() && evenly(&[], 3, 1).is_empty());
    }
}
