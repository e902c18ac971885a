//! `cargo xtask python --wheels`: the wheels that a release has, for machines other than this.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::python::{
    beside, environment, folder, install, path_with, python_of_package, tested, the_wheel,
};
use crate::setup;
use crate::step::{command, root, run, target};

/// Rust's name of a target, and Python's of its machine.
const LINUX: [(&str, &str); 2] = [
    ("x86_64-unknown-linux-gnu", "x86_64"),
    ("aarch64-unknown-linux-gnu", "aarch64"),
];

/// Of the package's tests, what a wheel of a release has not: no panic can be put into it.
const NOT_OF_A_RELEASE: &str = "not panic";

/// Nor what an emulated Python cannot do, or is too slow for: start itself again, be interrupted in time, be as fast. A
/// diagnosis by the command is this machine's, and rounds its last digit otherwise.
const NOT_EMULATED: &str = "not panic and not tutorial and not interrupt and not twentieth and not readme and not diagnosis_writes";

/// What those tests import.
const IMPORTED: [&str; 5] = ["numpy", "pandas", "polars", "pyarrow", "pytest"];

/// Builds the wheels with zig, looks at them from outside, and runs the package's tests by those that a Python can be had for.
pub fn build() -> Result<()> {
    let tools = environment("wheels", "requirements-wheels.txt")?;
    let (muslip, _) = beside()?;
    for (rust, machine) in LINUX {
        let wheel = built(&tools, rust)?;
        let mut looked_at = command(&tools, &[]);
        looked_at
            .arg(folder().join("tests/wheels.py"))
            .arg(&wheel)
            .args(["--machine", machine]);
        run(&format!("the wheel for {machine}, from outside"), looked_at)?;
        let mut audited = command(&tools, &["-m", "auditwheel", "show"]);
        audited.arg(&wheel);
        run(&format!("auditwheel of {machine}"), audited)?;
        if machine == std::env::consts::ARCH {
            let python = python_of_package()?;
            install(&python, &wheel)?;
            tested(&python, &muslip, &["-k", NOT_OF_A_RELEASE])?;
        } else {
            emulated(&tools, &wheel, machine, &muslip)?;
        }
    }
    Ok(())
}

/// The wheel for a target, built by maturin with zig's compiler and linker.
fn built(tools: &str, rust: &str) -> Result<PathBuf> {
    setup::rust_target(rust)?;
    let wheels = target().join("wheels").join(rust);
    if wheels.exists() {
        fs::remove_dir_all(&wheels)?;
    }
    let mut build = command(
        tools,
        &["-m", "maturin", "build", "--locked", "--quiet", "--zig"],
    );
    build
        .args(["--profile", "release", "--target", rust])
        .args(["--compatibility", "manylinux2014"])
        .arg("--manifest-path")
        .arg(folder().join("Cargo.toml"))
        .arg("--out")
        .arg(&wheels)
        // Where maturin finds zig.
        .env("PATH", path_with(tools)?);
    run(&format!("the wheel for {rust}"), build)?;
    the_wheel(&wheels)
}

/// Runs the package's tests in an emulator, by Debian's Python for that machine: against the command of this one.
fn emulated(tools: &str, wheel: &Path, machine: &str, muslip: &str) -> Result<()> {
    setup::for_emulation()?;
    let files = foreign_python(machine)?;
    let python = fs::read_dir(files.join("usr/bin"))?
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .find(|name| name.starts_with("python3."))
        .context("no interpreter among the packages")?;
    let packages = target().join("tools").join(format!("packages-{machine}"));
    if packages.exists() {
        fs::remove_dir_all(&packages)?;
    }
    let requirements = fs::read_to_string(folder().join("requirements.txt"))?;
    let mut install = command(
        tools,
        &[
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "--only-binary=:all:",
            "--implementation=cp",
        ],
    );
    install
        .args(["--python-version", python.trim_start_matches("python")])
        .args(["--platform", &format!("manylinux2014_{machine}")])
        .args(["--platform", &format!("manylinux_2_28_{machine}")])
        .args(["--platform", &format!("manylinux_2_27_{machine}")])
        .arg("--target")
        .arg(&packages)
        .args(requirements.lines().filter(|line| {
            line.split_once("==")
                .is_some_and(|(name, _)| IMPORTED.contains(&name))
        }))
        .arg(wheel);
    run(&format!("packages for {machine}"), install)?;
    let mut tests = command(&format!("qemu-{machine}"), &["-L"]);
    tests
        .arg(&files)
        .arg(files.join("usr/bin").join(&python))
        .args(["-m", "pytest", "-p", "no:cacheprovider", "--quiet"])
        .args(["--import-mode=importlib", "-k", NOT_EMULATED])
        .arg(folder().join("tests/test_package.py"))
        .current_dir(target())
        .env("PYTHONPATH", &packages)
        .env("MUSLIP_COMMAND", muslip);
    run(&format!("tests of the wheel, emulated on {machine}"), tests)
}

