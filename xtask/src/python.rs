//! `cargo xtask python`: the Python package as a wheel, installed and held against the command.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};

use crate::setup;
use crate::step::{CHECKED, cargo, command, root, run, target};
use crate::trial::program;

/// The environment variable that names the command to the tests.
const COMMAND: &str = "MUSLIP_COMMAND";

/// As [`test`], against a command that is built for it.
pub fn test_alone() -> Result<()> {
    run(
        "the command that the package is held against",
        cargo(&[
            "build",
            "--package",
            "muslip-cli",
            "--profile",
            CHECKED,
            "--locked",
        ]),
    )?;
    test(&program(&target(), CHECKED, "muslip"))
}

/// Builds the wheel, installs it into a virtual environment of its own and runs the package's tests there, against
/// this command.
pub fn test(muslip: &str) -> Result<()> {
    let python = setup::python_environment("python", &root().join("python/requirements.txt"))?;
    let python = python.to_string_lossy();
    for (name, arguments) in [
        (
            "Python: lint",
            ["-m", "ruff", "check", "--quiet", "--no-cache"].as_slice(),
        ),
        (
            "Python: format",
            &["-m", "ruff", "format", "--quiet", "--check", "--no-cache"],
        ),
        ("Python: types", &["-m", "mypy", "--no-error-summary"]),
    ] {
        let mut check = command(&python, arguments);
        check
            .arg("muslip")
            .current_dir(root().join("python"))
            .env("MYPY_CACHE_DIR", target().join("mypy"));
        run(name, check)?;
    }
    let wheels = target().join("wheels");
    if wheels.exists() {
        fs::remove_dir_all(&wheels)?;
    }
    let mut build = command(
        &python,
        &[
            "-m",
            "maturin",
            "build",
            "--locked",
            "--quiet",
            "--profile",
            CHECKED,
        ],
    );
    build
        .arg("--manifest-path")
        .arg(root().join("python/Cargo.toml"))
        .arg("--out")
        .arg(&wheels);
    run("the wheel", build)?;
    let mut install = command(
        &python,
        &[
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "--force-reinstall",
            "--no-deps",
        ],
    );
    install.arg(wheel(&wheels)?);
    run("install the wheel", install)?;
    // Not from the sources, whose folder has the same name and no compiled part.
    let mut tests = command(
        &python,
        &[
            "-m",
            "pytest",
            "--quiet",
            "-p",
            "no:cacheprovider",
            "--import-mode=importlib",
        ],
    );
    tests
        .arg(root().join("python/tests"))
        .current_dir(&wheels)
        .env(COMMAND, muslip);
    run("tests of the Python package", tests)
}

/// The one wheel that was built.
fn wheel(folder: &std::path::Path) -> Result<PathBuf> {
    let mut wheels = Vec::new();
    for entry in fs::read_dir(folder).context("the folder of the wheel")? {
        let path = entry?.path();
        if path.extension().is_some_and(|e| e == "whl") {
            wheels.push(path);
        }
    }
    match wheels.as_slice() {
        [one] => Ok(one.clone()),
        other => bail!("{} wheels in {}, not one", other.len(), folder.display()),
    }
}
