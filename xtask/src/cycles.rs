//! `cargo xtask cycles`: what one update costs on a Cortex-M4F.
//!
//! Each candidate is an image of its own (`benches/cycles`), run in QEMU one instruction at a time; the
//! addresses that were executed between `run_full` and `roi_end` are counted, and timed by
//! [`crate::pipeline`].

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::pipeline::{Instruction, cycles, disassembled};
use crate::setup;
use crate::step::{command, root};

/// One image.
struct Candidate {
    name: &'static str,
    opt: &'static str,
}

const CANDIDATES: [Candidate; 7] = [
    Candidate {
        name: "article",
        opt: "3",
    },
    Candidate {
        name: "article",
        opt: "s",
    },
    Candidate {
        name: "article_report",
        opt: "3",
    },
    Candidate {
        name: "efficient",
        opt: "3",
    },
    Candidate {
        name: "efficient",
        opt: "s",
    },
    Candidate {
        name: "slip_friction",
        opt: "3",
    },
    Candidate {
        name: "nalgebra",
        opt: "3",
    },
];

/// What a candidate costs, means over the article's 41 points.
struct Cost {
    instructions: f64,
    most_instructions: usize,
    cycles: f64,
    most_cycles: i64,
    text_bytes: u64,
    stack_bytes: u64,
    /// The final estimate, in millionths.
    answer: String,
}

/// Measures all candidates and prints a table, or JSON and nothing else.
pub fn run_all(json: bool) -> Result<()> {
    setup::for_cycles()?;
    let mut rows = Vec::new();
    for candidate in &CANDIDATES {
        let cost = measured(candidate)
            .with_context(|| format!("{} at opt-level {}", candidate.name, candidate.opt))?;
        rows.push((candidate, cost));
    }
    if json {
        let objects: Vec<String> = rows
            .iter()
            .map(|(candidate, cost)| {
                format!(
                    "{{\"name\": \"{}\", \"target\": \"cortex-m4f\", \"opt\": \"{}\", \"instructions\": {:.3}, \"cycles\": {:.3}, \"most_instructions\": {}, \"most_cycles\": {}, \"text_bytes\": {}, \"stack_bytes\": {}}}",
                    candidate.name, candidate.opt, cost.instructions, cost.cycles,
                    cost.most_instructions, cost.most_cycles, cost.text_bytes, cost.stack_bytes
                )
            })
            .collect();
        println!("[{}]", objects.join(",\n "));
        return Ok(());
    }
    println!(
        "| candidate | opt | instructions, mean and most | modelled cycles, mean and most | text, bytes | stack, bytes | final mup, sp in millionths |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for (candidate, cost) in rows {
        println!(
            "| {} | {} | {:.1}, {} | {:.1}, {} | {} | {} | {} |",
            candidate.name,
            candidate.opt,
            cost.instructions,
            cost.most_instructions,
            cost.cycles,
            cost.most_cycles,
            cost.text_bytes,
            cost.stack_bytes,
            cost.answer
        );
    }
    Ok(())
}

fn measured(candidate: &Candidate) -> Result<Cost> {
    let image = built(candidate)?;
    let log = image.with_extension("trace");
    let answer = traced(&image, &log)?;
    let listing = output(command("arm-none-eabi-objdump", &["-d"]).arg(&image))?;
    let instructions = disassembled(&listing)?;
    let symbols = symbols(&output(command("arm-none-eabi-nm", &["-S"]).arg(&image))?);
    let calls = calls(&fs::read_to_string(&log)?, &symbols)?;
    fs::remove_file(&log)?;
    let mut cost = Cost {
        instructions: 0.0,
        most_instructions: 0,
        cycles: 0.0,
        most_cycles: 0,
        text_bytes: text_bytes(&calls, &symbols),
        stack_bytes: stack_bytes(&listing),
        answer,
    };
    let n = calls.len() as f64;
    for call in &calls {
        let time = cycles(&instructions, call)?;
        cost.instructions += call.len() as f64 / n;
        cost.cycles += time as f64 / n;
        cost.most_instructions = cost.most_instructions.max(call.len());
        cost.most_cycles = cost.most_cycles.max(time);
    }
    let _: &BTreeMap<u32, Instruction> = &instructions;
    Ok(cost)
}

/// Builds one image and puts it aside under its own name.
fn built(candidate: &Candidate) -> Result<PathBuf> {
    let folder = root().join("benches/cycles");
    let target = root().join("target/cycles");
    let mut build = command(
        &std::env::var("CARGO").unwrap_or_else(|_| "cargo".into()),
        &[
            "build",
            "--release",
            "--quiet",
            "--locked",
            "--target",
            "thumbv7em-none-eabihf",
            "--features",
            candidate.name,
        ],
    );
    build
        .current_dir(&folder)
        .env("CARGO_TARGET_DIR", &target)
        .env("CARGO_PROFILE_RELEASE_OPT_LEVEL", candidate.opt)
        // Without the cpu fused multiply-accumulates cost more cycles than they save.
        .env(
            "RUSTFLAGS",
            "-C target-cpu=cortex-m4 -C link-arg=-Tlink.x -C link-arg=--nmagic",
        );
    output(&mut build)?;
    let made = target.join("thumbv7em-none-eabihf/release/cycles-bench");
    let kept = target.join(format!("{}-{}", candidate.name, candidate.opt));
    fs::copy(&made, &kept).with_context(|| format!("cannot copy {}", made.display()))?;
    Ok(kept)
}

