//! The `muslip` command line: arguments in, calls into the library, words out.
//!
//! One file a subcommand. Exit status: 0 done; 2 bad usage or bad input, with exactly one line on
//! standard error. Whoever reads standard output may stop at any time: that ends the command quietly.

mod campaign;
mod channels;
mod completions;
mod convert;
mod demo;
mod diagnose;
mod estimate;
mod explain;
mod failure;
mod fit;
mod interrupt;
mod mapping;
mod predict;
mod progress;
mod records;
mod rig;
mod rig_source;
mod rig_view;
mod simulate;
mod terminal;

use std::io;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use muslip_recordings::input_error::one_line;

use failure::Failure;
use terminal::Terminal;

/// Exit status of bad usage and bad input.
const BAD_INPUT: u8 = 2;

/// Estimate mu-slip curves from recordings of a braked wheel, find what a simulation lacks, operate a rig.
#[derive(Debug, Parser)]
#[command(name = "muslip", bin_name = "muslip", version, max_term_width = 100)]
#[command(after_help = "Try it: muslip demo\n\
Exit status: 0 done; 2 bad usage or bad input, one line on standard error naming file, line and column.")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Estimate(estimate::Arguments),
    Channels(channels::Arguments),
    Convert(convert::Arguments),
    Campaign(campaign::Arguments),
    Fit(fit::Arguments),
    Diagnose(diagnose::Arguments),
    Predict(predict::Arguments),
    Explain(explain::Arguments),
    Simulate(simulate::Arguments),
    Demo(demo::Arguments),
    Rig(rig::Arguments),
    Completions(completions::Arguments),
}

/// Runs the command with the arguments of the process.
pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return usage(&error),
    };
    // A library that gives up on a damaged file is one line about the file, as everything else is.
    muslip_formats::quiet_panics();
    // What a rig sent until then is not thrown away.
    if !matches!(arguments.command, Command::Rig(_)) {
        interrupt::removes_half_written();
    }
    let mut terminal = Terminal::new();
    let outcome = match arguments.command {
        Command::Estimate(arguments) => estimate::run(&arguments, &mut terminal),
        Command::Channels(arguments) => channels::run(&arguments, &mut terminal),
        Command::Convert(arguments) => convert::run(&arguments, &mut terminal),
        Command::Campaign(arguments) => campaign::run(&arguments, &mut terminal),
        Command::Fit(arguments) => fit::run(&arguments, &mut terminal),
        Command::Diagnose(arguments) => diagnose::run(&arguments, &mut terminal),
        Command::Predict(arguments) => predict::run(&arguments, &mut terminal),
        Command::Explain(arguments) => explain::run(&arguments, &mut terminal),
        Command::Simulate(arguments) => simulate::run(&arguments, &mut terminal),
        Command::Demo(arguments) => demo::run(&arguments, &mut terminal),
        Command::Rig(arguments) => rig::run(&arguments, &mut terminal),
        Command::Completions(arguments) => completions::run(&arguments, &mut terminal),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        // The reader of standard output has seen enough.
        Err(Failure::Terminal(error)) if error.kind() == io::ErrorKind::BrokenPipe => {
            ExitCode::SUCCESS
        }
        Err(failure) => {
            terminal::complain(&one_line(&failure.to_string()));
            ExitCode::from(BAD_INPUT)
        }
    }
}

/// Help and version as they are; a complaint about usage in one line.
fn usage(error: &clap::Error) -> ExitCode {
    if !error.use_stderr() {
        // Help that nobody reads to the end is no failure.
        let _ = error.print();
        return ExitCode::SUCCESS;
    }
    let text = error.render().to_string();
    let told: Vec<&str> = text
        .lines()
        .map(str::trim)
        .take_while(|line| !line.starts_with("Usage:"))
        .filter(|line| !line.is_empty())
        .collect();
    let told = if told.is_empty()
        || error.kind() == clap::error::ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
    {
        "error: a subcommand is needed".to_owned()
    } else {
        told.join(" ")
    };
    terminal::complain(&format!("{} (more: muslip --help)", one_line(&told)));
    ExitCode::from(BAD_INPUT)
}
