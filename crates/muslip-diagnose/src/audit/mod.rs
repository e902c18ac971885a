//! The audit of the measuring chain: what the channels' own timing, noise and resolution are, found before any physics.
//!
//! | question | module |
//! | --- | --- |
//! | when each channel tells what happened | [`timing`]: [`vehicle`], [`wheel`], [`law`], all by [`squares`] |
//! | what is held, what moves in steps | [`hold`], [`steps`], [`simple`] |
//! | narrow lines: hum, ripple | [`line`] |
//! | what filters a channel passes | [`filter`] |
//! | what is off at a standstill | [`still`] |
//! | noise with a memory | [`colour`] |
//! | columns made from the drag | [`leak`] |
//! | what it says | [`finding`] |
//! | by which figures it decides | [`constants`] |

pub mod colour;
pub mod constants;
pub mod filter;
pub mod finding;
pub mod hold;
pub mod law;
pub mod leak;
pub mod line;
pub mod recording;
pub mod signal;
pub mod simple;
pub mod squares;
pub mod steps;
pub mod still;
pub mod timing;
pub mod vehicle;
pub mod wheel;

pub use finding::{Finding, Timing, Word};

use crate::campaign::{Rig, Run};
use crate::smooth::{difference_sigma, median_in_place};
use recording::{Recording, recording};
use timing::{Timings, timings};

/// What the audit found.
#[derive(Clone, Debug, Default)]
pub struct Audit {
    /// Delay of the wheel speed against the drag.
    pub wheel_late: Timing,
    /// Delay of the vehicle speed against the drag.
    pub vehicle_late: Timing,
    /// Delay of the brake column against the drag.
    pub brake_late: Timing,
    /// The delays in detail.
    pub timings: Timings,
    /// Entries of `chain`.
    pub findings: Vec<Finding>,
}

/// Slow noise of the vehicle speed, where its balance shows it.
fn slow_noise(timings: &Timings, recordings: &[Recording]) -> Option<Finding> {
    if recordings.iter().any(|run| run.speed.hold.is_some()) {
        return None;
    }
    let left = timings.vehicle_left.as_ref()?;
    let mut white: Vec<f64> = recordings
        .iter()
        .map(|run| difference_sigma(&run.speed.clean))
        .collect();
    colour::of_vehicle(&left.residual, left.step, median_in_place(&mut white))
}

/// Audits the measuring chain of a campaign.
#[must_use]
pub fn audit(rig: &Rig, runs: &[Run]) -> Audit {
    let recordings: Vec<Recording> = runs.iter().map(|run| recording(rig, run)).collect();
    let timings = timings(rig, &recordings);
    let brake = recordings
        .iter()
        .find_map(|run| run.brake.as_ref())
        .map_or("", |(name, _)| name);
    let mut findings = timing::findings(&timings, brake);
    findings.extend(simple::simple(runs, &recordings));
    findings.extend(line::hum(&recordings));
    findings.extend(line::ripple(&recordings));
    findings.extend(leak::leaks(runs));
    findings.extend(filter::filters(&timings, &recordings));
    findings.extend(still::zero(&recordings));
    findings.extend(slow_noise(&timings, &recordings));
    Audit {
        wheel_late: timings.wheel,
        vehicle_late: timings.vehicle,
        brake_late: timings.brake,
        findings,
        timings,
    }
}
