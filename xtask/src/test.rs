//! `cargo xtask test`: every test there is.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::thread;

use anyhow::{Context, Result, bail};

use crate::cycles;
use crate::firmware;
use crate::formats;
use crate::python;
use crate::setup::{self, TARGETS};
use crate::step::{CHECKED, cargo, run, step};
use crate::trial;
use crate::what_if;

/// The libraries of the target, ...
const TARGET_LIBRARIES: [&str; 5] = [
    "muslip",
    "muslip-laws",
    "muslip-quarter-car",
    "muslip-compensate",
    "muslip-innovations",
];
/// ... and the sets of features that they must build with, each with the libraries that have them.
const TARGET_FEATURES: [(&str, &[&str]); 5] = [
    ("", &TARGET_LIBRARIES),
    ("defmt", WITH_FEATURES),
    ("serde", WITH_FEATURES),
    ("nalgebra", &["muslip"]),
    ("defmt,serde,nalgebra", WITH_FEATURES),
];
const WITH_FEATURES: &[&str] = &[
    "muslip",
    "muslip-laws",
    "muslip-quarter-car",
    "muslip-compensate",
];
/// Tests that exist only with these on run with all others: a feature changes no number. The last one is the wheel's, which is
/// built beside them.
pub const TESTED_FEATURES: &str =
    "muslip/serde,muslip/nalgebra,muslip-laws/serde,muslip-python/extension-module";

/// Sums of the test harness's result lines.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
struct Tally {
    passed: u64,
    failed: u64,
    ignored: u64,
}

/// Installs what is missing, runs everything, and closes with the number of tests.
///
/// A failing test does not stop the others; a build that fails does.
pub fn run_all() -> Result<()> {
    setup::run_all()?;

    what_if::check()?;

    let files = formats::write()?;

    // Downloads and unpacking mostly wait: beside what is built.
    let tally = thread::scope(|scope| {
        let environments = scope.spawn(python::environments);
        let tally = workspace(files)?;
        match environments.join() {
            Ok(made) => made?,
            Err(_) => bail!("making the Python environments panicked"),
        }
        Ok(tally)
    })?;

    python::test(&trial::under_test(), python::BESIDE_TESTS)?;

    trial::small()?;

    for target in TARGETS {
        for (features, packages) in TARGET_FEATURES {
            let mut build = cargo(&["build", "--lib", "--locked", "--quiet", "--target", target]);
            build.args(["--profile", CHECKED, "--features", features]);
            for package in packages {
                build.args(["--package", package]);
            }
            run(
                &format!("libraries for {target}, features: {features}"),
                build,
            )?;
        }
    }

    cycles::check()?;

    firmware::test()?;

    println!("{} passed, {} failed", tally.passed, tally.failed);
    if tally.failed > 0 {
        bail!("{} tests failed", tally.failed);
    }
    if tally.ignored > 0 {
        bail!("{} tests were left out", tally.ignored);
    }
    Ok(())
}

/// Runs the tests of the workspace, with these files of other programs.
fn workspace(files: PathBuf) -> Result<Tally> {
    // The long ones too: a test is ignored by `cargo test` because it is long, and for no other reason.
    let mut workspace = cargo(&[
        "test",
        "--workspace",
        "--profile",
        CHECKED,
        "--locked",
        "--no-fail-fast",
        "--features",
        TESTED_FEATURES,
        "--",
        "--include-ignored",
    ]);
    workspace
        .env(formats::FILES, files)
        .env(formats::PYTHON, formats::python()?);
    tests("tests of the workspace", workspace)
}

/// Runs a `cargo test`, passing its output on, and sums its results.
///
/// An error if it failed without a failing test to show for it: then something did not build.
fn tests(name: &str, mut command: Command) -> Result<Tally> {
    step(name, || {
        let mut child = command
            // The browser is installed by now: tests of the pages may not be left out.
            .env("MUSLIP_PAGES_MUST_RUN", "1")
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot start {command:?}"))?;
        let output = child.stdout.take().context("standard output is piped")?;
        let mut tally = Tally::default();
        for line in BufReader::new(output).lines() {
            let line = line?;
            println!("{line}");
            tally.add(&line);
        }
        let status = child.wait()?;
        if !status.success() && tally.failed == 0 {
            bail!("{name}: {status}");
        }
        Ok(tally)
    })
}

impl Tally {
    /// Adds a line such as `test result: ok. 27 passed; 0 failed; 1 ignored; 0 measured; ...`.
    fn add(&mut self, line: &str) {
        let Some((_, counts)) = line
            .strip_prefix("test result: ")
            .and_then(|rest| rest.split_once(". "))
        else {
            return;
        };
        for part in counts.split("; ") {
            match part.split_once(' ') {
                Some((count, "passed")) => self.passed += count.parse().unwrap_or(0),
                Some((count, "failed")) => self.failed += count.parse().unwrap_or(0),
                Some((count, "ignored")) => self.ignored += count.parse().unwrap_or(0),
                _ => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Tally;

    #[test]
    fn result_lines_are_summed_and_others_are_not() {
        let mut tally = Tally::default();
        for line in [
            "test result: ok. 27 passed; 0 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.03s",
            "test result: FAILED. 3 passed; 2 failed; 0 ignored; 0 measured; 9 filtered out; finished in 1.00s",
            "test real::sine::tests::zero_and_sign_are_exact ... ok",
            "99 passed; 99 failed",
        ] {
            tally.add(line);
        }
        assert_eq!(
            tally,
            Tally {
                passed: 30,
                failed: 2,
                ignored: 1
            }
        );
    }
}