/// Debian's Python for another machine with all that it needs, unpacked below the target folder. Nothing is installed.
fn foreign_python(machine: &str) -> Result<PathBuf> {
    let architecture = match machine {
        "x86_64" => "amd64",
        "aarch64" => "arm64",
        other => bail!("Debian's name for {other} is not known here"),
    };
    let folder = target().join("tools").join(format!("python-{machine}"));
    let files = folder.join("files");
    if files.join("usr/bin").exists() {
        return Ok(files);
    }
    for made in ["state/lists/partial", "cache/archives/partial"] {
        fs::create_dir_all(folder.join(made))?;
    }
    fs::write(folder.join("state/status"), "")?;
    let of = |name: &str, path: &Path| format!("{name}={}", path.display());
    let options = [
        format!("APT::Architecture={architecture}"),
        format!("APT::Architectures::={architecture}"),
        of("Dir::State", &folder.join("state")),
        of("Dir::State::status", &folder.join("state/status")),
        of("Dir::Cache", &folder.join("cache")),
        "APT::Install-Recommends=false".to_owned(),
        "Debug::NoLocking=1".to_owned(),
        "APT::Sandbox::User=root".to_owned(),
    ];
    let apt = |arguments: &[&str]| {
        let mut apt = command("apt-get", &["-q"]);
        for option in &options {
            apt.args(["-o", option]);
        }
        apt.args(arguments);
        apt
    };
    run(
        &format!("package lists for {architecture}"),
        apt(&["update"]),
    )?;
    run(
        &format!("Python for {architecture}"),
        apt(&[
            "install",
            "-y",
            "--download-only",
            "python3-minimal",
            "libpython3-stdlib",
            "libstdc++6",
        ]),
    )?;
    let unpacked = folder.join("unpacked");
    fs::create_dir_all(&unpacked)?;
    for entry in fs::read_dir(folder.join("cache/archives"))? {
        let package = entry?.path();
        if package.extension().is_some_and(|kind| kind == "deb") {
            let mut unpack = command("dpkg-deb", &["--extract"]);
            unpack.arg(&package).arg(&unpacked);
            run(&format!("unpack {}", package.display()), unpack)?;
        }
    }
    // Whole or absent.
    fs::rename(&unpacked, &files)?;
    Ok(files)
}

/// `cargo xtask python --checkout`: what a user does who has rustup, Python and a checkout, and nothing else.
pub fn from_a_checkout() -> Result<()> {
    let checkout = target().join("checkout");
    if checkout.exists() {
        fs::remove_dir_all(&checkout)?;
    }
    let mut clone = command("git", &["clone", "--quiet", "--local", "--no-hardlinks"]);
    clone.arg(root()).arg(&checkout);
    run("a checkout of what is committed", clone)?;
    let bare = checkout.join("environment");
    let mut make = command("python3", &["-m", "venv"]);
    make.arg(&bare);
    run("a bare environment", make)?;
    let python = bare.join("bin/python");
    let python = python.to_string_lossy();
    let mut install = command(
        &python,
        &["-m", "pip", "install", "--disable-pip-version-check"],
    );
    install
        .arg("./python")
        .current_dir(&checkout)
        // What is built of others' crates is the same as for this checkout.
        .env("CARGO_TARGET_DIR", target());
    run("pip install ./python", install)?;
    let mut used = command(&python, &["-c", USED]);
    used.current_dir(&bare);
    run("the package from a checkout", used)
}

/// The README's lines on a recording that is simulated for it, with nothing but NumPy there.
const USED: &str = r#"
import importlib.util, muslip
rig = muslip.Rig(radius_m=0.31, inertia_kg_m2=1.25, mass_kg=420.0, peak_friction=0.85, critical_slip=0.14)
rig.to_toml("rig.toml")
assert importlib.util.find_spec("pandas") is None
estimate = muslip.estimate(muslip.simulate(rig, seed=1), "rig.toml")
assert abs(estimate.peak_friction.value - 0.85) < 4 * estimate.peak_friction.std, estimate
print(muslip.__version__, muslip.__file__, estimate.peak_friction.value, "+-", estimate.peak_friction.std)
"#;
