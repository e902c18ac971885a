//! The estimators side by side: prints `docs/estimators.md`'s part on accuracy.
//!
//! `cargo run --release -p host-sim --example estimators [SEEDS]`; without an argument 10,000 streams of
//! noise a curve.
#![allow(clippy::unwrap_used, reason = "a program that may end by panicking")]

mod accuracy;
mod contenders;
mod particle;
mod special;
mod streams;
mod summary;

use accuracy::{accuracy, conditions};
use particle::particle;
use special::{survival, tracking};

fn main() {
    let seeds = std::env::args()
        .nth(1)
        .map_or(10_000, |text| text.parse().unwrap());
    println!(
        "## Accuracy\n\nPrinted by `cargo run --release -p host-sim --example estimators {seeds}`; ChaCha8 streams, seeds from 0.\n"
    );
    accuracy(seeds);
    conditions(seeds);
    tracking(seeds);
    survival();
    particle(seeds);
}
