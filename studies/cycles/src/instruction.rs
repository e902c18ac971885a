//! Executed instructions as the cycle models need them, decoded from `objdump -d`.

use std::collections::HashMap;

use anyhow::{Result, bail};

const CONDITIONS: [&str; 17] = [
    "eq", "ne", "cs", "cc", "hs", "lo", "mi", "pl", "vs", "vc", "hi", "ls", "ge", "lt", "gt", "le",
    "al",
];

/// Mnemonics whose end only looks like a condition.
const WHOLE: [&str; 33] = [
    "teq", "bls", "bcs", "bvs", "vcls", "movs", "lsls", "muls", "mls", "vmls", "vnmls", "vfms",
    "vfnms", "sbcs", "adcs", "bics", "svc", "umlal", "smlal", "smmls", "vmul", "mul", "vcvt",
    "cmp", "umull", "smull", "push", "pop", "bl", "it", "itt", "ite", "mvn",
];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Integer,
    Divide,
    Accumulate,
    Arithmetic,
    Move,
    Load,
    Store,
    Multiple,
    MultipleToCounter,
    LoadToCounter,
    Branch,
    IfThen,
}

/// One instruction.
#[derive(Debug, Clone)]
pub struct Instruction {
    pub size: u32,
    pub kind: Kind,
    /// Uses the floating-point unit's load and store path.
    pub float_memory: bool,
    /// Cycles in the Cortex-M4's manual.
    pub manual: i64,
    pub words: i64,
    /// Registers: s0 to s31 as 0 to 31, r0 to r15 as 32 to 47.
    pub reads: Vec<u8>,
    pub writes: Vec<u8>,
    pub addend: Vec<u8>,
    /// Bytes by which it grows the stack.
    pub stack_bytes: i64,
}

/// Instructions by address.
pub type Image = HashMap<u32, Instruction>;

/// Registers in an operand: s0 to s31 as 0 to 31, r0 to r15 as 32 to 47.
fn registers(text: &str) -> Vec<u8> {
    let mut found = Vec::new();
    let mut last: Option<(char, u8)> = None;
    let mut joined = false;
    for word in words(text) {
        if word == "-" {
            joined = true;
            continue;
        }
        let register = register(&word);
        if let Some((bank, number)) = register {
            let from = match last {
                Some((before, first)) if joined && before == bank => first + 1,
                _ => number,
            };
            for index in from..=number {
                match bank {
                    's' => found.push(index),
                    'd' => found.extend([2 * index, 2 * index + 1]),
                    _ => found.push(32 + index),
                }
            }
        }
        last = register;
        joined = false;
    }
    found
}

fn words(text: &str) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    let mut word = String::new();
    for letter in text.chars().chain([' ']) {
        if letter.is_ascii_alphanumeric() || letter == '_' {
            word.push(letter);
            continue;
        }
        if !word.is_empty() {
            out.push(std::mem::take(&mut word));
        }
        out.push(if letter == '-' { "-" } else { "," }.to_owned());
    }
    out
}

fn register(word: &str) -> Option<(char, u8)> {
    let named = match word {
        "sb" => 9,
        "sl" => 10,
        "fp" => 11,
        "ip" => 12,
        "sp" => 13,
        "lr" => 14,
        "pc" => 15,
        _ => {
            let bank = word.chars().next()?;
            let number = word.get(1..)?.parse().ok()?;
            return matches!(bank, 's' | 'd' | 'r').then_some((bank, number));
        }
    };
    Some(('r', named))
}

/// Operands, parted at commas outside brackets and braces.
fn operands(text: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let (mut depth, mut from) = (0, 0);
    for (at, letter) in text.char_indices() {
        match letter {
            '[' | '{' => depth += 1,
            ']' | '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(text[from..at].trim());
                from = at + 1;
            }
            _ => {}
        }
    }
    if !text.trim().is_empty() {
        parts.push(text[from..].trim());
    }
    parts
}

/// The mnemonic without width, type and condition.
fn core_of(mnemonic: &str) -> &str {
    let base = mnemonic.split('.').next().unwrap_or(mnemonic);
    if WHOLE.contains(&base) {
        return base;
    }
    for condition in CONDITIONS {
        if let Some(core) = base.strip_suffix(condition)
            && !core.is_empty()
        {
            return core;
        }
    }
    base
}

