//! Rows averaged over short stretches of time: what a balance is weighed on.
//!
//! Sensors pass less than the recording's rate: a satellite receiver has ten to fifty fixes a second, a counter a
//! window. Between two of its own readings a channel only repeats or interpolates, and noise that is a straight line
//! between them is no sum of the whitener's parts: its size would be read off samples that say nothing. A mean over
//! a few own readings keeps all that is known of what is slower, and every column passes the same mean.

use core::ops::Range;

use crate::balance::Balance;
use crate::series::Series;
use crate::smooth::{bend, median_in_place};

/// Shortest block in s: a fifth of the period of the fastest force that is named.
const SHORTEST_S: f64 = 0.01;
/// Longest block in s.
const LONGEST_S: f64 = 0.25;
/// Own readings of the slowest channel in one block where that is longer.
const OWN_READINGS: f64 = 2.0;
/// Share of a channel's second differences below which the quieter two fifths lie where it only interpolates.
const STRAIGHT: f64 = 0.15;

/// Neighbours in which one bend shows at most.
const BENT: usize = 3;

/// Blocks of one balance on one run.
#[derive(Clone, Debug, Default)]
pub struct Blocks {
    /// Mean time of each in s.
    pub time: Vec<f64>,
    /// Samples of each.
    pub samples: Vec<Range<usize>>,
    /// Stretches without a break, in blocks.
    pub segments: Vec<Range<usize>>,
}

impl Blocks {
    fn new(time: &[f64], segments: &[Range<usize>], length: f64) -> Self {
        let mut out = Self::default();
        for segment in segments {
            let first = out.samples.len();
            let mut from = segment.start;
            for k in segment.clone() {
                // A block ends where the next sample would make it longer by more than half a step.
                let next = k + 1;
                let full = next == segment.end
                    || time[next] - time[from] > length - 0.5 * (time[next] - time[k]);
                if full {
                    out.samples.push(from..next);
                    out.time
                        .push(time[from..next].iter().sum::<f64>() / (next - from) as f64);
                    from = next;
                }
            }
            out.segments.push(first..out.samples.len());
        }
        out
    }

    /// By how many s neighbours are apart in the mean; infinite where none has one.
    #[must_use]
    pub fn apart_s(&self) -> f64 {
        let (mut steps, mut span) = (0.0, 0.0);
        for own in self.segments.iter().map(|s| &self.time[s.clone()]) {
            if let [first, .., last] = own {
                steps += (own.len() - 1) as f64;
                span += last - first;
            }
        }
        if steps > 0.0 {
            span / steps
        } else {
            f64::INFINITY
        }
    }

    /// Means of a column; nothing of an empty one.
    #[must_use]
    pub fn mean(&self, column: &[f64]) -> Vec<f64> {
        if column.is_empty() {
            return Vec::new();
        }
        self.mean_of(|k| column[k])
    }

    /// Means of what stands at each sample.
    #[must_use]
    pub fn mean_of(&self, at: impl Fn(usize) -> f64) -> Vec<f64> {
        let mean = |samples: &Range<usize>| {
            let (mut sum, mut count) = (0.0, 0.0);
            for x in samples.clone().map(&at).filter(|x| x.is_finite()) {
                sum += x;
                count += 1.0;
            }
            sum / f64::max(count, 1.0)
        };
        self.samples.iter().map(mean).collect()
    }
}

/// Time in s between a channel's own readings, where it repeats or interpolates in between; else nothing.
#[must_use]
pub fn own_interval(time: &[f64], x: &[f64], segments: &[Range<usize>]) -> f64 {
    let mut bends: Vec<(f64, f64)> = Vec::new();
    for s in segments {
        for k in s.start + 1..s.end.saturating_sub(1) {
            let bend = bend(time, x, k);
            if bend.is_finite() {
                bends.push((time[k], bend));
            }
        }
    }
    if bends.len() < 50 {
        return 0.0;
    }
    let mean_square = bends.iter().map(|b| b.1 * b.1).sum::<f64>() / bends.len() as f64;
    let mut sorted: Vec<f64> = bends.iter().map(|b| b.1).collect();
    sorted.sort_by(f64::total_cmp);
    let sharp = 0.5 * mean_square.sqrt();
    if !(sorted[2 * sorted.len() / 5] < 2.0 * STRAIGHT * sharp) {
        return 0.0;
    }
    // A bend that was moved in time and averaged shows in up to three neighbours: the first of them counts.
    let mut gaps: Vec<f64> = Vec::new();
    let mut before: Option<(usize, f64)> = None;
    for (i, (t, bend)) in bends.iter().enumerate() {
        if *bend < sharp {
            continue;
        }
        match before {
            Some((at, _)) if i < at + BENT => {}
            Some((_, since)) => {
                gaps.push(t - since);
                before = Some((i, *t));
            }
            None => before = Some((i, *t)),
        }
    }
    if gaps.is_empty() {
        return 0.0;
    }
    median_in_place(&mut gaps)
}

