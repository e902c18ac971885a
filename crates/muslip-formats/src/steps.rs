//! Times of any number, gone through once in bounded memory: how many, from when to when, at which rate, with which gaps.

use std::collections::HashMap;

use crate::raster;

/// Different steps that are counted exactly; beyond, those within 2^-20 of each other are one.
const MOST_STEPS: usize = 1 << 16;
/// Long steps that are kept until the rate tells which of them are gaps.
const MOST_LONG: usize = 1 << 16;
/// The bits of a number that steps are told apart by where there are too many of them.
const COARSE: u64 = !0 << 32;

/// What is known of times that were gone through.
#[derive(Debug, Clone)]
pub(crate) struct Steps {
    /// How many.
    pub(crate) count: u64,
    /// The first and the last in s.
    pub(crate) ends: Option<(f64, f64)>,
    /// How often each step was seen, by its bits: of positive numbers they are in the numbers' order.
    seen: HashMap<u64, u64>,
    mask: u64,
    /// Steps that may be gaps, from and to.
    long: Vec<(f64, f64)>,
}

impl Default for Steps {
    fn default() -> Self {
        Self {
            count: 0,
            ends: None,
            seen: HashMap::new(),
            mask: !0,
            long: Vec::new(),
        }
    }
}

impl Steps {
    /// Goes on to the next time.
    pub(crate) fn next(&mut self, time: f64) {
        self.count += 1;
        let Some((first, before)) = self.ends.replace((time, time)) else {
            return;
        };
        self.ends = Some((first, time));
        let step = time - before;
        *self.seen.entry(step.to_bits() & self.mask).or_insert(0) += 1;
        if self.seen.len() > MOST_STEPS && self.mask != COARSE {
            self.mask = COARSE;
            for (bits, count) in std::mem::take(&mut self.seen) {
                *self.seen.entry(bits & COARSE).or_insert(0) += count;
            }
        }
        if step > raster::GAP_S {
            self.long.push((before, time));
            if self.long.len() >= MOST_LONG {
                self.forget_short();
            }
        }
    }

    /// Leaves of the long steps those that are gaps at the rate so far, and not too many of them.
    fn forget_short(&mut self) {
        let longest = self.longest_step_s();
        self.long.retain(|(from, to)| to - from > longest);
        self.long.truncate(MOST_LONG / 2);
    }

    /// Median step in s, as [`raster::interval_s`].
    pub(crate) fn interval_s(&self) -> Option<f64> {
        let mut seen: Vec<(u64, u64)> = self.seen.iter().map(|(&bits, &n)| (bits, n)).collect();
        seen.sort_unstable();
        let middle = (self.count.checked_sub(1).filter(|&steps| steps > 0)?) / 2;
        let mut below = 0;
        let (bits, _) = seen.into_iter().find(|&(_, n)| {
            below += n;
            below > middle
        })?;
        let median = f64::from_bits(bits);
        (median.is_finite() && median > 0.0).then_some(median)
    }

    /// Readings a second, as [`raster::rate_hz`].
    pub(crate) fn rate_hz(&self) -> Option<f64> {
        let (first, last) = self.ends?;
        Some(raster::rate_of(
            self.interval_s()?,
            self.count as f64,
            last - first,
        ))
    }

    fn longest_step_s(&self) -> f64 {
        raster::longest_of(self.interval_s())
    }

    /// The first so many gaps, from and to.
    pub(crate) fn gaps(&self, most: usize) -> Vec<(f64, f64)> {
        let longest = self.longest_step_s();
        let gaps = self.long.iter().filter(|(from, to)| to - from > longest);
        gaps.take(most).copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(times: &[f64]) -> Steps {
        let mut steps = Steps::default();
        times.iter().for_each(|&time| steps.next(time));
        steps
    }

    #[test]
    fn once_through_tells_what_the_whole_list_tells() {
        let even: Vec<f64> = (0..5000).map(|k| f64::from(k) / 200.0).collect();
        let jittered: Vec<f64> = (0..200_000)
            .map(|k| f64::from(k) * 0.01 + 0.004 * (f64::from(k) * 1.7).sin())
            .collect();
        let mut gapped = even.clone();
        gapped.iter_mut().skip(2000).for_each(|time| *time += 3.0);
        for times in [&even[..], &jittered, &gapped, &[1.0, 1.5]] {
            let steps = of(times);
            let (interval, expected) = (
                steps.interval_s().unwrap(),
                raster::interval_s(times).unwrap(),
            );
            assert!(
                (interval / expected - 1.0).abs() < 2e-6,
                "{interval} {expected}"
            );
            let (rate, expected) = (steps.rate_hz().unwrap(), raster::rate_hz(times).unwrap());
            assert!((rate / expected - 1.0).abs() < 2e-6, "{rate} {expected}");
        }
        assert_eq!(of(&even).interval_s(), raster::interval_s(&even));
        assert_eq!(of(&gapped).gaps(9), [(even[1999], even[2000] + 3.0)]);
        assert!(of(&even).gaps(9).is_empty());
        assert_eq!((of(&[]).rate_hz(), of(&[1.0]).rate_hz()), (None, None));
    }

    #[test]
    fn a_slow_channel_s_steps_are_no_gaps_however_many_there_are() {
        let mut slow: Vec<f64> = (0..150_000).map(f64::from).collect();
        slow.iter_mut().skip(100_000).for_each(|time| *time += 20.0);
        assert_eq!(of(&slow).gaps(9), [(99_999.0, 100_020.0)]);
    }
}
