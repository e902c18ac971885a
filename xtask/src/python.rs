//! `cargo xtask python`: the Python package as a wheel, installed and held against the command.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::setup;
use crate::step::{CHECKED, cargo, command, root, run, target};
use crate::trial::program;

/// The environment variable that names the command to the tests.
const COMMAND: &str = "MUSLIP_COMMAND";

/// How much of the proof is part of the tests.
const SMALL: Proof = Proof {
    recordings: 300,
    diagnoses: 3,
    large: 0,
};

/// How large a fleet is proved on.
#[derive(Debug, Clone, Copy)]
pub struct Proof {
    /// Small recordings, which are estimated.
    pub recordings: u32,
    /// Diagnoses of three recordings each.
    pub diagnoses: u32,
    /// Recordings of a minute at 1 kHz.
    pub large: u32,
}

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

/// Builds the wheel, installs it into virtual environments of its own and runs the package's tests there, against this
/// command.
pub fn test(muslip: &str) -> Result<()> {
    let python = environment("python", "requirements.txt")?;
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
    let wheel = built(&python, CHECKED)?;
    install(&python, &wheel)?;
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
        .current_dir(wheels())
        .env(COMMAND, muslip);
    run("tests of the Python package", tests)?;
    let mut reference = command(
        &python,
        &["-W", "error", "-m", "pdoc", "--docformat", "numpy"],
    );
    reference
        .args(["muslip", "muslip.fleet", "--output-directory"])
        .arg(target().join("python-reference"))
        .current_dir(wheels());
    run("Python: reference", reference)?;
    prove(&wheel, SMALL)
}

/// `cargo xtask fleet`: the proof on a large fleet, by a wheel that is built as a release is.
pub fn fleet(proof: Proof) -> Result<()> {
    let python = environment("python", "requirements.txt")?;
    prove(&built(&python, "release")?, proof)
}

/// A fleet through Spark, with all that goes wrong: `python/tests/proof.py`.
fn prove(wheel: &Path, proof: Proof) -> Result<()> {
    setup::for_spark()?;
    let spark = environment("spark", "requirements-spark.txt")?;
    let executor = environment("executor", "requirements-executor.txt")?;
    install(&spark, wheel)?;
    let mut proved = command(&spark, &[]);
    proved
        .arg(root().join("python/tests/proof.py"))
        .args(["--executor", &executor, "--wheel"])
        .arg(wheel)
        .arg("--folder")
        .arg(target().join("fleet"));
    for (name, count) in [
        ("--recordings", proof.recordings),
        ("--diagnoses", proof.diagnoses),
        ("--large", proof.large),
    ] {
        proved.args([name, &count.to_string()]);
    }
    run("a fleet through Spark", proved)
}

/// The interpreter of the environment that a file of requirements asks for.
fn environment(name: &str, requirements: &str) -> Result<String> {
    let python = setup::python_environment(name, &root().join("python").join(requirements))?;
    Ok(python.to_string_lossy().into_owned())
}

/// Where the wheel is built.
fn wheels() -> PathBuf {
    target().join("wheels")
}

/// The wheel, built anew in a profile.
fn built(python: &str, profile: &str) -> Result<PathBuf> {
    let wheels = wheels();
    if wheels.exists() {
        fs::remove_dir_all(&wheels)?;
    }
    let mut build = command(
        python,
        &[
            "-m",
            "maturin",
            "build",
            "--locked",
            "--quiet",
            "--profile",
            profile,
        ],
    );
    build
        .arg("--manifest-path")
        .arg(root().join("python/Cargo.toml"))
        .arg("--out")
        .arg(&wheels);
    run("the wheel", build)?;
    the_wheel(&wheels)
}

fn install(python: &str, wheel: &Path) -> Result<()> {
    let mut install = command(
        python,
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
    install.arg(wheel);
    run("install the wheel", install)
}

/// The one wheel that was built.
fn the_wheel(folder: &Path) -> Result<PathBuf> {
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
