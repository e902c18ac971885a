//! `cargo xtask mutants`: whether the controller's tests notice when its interlocks, sequence, ranges and store are changed.

use anyhow::Result;

use crate::setup;
use crate::step::{CHECKED, command, run, target};

/// Where a mistake can hurt.
const FILES: [&str; 4] = [
    "crates/muslip-control/src/interlock.rs",
    "crates/muslip-control/src/sequence.rs",
    "crates/muslip-control/src/store.rs",
    "crates/muslip-control/src/validate.rs",
];

/// Changes each place of these files, one at a time, and runs the controller's tests: an error names the changes that none
/// noticed, but for those that `.cargo/mutants.toml` leaves out with their reason.
pub fn run_all() -> Result<()> {
    let program = setup::cargo_mutants()?.display().to_string();
    let mut mutants = command(&program, &["mutants", "--package", "muslip-control"]);
    mutants
        .args(FILES.into_iter().flat_map(|file| ["--file", file]))
        .args(["--profile", CHECKED, "--output"])
        .arg(target().join("mutants"));
    run("mutants of the controller", mutants)
}
