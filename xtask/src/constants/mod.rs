//! `cargo xtask constants`: each constant by which the diagnosis decides, halved and doubled, on the same campaigns.

mod moved;
mod tunable;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::step::{cargo, command, program, program_in, root, run, target};
use crate::trial::clean_commit;
use moved::{Answers, Moved};
use tunable::{Constant, TUNED};

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
    /// Only constants whose name holds this.
    pub only: Option<String>,
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
        let as_it_is = bench.answers(None)?;
        let mut rows = Vec::new();
        for constant in constants.iter().filter(|constant| self.wants(constant)) {
            let [halved, doubled] = constant.varied().map(|value| -> Result<Moved> {
                Ok(as_it_is.moved(&bench.answers(Some((constant, value)))?))
            });
            let row = moved::row(constant, [&halved?, &doubled?]);
            println!("{row}");
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
        only.is_none_or(|only| constant.path().contains(only.as_str()))
    }

    /// What prints the same again.
    fn command(&self) -> String {
        let only = self.only.as_ref();
        let only = only.map_or_else(String::new, |only| format!(" --only {only}"));
        format!(
            "cargo xtask constants --seed {} --count {}{only} --write",
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
    /// All campaigns diagnosed with one constant set to a value, or with all of them as they are. Answers that are there
    /// already are not asked for again.
    fn answers(&self, set: Option<(&Constant, f64)>) -> Result<Answers> {
        let (name, setting) = match set {
            None => ("as-it-is".to_owned(), String::new()),
            Some((constant, value)) => {
                let setting = format!("{}={value:e}", constant.path());
                (setting.replace("::", "-"), setting)
            }
        };
        let answers = self.campaigns.join("answers");
        let results = answers.join(&name);
        let judged = answers.join(format!("{name}.json"));
        if !judged.exists() {
            let part = answers.join(format!("{name}.part"));
            let mut score = command(&judge(), &["score", "--terse", "--reuse"]);
            score.args(["--muslip", &self.tunable]);
            score.arg("--campaigns").arg(&self.campaigns);
            score.arg("--results").arg(&results);
            score.arg("--out").arg(&part);
            score.env(TUNED, &setting);
            score.stdout(std::process::Stdio::null());
            run(&name, score)?;
            fs::rename(&part, &judged)?;
            // Only what is judged of them is of use, and it is a hundredth of them.
            fs::remove_dir_all(&results)?;
        }
        Answers::read(&judged)
    }
}
