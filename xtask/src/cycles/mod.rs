//! `cargo xtask cycles`: what one update costs on a Cortex-M4F and, in software arithmetic, on a Cortex-M0.
//!
//! Each candidate is an image of its own (`benches/cycles`), run in QEMU one instruction at a time; the
//! addresses that were executed in `update` are counted, and timed by [`pipeline`].

mod budget;
mod instruction;
mod pipeline;
mod table;
mod trace;

use std::fs;

use anyhow::{Context, Result};

use crate::figures::replaced_between;
use crate::setup;
use crate::step::{root, step};
use trace::{Cost, measured};

/// Where the table is, and between which marks.
const DOCUMENT: &str = "docs/estimators.md";
const TABLE: [&str; 2] = ["<!-- cycles -->", "<!-- end of cycles -->"];

/// A processor that the candidates are built for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Core {
    M4F,
    M0,
}

impl Core {
    fn name(self) -> &'static str {
        match self {
            Self::M4F => "cortex-m4f",
            Self::M0 => "cortex-m0",
        }
    }

    fn triple(self) -> &'static str {
        match self {
            Self::M4F => "thumbv7em-none-eabihf",
            Self::M0 => "thumbv6m-none-eabi",
        }
    }

    /// Without the cpu, the compiler fuses multiplications and additions, which on a Cortex-M4 costs more
    /// cycles than it saves.
    fn cpu(self) -> &'static str {
        match self {
            Self::M4F => "cortex-m4",
            Self::M0 => "cortex-m0",
        }
    }

    /// The Cortex-M3 executes a Cortex-M0's instructions as they are.
    fn machine(self) -> &'static str {
        match self {
            Self::M4F => "mps2-an386",
            Self::M0 => "mps2-an385",
        }
    }
}

/// One image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Candidate {
    name: &'static str,
    core: Core,
    opt: &'static str,
    /// 10,000 samples of a rig in place of the article's 41 points.
    long: bool,
}

impl Candidate {
    const fn on(name: &'static str, core: Core, opt: &'static str) -> Self {
        Self {
            name,
            core,
            opt,
            long: false,
        }
    }

    /// Its name in the budgets and of its image.
    fn key(&self) -> String {
        let Self {
            name, core, opt, ..
        } = self;
        let long = if self.long { "-long" } else { "" };
        format!("{name}-{}-{opt}{long}", core.name())
    }
}

/// Ours.
const OURS: [&str; 6] = [
    "article",
    "article_checked",
    "article_report",
    "efficient",
    "slip_friction",
    "quarter_car",
];

/// Ours, a whole sample a call; for the controller alone and within its share of a sample.
const SAMPLED: [&str; 1] = ["innovations"];

const PEERS: [&str; 4] = ["nalgebra", "kfilter", "adskalman", "minikalman"];

/// All rows, in the table's order.
fn candidates() -> Vec<Candidate> {
    let each = |names: &'static [&'static str], core, opt| {
        names.iter().map(move |name| Candidate::on(name, core, opt))
    };
    let mut all: Vec<Candidate> = each(&OURS, Core::M4F, "3").collect();
    all.push(Candidate {
        long: true,
        ..Candidate::on("efficient", Core::M4F, "3")
    });
    all.extend(each(&SAMPLED, Core::M4F, "3"));
    all.extend(each(&PEERS, Core::M4F, "3"));
    all.extend(each(&OURS, Core::M4F, "s"));
    all.extend(each(&SAMPLED, Core::M4F, "s"));
    all.extend(each(&OURS, Core::M0, "3"));
    all
}

/// Measures all candidates and prints a table, or JSON and nothing else; `write` puts the table into its
/// document.
pub fn run_all(json: bool, write: bool) -> Result<()> {
    setup::for_cycles()?;
    let rows = candidates()
        .into_iter()
        .map(cost_of)
        .collect::<Result<Vec<_>>>()?;
    if json {
        println!("{}", table::json(&rows));
        return Ok(());
    }
    let table = table::markdown(&rows, budget::sample_percent()?);
    print!("{table}");
    if write {
        let path = root().join(DOCUMENT);
        let text = fs::read_to_string(&path)?;
        fs::write(path, replaced_between(&text, TABLE, &table)?)?;
    }
    Ok(())
}

fn cost_of(candidate: Candidate) -> Result<(Candidate, Cost)> {
    let cost = measured(&candidate).with_context(|| candidate.key())?;
    Ok((candidate, cost))
}

/// Holds the instruction counts of our own filters against their budgets, and what fills a sample against its share.
pub fn check() -> Result<()> {
    setup::for_cycles()?;
    step("instructions of the filters", || {
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
    })
}
