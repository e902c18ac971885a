//! Where the repaired model differs from the base: in time, and by operating region.

use core::ops::Range;

use crate::data::Data;
use crate::outcome::Region;
use crate::variable::Variable;

/// Length over which the difference is averaged in s.
const MEAN_S: f64 = 0.05;
/// Shorter gaps between intervals are closed, in s.
const CLOSE_S: f64 = 0.1;

/// Intervals in which the mean size of `difference` over 50 ms exceeds `sigma`, gaps below 0.1 s closed: its size, for
/// what rings faster than that is there all the same.
#[must_use]
pub fn intervals(
    time: &[f64],
    difference: &[f64],
    usable: &[Range<usize>],
    sigma: f64,
    step_sigma: f64,
) -> Vec<(f64, f64, f64)> {
    let n = time.len();
    let mut ok = vec![false; n];
    for segment in usable {
        ok[segment.clone()].fill(true);
    }
    let mut sums = vec![0.0; n + 1];
    let mut counts = vec![0usize; n + 1];
    for k in 0..n {
        let d = if ok[k] && difference[k].is_finite() {
            difference[k].abs()
        } else {
            0.0
        };
        sums[k + 1] = sums[k] + d;
        counts[k + 1] = counts[k] + usize::from(ok[k]);
    }
    let mut found: Vec<(usize, usize)> = Vec::new();
    let (mut low, mut high) = (0, 0);
    for k in 0..n {
        while time[k] - time[low] > 0.5 * MEAN_S {
            low += 1;
        }
        while high + 1 < n && time[high + 1] - time[k] <= 0.5 * MEAN_S {
            high += 1;
        }
        let count = counts[high + 1] - counts[low];
        if count == 0 || !ok[k] {
            continue;
        }
        let mean = (sums[high + 1] - sums[low]) / count as f64;
        if mean > sigma {
            match found.last_mut() {
                Some(last) if time[k] - time[last.1] < CLOSE_S => last.1 = k,
                _ => found.push((k, k)),
            }
        }
    }
    found
        .into_iter()
        .map(|(from, to)| {
            let square: f64 = (from..=to)
                .filter(|k| ok[*k] && difference[*k].is_finite())
                .map(|k| difference[k] * difference[k])
                .sum();
            (
                time[from],
                time[to],
                (square.sqrt() / step_sigma.max(1e-300)).min(1e6),
            )
        })
        .collect()
}

/// Ranges of a variable are made of so many bins.
const BINS: usize = 40;
/// Share of the difference's energy that a region holds.
const SHARE: f64 = 0.8;

/// Regions of operation that hold most of the difference: for each variable the shortest range with four fifths
/// of its energy, the most concentrated first. Of the recorded columns those that the model reads: beside any other the
/// difference is concentrated by chance.
#[must_use]
pub fn regions(
    data: &Data,
    balance: &'static str,
    difference: &[Vec<f64>],
    usable: &[Vec<Range<usize>>],
    columns: &[Variable],
    sigma: f64,
) -> Vec<Region> {
    let mut found: Vec<(f64, Region)> = Vec::new();
    let variables = [
        Variable::Slip,
        Variable::SlidingSpeed,
        Variable::VehicleSpeed,
        Variable::NormalForce,
        Variable::Time,
        Variable::Distance,
        Variable::SlipRate,
    ]
    .into_iter()
    .chain(columns.iter().cloned());
    for variable in variables {
        let mut samples = energies(data, &variable, difference, usable);
        let total: f64 = samples.iter().map(|s| s.1).sum();
        if samples.len() < 50 || !(total > 0.0) {
            continue;
        }
        if let Some(range) = shortest(&mut samples, total) {
            let region = Region {
                balance,
                variable: variable.word(data),
                low: range.low,
                high: range.high,
                z: (range.energy.sqrt() / sigma.max(1e-300)).min(1e6),
                share: (range.energy / total).clamp(0.0, 1.0),
            };
            let members = range.members as f64 / samples.len() as f64;
            found.push(((range.energy / total) / members.max(1e-6), region));
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.into_iter().map(|(_, r)| r).take(4).collect()
}

/// Variable and squared difference at every sample at which both are known.
fn energies(
    data: &Data,
    variable: &Variable,
    difference: &[Vec<f64>],
    usable: &[Vec<Range<usize>>],
) -> Vec<(f64, f64)> {
    let mut samples = Vec::new();
    for (run, segments) in usable.iter().enumerate() {
        if segments.is_empty() {
            continue;
        }
        let u = variable.values(data, run);
        for k in segments.iter().flat_map(Clone::clone) {
            let d = difference[run][k];
            if u[k].is_finite() && d.is_finite() {
                samples.push((u[k], d * d));
            }
        }
    }
    samples
}

/// A range of a variable.
struct Held {
    low: f64,
    high: f64,
    energy: f64,
    members: usize,
}

/// The range with the fewest samples that holds its share of the energy.
fn shortest(samples: &mut [(f64, f64)], total: f64) -> Option<Held> {
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    let low = samples[samples.len() / 500].0;
    let high = samples[samples.len() - 1 - samples.len() / 500].0;
    if !(high > low) {
        return None;
    }
    let width = (high - low) / BINS as f64;
    let mut energy = [0.0; BINS];
    let mut count = [0usize; BINS];
    for (u, e) in &*samples {
        let bin = (((u - low) / width).max(0.0) as usize).min(BINS - 1);
        energy[bin] += e;
        count[bin] += 1;
    }
    let mut best: Option<Held> = None;
    for from in 0..BINS {
        let (mut sum, mut members) = (0.0, 0);
        for to in from..BINS {
            sum += energy[to];
            members += count[to];
            if sum >= SHARE * total {
                if best.as_ref().is_none_or(|b| members < b.members) {
                    best = Some(Held {
                        low: low + from as f64 * width,
                        high: low + (to + 1) as f64 * width,
                        energy: sum,
                        members,
                    });
                }
                break;
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Intervals of a difference of two seconds at 500 Hz, in standard deviations.
    fn intervals_of(difference: impl Fn(f64) -> f64) -> Vec<(f64, f64, f64)> {
        let time: Vec<f64> = (0..1000).map(|k| f64::from(k) * 0.002).collect();
        let d: Vec<f64> = time.iter().map(|t| difference(*t)).collect();
        let all = 0..1000;
        intervals(&time, &d, &[all], 1.0, 1.0)
    }

    #[test]
    fn intervals_hold_what_rings_faster_than_the_mean() {
        let found = intervals_of(|t| {
            if (0.5..1.0).contains(&t) {
                3.0 * (core::f64::consts::TAU * 40.0 * t).sin()
            } else {
                0.0
            }
        });
        assert_eq!(found.len(), 1, "{found:?}");
        assert!((found[0].0 - 0.5).abs() < 0.03 && (found[0].1 - 1.0).abs() < 0.03);
    }

    #[test]
    fn intervals_close_short_gaps_and_keep_long_ones() {
        let away = [0.4..0.7, 0.75..0.9, 1.4..1.6];
        let found = intervals_of(|t| {
            if away.iter().any(|range| range.contains(&t)) {
                3.0
            } else {
                0.0
            }
        });
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0].0 - 0.39).abs() < 0.02 && (found[0].1 - 0.91).abs() < 0.02);
        assert!((found[1].0 - 1.39).abs() < 0.02 && (found[1].1 - 1.61).abs() < 0.02);
    }
}
