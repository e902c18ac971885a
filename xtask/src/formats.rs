//! `cargo xtask formats`: files of other programs, and the readers held against them.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use anyhow::{Result, bail};

use crate::figures::replaced_between;
use crate::setup;
use crate::step::{CHECKED, cargo, command, root, run, target};

/// The environment variable that names the files to the tests.
pub const FILES: &str = "MUSLIP_FORMATS_FILES";
/// The same of the interpreter that has the field's programs.
pub const PYTHON: &str = "MUSLIP_FORMATS_PYTHON";
/// The same of the file that takes the table of what was read of whose files.
const TABLE: &str = "MUSLIP_FORMATS_TABLE";
/// Between these lines of docs/formats.md that stands.
const OTHERS: [&str; 2] = ["<!-- others -->", "<!-- end of others -->"];
/// Between these the times.
const TIMES: [&str; 2] = ["<!-- times -->", "<!-- end of times -->"];

/// Writes the files with the programs that the field uses; answers with their folder.
///
/// The programs are installed at the versions of tests/formats/requirements.txt into a virtual environment below the target folder, once.
pub fn write() -> Result<PathBuf> {
    let sources = root().join("tests/formats");
    let python = python()?;
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

/// The interpreter that has the programs that the field uses.
pub fn python() -> Result<PathBuf> {
    let requirements = root().join("tests/formats/requirements.txt");
    setup::python_environment("formats", &requirements)
}

/// A script of tests/formats, with the place of a program that is built first: of the whole workspace, so that nothing is built a second time with
/// other features.
fn script(name: &str, program: &str) -> Result<Command> {
    let build = cargo(&[
        "build",
        "--release",
        "--locked",
        "--quiet",
        "--bin",
        program,
    ]);
    run(&format!("build {program}"), build)?;
    let mut script = command(&python()?.to_string_lossy(), &[]);
    script
        .arg(root().join("tests/formats").join(name))
        .arg(target().join("formats-large"))
        .arg(target().join("release").join(program));
    Ok(script)
}

/// Times the readers beside the programs that the field uses, and writes the table into docs/formats.md where that is wanted.
pub fn times(write: bool) -> Result<()> {
    let mut times = script("times.py", "time-reading")?;
    let output = times.stderr(Stdio::inherit()).output()?;
    let table = String::from_utf8(output.stdout)?;
    print!("{table}");
    if !output.status.success() {
        bail!("times.py: {}", output.status);
    }
    if write {
        put(TIMES, &table)?;
    }
    Ok(())
}

/// Puts a table between its marks in docs/formats.md.
fn put(marks: [&str; 2], table: &str) -> Result<()> {
    let page = root().join("docs/formats.md");
    let text = fs::read_to_string(&page)?;
    Ok(fs::write(&page, replaced_between(&text, marks, table)?)?)
}

/// Converts files that are larger than memory should be; `rows` of the CSV, a tenth of it in the MDF file.
pub fn large(rows: u64) -> Result<()> {
    let mut large = script("large.py", "muslip")?;
    large.arg(rows.to_string());
    run("long files", large)
}

/// Writes the files and runs the tests of the readers alone; writes what was read of whose files into docs/formats.md where that is wanted.
pub fn test(mutations: Option<u64>, write_table: bool) -> Result<()> {
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
    let table = target().join("formats.md");
    tests.env(FILES, files).env(TABLE, &table);
    if let Some(mutations) = mutations {
        tests.env("MUSLIP_MUTATIONS", mutations.to_string());
    }
    run("readers against the files of other programs", tests)?;
    if write_table {
        put(OTHERS, &fs::read_to_string(&table)?)?;
    }
    Ok(())
}
