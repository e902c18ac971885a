//! How late each interrupt may come: measured instructions, modelled waits, deadlines.
//!
//! Response-time analysis of fixed priorities (M. Joseph and P. Pandya, The Computer Journal 29 (1986) 390-395): an
//! interrupt is done at the smallest R with
//!
//! ```text
//! R = masked + C + Σ ⌈R / T⌉ C      over all of the same and of higher priority
//! ```
//!
//! Instructions, and the priorities as the image sets them, are those of the emulator: of each part by itself, without
//! what interrupted it, which the sum adds. What the emulator does not model is added here at its worst.

use std::collections::BTreeMap;

use anyhow::{Context, Result, ensure};

/// Core cycles from one sample to the next.
const SAMPLE: u64 = 168_000;
/// From one byte of the link to the next in core cycles: ten bits at 921,600 baud, from a sender 2 % fast.
const BYTE: u64 = 168_000_000 * 10 / 921_600 * 98 / 100;
/// Into an interrupt and out of it, with 18 words of the FPU in either direction (Cortex-M4 Technical Reference Manual
/// r0p1, 3.9: 12 cycles each without them).
const ENTRY_AND_EXIT: u64 = 60;
/// Cycles an instruction: two for itself (loads two, branches taken two to four, most others one), two for a flash of
/// five wait states whose line of four to eight instructions takes six (RM0090, 3.4.1), none of them cached.
const PER_INSTRUCTION: u64 = 4;
/// An access to a register behind APB1, at a quarter of the core's clock: two of its cycles and one to fall into step.
const PER_ACCESS: u64 = 12;
/// Accesses of one run of the link's interrupt: status three times, data both ways, control read and written, and one
/// to spare.
const LINK_ACCESSES: u64 = 8;
/// Accesses of one sample: two encoders, four tries, five registers; 24 bytes of the bridge at four; two converters at
/// three; seven more.
const SAMPLING_ACCESSES: u64 = 2 * 4 * 5 + 24 * 4 + 2 * 3 + 7;
/// The bridge's 24 bytes at 10.5 MHz, and for each a poll that began just before the byte was there.
const BRIDGE: u64 = 24 * (8 * 16 + PER_ACCESS + 6 * PER_INSTRUCTION);

/// Something that the core does at a priority.
struct Task {
    name: &'static str,
    /// 0 goes first; the thread after all interrupts.
    priority: u64,
    instructions: u64,
    /// Cycles that it takes at most.
    cost: u64,
    /// Cycles from one to the next at least.
    period: u64,
    /// Cycles within which it is done.
    deadline: u64,
    /// Cycles for which it can be masked.
    masked: u64,
}

impl Task {
    /// Cycles from the request to the end, none where that is beyond the period.
    fn done_within(&self, all: &[Self]) -> Option<u64> {
        let mut response = self.masked + self.cost;
        loop {
            let others: u64 = all
                .iter()
                .filter(|other| other.name != self.name && other.priority <= self.priority)
                .map(|other| response.div_ceil(other.period) * other.cost)
                .sum();
            let next = self.masked + self.cost + others;
            if next == response {
                return Some(response);
            }
            if next > self.period.max(self.deadline) {
                return None;
            }
            response = next;
        }
    }
}

fn tasks(measured: &BTreeMap<String, u64>) -> Result<Vec<Task>> {
    let took = |name: &str| {
        measured
            .get(name)
            .copied()
            .with_context(|| format!("the runs measured no {name}"))
    };
    let (link, sampling) = (took("link_priority")?, took("sampling_priority")?);
    let masked = took("masked")? * PER_INSTRUCTION;
    let held_off = took("held_off")? * PER_INSTRUCTION + 2 * PER_ACCESS;
    let byte = |name, instructions| Task {
        name,
        priority: link,
        instructions,
        cost: ENTRY_AND_EXIT + instructions * PER_INSTRUCTION + LINK_ACCESSES * PER_ACCESS,
        period: BYTE,
        deadline: BYTE,
        masked,
    };
    let sample = took("interrupt")? + took("sensors")?;
    let step = took("step")?;
    Ok(vec![
        byte("USART2, a byte in", took("receive")?),
        // Nothing is lost where it comes late, but the wire's room.
        byte("USART2, a byte out", took("send")?),
        Task {
            name: "SysTick, sampling",
            priority: sampling,
            instructions: sample,
            cost: ENTRY_AND_EXIT
                + sample * PER_INSTRUCTION
                + SAMPLING_ACCESSES * PER_ACCESS
                + BRIDGE,
            period: SAMPLE,
            deadline: SAMPLE / 5,
            masked: masked.max(held_off),
        },
        Task {
            name: "thread, a sample's work",
            priority: u64::MAX,
            instructions: step,
            cost: step * PER_INSTRUCTION,
            period: SAMPLE,
            deadline: SAMPLE,
            masked: 0,
        },
    ])
}