/// Bytes by which an instruction moves the stack pointer down.
fn stack_bytes(core: &str, parts: &[&str]) -> i64 {
    let listed = || {
        parts
            .first()
            .map_or(0, |list| 4 * registers(list).len() as i64)
    };
    let offset = || {
        let last = parts.last().copied().unwrap_or("");
        let digits = last.rsplit('#').next().unwrap_or("");
        digits.trim_end_matches(['!', ']']).parse().unwrap_or(0)
    };
    let on_stack = parts.first() == Some(&"sp");
    match core {
        "push" | "vpush" => listed(),
        "pop" | "vpop" => -listed(),
        "sub" | "subw" if on_stack => offset(),
        "add" | "addw" if on_stack => -offset(),
        "str" | "strd" | "vstr"
            if parts
                .last()
                .is_some_and(|last| last.starts_with("[sp") && last.ends_with('!')) =>
        {
            -offset()
        }
        "ldr" | "ldrd" if parts.iter().rev().nth(1) == Some(&"[sp]") => -offset(),
        _ => 0,
    }
}

fn decode(size: u32, mnemonic: &str, text: &str) -> Result<Instruction> {
    let core = core_of(mnemonic);
    let parts = operands(text);
    let each: Vec<Vec<u8>> = parts.iter().map(|part| registers(part)).collect();
    let all: Vec<u8> = each.concat();
    let first = each.first().cloned().unwrap_or_default();
    let rest: Vec<u8> = each.iter().skip(1).flatten().copied().collect();
    let double = mnemonic.ends_with(".64")
        || words(text)
            .iter()
            .any(|word| register(word).is_some_and(|(bank, _)| bank == 'd'));
    let list = |parts: &[&str]| -> Vec<u8> {
        parts
            .iter()
            .find(|part| part.starts_with('{'))
            .map(|part| registers(part))
            .unwrap_or_default()
    };
    let mut i = Instruction {
        size,
        kind: Kind::Integer,
        float_memory: false,
        manual: 1,
        words: 1,
        reads: Vec::new(),
        writes: Vec::new(),
        addend: Vec::new(),
        stack_bytes: stack_bytes(core, &parts),
    };
    if core.starts_with('v') {
        (i.kind, i.manual) = match core {
            "vdiv" | "vsqrt" => (Kind::Divide, 14),
            "vmla" | "vmls" | "vfma" | "vfms" | "vnmla" | "vnmls" | "vfnma" | "vfnms" => {
                (Kind::Accumulate, 3)
            }
            "vmul" | "vnmul" | "vadd" | "vsub" | "vcvt" | "vcvtr" | "vcvtb" | "vcvtt" => {
                (Kind::Arithmetic, 1)
            }
            "vabs" | "vneg" | "vcmp" | "vcmpe" | "vmrs" | "vmsr" | "vmov" | "vsel" | "vmaxnm"
            | "vminnm" => (
                Kind::Move,
                if core == "vmov" && parts.len() >= 3 {
                    2
                } else {
                    1
                },
            ),
            "vldr" => (Kind::Load, if double { 3 } else { 2 }),
            "vstr" => (Kind::Store, if double { 3 } else { 2 }),
            "vpush" | "vpop" => (Kind::Multiple, 0),
            _ if core.starts_with("vldm") || core.starts_with("vstm") => (Kind::Multiple, 0),
            _ => bail!("no timing for {mnemonic} {text}"),
        };
        match core {
            "vcmp" | "vcmpe" | "vmsr" => i.reads = all,
            "vstr" => {
                i.reads = all;
                i.float_memory = true;
            }
            "vldr" => {
                i.writes = first;
                i.reads = rest;
                i.float_memory = true;
            }
            "vmrs" => {}
            "vmov" if parts.len() == 3 || parts.len() == 4 => {
                let written = if parts.len() == 4 || parts[0].starts_with('r') {
                    2
                } else {
                    1
                };
                i.writes = each[..written].concat();
                i.reads = each[written..].concat();
            }
            _ if i.kind == Kind::Multiple => {
                let registers = list(&parts);
                i.words = registers.len() as i64;
                i.manual = 1 + i.words;
                i.float_memory = true;
                if core == "vpop" || core.starts_with("vldm") {
                    i.writes = registers;
                    if core != "vpop" {
                        i.reads = first;
                    }
                } else {
                    i.reads = all;
                }
            }
            _ => {
                i.writes.clone_from(&first);
                i.reads = rest;
                if i.kind == Kind::Accumulate {
                    i.addend = first;
                } else if parts.len() == 2 && matches!(core, "vadd" | "vsub" | "vmul") {
                    i.reads = all;
                }
            }
        }
        return Ok(i);
    }
    let branch = matches!(
        core,
        "b" | "bl" | "bx" | "blx" | "cbz" | "cbnz" | "tbb" | "tbh"
    ) || core
        .strip_prefix('b')
        .is_some_and(|condition| CONDITIONS.contains(&condition));
    if matches!(core, "push" | "pop") || core.starts_with("ldm") || core.starts_with("stm") {
        let registers = list(&parts);
        let loads = core == "pop" || core.starts_with("ldm");
        i.kind = Kind::Multiple;
        i.words = registers.len() as i64;
        i.manual = 1 + i.words;
        if loads {
            if registers.contains(&47) {
                i.kind = Kind::MultipleToCounter;
            }
            i.writes = registers;
            if core != "pop" {
                i.reads = first;
            }
        } else {
            i.reads = all;
        }
    } else if core.starts_with("ldr") || core.starts_with("str") {
        let pair = usize::from(matches!(core, "ldrd" | "strd")) + 1;
        let loads = core.starts_with("ldr");
        i.kind = if loads { Kind::Load } else { Kind::Store };
        i.manual = 1 + pair as i64;
        i.words = pair as i64;
        if loads {
            i.writes = each.iter().take(pair).flatten().copied().collect();
            i.reads = each.iter().skip(pair).flatten().copied().collect();
            if i.writes.contains(&47) {
                i.kind = Kind::LoadToCounter;
            }
        } else {
            i.reads = all;
        }
    } else if branch {
        i.kind = Kind::Branch;
        if matches!(core, "bx" | "blx" | "cbz" | "cbnz") {
            i.reads = all;
        }
    } else if core.starts_with("it")
        && core.len() <= 5
        && core[1..].chars().all(|letter| matches!(letter, 't' | 'e'))
    {
        i.kind = Kind::IfThen;
    } else {
        i.manual = match core {
            "udiv" | "sdiv" => 7,
            "mrs" | "msr" => 2,
            _ => 1,
        };
        if matches!(core, "cmp" | "cmn" | "tst" | "teq" | "nop") {
            i.reads = all;
        } else {
            let copies = ["mov", "mvn", "uxt", "sxt", "clz", "rev", "rsb", "neg"]
                .iter()
                .any(|start| core.starts_with(start));
            i.reads = if parts.len() > 2 || copies { rest } else { all };
            i.writes = first;
        }
    }
    Ok(i)
}

