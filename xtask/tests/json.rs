//! What prints JSON prints nothing else on standard output, whatever it has to install first.
#![cfg(unix)]
#![expect(clippy::unwrap_used, reason = "a test ends by panicking")]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

const JSON: &str = "[{\"name\": \"article\"}]\n";

/// Programs of a machine that lacks everything; each prints on both streams.
fn programs() -> [(&'static str, String); 4] {
    let installs = ["qemu-system-arm", "arm-none-eabi-objdump"]
        .map(|tool| format!(": > \"${{0%/*}}/{tool}\"\n"))
        .concat();
    [
        (
            "rustup",
            "[ \"$2\" = list ] || echo installing; echo info >&2".to_owned(),
        ),
        ("id", "echo 0".to_owned()),
        (
            "apt-get",
            format!("echo Reading package lists; echo W: >&2\n{installs}"),
        ),
        ("cargo", format!("printf '%s' '{JSON}'; echo Compiling >&2")),
    ]
}

fn put(folder: &Path, name: &str, script: &str) {
    let path = folder.join(name);
    fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
}

#[test]
fn json_stands_alone_on_standard_output_of_a_machine_that_lacks_everything() {
    let folder = tempfile::tempdir().unwrap();
    for (name, script) in programs() {
        put(folder.path(), name, &script);
    }
    let told = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args(["cycles", "--json"])
        .env("PATH", folder.path())
        .env("CARGO", folder.path().join("cargo"))
        .output()
        .unwrap();
    let error = String::from_utf8(told.stderr).unwrap();
    assert!(told.status.success(), "{error}");
    assert_eq!(String::from_utf8(told.stdout).unwrap(), JSON);
    for word in [
        "==> install thumbv7em-none-eabihf",
        "installing",
        "==> update package lists",
        "Reading package lists",
        "Compiling",
    ] {
        assert!(error.contains(word), "no '{word}' in: {error}");
    }
}
