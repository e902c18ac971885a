//! `cargo xtask python`: the Python package as a wheel, installed and held against the command.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::setup;
use crate::step::{CHECKED, cargo, command, program, root, run, target};

/// The environment variable that names the command to the tests.
const COMMAND: &str = "MUSLIP_COMMAND";

/// The features of a wheel that is released.
const FEATURES: &str = "extension-module";

/// The features of a wheel that is built beside the tests of the workspace: of what these are built of, as far as that is what
/// a released one does.
pub const BESIDE_TESTS: &str = "extension-module,beside-tests";

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
    let (muslip, features) = beside()?;
    test(&muslip, features)
}

/// The command that the package is held against, and the features of a wheel that is built beside it: what both depend on is
/// then built once.
pub fn beside() -> Result<(String, &'static str)> {
    let mut build = cargo(&["build", "--profile", CHECKED, "--locked", "--bin=muslip"]);
    build
        .args(["--package=muslip-cli", "--package=muslip-python"])
        .args(["--features", "muslip-python/extension-module"])
        .args(["--features", "muslip-python/beside-command"]);
    run("the command that the package is held against", build)?;
    let features = "extension-module,beside-command";
    Ok((program(CHECKED, "muslip"), features))
}

/// Builds the wheel, installs it into virtual environments of its own and runs the package's tests there, against this
/// command.
pub fn test(muslip: &str, features: &str) -> Result<()> {
    let python = python_of_package()?;
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
        (
            "Python: types, a second opinion",
            // Its settings are the package's, whatever lies in folders above.
            &[
                "-m",
                "basedpyright",
                "--warnings",
                "--project",
                "pyproject.toml",
                "--pythonpath",
                &python,
            ],
        ),
    ] {
        let mut check = command(&python, arguments);
        check
            .arg("muslip")
            .current_dir(folder())
            .env("MYPY_CACHE_DIR", target().join("mypy"));
        run(name, check)?;
    }
    let wheel = built(&python, CHECKED, features)?;
    install(&python, &wheel)?;
    // As those see it who use it: the stub against the compiled module, and whether every public type is known.
    let mut stub = command(&python, &["-m", "mypy.stubtest", "--ignore-disjoint-bases"]);
    stub.arg("--allowlist")
        .arg(folder().join("tests/stubtest.txt"))
        .arg("muslip._native")
        .current_dir(wheels())
        .env("MYPY_CACHE_DIR", target().join("mypy"));
    run("Python: the stub is the compiled module's", stub)?;
    let mut known = command(
        &python,
        &[
            "-m",
            "basedpyright",
            "--verifytypes",
            "muslip",
            "--ignoreexternal",
        ],
    );
    // It looks for packages by the first python of the search path.
    known.current_dir(wheels()).env("PATH", path_with(&python)?);
    run("Python: every public type is known", known)?;
    tested(&python, muslip, &[])?;
    let mut reference = command(
        &python,
        &["-W", "error", "-m", "pdoc", "--docformat", "numpy"],
    );
    reference
        .args(["muslip", "muslip.fleet", "--output-directory"])
        .arg(target().join("python-reference"))
        .current_dir(wheels());
    run("Python: reference", reference)?;
    prove(&wheel, SMALL, "fleet-of-the-tests")
}

