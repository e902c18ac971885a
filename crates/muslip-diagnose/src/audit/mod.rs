//! The audit of the measuring chain: what the channels' own timing, noise and resolution are, found before any physics.
//!
//! | question | module |
//! | --- | --- |
//! | when each channel tells what happened | [`timing`]: [`vehicle`], [`wheel`], [`law`], all by [`squares`] |
//! | what is held, what moves in steps | [`hold`], [`steps`], [`simple`] |
//! | narrow lines: hum, ripple | [`line`] |
//! | columns made from the drag | [`leak`] |
//! | what it says | [`finding`] |
//! | by which figures it decides | [`constants`] |

pub mod constants;
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
pub mod timing;
pub mod vehicle;
pub mod wheel;

pub use finding::{Finding, Timing, Word};

use crate::campaign::{Rig, Run};
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

/// Audits the measuring chain of a campaign.
#[must_use]
pub fn audit(rig: &Rig, runs: &[Run]) -> Audit {
    let recordings: Vec<Recording> = runs.iter().map(|run| recording(rig, run)).collect();
    let timings = timings(rig, &recordings);
    let brake = recordings.iter().find_map(|run| run.brake.as_ref()).map_or("", |(name, _)| name);
    let mut findings = timing::findings(&timings, brake);
    findings.extend(simple::simple(runs, &recordings));
    findings.extend(line::hum(&recordings));
    findings.extend(line::ripple(&recordings));
    findings.extend(leak::leaks(runs));
    Audit {
        wheel_late: timings.wheel,
        vehicle_late: timings.vehicle,
        brake_late: timings.brake,
        findings,
        timings,
    }
}
