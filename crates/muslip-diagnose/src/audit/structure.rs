//! Noise with a memory, read off second differences: of one series, or the part that two series share.
//!
//! Half the mean of the product of two series' second differences over a lag is three times the variance of what is
//! white in both, and for a shared part of variance c² and time constant T it grows as c² (3 − 4 exp(−l/T) + exp(−2l/T)).
//! Whatever runs straight has none; a motion that bends shows by the fourth power of the lag, and one that breaks off, as a
//! ramp's end, by differences that no noise has. Means over a width l₀ have
//! the covariance of means: 2 (x − 1 + exp(−x)) / x² of the variance at no lag, (2 sinh(x/2) / x)² of it beyond, x = l₀/T.

use super::constants::{
    LONGEST_COLOUR_S, MEMORY_BLOCK_S, MEMORY_BREAK_SIGMAS, MEMORY_GROUPS, MEMORY_LAGS,
    MEMORY_MOTION_S, MEMORY_SIGMAS, MEMORY_TIMES,
};
use crate::smooth::{SIGMA_PER_MAD, median_in_place};
use nalgebra::{Matrix3, Vector3};

/// Two series on one even grid; products are multiplied by a weight of their own.
#[derive(Clone, Debug, Default)]
pub struct Pair {
    /// First series.
    pub a: Vec<f64>,
    /// Second series.
    pub b: Vec<f64>,
    /// Factor on the product at each point.
    pub factor: Vec<f64>,
    /// What blocks are ranked by, at each point: as many rankings as wanted.
    pub levels: Vec<Vec<f64>>,
}

/// What two series share.
#[derive(Clone, Copy, Debug)]
pub struct Memory {
    /// Variance of the shared part that lasts.
    pub variance: f64,
    /// Its standard deviation.
    pub std: f64,
    /// Its time constant in s.
    pub time: f64,
    /// How fast it wanders, variance over time constant, and that figure's standard deviation: the two are known worse
    /// than what the shortest lags show of both.
    pub rate: (f64, f64),
    /// Variance of the shared part that is white.
    pub white: f64,
}

impl Memory {
    /// Standard deviation of the noise, and that figure's own.
    #[must_use]
    pub fn size(&self) -> (f64, f64) {
        let size = self.variance.max(0.0).sqrt();
        (size, 0.5 * self.std / size.max(1e-300))
    }

    /// Whether it is beyond chance.
    #[must_use]
    pub fn is_sure(&self) -> bool {
        self.rate.0 > MEMORY_SIGMAS * self.rate.1 && self.variance > 0.0
    }
}

/// Sums of products over blocks, by lag.
#[derive(Clone, Debug, Default)]
pub struct Structure {
    lags: Vec<usize>,
    step: f64,
    /// Width of the means that the series are made of, s.
    width: f64,
    blocks: Vec<Sums>,
}

/// What a structure is made of beside motion.
#[derive(Clone, Copy, Debug)]
struct Parts {
    white: f64,
    lasting: f64,
    time: f64,
}

impl Parts {
    fn rate(&self) -> f64 {
        self.lasting / self.time
    }
}

/// Shares of three columns, none negative, that leave the least of what is fitted; and what they explain of it.
fn non_negative(gram: &Matrix3<f64>, pull: &Vector3<f64>) -> (Vector3<f64>, f64) {
    let mut best = (Vector3::zeros(), 0.0);
    for chosen in 1..8_usize {
        let with = |i: usize| chosen >> i & 1 == 1;
        if (0..3).any(|i| with(i) && !(gram[(i, i)] > 0.0)) {
            continue;
        }
        // Scaled to ones on the diagonal; a column that is left out stands by itself.
        let scale = Vector3::from_fn(|i, _| {
            if with(i) {
                gram[(i, i)].sqrt().recip()
            } else {
                0.0
            }
        });
        let scaled = Matrix3::from_fn(|i, j| {
            let alone = if i == j && !with(i) { 1.0 } else { 0.0 };
            scale[i] * gram[(i, j)] * scale[j] + alone
        });
        let Some(factor) = scaled.cholesky() else {
            continue;
        };
        let shares = factor
            .solve(&pull.component_mul(&scale))
            .component_mul(&scale);
        let gain = shares.dot(pull);
        if shares.iter().all(|s| *s >= 0.0 && s.is_finite()) && gain > best.1 {
            best = (shares, gain);
        }
    }
    best
}

