//! `cargo xtask trial`: the sealed trial of the diagnosis, from building the tool to the pages.

use anyhow::Result;

use crate::step::{cargo, command, root, run};

/// Builds tool and trial in release, then plays the trial with the given further arguments.
pub fn play(arguments: &[String]) -> Result<()> {
    run(
        "tool and trial, in release",
        cargo(&[
            "build",
            "--release",
            "--locked",
            "--quiet",
            "--package",
            "host-sim",
            "--package",
            "sealed-trial",
        ]),
    )?;
    let target = std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| root().join("target"), |folder| root().join(folder));
    let program = |name: &str| {
        target
            .join("release")
            .join(format!("{name}{}", std::env::consts::EXE_SUFFIX))
            .display()
            .to_string()
    };
    let mut trial = command(
        &program("sealed-trial"),
        &["run", "--muslip", &program("muslip")],
    );
    trial.args(arguments);
    run("sealed trial", trial)
}

/// The small trial: a few campaigns of a development seed, with loose bars that must hold.
pub fn small() -> Result<()> {
    play(&["--small".into(), "--seed".into(), "41".into()])
}