/// The table of docs/rig.md.
///
/// # Errors
/// Something is not done within its deadline, or was not measured.
pub fn table(measured: &BTreeMap<String, u64>) -> Result<String> {
    let tasks = tasks(measured)?;
    let mut table = String::from(
        "| what | priority | instructions | cycles | masked | done within | deadline |\n\
         | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for task in &tasks {
        let Task {
            name,
            instructions,
            cost,
            deadline,
            masked,
            ..
        } = task;
        let within = task.done_within(&tasks).filter(|within| within <= deadline);
        ensure!(
            within.is_some(),
            "{name}: {cost} cycles are not done within {deadline} of the request"
        );
        let priority = if task.priority == u64::MAX {
            "-".to_owned()
        } else {
            task.priority.to_string()
        };
        table += &format!(
            "| {name} | {priority} | {instructions} | {cost} | {masked} | {} | {deadline} |\n",
            within.unwrap_or_default()
        );
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::figures;

    /// About what the image takes.
    const MEASURED: &str = "interrupt = 100\nsensors = 1400\nreceive = 60\nsend = 60\n\
                            masked = 20\nheld_off = 40\nstep = 10000\n";

    fn with(priorities: &str, change: (&str, &str)) -> Result<String> {
        table(&figures(&format!("{MEASURED}{priorities}").replace(change.0, change.1)).unwrap())
    }

    const LINK_FIRST: &str = "link_priority = 0\nsampling_priority = 1\n";

    #[test]
    fn the_link_above_sampling_holds() {
        let table = with(LINK_FIRST, ("", "")).unwrap();
        assert_eq!(table.lines().count(), 6);
    }

    #[test]
    fn sampling_above_the_link_loses_its_bytes() {
        let error = with("link_priority = 1\nsampling_priority = 0\n", ("", "")).unwrap_err();
        assert!(error.to_string().contains("a byte in"), "{error}");
    }

    #[test]
    fn a_mask_longer_than_a_byte_and_work_longer_than_a_sample_fail_by_name() {
        for (change, name) in [
            (("masked = 20", "masked = 400"), "a byte in"),
            (("send = 60", "send = 400"), "a byte in"),
            (("sensors = 1400", "sensors = 8000"), "sampling"),
            (("step = 10000", "step = 40000"), "a sample's work"),
        ] {
            let error = with(LINK_FIRST, change).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
    }

    #[test]
    fn what_was_not_measured_does_not_hold() {
        assert!(with(LINK_FIRST, ("receive = 60", "")).is_err());
        assert!(with("link_priority = 0\n", ("", "")).is_err());
    }

    #[test]
    fn the_response_is_the_smallest_fixed_point() {
        let task = |name, priority, cost, period| Task {
            name,
            priority,
            instructions: 0,
            cost,
            period,
            deadline: period,
            masked: 0,
        };
        // The example of Joseph and Pandya's method in A. Burns, A. Wellings, Real-Time Systems and Programming
        // Languages: periods 7, 12, 20, costs 3, 3, 5; responses 3, 6, 20.
        let tasks = [task("a", 0, 3, 7), task("b", 1, 3, 12), task("c", 2, 5, 20)];
        let responses: Vec<_> = tasks.iter().map(|task| task.done_within(&tasks)).collect();
        assert_eq!(responses, [Some(3), Some(6), Some(20)]);
    }
}