/// Blocks of every run, in the order tyre, wheel, vehicle.
#[must_use]
pub fn blocks(series: &[Series]) -> Vec<[Blocks; 3]> {
    let interval = |f: &dyn Fn(&Series) -> f64| {
        let mut all: Vec<f64> = series.iter().map(f).collect();
        if all.is_empty() {
            0.0
        } else {
            median_in_place(&mut all)
        }
    };
    let wheel = interval(&|s| own_interval(&s.time, &s.wheel.raw, &s.wheel_balance));
    let vehicle = interval(&|s| own_interval(&s.time, &s.speed.raw, &s.vehicle_balance));
    let length = |own: f64| (OWN_READINGS * own).clamp(SHORTEST_S, LONGEST_S);
    series
        .iter()
        .map(|s| {
            [
                (Balance::Tyre, SHORTEST_S),
                (Balance::Wheel, length(wheel)),
                (Balance::Vehicle, length(vehicle)),
            ]
            .map(|(balance, length)| Blocks::new(&s.time, s.segments(balance), length))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_end_at_breaks_and_hold_every_sample_once() {
        let time: Vec<f64> = (0..40).map(|k| 0.004 * f64::from(k)).collect();
        let blocks = Blocks::new(&time, &[3..17, 20..40], 0.012);
        let all: Vec<usize> = blocks.samples.iter().flat_map(Clone::clone).collect();
        assert_eq!(all, (3..17).chain(20..40).collect::<Vec<_>>());
        assert!(blocks.samples.iter().all(|s| s.len() <= 3));
        assert_eq!(blocks.segments.len(), 2);
        let mean = blocks.mean(&time);
        assert!(
            mean.iter()
                .zip(&blocks.time)
                .all(|(a, b)| (a - b).abs() < 1e-12)
        );
    }

    #[test]
    fn lines_that_were_moved_in_time_and_averaged_are_as_long_by_an_uneven_clock() {
        // Readings 0.1 s apart at 500 Hz, 1.3 samples later, means of three; a clock that is off by a tenth of a step.
        let reading = |k: usize| ((k * 7919 + 13) % 101) as f64 / 101.0;
        let line = |t: f64| {
            let (at, share) = ((10.0 * t) as usize, (10.0 * t).fract());
            reading(at) * (1.0 - share) + reading(at + 1) * share
        };
        let clock = |k: usize| 0.002 * (k as f64 + 0.2 * (reading(k) - 0.5));
        let mean =
            |of: &dyn Fn(usize) -> f64, k: usize| (3 * k..3 * k + 3).map(of).sum::<f64>() / 3.0;
        let time: Vec<f64> = (0..700).map(|k| mean(&clock, k)).collect();
        let moved = |k: usize| line(clock(k) + 0.0026);
        let means: Vec<f64> = (0..700).map(|k| mean(&moved, k)).collect();
        let whole = 0..means.len();
        let found = own_interval(&time, &means, core::slice::from_ref(&whole));
        assert!((found - 0.1).abs() < 0.01, "{found}");
    }

    #[test]
    fn the_interval_of_an_interpolated_channel_is_found_and_a_free_one_has_none() {
        let time: Vec<f64> = (0..900).map(|k| 0.004 * f64::from(k)).collect();
        let noise = |k: usize| ((k * 7919 + 13) % 101) as f64 / 101.0 - 0.5;
        let interpolated: Vec<f64> = (0..900)
            .map(|k| {
                let (at, share) = (k / 5, (k % 5) as f64 / 5.0);
                noise(at) * (1.0 - share) + noise(at + 1) * share
            })
            .collect();
        let free: Vec<f64> = (0..900).map(noise).collect();
        let whole = core::slice::from_ref(&(0..900));
        assert!((own_interval(&time, &interpolated, whole) - 0.02).abs() < 1e-9);
        assert!(own_interval(&time, &free, whole).abs() < 1e-9);
    }
}
