//! `cargo xtask what-if`: the core as WebAssembly that the pages carry, compiled or held against its sources.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::setup;
use crate::step::{cargo, root, run, target};

/// The committed module.
const MODULE: &str = "crates/muslip-report/what-if/muslip_wasm.wasm";
const TARGET: &str = "wasm32-unknown-unknown";
/// The profile of the workspace that makes it small.
const PROFILE: &str = "wasm";
/// What the caller's surroundings could change in the module.
const NOT_PASSED_ON: [&str; 5] = [
    "RUSTFLAGS",
    "RUSTC_WRAPPER",
    "RUSTC_WORKSPACE_WRAPPER",
    "CARGO_BUILD_TARGET",
    "CARGO_INCREMENTAL",
];

/// Compiles the module into its place.
pub fn write() -> Result<()> {
    let module = compiled()?;
    fs::write(root().join(MODULE), &module)?;
    println!("{MODULE}: {} bytes", module.len());
    Ok(())
}

/// Compiles the module below the target folder and holds the committed one against it.
pub fn check() -> Result<()> {
    let committed = fs::read(root().join(MODULE)).with_context(|| MODULE)?;
    same(&committed, &compiled()?)
}

fn same(committed: &[u8], compiled: &[u8]) -> Result<()> {
    ensure!(
        committed == compiled,
        "{MODULE} is not what its sources compile to with the toolchain of rust-toolchain.toml: \
         run `cargo xtask what-if` and commit it"
    );
    Ok(())
}

fn compiled() -> Result<Vec<u8>> {
    setup::for_what_if()?;
    let folder = target().join("what-if");
    let mut build = cargo(&["build", "--quiet", "--locked", "--lib"]);
    build
        .args(["--package", "muslip-wasm", "--target", TARGET])
        .args(["--profile", PROFILE, "--target-dir"])
        .arg(&folder);
    for name in NOT_PASSED_ON {
        build.env_remove(name);
    }
    // In place of all other flags, those of a configuration file included.
    build.env("CARGO_ENCODED_RUSTFLAGS", remappings()?.join("\u{1f}"));
    run("the core as WebAssembly", build)?;
    let module = folder.join(TARGET).join(PROFILE).join("muslip_wasm.wasm");
    fs::read(&module).with_context(|| module.display().to_string())
}

/// Flags that keep the places of checkout and dependencies out of the module.
fn remappings() -> Result<[String; 2]> {
    Ok([
        remapping(&root().canonicalize()?, "/muslip"),
        remapping(&cargo_home()?, "/cargo"),
    ])
}

fn remapping(from: &Path, to: &str) -> String {
    format!("--remap-path-prefix={}={to}", from.display())
}

fn cargo_home() -> Result<PathBuf> {
    std::env::var_os("CARGO_HOME")
        .map(PathBuf::from)
        .or_else(|| Some(std::env::home_dir()?.join(".cargo")))
        .context("neither CARGO_HOME nor a home folder")
}

#[cfg(test)]
mod tests {
    use super::same;

    #[test]
    fn a_module_that_differs_is_told_with_what_to_run() {
        assert!(same(b"\0asm", b"\0asm").is_ok());
        let told = same(b"\0asm", b"\0asm\x01").unwrap_err().to_string();
        assert!(
            told.contains("run `cargo xtask what-if` and commit"),
            "{told}"
        );
    }
}
