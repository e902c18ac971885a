//! `cargo xtask check`: formatting, lints, documentation.

use anyhow::Result;

use crate::setup;
use crate::step::{CHECKED, cargo, run};

/// Runs the three; the first that fails ends it.
pub fn run_all() -> Result<()> {
    run("formatting", cargo(&["fmt", "--all", "--check"]))?;
    clippy("clippy", &["--workspace", "--all-targets"])?;
    clippy(
        "clippy of the features",
        &[
            "--package=muslip",
            "--package=muslip-laws",
            "--package=muslip-quarter-car",
            "--package=muslip-compensate",
            "--all-features",
        ],
    )?;
    setup::rust_target("thumbv7em-none-eabihf")?;
    clippy(
        "clippy of the firmware's image",
        &[
            "--package=firmware",
            "--features=test-image",
            "--target=thumbv7em-none-eabihf",
        ],
    )?;
    clippy(
        "clippy of the STM32G474's image",
        &[
            "--package=firmware",
            "--no-default-features",
            "--features=stm32g474",
            "--target=thumbv7em-none-eabihf",
        ],
    )?;
    // Libraries only: the command and the core are both called muslip and would overwrite each other.
    let mut documentation = cargo(&["doc", "--workspace", "--lib", "--no-deps", "--locked"]);
    documentation.args(["--profile", CHECKED]);
    documentation.env("RUSTDOCFLAGS", "-D warnings");
    run("documentation", documentation)
}

/// Clippy with these arguments, warnings denied. In the tests' profile: what the compiler runs itself, macros and scripts of
/// builds, is then there already.
fn clippy(name: &str, arguments: &[&str]) -> Result<()> {
    let mut command = cargo(&["clippy", "--locked", "--profile", CHECKED]);
    command.args(arguments).args(["--", "-D", "warnings"]);
    run(name, command)
}
