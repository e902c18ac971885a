//! What one update costs on a Cortex-M4F and, in software arithmetic, on a Cortex-M0: the cycle tables of
//! `docs/estimators.md`.
//!
//! `cargo xtask cycles` installs what is needed and calls this. Each candidate is an image of its own
//! (`benches/cycles`), run in QEMU one instruction at a time; the addresses that were executed in `update` are
//! counted, and timed by [`pipeline`].
#![forbid(unsafe_code)]

mod budget;
mod candidate;
mod instruction;
mod pipeline;
mod process;
mod table;
mod trace;

use anyhow::{Context, Result};
use clap::Parser;

use candidate::{Candidate, OURS, SAMPLED, candidates};
use trace::{Cost, measured};

/// What one update of each filter costs on a Cortex-M4F: instructions in QEMU, modelled cycles.
#[derive(Debug, Parser)]
#[command(name = "study-cycles")]
struct Arguments {
    /// Print a JSON list in place of the table.
    #[arg(long)]
    json: bool,
    /// Only hold instruction counts against .ci/cycles.toml.
    #[arg(long, conflicts_with = "json")]
    check: bool,
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    if arguments.check {
        return check();
    }
    let rows = candidates()
        .into_iter()
        .map(cost_of)
        .collect::<Result<Vec<_>>>()?;
    if arguments.json {
        println!("{}", table::json(&rows));
    } else {
        print!("{}", table::markdown(&rows, budget::sample_percent()?));
    }
    Ok(())
}

fn cost_of(candidate: Candidate) -> Result<(Candidate, Cost)> {
    let cost = measured(&candidate).with_context(|| candidate.key())?;
    Ok((candidate, cost))
}

/// Holds the instruction counts of our own filters against their budgets, and what fills a sample against its share.
fn check() -> Result<()> {
    let percent = budget::sample_percent()?;
    let mut counts = Vec::new();
    for candidate in candidates() {
        let sampled = SAMPLED.contains(&candidate.name);
        if (OURS.contains(&candidate.name) || sampled) && !candidate.long {
            let (candidate, cost) = cost_of(candidate)?;
            // The image is built for speed.
            if sampled && candidate.opt == "3" {
                budget::check_sample(&candidate.key(), cost.most_cycles, percent)?;
            }
            counts.push((candidate.key(), cost.instructions));
            // The order of instructions costs cycles, too.
            counts.push((
                format!("{}-cycles", candidate.key()),
                cost.cycles.unsigned_abs(),
            ));
        }
    }
    budget::check(&counts)
}