/// The instructions of an image by address, from `objdump -d`.
pub fn disassembled(listing: &str) -> Result<Image> {
    let mut found = Image::new();
    for line in listing.lines() {
        let Some((address, rest)) = line.split_once(':') else {
            continue;
        };
        let Ok(address) = u32::from_str_radix(address.trim(), 16) else {
            continue;
        };
        let mut columns = rest.split('\t').map(str::trim).filter(|c| !c.is_empty());
        let (Some(code), Some(mnemonic)) = (columns.next(), columns.next()) else {
            continue;
        };
        if mnemonic.starts_with('.') || !code.split(' ').all(|half| half.len() == 4) {
            continue;
        }
        let text: String = columns.next().unwrap_or("").to_owned();
        let text = text.split(['@', ';', '<']).next().unwrap_or("").trim();
        let size = if code.len() == 4 { 2 } else { 4 };
        // Data among the code may read as anything; it counts only if it is executed.
        if let Ok(instruction) = decode(size, mnemonic, text) {
            found.insert(address, instruction);
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::decode;

    #[test]
    fn what_moves_the_stack_pointer_counts_as_stack() {
        for (mnemonic, text, bytes) in [
            ("push", "{r4, r5, r7, lr}", 16),
            ("vpush", "{d8-d9}", 16),
            ("vpop", "{d8-d9}", -16),
            ("sub", "sp, #40", 40),
            ("sub.w", "sp, sp, #264", 264),
            ("add", "sp, #40", -40),
            ("add", "r7, sp, #8", 0),
            ("str.w", "r8, [sp, #-4]!", 4),
            ("str", "r0, [sp, #4]", 0),
            ("ldr.w", "r8, [sp], #4", -4),
        ] {
            let found = decode(2, mnemonic, text).unwrap().stack_bytes;
            assert_eq!(found, bytes, "{mnemonic} {text}");
        }
    }
}