#[derive(Clone, Debug, Default)]
struct Sums {
    /// Of each lag: products, squares of the first series, of the second, number.
    lags: Vec<[f64; 4]>,
    /// Whether a motion breaks off within it, by lag: that says nothing of noise.
    breaks_off: Vec<bool>,
    levels: Vec<f64>,
    series: usize,
}

/// The second difference of a series over a lag about a place.
fn second_difference(x: &[f64], k: usize, lag: usize) -> f64 {
    x[k + lag] - 2.0 * x[k] + x[k - lag]
}

/// Places of a series of so many values that have a second difference over a lag.
fn places(count: usize, lag: usize) -> core::ops::Range<usize> {
    lag..count.saturating_sub(lag)
}

/// Size of a second difference as its product counts, with the factor on that.
fn size_of(difference: f64, factor: f64) -> f64 {
    difference.abs() * factor.abs().sqrt()
}

/// Size beyond which a second difference over a lag is that of a motion that breaks off.
fn size_of_breaks(pairs: &[Pair], lag: usize, pick: fn(&Pair) -> &[f64]) -> f64 {
    let mut sizes: Vec<f64> = pairs
        .iter()
        .flat_map(|pair| {
            let x = pick(pair);
            // Neighbours say the same over a long lag.
            let apart = places(x.len(), lag).step_by(lag.div_ceil(4));
            let counts = apart.filter(|k| pair.factor[*k] != 0.0);
            counts.map(move |k| size_of(second_difference(x, k, lag), pair.factor[k]))
        })
        .collect();
    let usual = median_in_place(&mut sizes);
    // Of a channel that hardly moves whatever does would break off.
    if usual > 0.0 {
        MEMORY_BREAK_SIGMAS * SIGMA_PER_MAD * usual
    } else {
        f64::INFINITY
    }
}

/// Sums over all series on grids of a step, of means over a width (both in s), from a lag of so many steps to one in s.
#[must_use]
pub fn structure(
    pairs: &[Pair],
    (step, width): (f64, f64),
    (shortest, longest_s): (usize, f64),
) -> Structure {
    let longest = ((longest_s / step) as usize).max(shortest + 4);
    let mut lags: Vec<usize> = (0..MEMORY_LAGS)
        .map(|i| {
            let share = i as f64 / (MEMORY_LAGS - 1) as f64;
            (shortest as f64 * (longest as f64 / shortest as f64).powf(share)).round() as usize
        })
        .collect();
    lags.dedup();
    let breaks: Vec<[f64; 2]> = lags
        .iter()
        .map(|&lag| {
            let of = |pick: fn(&Pair) -> &[f64]| size_of_breaks(pairs, lag, pick);
            [of(|pair| &pair.a), of(|pair| &pair.b)]
        })
        .collect();
    let length = ((MEMORY_BLOCK_S / step) as usize).max(8);
    let mut blocks = Vec::new();
    for (series, pair) in pairs.iter().enumerate() {
        let n = pair.a.len();
        for start in (0..n).step_by(length) {
            let end = (start + length).min(n);
            let mut sums = Sums {
                lags: vec![[0.0; 4]; lags.len()],
                breaks_off: vec![false; lags.len()],
                levels: pair
                    .levels
                    .iter()
                    .map(|level| level[start..end].iter().copied().fold(0.0, f64::max))
                    .collect(),
                series,
            };
            let of_lags = sums.lags.iter_mut().zip(&mut sums.breaks_off);
            for ((sum, breaks_off), (&lag, &[most_a, most_b])) in
                of_lags.zip(lags.iter().zip(&breaks))
            {
                let all = places(n, lag);
                for k in start.max(all.start)..end.min(all.end) {
                    let [a, b] = [&pair.a, &pair.b].map(|x| second_difference(x, k, lag));
                    let f = pair.factor[k];
                    sum[0] += 0.5 * a * b * f;
                    sum[1] += 0.5 * a * a * f;
                    sum[2] += 0.5 * b * b * f;
                    sum[3] += 1.0;
                    *breaks_off |= size_of(a, f) > most_a || size_of(b, f) > most_b;
                }
            }
            blocks.push(sums);
        }
    }
    Structure {
        lags,
        step,
        width,
        blocks,
    }
}

