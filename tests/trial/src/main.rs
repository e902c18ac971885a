//! The `sealed-trial` command.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::{Args, Parser, Subcommand};
use sealed_trial::{
    Compensation, Request, ScoreRequest, Tool, Trial, compensation, generate, only_measured, pace,
    score, trial,
};

/// Seeds from here on are reported on, and not developed against.
const REPORTED: u64 = 20_000;

/// Conceal effects in recordings, have them diagnosed, and judge.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Args)]
struct ToolArguments {
    /// The tool under trial.
    #[arg(long, default_value = "target/release/muslip")]
    muslip: PathBuf,
    /// A further argument to `muslip diagnose`, for baselines and ablations; may be repeated.
    #[arg(long = "diagnose-argument", allow_hyphen_values = true)]
    diagnose_arguments: Vec<String>,
    /// Campaigns at the same time, each on one thread.
    #[arg(long, default_value_t = 2)]
    jobs: usize,
}

impl ToolArguments {
    fn tool(&self) -> Tool {
        Tool {
            path: self.muslip.clone(),
            diagnose_arguments: self.diagnose_arguments.clone(),
        }
    }
}

#[derive(Subcommand)]
enum Command {
    /// Write campaigns of recordings with a sealed truth.
    Generate {
        /// Where to write; further campaigns are added to those already there.
        #[arg(long)]
        out: PathBuf,
        /// null, chain, single, pair or outside; several with commas.
        #[arg(long, value_delimiter = ',')]
        stratum: Vec<String>,
        #[arg(long)]
        seed: u64,
        /// Campaigns of each stratum.
        #[arg(long)]
        count: usize,
        /// Only this mechanism (single), pairs with it, or this form (outside).
        #[arg(long)]
        mechanism: Option<String>,
        /// Size of each effect in sigma, instead of the ladder.
        #[arg(long)]
        strength: Option<f64>,
        /// Through real measuring chains rather than ideal sensors.
        #[arg(long)]
        real_chain: bool,
    },
    /// Have campaigns diagnosed, then open the truth and judge.
    Score {
        #[command(flatten)]
        tool: ToolArguments,
        /// Directory that `generate` wrote.
        #[arg(long)]
        campaigns: PathBuf,
        /// Where the tool's answers go; beside the campaigns unless given.
        #[arg(long)]
        results: Option<PathBuf>,
        /// Only these strata.
        #[arg(long, value_delimiter = ',')]
        stratum: Vec<String>,
        /// Only campaigns whose name, mechanism or form holds this text (alternatives with |).
        #[arg(long)]
        only: Option<String>,
        /// List failed campaigns only.
        #[arg(long)]
        only_failures: bool,
        /// One line a campaign, no tables.
        #[arg(long)]
        terse: bool,
        /// Apply the textbook baselines to the same files as well.
        #[arg(long)]
        baselines: bool,
        /// Judge the answers of an earlier call.
        #[arg(long)]
        reuse: bool,
        /// Write everything to this file.
        #[arg(long)]
        out: Option<PathBuf>,
    },
    /// Estimate fresh runs with and without the model that a diagnosis wrote, beside the same runs of a rig
    /// without the effect.
    Compensate {
        /// The tool under trial.
        #[arg(long, default_value = "target/release/muslip")]
        muslip: PathBuf,
        /// Seed of every draw: 260 unless given, and with --page one from 20,000.
        #[arg(long)]
        seed: Option<u64>,
        /// Campaigns of each mechanism.
        #[arg(long, default_value_t = 24)]
        count: usize,
        /// Which estimator.
        #[arg(long, default_value = "article")]
        estimator: String,
        /// Scratch directory.
        #[arg(long, default_value = "target/compensation")]
        work: PathBuf,
        /// Page to write.
        #[arg(long)]
        page: Option<PathBuf>,
        /// One line a run as well.
        #[arg(long)]
        all: bool,
    },
    /// Generate from a fresh seed, score, and write the pages.
    Run(RunArguments),
    /// Only what `run` does with measured recordings; writes reality.md and its pictures where `--out` is given.
    Measured(RunArguments),
    /// Only how long `run` finds a diagnosis to take, on two threads, and how much memory.
    Pace {
        /// The tool under trial.
        #[arg(long, default_value = "target/release/muslip")]
        muslip: PathBuf,
        /// Campaigns of six runs of 5,000 samples.
        #[arg(long, default_value_t = 20)]
        six: usize,
        /// Leave out the diagnosis of ten million samples.
        #[arg(long)]
        no_ten_million: bool,
        /// Scratch directory.
        #[arg(long, default_value = "target/pace")]
        work: PathBuf,
    },
}

