//! The audit of the measuring chain: what the channels' own timing, noise and resolution are, found before any physics.
//!
//! | question | module |
//! | --- | --- |
//! | when each channel tells what happened | [`timing`]: [`vehicle`], [`wheel`], [`law`], all by [`squares`] |
//! | what is held | [`hold`] |
//! | what it says | [`finding`] |
//! | by which figures it decides | [`constants`] |

pub mod constants;
pub mod finding;
pub mod hold;
pub mod law;
pub mod recording;
pub mod signal;
pub mod squares;
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
    let findings = timing::findings(&timings, brake);
    Audit {
        wheel_late: timings.wheel,
        vehicle_late: timings.vehicle,
        brake_late: timings.brake,
        findings,
        timings,
    }
}
