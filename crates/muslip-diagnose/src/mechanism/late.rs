//! A time by which something comes late: its bounds and where a search for it starts.

use super::prelude::*;

/// Longest time as a share of the longest run: what comes later is not seen coming.
const MOST_SHARE: f64 = 0.25;
/// A time below this share of a sampling step is none.
const LEAST_STEPS: f64 = 0.2;

/// What a drag that comes late, however, is mistaken for: a lag in distance, ...
pub const AT_ONE_SPEED: Alias = Alias {
    with: Id::RelaxationLength,
    why: "At one speed a distance is a time.",
    run: runs::RAMP_SPEEDS,
};
/// ... a loop, ...
pub const AT_ONE_RATE: Alias = Alias {
    with: Id::SlipHysteresis,
    why: "At one rate of slip what comes late opens the same loop.",
    run: runs::RAMP_RATES,
};
/// ... and a reaction to the wheel's acceleration.
pub const AS_THE_WHEEL_SLOWS: Alias = Alias {
    with: Id::InertialReaction,
    why: "When the wheel slows before the force falls, its acceleration looks like the force's past.",
    run: runs::STOP_LIFTED,
};

/// The longest time in s of which a campaign shows something, no longer than `most_s`.
pub fn longest(most_s: f64, context: &Context) -> f64 {
    most_s.min(MOST_SHARE * context.duration)
}

/// The times in s of which samples show something.
pub fn seen(times_s: impl Iterator<Item = f64>, context: &Context) -> impl Iterator<Item = f64> {
    times_s.filter(|s| *s > LEAST_STEPS * context.dt)
}

/// Starts of a search for a time alone, at these times in ms.
pub fn starts(times_ms: &[f64], context: &Context) -> Vec<Vec<f64>> {
    let times_s = times_ms.iter().map(|ms| ms * 1e-3);
    seen(times_s, context).map(|s| vec![s]).collect()
}