#[derive(Args)]
struct RunArguments {
    #[command(flatten)]
    tool: ToolArguments,
    /// Seed of every draw: below 1000 to develop, 1000 to 1999 for continuous integration, from 20,000 to report.
    #[arg(long, default_value_t = 41)]
    seed: u64,
    /// A tenth of the campaigns, whose figures may not be worse than those of .ci/trial.toml; no pages.
    #[arg(long)]
    small: bool,
    /// With --small: write .ci/trial.toml anew instead.
    #[arg(long, requires = "small")]
    bless: bool,
    /// Campaigns as a share of the full trial's 585.
    #[arg(long, default_value_t = 1.0)]
    scale: f64,
    /// An earlier engine, tried on every sixth campaign.
    #[arg(long)]
    rival: Option<PathBuf>,
    /// Commit that the tool was built from; only with a seed to report.
    #[arg(long)]
    commit: Option<String>,
    /// Scratch directory; a trial that was stopped goes on from what is there.
    #[arg(long, default_value = "target/trial")]
    work: PathBuf,
    /// Directory of trials.md, trials/ and reality.md; none are written unless given. The project's own only with --commit.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Directory of measured recordings.
    #[arg(long, default_value = "../shared/data")]
    data: PathBuf,
    /// Leave out the diagnosis of ten million samples.
    #[arg(long)]
    no_ten_million: bool,
    /// Write every judged campaign to this file as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
}

fn main() -> Result<()> {
    match Arguments::parse().command {
        Command::Generate {
            out,
            stratum,
            seed,
            count,
            mechanism,
            strength,
            real_chain,
        } => {
            if seed >= REPORTED {
                bail!(
                    "seed {seed} is for reports, which `run` makes: a development seed is below 1000"
                );
            }
            let requests: Vec<Request> = stratum
                .into_iter()
                .map(|stratum| Request {
                    stratum,
                    real_chain,
                    count,
                    mechanism: mechanism.clone(),
                    strength,
                })
                .collect();
            let hash = generate(&out, &requests, seed)?;
            println!("sealed truth sha256 {hash}");
        }
        Command::Score {
            tool,
            campaigns,
            results,
            stratum,
            only,
            only_failures,
            terse,
            baselines,
            reuse,
            out,
        } => {
            let report = score(&ScoreRequest {
                tool: tool.tool(),
                results: results.unwrap_or_else(|| campaigns.join("answers")),
                campaigns,
                strata: stratum,
                only,
                jobs: tool.jobs,
                baselines,
                reuse,
                every: 1,
            })?;
            print!("{}", report.lines(only_failures));
            if !terse {
                print!("{}", report.text());
            }
            if let Some(path) = out {
                report.write(&path)?;
            }
        }
        Command::Compensate {
            muslip,
            seed,
            count,
            estimator,
            work,
            page,
            all,
        } => {
            let seed = seed.unwrap_or(260);
            if page.is_some() != (seed >= REPORTED) {
                bail!(
                    "a page is of a seed from {REPORTED}, and such a seed is for a page: seed {seed}"
                );
            }
            let report = compensation(&Compensation {
                muslip,
                seed,
                count,
                estimator,
                work,
            })?;
            if all {
                print!("{}", report.lines());
            }
            print!("{}", report.text());
            if let Some(page) = page {
                std::fs::write(page, report.markdown())?;
            }
        }
        Command::Run(run) => {
            let report = trial(&run.trial())?;
            print!("{}", report.text());
            if let Some(path) = run.json {
                report.write(&path)?;
            }
        }
        Command::Measured(run) => {
            let study = only_measured(&run.trial())?;
            print!("{}", study.text());
            if let Some(docs) = &run.out {
                study.write(docs)?;
            }
        }
        Command::Pace {
            muslip,
            six,
            no_ten_million,
            work,
        } => {
            let tool = Tool {
                path: muslip,
                diagnose_arguments: Vec::new(),
            };
            print!("{}", pace(&tool, &work, six, !no_ten_million)?);
        }
    }
    Ok(())
}

impl RunArguments {
    fn trial(&self) -> Trial {
        Trial {
            tool: self.tool.tool(),
            seed: self.seed,
            small: self.small,
            bless: self.bless,
            rival: self.rival.clone(),
            commit: self.commit.clone(),
            scale: self.scale,
            work: self.work.clone(),
            pages: self.out.clone(),
            data: self.data.clone(),
            jobs: self.tool.jobs,
            ten_million: !self.no_ten_million,
        }
    }
}
