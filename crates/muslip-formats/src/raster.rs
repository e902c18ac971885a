//! Channels of different rates on one time.
//!
//! Values come from between two readings or from one of them; none from outside a channel's own time, from within a gap, or from a reading that is
//! missing. A channel that is faster than the raster is low-passed first, without delay.

use std::f64::consts::PI;
use std::ops::Range;

use crate::map::Method;

/// A step is a gap from so many sample intervals ...
const GAP_INTERVALS: f64 = 5.0;
/// ... and from so many seconds.
pub(crate) const GAP_S: f64 = 0.1;
/// A channel that much faster than the raster is decimated; below, jitter alone may make it.
const FASTER_BY: f64 = 1.2;
/// Edge of the low-pass before decimation, as a share of the raster's rate: 0.5 would alias just at the edge.
const EDGE: f64 = 0.4;
/// Zero crossings of its kernel on each side.
const CROSSINGS: f64 = 8.0;

/// Median interval of times in s; `None` for fewer than two.
#[must_use]
pub fn interval_s(times: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if steps.is_empty() {
        return None;
    }
    let middle = steps.len() / 2;
    let (_, median, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    (median.is_finite() && *median > 0.0).then_some(*median)
}

/// Samples a second. Times of even steps give the mean, which does not carry the rounding of a single step.
#[must_use]
pub fn rate_hz(times: &[f64]) -> Option<f64> {
    let interval = interval_s(times)?;
    let (first, last) = (times.first()?, times.last()?);
    Some(rate_of(interval, times.len() as f64, last - first))
}

/// The rate of so many times with a median interval, over a span in s.
pub(crate) fn rate_of(interval: f64, count: f64, span: f64) -> f64 {
    let mean = (count - 1.0) / span;
    let even = (mean * interval - 1.0).abs() < 0.01;
    if even { mean } else { 1.0 / interval }
}

/// Longest step in s that is no gap.
#[must_use]
pub fn longest_step_s(times: &[f64]) -> f64 {
    longest_of(interval_s(times))
}

/// The same of a median interval.
pub(crate) fn longest_of(interval: Option<f64>) -> f64 {
    interval.map_or(GAP_S, |interval| (GAP_INTERVALS * interval).max(GAP_S)) * (1.0 + 1e-9)
}

/// What was done to bring a channel onto the raster.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Done {
    /// It has these times itself.
    Kept,
    /// Between its readings, by the map's method.
    Interpolated(Method),
    /// Low-passed, then read off.
    Decimated {
        /// Edge of the low-pass in Hz.
        edge_hz: f64,
    },
}

/// A channel's values at the raster's times.
///
/// `times` are strictly increasing, and as many as `values`; a missing value is `NaN`. Both lists are gone through once: cost grows with their
/// lengths, and for a decimated channel with sixteen times the ratio of the rates.
#[must_use]
pub fn onto(raster: &[f64], times: &[f64], values: &[f64], method: Method) -> (Vec<f64>, Done) {
    if raster == times {
        return (values.to_vec(), Done::Kept);
    }
    let bringing = Bringing::of(interval_s(times), rate_hz(times), rate_hz(raster), method);
    (bringing.values(raster, times, values), bringing.done)
}

/// How a channel is brought onto a raster: known before its readings are, so that they may come some at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bringing {
    pub(crate) done: Done,
    /// Longest step in s that is no gap.
    longest_s: f64,
}

impl Bringing {
    /// Of a channel's median interval in s and its rate, onto a raster of a rate.
    pub(crate) fn of(
        interval_s: Option<f64>,
        own: Option<f64>,
        raster: Option<f64>,
        method: Method,
    ) -> Self {
        let done = match (own, raster, method) {
            (Some(own), Some(wanted), Method::Linear) if own > FASTER_BY * wanted => {
                Done::Decimated {
                    edge_hz: EDGE * wanted,
                }
            }
            _ => Done::Interpolated(method),
        };
        Self {
            done,
            longest_s: longest_of(interval_s),
        }
    }

