//! `cargo xtask python --versions`: the package's tests on the oldest and the newest Python, with the oldest and the newest of
//! what it works with.

use anyhow::Result;

use crate::python::{beside, built, folder, install, python_of_package, tested};
use crate::setup;
use crate::step::CHECKED;

/// Python, and the file that says with what.
const VERSIONS: [(&str, &str); 2] = [
    ("3.10", "requirements-oldest.txt"),
    ("3.13", "requirements.txt"),
];

/// Builds the wheel once, and runs the package's tests by it on each version.
pub fn test() -> Result<()> {
    let (muslip, features) = beside()?;
    let wheel = built(&python_of_package()?, CHECKED, features)?;
    for (version, requirements) in VERSIONS {
        let python = setup::python_environment_by(
            &setup::python_of(version)?,
            &format!("python-{version}"),
            &folder().join(requirements),
        )?;
        let python = python.to_string_lossy();
        install(&python, &wheel)?;
        println!("Python {version}, {requirements}");
        tested(&python, &muslip, &[])?;
    }
    Ok(())
}
