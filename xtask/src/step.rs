//! One child process with its name and time, and where the workspace is.

use std::env::consts::EXE_SUFFIX;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, bail};

/// The profile of the workspace's tests: the same for all of them, so that everything is built once.
pub const CHECKED: &str = "checked";

/// The root of the workspace.
pub fn root() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// The folder that cargo builds into.
pub fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| root().join("target"), |folder| root().join(folder))
}

/// A program that was built in a profile.
pub fn program(profile: &str, name: &str) -> String {
    program_in(&target(), profile, name)
}

/// As [`program`], in another target folder.
pub fn program_in(target: &Path, profile: &str, name: &str) -> String {
    target
        .join(profile)
        .join(format!("{name}{EXE_SUFFIX}"))
        .display()
        .to_string()
}

/// `cargo` with these arguments, in the root, without standard input.
pub fn cargo(arguments: &[&str]) -> Command {
    // The cargo that runs this, so that a `+toolchain` carries over.
    command(
        &std::env::var("CARGO").unwrap_or_else(|_| "cargo".into()),
        arguments,
    )
}

/// A program with these arguments, in the root, without standard input.
pub fn command(program: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(program);
    command
        .args(arguments)
        .current_dir(root())
        .stdin(Stdio::null());
    command
}

/// Does `work` under a heading and says how long it took: on standard error, for standard output holds results.
pub fn step<T>(name: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
    eprintln!("==> {name}");
    let start = Instant::now();
    let result = work();
    let outcome = if result.is_ok() { "done" } else { "FAILED" };
    eprintln!(
        "==> {name}: {outcome} in {:.1} s",
        start.elapsed().as_secs_f64()
    );
    result
}

/// Runs a command as a step that fails unless it succeeds.
pub fn run(name: &str, mut command: Command) -> Result<()> {
    step(name, || {
        let status = command
            .status()
            .with_context(|| format!("cannot start {command:?}"))?;
        if !status.success() {
            bail!("{name}: {status}");
        }
        Ok(())
    })
}

/// What a command prints on standard output.
pub fn output(mut command: Command) -> Result<String> {
    let output = command
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| format!("cannot start {command:?}"))?;
    if !output.status.success() {
        bail!("{command:?}: {}", output.status);
    }
    Ok(String::from_utf8(output.stdout)?)
}
