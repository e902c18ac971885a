//! `cargo xtask mechanisms`: the field guide, `docs/mechanisms.md` and its pictures.

use std::fs;

use anyhow::Result;

use crate::step::{cargo, output, root};

/// The page, ...
const PAGE: &str = "docs/mechanisms.md";
/// ... and the folder of its pictures.
const PICTURES: &str = "docs/mechanisms";

/// Writes both from what the mechanisms say of themselves.
pub fn write() -> Result<()> {
    let page = output(cargo(&[
        "run",
        "--release",
        "--locked",
        "--quiet",
        "--package",
        "muslip-cli",
        "--bin",
        "muslip",
        "--",
        "explain",
        "--markdown",
        "--pictures",
        PICTURES,
    ]))?;
    fs::write(root().join(PAGE), page)?;
    println!("{PAGE}, {PICTURES}");
    Ok(())
}
