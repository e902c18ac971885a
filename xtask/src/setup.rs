//! What the tests need beyond a Rust toolchain: rustup targets and system packages.

use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::step::{command, run};

/// Targets that the core is built for.
pub const TARGETS: [&str; 3] = [
    "thumbv7em-none-eabihf",
    "thumbv6m-none-eabi",
    "wasm32-unknown-unknown",
];

/// A program from a system package.
struct Tool {
    /// Name on the search path.
    program: &'static str,
    /// Debian's package that has it.
    package: &'static str,
    /// What cannot run without it.
    needed_for: &'static str,
}

/// Programs that the tests call.
const TOOLS: &[Tool] = &[Tool {
    program: "qemu-system-arm",
    package: "qemu-system-arm",
    needed_for: "the firmware's runs",
}];

/// Programs that the cycles table calls.
const CYCLES_TOOLS: &[Tool] = &[
    Tool {
        program: "qemu-system-arm",
        package: "qemu-system-arm",
        needed_for: "running the candidates",
    },
    Tool {
        program: "arm-none-eabi-objdump",
        package: "binutils-arm-none-eabi",
        needed_for: "reading what was executed",
    },
];

/// As [`run_all`], for `cargo xtask cycles`.
pub fn for_cycles() -> Result<()> {
    targets()?;
    tools(CYCLES_TOOLS)
}

/// Installs what is missing, or says exactly what to install.
pub fn run_all() -> Result<()> {
    targets()?;
    tools(TOOLS)
}

fn targets() -> Result<()> {
    let Ok(listed) = command("rustup", &["target", "list", "--installed"]).output() else {
        // A toolchain without rustup: its targets are somebody else's work, and the builds will tell.
        return Ok(());
    };
    let installed = String::from_utf8_lossy(&listed.stdout).into_owned();
    let missing: Vec<&str> = TARGETS
        .into_iter()
        .filter(|target| !installed.lines().any(|line| line.trim() == *target))
        .collect();
    if missing.is_empty() {
        return Ok(());
    }
    let mut install = command("rustup", &["target", "add"]);
    install.args(&missing);
    run(&format!("install {}", missing.join(", ")), install)
}

fn tools(wanted: &[Tool]) -> Result<()> {
    let missing: Vec<&Tool> = wanted
        .iter()
        .filter(|tool| !present(tool.program))
        .collect();
    if missing.is_empty() {
        return Ok(());
    }
    let packages: Vec<&str> = missing.iter().map(|tool| tool.package).collect();
    let packages = packages.join(" ");
    if !(present("apt-get") && is_root()) {
        let reasons: Vec<String> = missing
            .iter()
            .map(|tool| format!("{} for {}", tool.program, tool.needed_for))
            .collect();
        bail!(
            "missing {}; install with: sudo apt-get install {packages}",
            reasons.join(", ")
        );
    }
    run(
        "update package lists",
        command("apt-get", &["update", "-q"]),
    )?;
    let mut install = command(
        "apt-get",
        &["install", "-q", "-y", "--no-install-recommends"],
    );
    install
        .args(packages.split(' '))
        .env("DEBIAN_FRONTEND", "noninteractive");
    run(&format!("install {packages}"), install)
        .with_context(|| format!("install by hand: {packages}"))
}

fn present(program: &str) -> bool {
    std::env::var_os("PATH").is_some_and(|path| {
        std::env::split_paths(&path).any(|folder| folder.join(program).is_file())
    })
}

fn is_root() -> bool {
    Command::new("id")
        .arg("-u")
        .output()
        .is_ok_and(|id| id.stdout.trim_ascii() == b"0")
}

#[cfg(test)]
mod tests {
    use super::{Tool, present, tools};

    #[test]
    fn programs_are_found_on_the_search_path_only() {
        assert!(present("cargo"));
        assert!(!present("no-such-program"));
    }

    #[test]
    fn nothing_is_installed_where_nothing_is_missing() {
        let cargo = Tool {
            program: "cargo",
            package: "no-such-package",
            needed_for: "this test",
        };
        assert!(tools(&[cargo]).is_ok());
    }
}