impl Structure {
    /// The part of it whose blocks are, in a ranking, among the lowest share of all.
    #[must_use]
    pub fn calmest(&self, ranking: usize, share: f64) -> Self {
        let mut levels: Vec<f64> = self.blocks.iter().map(|b| b.levels[ranking]).collect();
        levels.sort_by(f64::total_cmp);
        let most = levels
            .get((share * levels.len() as f64) as usize)
            .copied()
            .unwrap_or(f64::INFINITY);
        Self {
            blocks: self
                .blocks
                .iter()
                .filter(|b| b.levels[ranking] <= most)
                .cloned()
                .collect(),
            ..self.clone()
        }
    }

    /// How much moves in each block at a short lag, blocks as far around as a lag reaches taken together.
    fn motions(&self, lag: usize) -> Vec<f64> {
        let place = self
            .lags
            .iter()
            .position(|l| *l as f64 * self.step >= MEMORY_MOTION_S)
            .unwrap_or(0);
        let own: Vec<[f64; 4]> = self.blocks.iter().map(|b| b.lags[place]).collect();
        let reach = (lag as f64 * self.step / MEMORY_BLOCK_S).ceil() as usize;
        (0..own.len())
            .map(|k| {
                let (from, to) = (k.saturating_sub(reach), (k + reach + 1).min(own.len()));
                let (mut a, mut b, mut n) = (0.0, 0.0, 0.0);
                for i in (from..to).filter(|&i| self.blocks[i].series == self.blocks[k].series) {
                    a += own[i][1];
                    b += own[i][2];
                    n += own[i][3];
                }
                f64::max(a * b, 0.0).sqrt() / f64::max(n, 1.0)
            })
            .collect()
    }

    /// Products by lag with each block's weight: blocks in which much moves count little, and those in which a motion
    /// breaks off, unless they are asked for, nothing.
    fn weighed(&self, with_breaks: bool) -> Vec<Vec<[f64; 3]>> {
        self.lags
            .iter()
            .enumerate()
            .map(|(i, &lag)| {
                let motions = self.motions(lag);
                let counts = |b: &Sums| b.lags[i][3] > 0.0 && (with_breaks || !b.breaks_off[i]);
                let usual = middle(
                    motions
                        .iter()
                        .zip(&self.blocks)
                        .filter(|(_, b)| counts(b))
                        .map(|(m, _)| *m),
                );
                self.blocks
                    .iter()
                    .zip(&motions)
                    .map(|(block, motion)| {
                        let s = &block.lags[i];
                        let weight = (usual + motion).powi(-2);
                        if !counts(block) || !weight.is_finite() {
                            return [0.0; 3];
                        }
                        [
                            weight * s[0],
                            weight * f64::max(s[1] * s[2], 0.0).sqrt(),
                            weight * s[3],
                        ]
                    })
                    .collect()
            })
            .collect()
    }

    /// Lag in s, mean product and mean size by lag, one group of blocks left out.
    fn means(&self, weighed: &[Vec<[f64; 3]>], without: Option<usize>) -> Vec<(f64, f64, f64)> {
        let group = self.blocks.len().div_ceil(MEMORY_GROUPS).max(1);
        self.lags
            .iter()
            .zip(weighed)
            .filter_map(|(&lag, blocks)| {
                let mut sums = [0.0; 3];
                for (k, block) in blocks.iter().enumerate() {
                    if without != Some(k / group) {
                        for (sum, x) in sums.iter_mut().zip(block) {
                            *sum += x;
                        }
                    }
                }
                (sums[2] > 0.0)
                    .then(|| (lag as f64 * self.step, sums[0] / sums[2], sums[1] / sums[2]))
            })
            .collect()
    }

