//! Compiles the core to WebAssembly for the pages: `OUT_DIR/muslip_wasm.base64`.
//!
//! Cargo is called for another target, into a folder of its own: the one that calls this holds the lock of
//! the usual folder. A toolchain without that target makes an empty file and a warning; the pages then
//! leave the what-if out, and the tests of the pages fail where they must not be left out.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

use base64::Engine as _;

const TARGET: &str = "wasm32-unknown-unknown";
const PROFILE: &str = "wasm";
/// Variables by which the calling cargo would speak to the called one.
const NOT_PASSED_ON: [&str; 6] = [
    "RUSTFLAGS",
    "CARGO_ENCODED_RUSTFLAGS",
    "RUSTC_WRAPPER",
    "RUSTC_WORKSPACE_WRAPPER",
    "CARGO_BUILD_TARGET",
    "CARGO_TARGET_DIR",
];

fn main() -> Result<(), Box<dyn Error>> {
    let variable =
        |name: &str| env::var_os(name).ok_or_else(|| format!("cargo did not set {name}"));
    let here = PathBuf::from(variable("CARGO_MANIFEST_DIR")?);
    let out = PathBuf::from(variable("OUT_DIR")?);
    let root = here.ancestors().nth(2);
    let root = root.ok_or("the crate lies in the repository")?;
    for watched in ["crates/muslip", "crates/muslip-wasm", "Cargo.toml"] {
        println!("cargo:rerun-if-changed={}", root.join(watched).display());
    }
    let module = if has_target(&variable("RUSTC")?)? {
        compiled(root, &out, &variable("CARGO")?)?
    } else {
        println!(
            "cargo:warning=the target {TARGET} is not installed (rustup target add {TARGET}): reports will lack \
             the live what-if"
        );
        Vec::new()
    };
    let text = base64::engine::general_purpose::STANDARD.encode(module);
    fs::write(out.join("muslip_wasm.base64"), text)?;
    Ok(())
}

fn has_target(rustc: &std::ffi::OsStr) -> Result<bool, Box<dyn Error>> {
    let printed = Command::new(rustc)
        .args(["--print", "target-libdir", "--target", TARGET])
        .output()?;
    let folder = String::from_utf8(printed.stdout)?;
    Ok(printed.status.success() && Path::new(folder.trim()).is_dir())
}

fn compiled(root: &Path, out: &Path, cargo: &std::ffi::OsStr) -> Result<Vec<u8>, Box<dyn Error>> {
    // <target folder>/<profile>/build/muslip-report-<hash>/out: one module for all profiles.
    let folder = out.ancestors().nth(4).unwrap_or(out).join("wasm-embedded");
    let mut command = Command::new(cargo);
    command
        .current_dir(root)
        .args(["build", "--quiet", "--locked", "--lib"])
        .args(["--package", "muslip-wasm", "--target", TARGET])
        .args(["--profile", PROFILE, "--target-dir"])
        .arg(&folder);
    for name in NOT_PASSED_ON {
        command.env_remove(name);
    }
    if !command.status()?.success() {
        return Err(format!("the core could not be compiled for {TARGET}").into());
    }
    Ok(fs::read(
        folder.join(TARGET).join(PROFILE).join("muslip_wasm.wasm"),
    )?)
}
