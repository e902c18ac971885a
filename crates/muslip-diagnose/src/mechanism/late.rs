//! A time by which something comes late: its bounds and where a search for it starts.

use super::prelude::*;

/// Longest time as a share of the longest run: what comes later is not seen coming.
const MOST_SHARE: f64 = 0.25;
/// A time below this share of a sampling step is none.
const LEAST_STEPS: f64 = 0.2;

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
