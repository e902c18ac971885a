//! What the image must do, one scenario each; an error says what is not as it must be.
#![expect(
    clippy::missing_errors_doc,
    reason = "every scenario's error is its finding"
)]

mod chip;
mod estimators;
mod guards;
mod interlocks;
mod link;
mod pace;
mod runs;

use muslip_record::{Profile, Program};

use crate::bench::{Bench, Worst};

pub use chip::{endurance, fault_handlers, free_run, log};
pub use estimators::{compensation, worst_estimate};
pub use guards::guards;
pub use interlocks::interlocks;
pub use link::{back_pressure, byte_by_byte, corruption, greets};
pub use pace::true_pace;
pub use runs::{full_lock, ramps, slip_hold, steps};

/// Cycles that a sample has at 168 MHz.
pub const CYCLES_PER_SAMPLE: u32 = 168_000;
/// Share of them that the sampling interrupt and the work of a sample may take, in per cent.
pub const WORK_PERCENT: u32 = 20;
/// The road of all scenarios that do not say another.
const LAW: &str = "rudd:0.85,0.14";

const RAMP: Profile = Profile {
    program: Program::Ramp { demand_per_s: 0.8 },
    start_speed_m_s: 15.0,
    skid_slip: 0.5,
    skid_hold_s: 0.05,
    applications: 2,
    cool_s: 0.3,
};

/// Ramps as often as the brake bears for ever, each run after the other: 33 kJ each, of which its default parameters let
/// 15 kW go at their limit.
const FOR_EVER: Profile = Profile {
    applications: 100,
    cool_s: 1.2,
    ..RAMP
};

/// What a scenario found, in one line; and the most that anything took.
pub struct Found {
    /// For people.
    pub line: String,
    /// For the budgets.
    pub worst: Worst,
}

fn found(bench: &Bench, line: String) -> Found {
    Found {
        line,
        worst: bench.worst,
    }
}