    /// How far it looks to both sides, in s. Readings that lie farther away, but for the next on each side, change nothing.
    pub(crate) fn reach_s(&self) -> f64 {
        match self.done {
            Done::Decimated { edge_hz } => reach_s(edge_hz),
            Done::Kept | Done::Interpolated(_) => 0.0,
        }
    }

    /// Values at the raster's times, of readings that begin and end beyond the reach of these or with the channel.
    pub(crate) fn values(&self, raster: &[f64], times: &[f64], values: &[f64]) -> Vec<f64> {
        match self.done {
            Done::Decimated { edge_hz } => {
                low_passed(raster, times, values, self.longest_s, edge_hz)
            }
            Done::Interpolated(Method::Hold) => {
                between(raster, times, values, self.longest_s, Method::Hold)
            }
            Done::Kept | Done::Interpolated(Method::Linear) => {
                between(raster, times, values, self.longest_s, Method::Linear)
            }
        }
    }
}

/// How far the low-pass looks to both sides, in s.
fn reach_s(edge_hz: f64) -> f64 {
    CROSSINGS / (2.0 * edge_hz)
}

/// Values between two readings, by the method.
fn between(
    raster: &[f64],
    times: &[f64],
    values: &[f64],
    longest: f64,
    method: Method,
) -> Vec<f64> {
    let mut next = 0;
    let at = |&time: &f64| {
        while times.get(next).is_some_and(|&t| t <= time) {
            next += 1;
        }
        let Some(before) = next.checked_sub(1) else {
            return f64::NAN;
        };
        let (t0, v0) = (times[before], values[before]);
        if t0 == time {
            return v0;
        }
        let Some((&t1, &v1)) = times.get(next).zip(values.get(next)) else {
            return f64::NAN;
        };
        if t1 - t0 > longest {
            return f64::NAN;
        }
        match method {
            Method::Hold => v0,
            Method::Linear => {
                let share = (time - t0) / (t1 - t0);
                v0 * (1.0 - share) + v1 * share
            }
        }
    };
    raster.iter().map(at).collect()
}

/// Stretches without a gap and without a missing reading.
fn stretches(times: &[f64], values: &[f64], longest: f64) -> Vec<Range<usize>> {
    let mut all = Vec::new();
    let mut from = None;
    for k in 0..times.len() {
        let gap = k > 0 && times[k] - times[k - 1] > longest;
        let here = values[k].is_finite();
        if let Some(start) = from
            && (gap || !here)
        {
            all.push(start..k);
            from = None;
        }
        if here && from.is_none() {
            from = Some(k);
        }
    }
    all.extend(from.map(|start| start..times.len()));
    all
}

