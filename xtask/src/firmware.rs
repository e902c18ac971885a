//! The firmware: its image, its budgets, its runs in QEMU, its way onto a chip.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};

use crate::figures::{figures, replaced_between};
use crate::image::{Forbidden, Image};
use crate::step::{CHECKED, cargo, command, program, root, run, step, target};
use crate::{latency, setup};

/// Target of the image.
const TARGET: &str = "thumbv7em-none-eabihf";
/// Profile of the image.
const PROFILE: &str = "firmware";
/// Core cycles from one sample to the next.
const CYCLES_PER_SAMPLE: u64 = 168_000;
/// Simulated seconds of the endurance run and of the one at true pace in `cargo xtask test`; ten minutes is `cargo xtask pil --seconds 600`.
const SECONDS_IN_TEST: &str = "3";
/// The image for the chip that QEMU has.
const IMAGE: &str = "muslip-firmware";
/// Images for other boards, each with the feature of its folder: nothing here runs them.
const OTHER_BOARDS: [(&str, &str); 1] = [("stm32g474", "muslip-firmware-stm32g474")];
/// Images with what must not be in one.
const BAD_IMAGES: [(Forbidden, &str); 3] = [
    (Forbidden::Panic, "panic-image"),
    (Forbidden::Double, "double-image"),
    (Forbidden::Heap, "heap-image"),
];
/// Where the README's table is.
const TABLE: [&str; 2] = [
    "<!-- firmware figures -->",
    "<!-- end of firmware figures -->",
];
/// Where the rig page's table of interrupts is.
const LATENCIES: [&str; 2] = ["<!-- latencies -->", "<!-- end of latencies -->"];

fn image_path(name: &str) -> PathBuf {
    target().join(TARGET).join(PROFILE).join(name)
}

/// Builds the image of every board, and those that the checks must refuse.
pub fn build() -> Result<()> {
    let arguments = ["build", "--locked", "--quiet", "--package", "firmware"];
    let profile = ["--profile", PROFILE, "--target", TARGET];
    let image = [&arguments[..], &profile, &["--bin", IMAGE]].concat();
    run("firmware", cargo(&image))?;
    for (board, name) in OTHER_BOARDS {
        let chosen = ["--no-default-features", "--features", board, "--bin", name];
        let image = [&arguments[..], &profile, &chosen].concat();
        run(&format!("firmware for {board}"), cargo(&image))?;
    }
    let mut bad = [&arguments[..], &profile, &["--features", "test-image"]].concat();
    for (_, name) in BAD_IMAGES {
        bad.extend(["--bin", name]);
    }
    run("images that must be refused", cargo(&bad))
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
    let others = OTHER_BOARDS.iter().map(|(_, name)| *name);
    for name in [IMAGE].into_iter().chain(others) {
        let image = Image::read(&image_path(name))?;
        println!("{name}:");
        check_sizes(&image, &budgets_file()?)?;
        image.is_clean()?;
        println!("no panic, no software double precision, no heap in the image");
    }
    // A check that never fails proves nothing.
    for (what, name) in BAD_IMAGES {
        let bad = Image::read(&image_path(name))?;
        ensure!(
            bad.has(what) && bad.is_clean().is_err(),
            "{name} has {} in it, and the check does not see it",
            what.meaning()
        );
        println!("{name} is refused: there is {} in it", what.meaning());
    }
    Ok(())
}

fn check_sizes(image: &Image, budgets: &BTreeMap<String, u64>) -> Result<()> {
    for (what, took, most) in [
        ("flash", image.flash_bytes, budget(budgets, "flash_bytes")?),
        ("static RAM", image.ram_bytes, budget(budgets, "ram_bytes")?),
    ] {
        println!("{what}: {took} of {most} bytes");
        ensure!(took <= most, "{what}: {took} bytes, the budget is {most}");
    }
    Ok(())
}

fn budgets_file() -> Result<BTreeMap<String, u64>> {
    figures(&fs::read_to_string(root().join(".ci/budgets.toml"))?)
}

/// The processor in the loop, built for it as for users.
fn built_loop() -> Command {
    cargo(&[
        "run",
        "--release",
        "--locked",
        "--quiet",
        "--package",
        "pil",
        "--",
    ])
}

/// The processor in the loop as the tests have built it: its package has a test of its own, for which cargo builds it.
fn loop_under_test() -> Command {
    command(&program(CHECKED, "pil"), &[])
}

/// The two images that the processor in the loop is given.
fn images() -> [PathBuf; 2] {
    [image_path(IMAGE), image_path("panic-image")]
}

/// Builds, checks and runs the image in QEMU; `write` puts the figures into README and rig page.
pub fn pil(arguments: &[String], write: bool) -> Result<()> {
    setup::run_all()?;
    play(built_loop(), arguments, write)
}

