//! `cargo xtask formats`: files of other programs, and the readers held against them.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result};

use crate::setup;
use crate::step::{CHECKED, cargo, command, root, run, target};

/// The environment variable that names the files to the tests.
pub const FILES: &str = "MUSLIP_FORMATS_FILES";

/// Writes the files with the programs that the field uses; answers with their folder.
///
/// The programs are installed at the versions of tests/formats/requirements.txt into a virtual environment below the target folder, once.
pub fn write() -> Result<PathBuf> {
    setup::for_formats()?;
    let sources = root().join("tests/formats");
    let requirements = sources.join("requirements.txt");
    let wanted = fs::read_to_string(&requirements).context("tests/formats/requirements.txt")?;
    let environment = target().join("tools").join("formats");
    let stamp = environment.join("installed.txt");
    let python = environment.join("bin").join("python");
    if fs::read_to_string(&stamp).ok().as_ref() != Some(&wanted) {
        let mut make = command("python3", &["-m", "venv", "--clear"]);
        make.arg(&environment);
        run(
            "make a Python environment for the files of other programs",
            make,
        )?;
        let mut install = command(
            &python.to_string_lossy(),
            &[
                "-m",
                "pip",
                "install",
                "--quiet",
                "--disable-pip-version-check",
                "-r",
            ],
        );
        install.arg(&requirements);
        run("install the programs that write them", install)?;
        fs::write(&stamp, &wanted)?;
    }
    let files = target().join("formats");
    if files.exists() {
        fs::remove_dir_all(&files)?;
    }
    let mut write = command(&python.to_string_lossy(), &[]);
    write.arg(sources.join("write.py")).arg(&files);
    // On standard error: a set-up is no result.
    write.stdout(std::io::stderr());
    run("write the files of other programs", write)?;
    Ok(files)
}

/// Writes the files and runs the tests of the readers alone.
pub fn test(mutations: Option<u64>) -> Result<()> {
    let files = write()?;
    let mut tests = cargo(&[
        "test",
        "--package",
        "formats-tests",
        "--profile",
        CHECKED,
        "--locked",
        "--no-fail-fast",
        "--",
        "--nocapture",
    ]);
    tests.env(FILES, files);
    if let Some(mutations) = mutations {
        tests.env("MUSLIP_MUTATIONS", mutations.to_string());
    }
    run("readers against the files of other programs", tests)
}