/// Runs the tests of the installed package, against this command.
pub fn tested(python: &str, muslip: &str, arguments: &[&str]) -> Result<()> {
    // Not from the sources, whose folder has the same name and no compiled part.
    let mut tests = command(
        python,
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
        .args(arguments)
        .arg(folder().join("tests"))
        .current_dir(target())
        .env(COMMAND, muslip);
    run("tests of the Python package", tests)
}

/// `cargo xtask fleet`: the proof on a large fleet, by a wheel that is built as a release is.
pub fn fleet(proof: Proof) -> Result<()> {
    let python = python_of_package()?;
    prove(&built(&python, "release", FEATURES)?, proof, "fleet")
}

/// A fleet through Spark, with all that goes wrong: `python/tests/proof.py`.
fn prove(wheel: &Path, proof: Proof, folder_name: &str) -> Result<()> {
    let [spark, executor] = pythons_of_spark()?;
    install(&spark, wheel)?;
    let mut proved = command(&spark, &[]);
    proved
        .arg(folder().join("tests/proof.py"))
        .args(["--executor", &executor, "--wheel"])
        .arg(wheel)
        .arg("--folder")
        .arg(target().join(folder_name));
    for (name, count) in [
        ("--recordings", proof.recordings),
        ("--diagnoses", proof.diagnoses),
        ("--large", proof.large),
    ] {
        proved.args([name, &count.to_string()]);
    }
    run("a fleet through Spark", proved)
}

/// The sources.
pub fn folder() -> PathBuf {
    root().join("python")
}

/// Makes every environment that [`test`] uses.
pub fn environments() -> Result<()> {
    python_of_package()?;
    pythons_of_spark()?;
    Ok(())
}

/// The interpreter that the package is built and tested with.
pub fn python_of_package() -> Result<String> {
    environment("python", "requirements.txt")
}

/// The interpreters of Spark's driver and of its executors, with what runs Spark.
fn pythons_of_spark() -> Result<[String; 2]> {
    setup::for_spark()?;
    Ok([
        environment("spark", "requirements-spark.txt")?,
        environment("executor", "requirements-executor.txt")?,
    ])
}

/// The interpreter of the environment that a file of requirements asks for.
pub fn environment(name: &str, requirements: &str) -> Result<String> {
    let python = setup::python_environment(name, &folder().join(requirements))?;
    Ok(python.to_string_lossy().into_owned())
}

/// The search path with what is beside an interpreter first, as an environment that is activated has it.
pub fn path_with(python: &str) -> Result<OsString> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let first = Path::new(python).parent().map(Path::to_owned);
    let folders = first.into_iter().chain(std::env::split_paths(&path));
    Ok(std::env::join_paths(folders)?)
}

/// Where the wheel is built.
fn wheels() -> PathBuf {
    target().join("wheels")
}

/// The wheel, built anew in a profile.
pub fn built(python: &str, profile: &str, features: &str) -> Result<PathBuf> {
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
            "--features",
            features,
        ],
    );
    build
        .arg("--manifest-path")
        .arg(folder().join("Cargo.toml"))
        .arg("--out")
        .arg(&wheels);
    run("the wheel", build)?;
    the_wheel(&wheels)
}

/// Installs a wheel and nothing else.
pub fn install(python: &str, wheel: &Path) -> Result<()> {
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

/// The one wheel in a folder.
pub fn the_wheel(folder: &Path) -> Result<PathBuf> {
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

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::BESIDE_TESTS;
    use crate::step::{cargo, output};
    use crate::test::TESTED_FEATURES;

    /// The features of each package that is built, by its name and version.
    fn built(arguments: &[&str]) -> BTreeMap<String, BTreeSet<String>> {
        let mut tree = cargo(&["tree", "--locked", "--no-dedupe"]);
        tree.args(["--prefix", "none", "--format", "{p}|{f}"])
            .args(arguments);
        let mut all: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        let printed = output(tree).unwrap();
        // An empty line parts the packages of the workspace.
        for line in printed.lines().filter(|line| !line.is_empty()) {
            let (package, features) = line.split_once('|').unwrap();
            let name = package.split(" (").next().unwrap();
            let features = features.trim_end_matches(" (*)");
            all.entry(name.to_owned())
                .or_default()
                .insert(features.to_owned());
        }
        all
    }

    #[test]
    fn a_wheel_beside_the_tests_is_built_of_what_they_are_built_of_but_serde_json() {
        let package = ["--package", "muslip-python", "--edges", "normal,build"];
        let of_wheel = |features| built(&[&package[..], &["--features", features]].concat());
        let needed = of_wheel("extension-module");
        let wheel = of_wheel(BESIDE_TESTS);
        let tests = built(&[
            "--workspace",
            "--edges",
            "normal,build,dev",
            "--features",
            TESTED_FEATURES,
        ]);
        assert!(needed.len() > 100, "{}", needed.len());
        for name in needed.keys() {
            // A released wheel's: with the tests' it refuses a rig.
            let other = if name.starts_with("serde_json ") {
                &needed
            } else {
                &tests
            };
            if !name.starts_with("muslip-python ") {
                assert_eq!(wheel[name], other[name], "{name}: python/Cargo.toml");
            }
        }
    }
}
