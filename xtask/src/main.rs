//! Multi-step project commands; CI calls these and nothing else.
#![forbid(unsafe_code)]

mod check;
mod setup;
mod step;
mod test;
mod trial;

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
    /// The sealed trial of the diagnosis: conceal effects, diagnose, open, judge, write docs/trials.md.
    ///
    /// Arguments go to `sealed-trial run`, among them --seed, --small, --scale, --jobs and --out; --help tells all.
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
        Command::Trial { arguments } => trial::play(&arguments),
    }
}
