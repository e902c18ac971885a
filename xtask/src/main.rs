//! Multi-step project commands; CI calls these and nothing else.
#![forbid(unsafe_code)]

mod check;
mod setup;
mod step;
mod test;

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
}

fn main() -> anyhow::Result<()> {
    match Arguments::parse().command {
        Command::Test => test::run_all(),
        Command::Check => check::run_all(),
    }
}
