//! `cargo xtask release --dry-run`: whether the crates that are released could be. Uploads nothing.
//!
//! Released is what its `Cargo.toml` does not keep from it by `publish`.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use crate::setup;
use crate::step::{cargo, command, output, root, run, step};

/// What a registry shows of a crate, by its key in `cargo metadata`.
const SHOWN: [&str; 7] = [
    "description",
    "readme",
    "license",
    "repository",
    "keywords",
    "categories",
    "rust_version",
];

/// Checks what the crates say of themselves, what they depend on, and that each builds out of its package.
pub fn dry_run() -> Result<()> {
    step("what the crates say of themselves", described)?;
    dependencies()?;
    // In the order of their dependencies, each built against the packages of those before it.
    run(
        "packages",
        cargo(&["publish", "--dry-run", "--workspace", "--locked"]),
    )
}

/// Licences, versions and sources of all dependencies by `deny.toml`; advisories where their database can be had.
fn dependencies() -> Result<()> {
    let program = setup::cargo_deny()?.display().to_string();
    let deny = |arguments: &[&str]| command(&program, &[&["--locked"], arguments].concat());
    run(
        "licences, versions and sources of dependencies",
        deny(&["check", "bans", "licenses", "sources"]),
    )?;
    if run("database of advisories", deny(&["fetch", "db"])).is_err() {
        println!("advisories: not checked, their database cannot be reached");
        return Ok(());
    }
    run(
        "advisories",
        deny(&["check", "--disable-fetch", "advisories"]),
    )
}

/// An error that names every crate which lacks something.
fn described() -> Result<()> {
    let metadata = output(cargo(&[
        "metadata",
        "--format-version",
        "1",
        "--no-deps",
        "--locked",
    ]))?;
    let metadata: Value = serde_json::from_str(&metadata)?;
    let packages = metadata["packages"].as_array().context("no packages")?;
    let toolchain = toolchain()?;
    let lacking: Vec<String> = packages
        .iter()
        .filter(|package| released(package))
        .flat_map(|package| lacking(package, &toolchain))
        .collect();
    ensure!(lacking.is_empty(), "{}", lacking.join("\n"));
    Ok(())
}

fn released(package: &Value) -> bool {
    // Null: to any registry; an empty list: to none.
    package["publish"]
        .as_array()
        .is_none_or(|to| !to.is_empty())
}

/// What a package lacks, a line each.
fn lacking(package: &Value, toolchain: &str) -> Vec<String> {
    let name = package["name"].as_str().unwrap_or_default();
    let mut lines: Vec<String> = SHOWN
        .into_iter()
        .filter(|key| package[key].is_null() || package[key].as_array().is_some_and(Vec::is_empty))
        .map(|key| format!("{name}: no {key}"))
        .collect();
    if let Some(version) = package["rust_version"].as_str()
        && !is_release_of(toolchain, version)
    {
        lines.push(format!(
            "{name}: rust-version {version} is not the toolchain {toolchain} that it is tested with"
        ));
    }
    let folder = Path::new(package["manifest_path"].as_str().unwrap_or_default()).parent();
    let licences = ["LICENSE-APACHE", "LICENSE-MIT"]
        .into_iter()
        .filter(|text| folder.is_some_and(|folder| !folder.join(text).exists()));
    lines.extend(licences.map(|text| format!("{name}: no {text}")));
    // Paths of dev-dependencies are left out of a package.
    let unversioned = package["dependencies"]
        .as_array()
        .into_iter()
        .flatten()
        .filter(|needed| needed["kind"] != "dev" && needed["req"] == "*");
    lines.extend(unversioned.map(|needed| {
        format!(
            "{name}: dependency {} has no version",
            needed["name"].as_str().unwrap_or_default()
        )
    }));
    lines
}

/// Whether a toolchain such as 1.95.0 is a release of a Rust version such as 1.95.
fn is_release_of(toolchain: &str, version: &str) -> bool {
    toolchain
        .strip_prefix(version)
        .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

/// The pinned toolchain.
fn toolchain() -> Result<String> {
    const FILE: &str = "rust-toolchain.toml";
    let text = fs::read_to_string(root().join(FILE))?;
    let channel = text
        .lines()
        .find_map(|line| line.strip_prefix("channel = \"")?.strip_suffix('"'));
    match channel {
        Some(channel) => Ok(channel.to_owned()),
        None => bail!("{FILE} names no channel"),
    }
}

#[cfg(test)]
mod tests {
    use super::{described, is_release_of, lacking, released};
    use serde_json::json;

    #[test]
    fn the_released_crates_lack_nothing() {
        described().unwrap();
    }

    #[test]
    fn what_a_crate_lacks_is_told_line_by_line() {
        let package = json!({
            "name": "a",
            "publish": null,
            "description": "It does.",
            "license": "MIT",
            "readme": null,
            "repository": "https://example.invalid/a",
            "keywords": [],
            "categories": ["science"],
            "rust_version": "1.9",
            "manifest_path": "no such folder/Cargo.toml",
            "dependencies": [
                {"name": "b", "kind": null, "req": "*"},
                {"name": "c", "kind": "dev", "req": "*"},
                {"name": "d", "kind": null, "req": "^1"},
            ],
        });
        assert!(released(&package) && !released(&json!({"publish": []})));
        assert_eq!(
            lacking(&package, "1.95.0"),
            [
                "a: no readme",
                "a: no keywords",
                "a: rust-version 1.9 is not the toolchain 1.95.0 that it is tested with",
                "a: no LICENSE-APACHE",
                "a: no LICENSE-MIT",
                "a: dependency b has no version",
            ]
        );
        assert!(is_release_of("1.95.0", "1.95") && is_release_of("1.95.0", "1.95.0"));
    }
}
