//! `cargo xtask formats`: files of other programs, and the readers held against them.

use std::fs;
use std::path::PathBuf;

use anyhow::Result;

use crate::setup;
use crate::step::{CHECKED, cargo, command, root, run, target};

/// The environment variable that names the files to the tests.
pub const FILES: &str = "MUSLIP_FORMATS_FILES";

/// Writes the files with the programs that the field uses; answers with their folder.
///
/// The programs are installed at the versions of tests/formats/requirements.txt into a virtual environment below the target folder, once.
pub fn write() -> Result<PathBuf> {
    let sources = root().join("tests/formats");
    let python = setup::python_environment("formats", &sources.join("requirements.txt"))?;
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
