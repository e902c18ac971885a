//! What is common to all runs of a campaign.

use serde::{Deserialize, Serialize};

/// What is common to all runs: typical sizes that give the parameters their scale.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Context {
    /// Rig radius in m.
    pub radius: f64,
    /// Wheel inertia in kg m².
    pub inertia: f64,
    /// Translating mass in kg.
    pub mass: f64,
    /// Rig file's peak friction and slip at the peak: a fixed curve for scales that must not move.
    pub nominal: [f64; 2],
    /// Mean normal force while rolling in N.
    pub mean_load: f64,
    /// Mean vehicle speed while rolling in m/s.
    pub mean_speed: f64,
    /// Largest vehicle speed in m/s.
    pub max_speed: f64,
    /// Mean wheel speed while rolling in rad/s.
    pub mean_wheel_speed: f64,
    /// Mean friction power on the nominal curve in W.
    pub mean_power: f64,
    /// Friction work over the whole campaign on the nominal curve in J.
    pub total_work: f64,
    /// Mean brake power in W.
    pub mean_brake_power: f64,
    /// Typical sampling step in s.
    pub dt: f64,
    /// Longest run in s.
    pub duration: f64,
    /// Sum of the runs' durations in s.
    pub total_time: f64,
    /// Number of runs in the campaign.
    pub runs: usize,
    /// Largest distance run in m.
    pub distance: f64,
    /// Whether each recording's clock goes on from the one before.
    pub clock_continues: bool,
    /// First time stamp of the campaign in s.
    pub first_time: f64,
    /// Noise of the drag channel in N.
    pub drag_sigma: f64,
    /// Standard deviation of the slip as read, from the white noise of both speeds (of held or counted ones, the white noise
    /// that is as large over a window); median while rolling.
    #[serde(default)]
    pub slip_sigma: f64,
    /// Largest drag reading (99.9th percentile) in N.
    pub max_drag: f64,
    /// Whether the drag varies once a revolution as a ripple of the wheel speed would have it, and its reading less.
    #[serde(skip)]
    pub ripple_unread: bool,
    /// Factor by which the smoothing windows are widened.
    pub reach_factor: f64,
    /// Work before each run in J and clock offset of each run in s, by position.
    pub before: Vec<Before>,
}

/// What had happened before a run began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Before {
    /// Friction work on the nominal curve in J.
    pub work: f64,
    /// Time in s.
    pub time: f64,
}

impl Context {
    /// What had happened before the run at this position; after the last one for a new run.
    #[must_use]
    pub fn before(&self, index: usize) -> Before {
        self.before.get(index).copied().unwrap_or(Before {
            work: self.total_work,
            time: self.total_time,
        })
    }
    /// Friction of the nominal curve (the rig file's two parameters).
    #[must_use]
    pub fn nominal_friction(&self, slip: f64) -> f64 {
        let x = slip / self.nominal[1];
        2.0 * self.nominal[0] * x / (1.0 + x * x)
    }
}
