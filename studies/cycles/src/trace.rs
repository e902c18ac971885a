//! One candidate's image: built, run in QEMU one instruction at a time, and counted.

use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

use super::candidate::{Candidate, Core};
use super::instruction::{Image, disassembled};
use super::pipeline;
use super::process::{command, root};

/// What a candidate costs over the calls of one run.
#[derive(Debug, Clone, Default)]
pub struct Cost {
    pub calls: u64,
    /// Of all calls together.
    pub instructions: u64,
    pub most_instructions: u64,
    pub cycles: i64,
    pub most_cycles: i64,
    pub text_bytes: u64,
    /// Deepest, with everything that is called.
    pub stack_bytes: i64,
    /// The final estimate, in millionths.
    pub answer: String,
}

impl Cost {
    pub fn mean_instructions(&self) -> f64 {
        self.instructions as f64 / self.calls as f64
    }

    pub fn mean_cycles(&self) -> f64 {
        self.cycles as f64 / self.calls as f64
    }
}

/// Builds, runs and counts a candidate.
pub fn measured(candidate: &Candidate) -> Result<Cost> {
    let path = built(candidate)?;
    let image = disassembled(&output(
        command("arm-none-eabi-objdump", &["-d"]).arg(&path),
    )?)?;
    let symbols = Symbols::of(&output(command("arm-none-eabi-nm", &["-S"]).arg(&path))?);
    let mut calls = Calls::new(candidate.core, &image, &symbols)?;
    let answer = traced(candidate.core, &path, |address| calls.executed(address))?;
    let mut cost = calls.finished()?;
    cost.answer = answer;
    Ok(cost)
}

/// Builds one image and puts it aside under its own name.
fn built(candidate: &Candidate) -> Result<PathBuf> {
    let folder = root().join("benches/cycles");
    let target = root().join("target/cycles");
    let triple = candidate.core.triple();
    let features = if candidate.long {
        format!("{},long", candidate.name)
    } else {
        candidate.name.to_owned()
    };
    let mut build = command(
        &std::env::var("CARGO").unwrap_or_else(|_| "cargo".into()),
        &["build", "--release", "--quiet", "--locked"],
    );
    build
        .args(["--target", triple, "--features", &features])
        .current_dir(&folder)
        .env("CARGO_TARGET_DIR", &target)
        .env("CARGO_PROFILE_RELEASE_OPT_LEVEL", candidate.opt)
        .env(
            "RUSTFLAGS",
            format!(
                "-C target-cpu={} -C link-arg=-Tlink.x -C link-arg=--nmagic",
                candidate.core.cpu()
            ),
        );
    output(&mut build)?;
    let made = target.join(triple).join("release/cycles-bench");
    let kept = target.join(candidate.key());
    fs::copy(&made, &kept).with_context(|| format!("cannot copy {}", made.display()))?;
    Ok(kept)
}