fn play(mut pil: Command, arguments: &[String], write: bool) -> Result<()> {
    budgets()?;
    let path = target().join("pil.figures");
    pil.args(images())
        .arg("--figures")
        .arg(&path)
        .args(arguments)
        .env("RUST_BACKTRACE", "0");
    run("processor in the loop", pil)?;
    step("budgets of the runs", || {
        let measured = figures(&fs::read_to_string(&path)?)?;
        let latency = latency::table(&measured)?;
        print!("{latency}");
        let table = check_runs(
            &measured,
            &Image::read(&image_path(IMAGE))?,
            &budgets_file()?,
        )?;
        print!("{table}");
        if write {
            write_table("README.md", TABLE, &table)?;
            write_table("docs/rig.md", LATENCIES, &latency)
        } else {
            Ok(())
        }
    })
}

/// Builds, checks, and serves the image behind a socket until it is ended.
pub fn serve(address: &str) -> Result<()> {
    setup::run_all()?;
    budgets()?;
    let mut pil = built_loop();
    pil.args(images()).args(["--serve", address]);
    run("simulated rig", pil)
}

/// What `cargo xtask test` runs of it.
pub fn test() -> Result<()> {
    let arguments = ["--seconds".to_owned(), SECONDS_IN_TEST.to_owned()];
    play(loop_under_test(), &arguments, false)
}

fn check_runs(
    measured: &BTreeMap<String, u64>,
    image: &Image,
    budgets: &BTreeMap<String, u64>,
) -> Result<String> {
    let took = |name: &str| {
        measured
            .get(name)
            .copied()
            .with_context(|| format!("the runs measured no {name}"))
    };
    let work = CYCLES_PER_SAMPLE * budget(budgets, "work_percent")? / 100;
    let stack = image.stack_bytes * budget(budgets, "stack_percent")? / 100;
    let rows = [
        (
            "flash, bytes",
            image.flash_bytes,
            budget(budgets, "flash_bytes")?,
        ),
        (
            "static RAM, bytes",
            image.ram_bytes,
            budget(budgets, "ram_bytes")?,
        ),
        ("deepest stack, bytes", took("stack")?, stack),
        (
            "sampling interrupt without the sensors' reading, worst, instructions",
            took("interrupt")?,
            budget(budgets, "sampling_instructions")?,
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

fn write_table(file: &str, marks: [&str; 2], table: &str) -> Result<()> {
    let path = root().join(file);
    let text = fs::read_to_string(&path)?;
    fs::write(path, replaced_between(&text, marks, table)?)?;
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
    let image = image_path(IMAGE).display().to_string();
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

#[cfg(test)]
mod tests {
    use super::{Image, check_runs, check_sizes, figures};

    #[test]
    fn each_figure_at_its_budget_passes_and_one_above_fails_by_its_name() {
        let budgets =
            figures("flash_bytes = 100\nram_bytes = 10\nstack_percent = 50\nsampling_instructions = 7\nwork_percent = 20")
                .unwrap();
        // Half of 16 bytes of stack, a fifth of 168,000 cycles.
        let most = [100, 10, 8, 7, 33_600, 33_600];
        let check = |figure: [u64; 6]| {
            let [flash_bytes, ram_bytes, stack, interrupt, control, step] = figure;
            let image = Image {
                flash_bytes,
                ram_bytes,
                stack_bytes: 16,
                forbidden: Vec::new(),
            };
            let measured = format!(
                "stack = {stack}\ninterrupt = {interrupt}\ncontrol = {control}\nstep = {step}"
            );
            check_sizes(&image, &budgets)
                .and_then(|()| check_runs(&figures(&measured)?, &image, &budgets))
        };
        assert!(
            check(most)
                .unwrap()
                .contains("| flash, bytes | 100 | 100 |")
        );
        let names = [
            "flash",
            "static RAM",
            "deepest stack",
            "sampling interrupt",
            "control step",
            "whole work",
        ];
        for (index, name) in names.into_iter().enumerate() {
            let mut above = most;
            above[index] += 1;
            let error = check(above).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
    }

    #[test]
    fn a_figure_that_was_not_measured_is_no_pass() {
        let budgets = figures(
            "flash_bytes = 1\nram_bytes = 1\nstack_percent = 1\nsampling_instructions = 1\nwork_percent = 1",
        );
        let image = Image {
            flash_bytes: 0,
            ram_bytes: 0,
            stack_bytes: 0,
            forbidden: Vec::new(),
        };
        let measured = figures("stack = 0\ninterrupt = 0\ncontrol = 0").unwrap();
        assert!(check_runs(&measured, &image, &budgets.unwrap()).is_err());
    }
}