    /// The parts that fit best.
    fn fit(&self, means: &[(f64, f64, f64)], white: bool) -> Option<Parts> {
        let mut best: Option<(Parts, f64)> = None;
        let longest = LONGEST_COLOUR_S.min(means.last()?.0);
        let shortest = 0.8 * self.step.max(0.008);
        for i in 0..MEMORY_TIMES {
            let share = i as f64 / (MEMORY_TIMES - 1) as f64;
            let time = shortest * (longest / shortest).max(1.0).powf(share);
            let (mut gram, mut pull) = (Matrix3::zeros(), Vector3::zeros());
            for &(lag, x, size) in means {
                let weight = (size * size * lag).max(1e-300).recip();
                let flat = if white { 3.0 } else { 0.0 };
                let column = Vector3::new(flat, self.growth(lag, time), (lag / longest).powi(4));
                gram += weight * column * column.transpose();
                pull += weight * x * column;
            }
            let (shares, gain) = non_negative(&gram, &pull);
            if best.as_ref().is_none_or(|b| gain > b.1) {
                let parts = Parts {
                    white: shares[0],
                    lasting: shares[1],
                    time,
                };
                best = Some((parts, gain));
            }
        }
        best.map(|b| b.0)
    }

    /// What noise of variance one and a time constant has at a lag.
    fn growth(&self, lag: f64, time: f64) -> f64 {
        let x = self.width / time;
        let (own, beyond) = if x > 1e-3 {
            let half = (0.5 * x).sinh() / (0.5 * x);
            (2.0 * (x - 1.0 + (-x).exp()) / (x * x), half * half)
        } else {
            (1.0, 1.0)
        };
        let decay = (-lag / time).exp();
        3.0 * own - beyond * (4.0 * decay - decay * decay)
    }

    /// What lasts in it; `white` where the series may share white noise as well.
    #[must_use]
    pub fn memory(&self, white: bool) -> Option<Memory> {
        if self.blocks.len() < 2 * MEMORY_GROUPS {
            return None;
        }
        let weighed = self.weighed(false);
        let all = self.fit(&self.means(&weighed, None), white)?;
        let others: Vec<Parts> = (0..MEMORY_GROUPS)
            .filter_map(|g| self.fit(&self.means(&weighed, Some(g)), white))
            .collect();
        // One group left out in turn (jackknife).
        let spread = |figure: fn(&Parts) -> f64| {
            let count = others.len() as f64;
            let mean = others.iter().map(figure).sum::<f64>() / count;
            let squares = others.iter().map(|p| (figure(p) - mean).powi(2));
            (squares.sum::<f64>() * (count - 1.0) / count).sqrt()
        };
        Some(Memory {
            variance: all.lasting,
            std: spread(|p| p.lasting),
            time: all.time,
            rate: (all.rate(), spread(Parts::rate)),
            white: all.white,
        })
    }

    /// Mean product of all that moves at the lag nearest to one in s.
    #[must_use]
    pub fn at(&self, lag_s: f64) -> f64 {
        self.nearest(lag_s).map_or(0.0, |(_, product, _)| product)
    }

    /// Mean size of these products.
    #[must_use]
    pub fn size_at(&self, lag_s: f64) -> f64 {
        self.nearest(lag_s).map_or(0.0, |(_, _, size)| size)
    }

    /// Means at the lag nearest to one in s.
    fn nearest(&self, lag_s: f64) -> Option<(f64, f64, f64)> {
        let all = self.means(&self.weighed(true), None).into_iter();
        all.min_by(|a, b| (a.0 - lag_s).abs().total_cmp(&(b.0 - lag_s).abs()))
    }
}

/// Median of a series' sizes, for a factor that shall not depend on outliers.
#[must_use]
pub fn middle(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    median_in_place(&mut values)
}

#[cfg(test)]
mod tests {
    use super::super::toy::white;
    use super::*;

    /// Nearly normal, of variance one: the sum of four.
    fn noise(white: &mut impl Iterator<Item = f64>) -> f64 {
        white.by_ref().take(4).map(|x| 3f64.sqrt() * x).sum()
    }