/// Runs an image, giving each address that it executes; returns what it printed.
fn traced(core: Core, image: &Path, mut executed: impl FnMut(u32) -> Result<()>) -> Result<String> {
    let mut child = command(
        "qemu-system-arm",
        &["-display", "none", "-monitor", "none", "-serial", "null"],
    )
    .args(["-semihosting-config", "enable=on,target=native"])
    // Its log, on standard error, has a line for each instruction.
    .args(["-singlestep", "-d", "exec,nochain"])
    .args(["-M", core.machine(), "-kernel"])
    .arg(image)
    .stdout(Stdio::piped())
    .stderr(Stdio::piped())
    .spawn()
    .context("cannot start qemu-system-arm")?;
    let log = child.stderr.take().context("standard error is piped")?;
    let mut log = BufReader::with_capacity(1 << 16, log);
    let mut line = Vec::new();
    while log.read_until(b'\n', &mut line)? > 0 {
        if line.starts_with(b"Trace") {
            let text = String::from_utf8_lossy(&line);
            let address = text
                .split_once('[')
                .and_then(|(_, rest)| rest.split('/').nth(1))
                .and_then(|text| u32::from_str_radix(text, 16).ok())
                .with_context(|| format!("no address in {text}"))?;
            executed(address)?;
        }
        line.clear();
    }
    let mut answer = String::new();
    child
        .stdout
        .take()
        .context("standard output is piped")?
        .read_to_string(&mut answer)?;
    let status = child.wait()?;
    if !status.success() {
        bail!("the image ended with {status}");
    }
    Ok(answer.trim().to_owned())
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

/// Address and size of the functions.
struct Symbols(BTreeMap<String, (u32, u32)>);

impl Symbols {
    fn of(listing: &str) -> Self {
        Self(
            listing
                .lines()
                .filter_map(|line| {
                    let mut columns = line.split_whitespace();
                    let address = u32::from_str_radix(columns.next()?, 16).ok()?;
                    let size = u32::from_str_radix(columns.next()?, 16).ok()?;
                    let kind = columns.next()?;
                    let name = columns.next()?.to_owned();
                    // Weak ones are the compiler's arithmetic.
                    matches!(kind, "t" | "T" | "w" | "W").then_some((name, (address & !1, size)))
                })
                .collect(),
        )
    }

    fn at(&self, name: &str) -> Result<(u32, u32)> {
        self.0
            .get(name)
            .copied()
            .with_context(|| format!("no symbol {name}"))
    }

    /// Size of every function of which something was executed.
    fn bytes(&self, executed: &HashSet<u32>) -> u64 {
        let hit: BTreeMap<u32, u32> = self
            .0
            .values()
            .copied()
            .filter(|&(begin, size)| (begin..begin + size).any(|a| executed.contains(&a)))
            .collect();
        hit.into_values().map(u64::from).sum()
    }
}

/// Parts what is executed into calls of `update`: from its first instruction until `run_full` has it back.
struct Calls<'a> {
    core: Core,
    image: &'a Image,
    symbols: &'a Symbols,
    update: u32,
    caller: (u32, u32),
    call: Vec<u32>,
    executed: HashSet<u32>,
    cost: Cost,
}

impl<'a> Calls<'a> {
    fn new(core: Core, image: &'a Image, symbols: &'a Symbols) -> Result<Self> {
        Ok(Self {
            core,
            image,
            symbols,
            update: symbols.at("update")?.0,
            caller: symbols.at("run_full")?,
            call: Vec::new(),
            executed: HashSet::new(),
            cost: Cost::default(),
        })
    }

    fn executed(&mut self, address: u32) -> Result<()> {
        let (begin, size) = self.caller;
        if self.call.is_empty() {
            if address == self.update {
                self.call.push(address);
            }
        } else if (begin..begin + size).contains(&address) {
            self.count()?;
        } else {
            self.call.push(address);
        }
        Ok(())
    }

    /// Counts the call that has ended.
    fn count(&mut self) -> Result<()> {
        let time = match self.core {
            Core::M4F => pipeline::cycles(self.image, &self.call)?,
            Core::M0 => pipeline::cortex_m0_cycles(self.image, &self.call)?,
        };
        let (mut depth, mut deepest) = (0, 0);
        for address in &self.call {
            depth += self.image.get(address).map_or(0, |i| i.stack_bytes);
            deepest = depth.max(deepest);
        }
        self.executed.extend(&self.call);
        let instructions = self.call.len() as u64;
        self.call.clear();
        let cost = &mut self.cost;
        cost.calls += 1;
        cost.instructions += instructions;
        cost.most_instructions = cost.most_instructions.max(instructions);
        cost.cycles += time;
        cost.most_cycles = cost.most_cycles.max(time);
        cost.stack_bytes = cost.stack_bytes.max(deepest);
        Ok(())
    }

    fn finished(mut self) -> Result<Cost> {
        if self.cost.calls == 0 {
            bail!("the candidate was never called");
        }
        self.cost.text_bytes = self.symbols.bytes(&self.executed);
        Ok(self.cost)
    }
}
