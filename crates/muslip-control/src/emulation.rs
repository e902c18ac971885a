//! What the emulated board and the rig simulator say to each other, in frames like those of the link.
//!
//! A sample goes in, and the firmware's answer comes out before the next may go in: lock-step. Totals of the
//! link's bytes go with both, so that its two streams are ordered against the samples as well.

use serde::{Deserialize, Serialize};

use crate::board::RawSample;
use crate::brake::BrakeOutput;

/// Base-two logarithm of the nanoseconds that the emulator takes an instruction for at the wire's pace: 16, which is 2.7 cycles at
/// 168 MHz, where the cycle model of the Cortex-M4 has 1.5 for the control step.
pub const NS_PER_INSTRUCTION_LOG2: u32 = 4;

/// From the simulator.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum ToFirmware {
    /// One sample.
    Sample {
        /// What the sensors read.
        raw: RawSample,
        /// Bytes sent on the link so far: the sample's work begins when all have arrived.
        link_sent: u32,
        /// Bytes that the link's wire takes during this sample.
        link_room: u16,
        /// Instructions to waste in this sample's work.
        burn: u32,
    },
    /// Let the 1 kHz timer run freely on this sample.
    FreeRun {
        /// What the sensors read, each time.
        raw: RawSample,
        /// How many samples.
        samples: u16,
        /// Instructions to waste in each sample's work.
        burn: u32,
    },
    /// Execute an undefined instruction, as memory gone bad would.
    HardFault,
    /// Call without end, as a program gone wrong would.
    ExhaustStack,
    /// Raise the interrupt that cannot be masked, as the crystal's end would.
    NonMaskable,
    /// The next sample at the pace of the wire, for which the emulator goes at
    /// [`NS_PER_INSTRUCTION_LOG2`]; the first of them begins that.
    Pace {
        /// What the sensors read.
        raw: RawSample,
        /// Bytes on the link that the wire brings from now on.
        link_bytes: u16,
    },
}

/// What can hold an interrupt off, the most of each so far, in instructions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Delays {
    /// The link's interrupt, taking one byte in.
    pub receive: u32,
    /// The link's interrupt, sending one byte.
    pub send: u32,
    /// Every interrupt masked, around the core's sleep.
    pub masked: u32,
    /// Sampling held off while the valves are set.
    pub held_off: u32,
}

/// From the firmware.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum FromFirmware {
    /// Start-up is done.
    Ready {
        /// Instructions of one look at the chip's own sensors, with every bus ready at once.
        sampling_instructions: u32,
        /// Whether the chip's registers hold what start-up sets: not in the emulator, which has not run that start-up
        /// and has few of them.
        registers_hold: bool,
        /// Priorities of the link's interrupt and of sampling as they are set; 0 goes first.
        priorities: [u8; 2],
    },
    /// A sample's work is done.
    Sample {
        /// Samples since start.
        tick: u32,
        /// What the valves were told.
        output: BrakeOutput,
        /// Instructions of the sampling interrupt.
        interrupt_instructions: u32,
        /// Instructions of the control step.
        control_instructions: u32,
        /// Instructions of the step and of the link's work after it.
        step_instructions: u32,
        /// What can hold an interrupt off.
        delays: Delays,
        /// Deepest stack so far in bytes.
        stack_bytes: u32,
        /// Bytes sent on the link so far.
        link_sent: u32,
    },
    /// A free run is over.
    FreeRun {
        /// Samples that the timer asked for.
        samples: u32,
        /// Samples whose work was done.
        worked: u32,
        /// Times that the interrupt found a sample not taken and dumped the brake.
        late: u32,
        /// Time passed by another timer, in ns.
        elapsed_ns: u32,
        /// What the valves were told last.
        output: BrakeOutput,
    },
    /// A fault handler ran; the brake was dumped before this was sent.
    Dumped {
        /// True for a panic, false for a hard fault.
        panic: bool,
        /// What the valves were told last.
        output: BrakeOutput,
    },
    /// A sample at the pace of the wire is over, whether its work is done or not.
    Paced {
        /// Samples raised.
        raised: u32,
        /// Samples whose work was done.
        worked: u32,
        /// Times that a sample was raised before the last was done.
        late: u32,
        /// What the valves were told last.
        output: BrakeOutput,
        /// Bytes sent on the link so far.
        link_sent: u32,
        /// Longest that a received byte waited to be taken, in core cycles.
        waited: u32,
        /// Bytes that the wire still has to bring.
        ready: u16,
        /// Received bytes that were lost.
        lost: u32,
    },
}
