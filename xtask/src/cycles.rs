//! `cargo xtask cycles`: the cycle tables of `study-cycles`, into `docs/estimators.md` or against their budgets.

use std::fs;
use std::process::Command;

use anyhow::Result;

use crate::figures::replaced_between;
use crate::setup;
use crate::step::{cargo, output, root, run};

/// Where the table is, and between which marks.
const DOCUMENT: &str = "docs/estimators.md";
const TABLE: [&str; 2] = ["<!-- cycles -->", "<!-- end of cycles -->"];

/// Measures all candidates and prints a table, or JSON and nothing else; `write` puts the table into its
/// document.
pub fn run_all(json: bool, write: bool) -> Result<()> {
    setup::for_cycles()?;
    let printed = output(study(if json { &["--json"] } else { &[] }))?;
    print!("{printed}");
    if write {
        let path = root().join(DOCUMENT);
        let text = fs::read_to_string(&path)?;
        fs::write(path, replaced_between(&text, TABLE, &printed)?)?;
    }
    Ok(())
}

/// Holds the instruction counts of our own filters against their budgets, and what fills a sample against its share.
pub fn check() -> Result<()> {
    setup::for_cycles()?;
    run("instructions of the filters", study(&["--check"]))
}

fn study(arguments: &[&str]) -> Command {
    let mut command = cargo(&[
        "run",
        "--locked",
        "--quiet",
        "--package",
        "study-cycles",
        "--",
    ]);
    command.args(arguments);
    command
}
