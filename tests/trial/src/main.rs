//! The `sealed-trial` command.

use std::path::PathBuf;

use anyhow::Result;
use clap::{Parser, Subcommand};
use sealed_trial::{Request, generate};

/// Conceal effects in recordings, have them diagnosed, and judge.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Write campaigns of recordings with a sealed truth.
    Generate {
        /// Where to write; further campaigns are added to those already there.
        #[arg(long)]
        out: PathBuf,
        /// null, single, pair or outside; several with commas.
        #[arg(long, value_delimiter = ',')]
        stratum: Vec<String>,
        #[arg(long)]
        seed: u64,
        /// Campaigns of each stratum.
        #[arg(long)]
        count: usize,
        /// Only this mechanism (single), or pairs with it.
        #[arg(long)]
        mechanism: Option<String>,
        /// Size of each effect in sigma, instead of the ladder.
        #[arg(long)]
        strength: Option<f64>,
    },
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
        } => {
            let requests: Vec<Request> = stratum
                .into_iter()
                .map(|stratum| Request {
                    stratum,
                    count,
                    mechanism: mechanism.clone(),
                    strength,
                })
                .collect();
            let hash = generate(&out, &requests, seed)?;
            println!("sealed truth sha256 {hash}");
        }
    }
    Ok(())
}
