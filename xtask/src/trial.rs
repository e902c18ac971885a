//! `cargo xtask trial`: the sealed trial of the diagnosis, from building the tool to the pages.

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::step::{CHECKED, cargo, command, program, program_in, run, target};

/// The engine that later ones are held against, by its commit.
const RIVAL: &str = "6b77987";
/// The profile of what users run.
const RELEASE: &str = "release";
/// Continuous integration's own seed.
const SMALL_SEED: &str = "1500";

/// Builds tool and trial in release, then plays the trial with the given further arguments. `--report` is for the
/// pages: of a commit and nothing else, with the earlier engine on the same files.
pub fn play(arguments: &[String]) -> Result<()> {
    let report = arguments.iter().any(|argument| argument == "--report");
    let small = arguments.iter().any(|argument| argument == "--small");
    let seeded = arguments
        .iter()
        .any(|argument| argument == "--seed" || argument.starts_with("--seed="));
    if report && small {
        bail!("--report is of the whole trial, --small of continuous integration's tenth");
    }
    if report && !seeded {
        bail!(
            "--report wants a fresh seed from 20,000: --seed; docs/trials/seeds.txt has the used ones"
        );
    }
    let mut further: Vec<String> = arguments
        .iter()
        .filter(|argument| *argument != "--report")
        .cloned()
        .collect();
    if small && !seeded {
        further.extend(["--seed".into(), SMALL_SEED.into()]);
    }
    if report {
        further.extend(["--commit".into(), clean_commit()?]);
        further.extend(["--rival".into(), rival()?.display().to_string()]);
        further.extend(["--out".into(), "docs".into()]);
    }
    run(
        "tool and trial, in release",
        cargo(&[
            "build",
            "--release",
            "--locked",
            "--quiet",
            "--package",
            "muslip-cli",
            "--package",
            "sealed-trial",
        ]),
    )?;
    play_built(RELEASE, &program(RELEASE, "muslip"), &further)
}

/// The small trial: continuous integration's seed, figures held by a ratchet. Of what the tests have built: their
/// command is the same `muslip` under another name.
pub fn small() -> Result<()> {
    let arguments = ["--small", "--seed", SMALL_SEED].map(str::to_owned);
    play_built(CHECKED, &under_test(), &arguments)
}

/// The command as the tests have built it.
pub fn under_test() -> String {
    program(CHECKED, "muslip-under-test")
}

/// Plays the trial with programs that are built.
fn play_built(profile: &str, muslip: &str, arguments: &[String]) -> Result<()> {
    let mut trial = command(
        &program(profile, "sealed-trial"),
        &["run", "--muslip", muslip],
    );
    trial.args(arguments);
    run("sealed trial", trial)
}

/// What a git command prints.
fn git(arguments: &[&str]) -> Result<String> {
    let output = command("git", arguments)
        .output()
        .context("cannot start git")?;
    if !output.status.success() {
        bail!(
            "git {}: {}",
            arguments.join(" "),
            String::from_utf8_lossy(&output.stderr).trim()
        );
    }
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// The commit that is checked out, where nothing differs from it but pages that this command writes.
pub fn clean_commit() -> Result<String> {
    let changed = git(&["status", "--porcelain", "--", ".", ":!docs"])?;
    if !changed.is_empty() {
        bail!("figures are reported of a commit: commit first\n{changed}");
    }
    git(&["rev-parse", "HEAD"])
}

/// The earlier engine, built from its commit in a tree of its own beside the trials.
fn rival() -> Result<PathBuf> {
    let folder = target().join("trial").join(format!("engine-{RIVAL}"));
    let built = folder.join("target");
    let path = PathBuf::from(program_in(&built, RELEASE, "muslip"));
    if path.exists() {
        return Ok(path);
    }
    if !folder.exists() {
        git(&["worktree", "prune"])?;
        git(&[
            "worktree",
            "add",
            "--detach",
            &folder.display().to_string(),
            RIVAL,
        ])
        .with_context(|| {
            format!("the earlier engine's commit {RIVAL} is needed: fetch the whole history")
        })?;
    }
    let mut build = Command::new(std::env::var("CARGO").unwrap_or_else(|_| "cargo".into()));
    build
        .args([
            "build",
            "--release",
            "--locked",
            "--quiet",
            "--package",
            // Which holds the command at that commit.
            "host-sim",
        ])
        .arg("--target-dir")
        .arg(&built)
        .current_dir(&folder)
        .stdin(std::process::Stdio::null());
    run(&format!("engine of commit {RIVAL}, in release"), build)?;
    Ok(path)
}
