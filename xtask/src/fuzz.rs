//! `cargo xtask fuzz`: the controller's fuzzing, longer than in the tests.

use anyhow::Result;

use crate::step::{cargo, run};

/// Runs so many cases, with overflow checks, and prints what happened in them how often.
pub fn run_all(cases: u64, seed: u64) -> Result<()> {
    let mut command = cargo(&["test", "--locked", "--quiet", "--profile", "checked"]);
    command
        .args(["--package", "muslip-control", "--test", "fuzz"])
        .args(["--", "--nocapture"])
        .env("MUSLIP_FUZZ_CASES", cases.to_string())
        .env("MUSLIP_FUZZ_SEED", seed.to_string());
    run("fuzzing of the controller", command)
}
