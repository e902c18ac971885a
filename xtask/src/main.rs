//! Multi-step project commands; CI calls these and nothing else.
#![forbid(unsafe_code)]

mod check;
mod constants;
mod cycles;
mod estimators;
mod figures;
mod firmware;
mod formats;
mod fuzz;
mod image;
mod latency;
mod mechanisms;
mod mutants;
mod python;
mod pythons;
mod release;
mod setup;
mod step;
mod test;
mod trial;
mod what_if;
mod wheels;

use clap::{Parser, Subcommand};

/// Project commands: `cargo xtask <COMMAND>`.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Install what is missing, then run every test there is.
    Test,
    /// Formatting, clippy and documentation, with warnings denied.
    Check,
    /// Build the firmware's image and check its sizes, and that it cannot panic, has no heap and no double
    /// precision.
    Firmware,
    /// Processor in the loop: the image in QEMU, in lock-step with the rig simulator, against its budgets.
    Pil {
        /// Simulated seconds of the endurance run, and of the one at true pace
        #[arg(long, default_value_t = 10)]
        seconds: u32,
        /// Only scenarios whose name contains this; budgets are then of those alone.
        #[arg(long)]
        only: Option<String>,
        /// Write the measured figures into README.md and docs/rig.md.
        #[arg(long)]
        write: bool,
        /// Instead of all that: the image behind a socket at this address, for `muslip rig`.
        #[arg(long, value_name = "HOST:PORT")]
        serve: Option<String>,
    },
    /// The controller under sequences of commands, damage and faults, against a model of it.
    Fuzz {
        /// Samples with whatever arrives in them.
        #[arg(long, default_value_t = 100_000_000)]
        cases: u64,
        /// Another seed makes other cases.
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Change the controller's interlocks, sequence, ranges and store, one place at a time: whether its tests notice each.
    Mutants,
    /// What one update of each filter costs on a Cortex-M4F: instructions in QEMU, modelled cycles.
    Cycles {
        /// Print a JSON list and nothing else.
        #[arg(long, conflicts_with_all = ["write", "check"])]
        json: bool,
        /// Write the table into docs/estimators.md.
        #[arg(long, conflicts_with = "check")]
        write: bool,
        /// Only hold instruction counts against .ci/cycles.toml, as the tests do.
        #[arg(long)]
        check: bool,
    },
    /// How accurate the estimators are: every bar beside its figure, and the tables that they are from.
    Estimators {
        /// Streams of noise a curve.
        #[arg(default_value_t = 10_000)]
        streams: u64,
        /// Write the tables into docs/estimators.md.
        #[arg(long)]
        write: bool,
        /// A python with numpy, scipy and filterpy: also runs docs/scripts/peers.py, on the same streams.
        #[arg(long, value_name = "PYTHON")]
        python: Option<String>,
    },
    /// Write files with the programs that the field uses, and hold the readers against them and against damage.
    Formats {
        /// Damaged files a format; 10,000 where it is not given, as in the tests.
        #[arg(long)]
        mutations: Option<u64>,
        /// Instead of all that: time the readers beside those programs on 10^7 samples, and print the ratios.
        #[arg(long, conflicts_with_all = ["mutations", "large"])]
        times: bool,
        /// Write the table of times, or of whose files were read, into docs/formats.md.
        #[arg(long, conflicts_with = "large")]
        write: bool,
        /// Instead of all that: list and convert a CSV of so many rows and an MDF 4 of a tenth of them, and print their time and peak of memory.
        #[arg(long, value_name = "ROWS", num_args = 0..=1, default_missing_value = "100000000", conflicts_with = "mutations")]
        large: Option<u64>,
    },
    /// Build the Python package as a wheel, install it, and hold it against the command.
    Python {
        /// Instead: the wheels of a release for manylinux2014 (x86_64, aarch64), looked at from outside and tested, the other one emulated.
        #[arg(long, conflicts_with_all = ["versions", "checkout"])]
        wheels: bool,
        /// Instead: its tests on the oldest and the newest Python, with the oldest and the newest pandas.
        #[arg(long, conflicts_with = "checkout")]
        versions: bool,
        /// Instead: `pip install ./python` from a checkout of what is committed, into a bare environment.
        #[arg(long)]
        checkout: bool,
    },
    /// A fleet of recordings through Spark's local cluster, against a plain loop, with workers and driver killed: of the Python package.
    Fleet {
        /// Small recordings, which are estimated.
        #[arg(long, default_value_t = 100_000)]
        recordings: u32,
        /// Diagnoses of three recordings each.
        #[arg(long, default_value_t = 1_000)]
        diagnoses: u32,
        /// Recordings of a minute at 1 kHz.
        #[arg(long, default_value_t = 400)]
        large: u32,
    },
    /// Halve and double each constant by which the diagnosis decides, on the same campaigns: what each moves. Hours; what is
    /// judged already is not played again.
    Constants {
        /// Campaigns of each sort, of which there are five.
        #[arg(long, default_value_t = 12)]
        count: usize,
        /// Seed of the campaigns, and the next one: below 999.
        #[arg(long, default_value_t = 97)]
        seed: u64,
        /// Only constants whose name holds this, or whose path begins with it: `constants::` decide, `audit::` are the audit's.
        #[arg(long)]
        only: Option<String>,
        /// Most campaigns that are diagnosed again for a constant halved, or doubled: so many stand for all in which it may
        /// change something.
        #[arg(long)]
        most: Option<usize>,
        /// Write docs/trials/constants.md.
        #[arg(long)]
        write: bool,
    },
    /// Write the field guide, docs/mechanisms.md with its pictures, from what the mechanisms say of themselves.
    Mechanisms,
    /// Compile the core to WebAssembly for the pages' what-if, into crates/muslip-report/what-if.
    WhatIf {
        /// Only hold the committed module against its sources, as the tests do.
        #[arg(long)]
        check: bool,
    },
    /// Whether the crates could be released: what they say of themselves, their dependencies, their packages.
    Release {
        /// Required: only this is done here; to upload is `cargo publish --workspace`, by who owns the names.
        #[arg(long, required = true)]
        dry_run: bool,
    },
    /// Build, check, and put the image onto a chip by probe-rs.
    Flash,
    /// The sealed trial of the diagnosis: conceal effects, diagnose, open, judge, hold against bars.
    ///
    /// --report writes docs/trials.md and docs/reality.md, of a clean commit and a fresh seed from 20,000; --small plays a tenth
    /// and holds its figures against .ci/trial.toml. Further arguments go to `sealed-trial run`; --help tells all.
    #[command(disable_help_flag = true)]
    Trial {
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
}

fn main() -> anyhow::Result<()> {
    match Arguments::parse().command {
        Command::Test => test::run_all(),
        Command::Check => check::run_all(),
        Command::Python { wheels: true, .. } => wheels::build(),
        Command::Python { versions: true, .. } => pythons::test(),
        Command::Python { checkout: true, .. } => wheels::from_a_checkout(),
        Command::Python { .. } => python::test_alone(),
        Command::Fleet {
            recordings,
            diagnoses,
            large,
        } => python::fleet(python::Proof {
            recordings,
            diagnoses,
            large,
        }),
        Command::Formats {
            times: true, write, ..
        } => formats::times(write),
        Command::Formats {
            large: Some(rows), ..
        } => formats::large(rows),
        Command::Formats {
            mutations, write, ..
        } => formats::test(mutations, write),
        Command::Firmware => firmware::budgets(),
        Command::Pil {
            seconds,
            only,
            write,
            serve,
        } => {
            let mut arguments = vec!["--seconds".to_owned(), seconds.to_string()];
            arguments.extend(
                only.into_iter()
                    .flat_map(|only| ["--only".to_owned(), only]),
            );
            match serve {
                Some(address) => firmware::serve(&address),
                None => firmware::pil(&arguments, write),
            }
        }
        Command::Mutants => mutants::run_all(),
        Command::Fuzz { cases, seed } => fuzz::run_all(cases, seed),
        Command::Cycles { check: true, .. } => cycles::check(),
        Command::Cycles { json, write, .. } => cycles::run_all(json, write),
        Command::Estimators {
            streams,
            write,
            python,
        } => estimators::run_all(streams, write, python.as_deref()),
        Command::Constants {
            count,
            seed,
            only,
            most,
            write,
        } => constants::Study {
            count,
            seed,
            only,
            most,
            write,
        }
        .play(),
        Command::Mechanisms => mechanisms::write(),
        Command::WhatIf { check: true } => what_if::check(),
        Command::WhatIf { check: false } => what_if::write(),
        Command::Release { .. } => release::dry_run(),
        Command::Flash => firmware::flash(),
        Command::Trial { arguments } => trial::play(&arguments),
    }
}