    fn pair(shared: f64, count: usize) -> Pair {
        let (mut white, mut x) = (white(5), 0.0);
        let keep = (-0.005f64 / 0.05).exp();
        let fresh = (1.0 - keep * keep).sqrt();
        let (mut a, mut b) = (Vec::new(), Vec::new());
        for k in 0..count {
            x = keep * x + fresh * noise(&mut white);
            a.push(shared * x + noise(&mut white) + 0.1 * k as f64);
            b.push(shared * x + noise(&mut white));
        }
        Pair {
            a,
            b,
            factor: vec![1.0; count],
            levels: Vec::new(),
        }
    }

    #[test]
    fn what_two_series_share_is_found_and_what_they_do_not_is_not() {
        let found = structure(&[pair(0.7, 12_000)], (0.005, 0.0), (1, 0.3))
            .memory(false)
            .unwrap();
        let (size, std) = found.size();
        assert!(
            found.is_sure() && (size - 0.7).abs() < 3.0 * std.max(0.02),
            "{found:?}"
        );
        assert!((found.time / 0.05).ln().abs() < 0.4, "{found:?}");
        let none = structure(&[pair(0.0, 12_000)], (0.005, 0.0), (1, 0.3));
        assert!(!none.memory(false).unwrap().is_sure());
        assert!(
            structure(&[], (0.005, 0.0), (1, 0.3))
                .memory(false)
                .is_none()
        );
    }

    #[test]
    fn a_motion_that_bends_is_no_memory_and_hides_none() {
        let bent = |shared: f64| {
            let mut one = pair(shared, 12_000);
            for (k, x) in one.a.iter_mut().enumerate() {
                *x += 100.0 * (k as f64 * 0.005 * 0.7).sin();
            }
            one.b = one.a.clone();
            structure(&[one], (0.005, 0.0), (1, 0.5))
                .memory(true)
                .unwrap()
        };
        assert!(!bent(0.0).is_sure(), "{:?}", bent(0.0));
        assert!(
            (bent(2.0).variance.sqrt() - 2.0).abs() < 0.4,
            "{:?}",
            bent(2.0)
        );
    }

    #[test]
    fn a_motion_that_breaks_off_is_no_memory_and_hides_none() {
        // A speed that is held, and changed along a ramp four times in a minute.
        let ramped = |shared: f64| {
            let mut one = pair(shared, 12_000);
            let mut held = 0.0;
            for (k, x) in one.a.iter_mut().enumerate() {
                if k % 3000 > 2000 && k % 3000 < 2200 {
                    held += 0.5;
                }
                *x += held;
            }
            one.b = one.a.clone();
            let all = structure(&[one], (0.005, 0.0), (1, 0.5));
            all.memory(true).unwrap()
        };
        assert!(!ramped(0.0).is_sure(), "{:?}", ramped(0.0));
        let size = ramped(2.0).size().0;
        assert!((size - 2.0).abs() < 0.4, "{size}");
    }

    #[test]
    fn means_over_a_width_show_the_noise_itself() {
        // Means over twenty steps of a noise that forgets within ten.
        let mut one = pair(2.0, 120_000);
        let means = one.a.chunks_exact(20).map(|c| c.iter().sum::<f64>() / 20.0);
        one.a = means.collect();
        one.b = one.a.clone();
        one.factor.truncate(one.a.len());
        let found = structure(&[one], (0.1, 0.1), (1, 1.0))
            .memory(false)
            .unwrap();
        assert!((found.variance.sqrt() - 2.0).abs() < 0.25, "{found:?}");
    }

    #[test]
    fn a_series_own_memory_is_told_from_its_white_noise() {
        let mut one = pair(2.0, 12_000);
        one.b = one.a.clone();
        let found = structure(&[one], (0.005, 0.0), (1, 0.5))
            .memory(true)
            .unwrap();
        assert!((found.variance.sqrt() - 2.0).abs() < 0.25, "{found:?}");
        assert!((found.white - 1.0).abs() < 0.25, "{found:?}");
        let mut white = pair(0.0, 12_000);
        white.b = white.a.clone();
        assert!(
            !structure(&[white], (0.005, 0.0), (1, 0.5))
                .memory(true)
                .unwrap()
                .is_sure()
        );
    }
}
