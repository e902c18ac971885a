//! Modelled Cortex-M4F cycles of a list of executed instructions.
//!
//! Single issue, in order, no wait states, after the instruction timing of the Cortex-M4 technical reference
//! manual (ARM 100166, 3.3 and 7.2.3): loads and stores pipeline, a floating-point result that the next
//! instruction uses costs one cycle more, multiply-accumulate takes its addend one cycle late, integer
//! instructions issue under a running division, IT costs nothing, a taken branch refills two.

use anyhow::{Context, Result};

use super::instruction::{Image, Instruction, Kind};

/// Cycles of a pipeline refill.
const REFILL: i64 = 2;

/// Modelled cycles of one call: addresses in the order of execution.
pub fn cycles(image: &Image, call: &[u32]) -> Result<i64> {
    let mut time = 0_i64;
    let mut ready = [0_i64; 48];
    let mut unit = 0;
    let mut before: Option<(&Instruction, i64)> = None;
    for (index, address) in call.iter().enumerate() {
        let i = image
            .get(address)
            .with_context(|| format!("no timing for what is executed at {address:#x}"))?;
        let taken = call.get(index + 1) != Some(&(address + i.size));
        let mut start = time;
        if let Some((b, _)) = before
            && b.kind == Kind::Load
            && b.words == 1
            && matches!(i.kind, Kind::Load | Kind::Store)
            && !i.reads.iter().any(|register| b.writes.contains(register))
        {
            start = time - 1;
        }
        for &register in &i.reads {
            start = start.max(ready[usize::from(register)]);
        }
        for &register in &i.addend {
            start = start.max(ready[usize::from(register)] - 1);
        }
        let float = i.float_memory
            || matches!(
                i.kind,
                Kind::Divide | Kind::Accumulate | Kind::Arithmetic | Kind::Move
            );
        if float {
            start = start.max(unit);
        }
        let cost = match i.kind {
            Kind::IfThen => 0,
            Kind::Divide => {
                unit = start + 14;
                1
            }
            Kind::Accumulate => {
                unit = start + 3;
                1
            }
            Kind::Load if i.float_memory => i.manual,
            Kind::Load => 1 + i.words,
            Kind::Store if i.float_memory => i.manual - 1,
            Kind::Store => i.words,
            Kind::MultipleToCounter => 1 + i.words + REFILL,
            Kind::LoadToCounter => 2 + REFILL,
            Kind::Branch => 1 + if taken { REFILL } else { 0 },
            _ => i.manual,
        };
        time = start + cost;
        let latency = match i.kind {
            Kind::Divide => Some(15),
            Kind::Accumulate => Some(4),
            Kind::Arithmetic => Some(2),
            _ => None,
        };
        for &register in &i.writes {
            ready[usize::from(register)] = latency.map_or(time, |latency| start + latency);
        }
        before = Some((i, time));
    }
    Ok(time.max(unit))
}

/// Cycles of one call on a Cortex-M0: a sum, as nothing there overlaps (technical reference manual, ARM DDI
/// 0432C, table 3-1; the multiplier is the fast one).
pub fn cortex_m0_cycles(image: &Image, call: &[u32]) -> Result<i64> {
    let mut sum = 0;
    for (index, address) in call.iter().enumerate() {
        let i = image
            .get(address)
            .with_context(|| format!("no timing for what is executed at {address:#x}"))?;
        let taken = call.get(index + 1) != Some(&(address + i.size));
        sum += match i.kind {
            Kind::Multiple => 1 + i.words,
            Kind::MultipleToCounter => 4 + i.words,
            Kind::Load | Kind::Store => 2,
            // A branch with link is the only one of two halves.
            Kind::Branch if i.size == 4 => 4,
            Kind::Branch if taken => 3,
            Kind::Integer if i.writes.contains(&47) => 3,
            _ => 1,
        };
    }
    Ok(sum)
}

#[cfg(test)]
mod tests {
    use super::super::instruction::disassembled;
    use super::{cortex_m0_cycles, cycles};

    fn timed(lines: &[&str]) -> i64 {
        let listing: String = lines
            .iter()
            .enumerate()
            .map(|(k, line)| format!("  {:x}:\t0000 0000 \t{line}\n", 4 * k))
            .collect();
        let image = disassembled(&listing).unwrap();
        let call: Vec<u32> = (0..lines.len() as u32).map(|k| 4 * k).collect();
        cycles(&image, &call).unwrap()
    }

    #[test]
    fn results_that_are_waited_for_cost_what_the_manual_says() {
        assert_eq!(timed(&["vmul.f32\ts0, s1, s2", "vmul.f32\ts3, s4, s5"]), 2);
        assert_eq!(timed(&["vmul.f32\ts0, s1, s2", "vmul.f32\ts3, s0, s5"]), 3);
        assert_eq!(timed(&["vdiv.f32\ts0, s1, s2", "vmul.f32\ts3, s0, s5"]), 16);
        assert_eq!(timed(&["vldr\ts0, [r0]", "vldr\ts1, [r0, #4]"]), 3);
        assert_eq!(timed(&["push\t{r4, lr}", "pop\t{r4, pc}"]), 3 + 5);
        assert_eq!(timed(&["vldmia\tr1!, {s0-s3}", "bx\tlr"]), 5 + 3);
    }

    #[test]
    fn a_cortex_m0_overlaps_nothing() {
        let listing = "  0:\tb510\tpush\t{r4, lr}\n  2:\t6801\tldr\tr1, [r0, #0]\n  \
                       4:\t4348\tmuls\tr0, r1\n  6:\tf000 f800\tbl\ta\n  a:\tbd10\tpop\t{r4, pc}\n";
        let image = disassembled(listing).unwrap();
        assert_eq!(
            cortex_m0_cycles(&image, &[0, 2, 4, 6, 10]).unwrap(),
            3 + 2 + 1 + 4 + 6
        );
    }
}
