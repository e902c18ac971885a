//! The firmware: its image, its budgets, its runs in QEMU, its way onto a chip.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, bail, ensure};
use object::{Object, ObjectSection, ObjectSymbol, SectionKind};

use crate::figures::{figures, replaced_between};
use crate::setup;
use crate::step::{cargo, command, root, run, step};

/// Target of the image.
const TARGET: &str = "thumbv7em-none-eabihf";
/// Profile of the image.
const PROFILE: &str = "firmware";
/// Core cycles from one sample to the next.
const CYCLES_PER_SAMPLE: u64 = 168_000;
/// Simulated seconds of the endurance run in `cargo xtask test`; ten minutes is `cargo xtask pil --seconds 600`.
const SECONDS_IN_TEST: &str = "5";
/// Where the README's table is.
const TABLE: [&str; 2] = [
    "<!-- firmware figures -->",
    "<!-- end of firmware figures -->",
];

/// Parts of symbols' names that must not be in the image, and what they would mean.
const FORBIDDEN: [(&str, &[&str]); 3] = [
    (
        "a panic",
        &[
            "4core9panicking",
            "rust_begin_unwind",
            "slice_index_fail",
            "unwrap_failed",
            "expect_failed",
        ],
    ),
    (
        "software double precision",
        &[
            "__aeabi_d",
            "__aeabi_f2d",
            "__aeabi_i2d",
            "__aeabi_ui2d",
            "__aeabi_l2d",
            "__adddf3",
            "__subdf3",
            "__muldf3",
            "__divdf3",
            "__extendsfdf2",
            "__truncdfsf2",
            "__floatsidf",
            "__fixdfsi",
        ],
    ),
    (
        "a heap",
        &[
            "__rust_alloc",
            "__rust_realloc",
            "__rg_alloc",
            "5alloc5alloc",
        ],
    ),
];

/// What an image takes, from its ELF file.
struct Image {
    flash_bytes: u64,
    ram_bytes: u64,
    stack_bytes: u64,
    forbidden: Vec<String>,
}

fn target_folder() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| root().join("target"), |folder| root().join(folder))
}

fn image_path(name: &str) -> PathBuf {
    target_folder().join(TARGET).join(PROFILE).join(name)
}

/// Builds the image, and the one that panics.
pub fn build() -> Result<()> {
    let arguments = ["build", "--locked", "--quiet", "--package", "firmware"];
    let target = ["--profile", PROFILE, "--target", TARGET];
    let image = [&arguments[..], &target, &["--bin", "muslip-firmware"]].concat();
    run("firmware", cargo(&image))?;
    let test = ["--features", "test-image", "--bin", "panic-image"];
    run(
        "firmware that panics on purpose",
        cargo(&[&arguments[..], &target, &test].concat()),
    )
}

impl Image {
    fn read(name: &str) -> Result<Self> {
        let path = image_path(name);
        let bytes = fs::read(&path).with_context(|| path.display().to_string())?;
        let elf = object::File::parse(&*bytes)?;
        let mut image = Self {
            flash_bytes: 0,
            ram_bytes: 0,
            stack_bytes: 0,
            forbidden: Vec::new(),
        };
        for section in elf.sections() {
            let in_ram = section.address() >= 0x2000_0000;
            match section.kind() {
                SectionKind::Text | SectionKind::ReadOnlyData | SectionKind::ReadOnlyString => {
                    image.flash_bytes += section.size();
                }
                SectionKind::Data if in_ram => {
                    image.flash_bytes += section.size();
                    image.ram_bytes += section.size();
                }
                // The vector table is data that stays in flash.
                SectionKind::Data => image.flash_bytes += section.size(),
                SectionKind::UninitializedData => image.ram_bytes += section.size(),
                _ => {}
            }
        }
        let mut stack = [0; 2];
        for symbol in elf.symbols() {
            let name = symbol.name()?;
            match name {
                "_stack_end" => stack[0] = symbol.address(),
                "_stack_start" => stack[1] = symbol.address(),
                _ => {}
            }
            for (meaning, parts) in FORBIDDEN {
                if parts.iter().any(|part| name.contains(part)) {
                    image.forbidden.push(format!("{meaning}: {name}"));
                }
            }
        }
        image.stack_bytes = stack[1] - stack[0];
        Ok(image)
    }
}

fn budget(budgets: &BTreeMap<String, u64>, name: &str) -> Result<u64> {
    budgets
        .get(name)
        .copied()
        .with_context(|| format!(".ci/budgets.toml has no {name}"))
}

/// Checks what the ELF file alone tells: sizes, panics, double precision, heap.
pub fn budgets() -> Result<()> {
    build()?;
    step("budgets of the image", check_image)
}