/// Runs an image one instruction at a time; gives what it printed.
fn traced(image: &Path, log: &Path) -> Result<String> {
    let mut qemu = command(
        "qemu-system-arm",
        &[
            "-M",
            "mps2-an386",
            "-display",
            "none",
            "-monitor",
            "none",
            "-serial",
            "null",
            "-semihosting-config",
            "enable=on,target=native",
            "-singlestep",
            "-d",
            "exec,nochain",
            "-D",
        ],
    );
    qemu.arg(log).arg("-kernel").arg(image);
    Ok(output(&mut qemu)?.trim().to_owned())
}

fn output(command: &mut Command) -> Result<String> {
    let output = command
        .output()
        .with_context(|| format!("cannot start {command:?}"))?;
    if !output.status.success() {
        bail!(
            "{command:?}: {}\n{}",
            output.status,
            String::from_utf8_lossy(&output.stderr)
        );
    }
    Ok(String::from_utf8(output.stdout)?)
}

/// Address and size by name.
fn symbols(listing: &str) -> BTreeMap<String, (u32, u32)> {
    listing
        .lines()
        .filter_map(|line| {
            let mut columns = line.split_whitespace();
            let address = u32::from_str_radix(columns.next()?, 16).ok()?;
            let size = u32::from_str_radix(columns.next()?, 16).ok()?;
            let kind = columns.next()?;
            let name = columns.next()?.to_owned();
            matches!(kind, "t" | "T").then_some((name, (address & !1, size)))
        })
        .collect()
}

/// What was executed by each call from `run_full`, up to `roi_end`.
fn calls(log: &str, symbols: &BTreeMap<String, (u32, u32)>) -> Result<Vec<Vec<u32>>> {
    let at = |name: &str| {
        symbols
            .get(name)
            .copied()
            .with_context(|| format!("no symbol {name}"))
    };
    let (begin, size) = at("run_full")?;
    let (end, _) = at("roi_end")?;
    let mut calls = Vec::new();
    let mut call = Vec::new();
    let mut inside = false;
    for line in log.lines().filter(|line| line.starts_with("Trace")) {
        let address = line
            .split_once('[')
            .and_then(|(_, rest)| rest.split('/').nth(1))
            .and_then(|text| u32::from_str_radix(text, 16).ok())
            .with_context(|| format!("no address in {line}"))?;
        if address == begin {
            inside = true;
        } else if inside && address == end {
            break;
        } else if inside && (begin..begin + size).contains(&address) {
            if !call.is_empty() {
                calls.push(std::mem::take(&mut call));
            }
        } else if inside {
            call.push(address);
        }
    }
    if !call.is_empty() {
        calls.push(call);
    }
    if calls.is_empty() {
        bail!("the candidate was never called");
    }
    Ok(calls)
}

/// Size of every function that was executed.
fn text_bytes(calls: &[Vec<u32>], symbols: &BTreeMap<String, (u32, u32)>) -> u64 {
    let mut sizes = BTreeMap::new();
    for &(begin, size) in symbols.values() {
        let hit = calls
            .iter()
            .flatten()
            .any(|address| (begin..begin + size).contains(address));
        if hit {
            sizes.insert(begin, u64::from(size));
        }
    }
    sizes.values().sum()
}

/// Stack of `update` alone: what it pushes and reserves.
fn stack_bytes(listing: &str) -> u64 {
    let mut bytes = 0;
    let function = listing
        .lines()
        .skip_while(|line| !line.ends_with("<update>:"))
        .skip(1)
        .take_while(|line| !line.trim().is_empty());
    for line in function {
        let mut columns = line.split('\t').skip(2);
        let (mnemonic, text) = (columns.next().unwrap_or(""), columns.next().unwrap_or(""));
        if mnemonic.starts_with("push") || mnemonic.starts_with("vpush") {
            let each = if text.contains('d') { 8 } else { 4 };
            let mut count = 0;
            for part in text.trim_matches(['{', '}']).split(',') {
                let number = |text: &str| {
                    text.trim_matches(|c: char| !c.is_ascii_digit())
                        .parse::<u64>()
                        .unwrap_or(0)
                };
                count += match part.split_once('-') {
                    Some((from, to)) => number(to) - number(from) + 1,
                    None => 1,
                };
            }
            bytes += each * count;
        } else if mnemonic.starts_with("sub") && text.starts_with("sp, ") {
            bytes += text
                .split(['#', ' ', '\t'])
                .filter_map(|word| word.parse::<u64>().ok())
                .next()
                .unwrap_or(0);
        }
    }
    bytes
}