/// A windowed-sinc low-pass about each time of the raster: symmetric, so without delay. Beyond the ends of a stretch it sees the stretch turned about
/// its end point, so that a slope stays a slope.
fn low_passed(
    raster: &[f64],
    times: &[f64],
    values: &[f64],
    longest: f64,
    edge_hz: f64,
) -> Vec<f64> {
    let reach = reach_s(edge_hz);
    let stretches = stretches(times, values, longest);
    let mut stretch = 0;
    let mut low = 0;
    let weight = |dt: f64| {
        let u = dt / reach;
        if u.abs() >= 1.0 {
            return 0.0;
        }
        let x = 2.0 * PI * edge_hz * dt;
        let sinc = if x.abs() < 1e-9 { 1.0 } else { x.sin() / x };
        // Blackman's window: side lobes 58 dB down.
        sinc * (0.42 + 0.5 * (PI * u).cos() + 0.08 * (2.0 * PI * u).cos())
    };
    let at = |&time: &f64| {
        while stretches
            .get(stretch)
            .is_some_and(|range| times[range.end - 1] < time)
        {
            stretch += 1;
        }
        let Some(range) = stretches
            .get(stretch)
            .filter(|range| times[range.start] <= time)
        else {
            return f64::NAN;
        };
        let (first, last) = (range.start, range.end - 1);
        low = low.max(first);
        while low < last && times[low] < time - reach {
            low += 1;
        }
        let (mut sum, mut weights) = (0.0, 0.0);
        let mut add = |dt: f64, value: f64| {
            let w = weight(dt);
            sum += w * value;
            weights += w;
        };
        let mut k = low;
        while k <= last && times[k] <= time + reach {
            add(times[k] - time, values[k]);
            k += 1;
        }
        for k in first + 1..=last {
            let mirrored = 2.0 * times[first] - times[k];
            if mirrored <= time - reach {
                break;
            }
            add(mirrored - time, 2.0 * values[first] - values[k]);
        }
        for k in (first..last).rev() {
            let mirrored = 2.0 * times[last] - times[k];
            if mirrored >= time + reach {
                break;
            }
            add(mirrored - time, 2.0 * values[last] - values[k]);
        }
        if weights.abs() > 1e-9 {
            sum / weights
        } else {
            f64::NAN
        }
    };
    raster.iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(count: usize, rate: f64) -> Vec<f64> {
        (0..count).map(|k| k as f64 / rate).collect()
    }

    #[test]
    fn values_lie_between_readings_and_nowhere_else() {
        let raster = [-0.5, 0.0, 0.25, 1.0, 1.5, 2.0, 2.5];
        let (linear, done) = onto(&raster, &[0.0, 1.0, 2.0], &[0.0, 10.0, 0.0], Method::Linear);
        assert_eq!(done, Done::Interpolated(Method::Linear));
        assert!(linear[0].is_nan() && linear[6].is_nan());
        assert_eq!(linear[1..6], [0.0, 2.5, 10.0, 5.0, 0.0]);
        let (hold, _) = onto(&raster, &[0.0, 1.0, 2.0], &[0.0, 10.0, 0.0], Method::Hold);
        assert_eq!(hold[1..6], [0.0, 0.0, 10.0, 10.0, 0.0]);
        assert!(hold[6].is_nan());
    }

    #[test]
    fn gaps_and_missing_readings_stay_empty() {
        let mut times = steps(100, 100.0);
        times.extend(steps(100, 100.0).iter().map(|t| t + 2.0));
        let mut values = vec![1.0; 200];
        values[50] = f64::NAN;
        let raster = steps(3000, 1000.0);
        let (got, _) = onto(&raster, &times, &values, Method::Linear);
        for (time, value) in raster.iter().zip(&got) {
            let in_gap = *time > 0.99 + 1e-9 && *time < 2.0 - 1e-9;
            let at_missing = *time > 0.49 + 1e-9 && *time < 0.51 - 1e-9;
            assert_eq!(
                value.is_nan(),
                in_gap || at_missing || *time > 2.99 + 1e-9,
                "{time}"
            );
        }
    }

    #[test]
    fn decimation_keeps_what_is_slow_and_removes_what_would_alias() {
        let times = steps(20_000, 1000.0);
        let raster = steps(2000, 100.0);
        let of = |hz: f64| {
            let values: Vec<f64> = times.iter().map(|t| (2.0 * PI * hz * t).sin()).collect();
            onto(&raster, &times, &values, Method::Linear)
        };
        let (slow, done) = of(10.0);
        let edge = |done: &Done| match done {
            Done::Decimated { edge_hz } => *edge_hz,
            _ => f64::NAN,
        };
        assert!((edge(&done) - 40.0).abs() < 1e-9, "{done:?}");
        for (time, value) in raster.iter().zip(&slow).skip(20).take(1900) {
            assert!(
                (value - (2.0 * PI * 10.0 * time).sin()).abs() < 2e-3,
                "{time}"
            );
        }
        // 97 Hz read off at 100 Hz would be 3 Hz.
        let (fast, _) = of(97.0);
        assert!(
            fast.iter()
                .skip(20)
                .take(1900)
                .all(|value| value.abs() < 5e-3)
        );
        // A slope stays one up to its ends.
        let slope: Vec<f64> = times.iter().map(|t| 3.0 * t).collect();
        let (got, _) = onto(&raster, &times, &slope, Method::Linear);
        assert!(
            raster
                .iter()
                .zip(&got)
                .all(|(t, v)| (v - 3.0 * t).abs() < 1e-9)
        );
    }

    #[test]
    fn rates_do_not_carry_a_step_s_rounding() {
        assert_eq!(rate_hz(&steps(12_000, 200.0)), Some(200.0));
        assert_eq!(rate_hz(&[1.0]), None);
    }
}