fn check_image() -> Result<()> {
    let budgets = figures(&fs::read_to_string(root().join(".ci/budgets.toml"))?)?;
    let image = Image::read("muslip-firmware")?;
    for (what, took, most) in [
        ("flash", image.flash_bytes, budget(&budgets, "flash_bytes")?),
        (
            "static RAM",
            image.ram_bytes,
            budget(&budgets, "ram_bytes")?,
        ),
    ] {
        println!("{what}: {took} of {most} bytes");
        ensure!(took <= most, "{what}: {took} bytes, the budget is {most}");
    }
    if !image.forbidden.is_empty() {
        bail!("in the image there is {}", image.forbidden.join("; "));
    }
    println!("no panic, no software double precision, no heap in the image");
    // A check that never fails proves nothing: the image made to panic must not pass it.
    let panics = Image::read("panic-image")?;
    ensure!(
        panics
            .forbidden
            .iter()
            .any(|found| found.starts_with("a panic")),
        "the check does not see the panic of the image that panics"
    );
    Ok(())
}

/// Builds, checks and runs the image in QEMU; `write` puts the figures into the README.
pub fn pil(arguments: &[String], write: bool) -> Result<()> {
    setup::run_all()?;
    budgets()?;
    let path = target_folder().join("pil.figures");
    let mut pil = cargo(&[
        "run",
        "--release",
        "--locked",
        "--quiet",
        "--package",
        "pil",
        "--",
    ]);
    pil.args([image_path("muslip-firmware"), image_path("panic-image")])
        .arg("--figures")
        .arg(&path)
        .args(arguments)
        .env("RUST_BACKTRACE", "0");
    run("processor in the loop", pil)?;
    step("budgets of the runs", || {
        let table = check_runs(&figures(&fs::read_to_string(&path)?)?)?;
        print!("{table}");
        if write { write_table(&table) } else { Ok(()) }
    })
}

/// Builds, checks, and serves the image behind a socket until it is ended.
pub fn serve(address: &str) -> Result<()> {
    setup::run_all()?;
    budgets()?;
    let mut pil = cargo(&[
        "run",
        "--release",
        "--locked",
        "--quiet",
        "--package",
        "pil",
        "--",
    ]);
    pil.args([image_path("muslip-firmware"), image_path("panic-image")])
        .args(["--serve", address]);
    run("simulated rig", pil)
}

/// What `cargo xtask test` runs of it.
pub fn test() -> Result<()> {
    pil(&["--seconds".to_owned(), SECONDS_IN_TEST.to_owned()], false)
}

fn check_runs(measured: &BTreeMap<String, u64>) -> Result<String> {
    let budgets = figures(&fs::read_to_string(root().join(".ci/budgets.toml"))?)?;
    let image = Image::read("muslip-firmware")?;
    let took = |name: &str| {
        measured
            .get(name)
            .copied()
            .with_context(|| format!("the runs measured no {name}"))
    };
    let work = CYCLES_PER_SAMPLE * budget(&budgets, "work_percent")? / 100;
    let stack = image.stack_bytes * budget(&budgets, "stack_percent")? / 100;
    let rows = [
        (
            "flash, bytes",
            image.flash_bytes,
            budget(&budgets, "flash_bytes")?,
        ),
        (
            "static RAM, bytes",
            image.ram_bytes,
            budget(&budgets, "ram_bytes")?,
        ),
        ("deepest stack, bytes", took("stack")?, stack),
        (
            "sampling interrupt, worst, instructions",
            took("interrupt")?,
            work,
        ),
        (
            "control step (interlocks, states, filters), worst, instructions",
            took("control")?,
            work,
        ),
        (
            "a sample's whole work with the link, worst, instructions",
            took("step")?,
            work,
        ),
    ];
    let mut table = String::from("| figure | measured | budget |\n| --- | --- | --- |\n");
    for (name, value, most) in rows {
        table += &format!("| {name} | {value} | {most} |\n");
    }
    match rows.iter().find(|(_, value, most)| value > most) {
        Some((name, value, most)) => bail!("{name}: {value}, the budget is {most}"),
        None => Ok(table),
    }
}

fn write_table(table: &str) -> Result<()> {
    let path = root().join("README.md");
    let text = fs::read_to_string(&path)?;
    fs::write(path, replaced_between(&text, TABLE, table)?)?;
    Ok(())
}

/// Puts the image onto a chip by probe-rs.
pub fn flash() -> Result<()> {
    budgets()?;
    if command("probe-rs", &["--version"]).output().is_err() {
        bail!(
            "missing probe-rs; install with: cargo install --locked probe-rs-tools --version 0.32.0"
        );
    }
    let image = image_path("muslip-firmware").display().to_string();
    run(
        "flash",
        command(
            "probe-rs",
            &[
                "download",
                "--chip",
                "STM32F405RGTx",
                "--verify",
                image.as_str(),
            ],
        ),
    )?;
    run(
        "reset",
        command("probe-rs", &["reset", "--chip", "STM32F405RGTx"]),
    )
}
