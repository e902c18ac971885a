//! Adaptive smoothing of a measured channel: a local quadratic over the widest window that the data
//! do not contradict (intersection of confidence intervals: Goldenshluger & Nemirovski 1997,
//! Katkovnik 1999). Slip computed from raw speeds carries enough noise to make any causal filter look
//! like physics (a "lag" merely averages it), so every model runs on smoothed inputs.

use core::ops::Range;

use pulp::{Arch, Simd, WithSimd};

/// Window half-widths tried, in samples.
const HALF_WIDTHS: [usize; 17] = [
    1, 2, 3, 4, 6, 8, 11, 15, 20, 27, 36, 48, 64, 85, 113, 150, 200,
];
/// Half-width of the confidence intervals that must intersect, in standard deviations.
const CONFIDENCE: f64 = 2.6;

/// A channel after smoothing.
#[derive(Clone, Debug, Default)]
pub struct Smoothed {
    /// Smoothed value, in the channel's unit.
    pub value: Vec<f64>,
    /// Its time derivative, in the channel's unit per second.
    pub rate: Vec<f64>,
    /// Variance of the smoothed value as a share of the channel's noise variance, 0..=1.
    pub variance_share: Vec<f64>,
}

/// Standard deviation of normal noise over the median of its sizes.
pub const SIGMA_PER_MAD: f64 = 1.4826;

/// Standard deviation of a channel's white noise from its third differences, robust to transients.
///
/// Missing values (`NaN`) are passed over. Zero where the channel is exactly smooth.
#[must_use]
pub fn difference_sigma(values: &[f64]) -> f64 {
    let mut differences: Vec<f64> = values
        .windows(4)
        .map(|w| (w[0] - 3.0 * w[1] + 3.0 * w[2] - w[3]).abs())
        .filter(|d| d.is_finite())
        .collect();
    if differences.is_empty() {
        return 0.0;
    }
    let median = median_in_place(&mut differences);
    if median > 0.0 {
        SIGMA_PER_MAD * median / 20f64.sqrt()
    } else {
        // More than half of the differences vanish (a coarse quantum or a held value): what is left
        // of the noise shows in the mean square without the largest two percent.
        let keep = differences.len() - differences.len() / 50;
        differences.sort_by(f64::total_cmp);
        let sum: f64 = differences[..keep].iter().map(|d| d * d).sum();
        (sum / keep.max(1) as f64 / 20.0).sqrt()
    }
}

/// Least share of samples on a straight line between their neighbours in a channel that was counted or held.
const DRAWN: f64 = 0.25;
/// Share of a large bend up to which a sample is on a straight line.
const STRAIGHT: f64 = 0.02;
/// Longest means in s by which noise with a memory is heard.
const LONGEST_MEAN_S: f64 = 0.0125;

/// By how much a sample lies off the straight line between its neighbours, twice, however uneven the time between them is.
#[must_use]
pub fn bend(time: &[f64], x: &[f64], k: usize) -> f64 {
    let slope = |k: usize| (x[k + 1] - x[k]) / (time[k + 1] - time[k]);
    ((slope(k) - slope(k - 1)) * 0.5 * (time[k + 1] - time[k - 1])).abs()
}

/// Whether many samples lie on straight lines: readings that were held or counted say the same several times, and so do
/// lines between them.
fn is_drawn(time: &[f64], values: &[f64]) -> bool {
    let inner = 1..values.len().saturating_sub(1);
    let bends = inner.map(|k| bend(time, values, k));
    let mut bends: Vec<f64> = bends.filter(|b| b.is_finite()).collect();
    if bends.is_empty() {
        return false;
    }
    let at = bends.len() * 9 / 10;
    let large = *bends.select_nth_unstable_by(at, f64::total_cmp).1;
    let straight = bends.iter().filter(|b| **b <= STRAIGHT * large);
    large > 0.0 && straight.count() as f64 > DRAWN * bends.len() as f64
}

/// Standard deviation of the white noise that is as large over a smoother's window as a channel's own. Readings that were
/// held or counted, or lines between them, err alike for several samples: their noise is that of means, times the root of
/// how many samples each is of, as far as that grows.
#[must_use]
pub fn noise_sigma(time: &[f64], values: &[f64], step_s: f64) -> f64 {
    let fine = difference_sigma(values);
    if !is_drawn(time, values) {
        return fine;
    }
    let of_means = |samples: usize| {
        let means: Vec<f64> = values
            .chunks_exact(samples)
            .map(|own| own.iter().sum::<f64>() / samples as f64)
            .collect();
        difference_sigma(&means) * (samples as f64).sqrt()
    };
    // Fewer than four means have no third difference.
    (2..=values.len() / 4)
        .take_while(|samples| *samples as f64 * step_s <= LONGEST_MEAN_S)
        .map(of_means)
        .fold(fine, f64::max)
}

/// Median step from one time to the next. `NaN` for fewer than two.
pub fn median_step(time: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
    median_in_place(&mut steps)
}

/// Median; reorders its argument. `NaN` for an empty slice.
pub fn median_in_place(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Smooths `values` inside each segment; `sigma` is the channel's noise, `reach_s[k]` the largest
/// half-window at sample `k` in seconds.
#[must_use]
pub fn smooth(
    time: &[f64],
    values: &[f64],
    segments: &[Range<usize>],
    sigma: f64,
    reach_s: &[f64],
) -> Smoothed {
    Arch::new().dispatch(Smoothing {
        time,
        values,
        segments,
        sigma,
        reach_s,
    })
}

/// What is smoothed, on the widest registers that there are.
struct Smoothing<'a> {
    time: &'a [f64],
    values: &'a [f64],
    segments: &'a [Range<usize>],
    sigma: f64,
    reach_s: &'a [f64],
}

impl WithSimd for Smoothing<'_> {
    type Output = Smoothed;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Smoothed {
        let n = self.values.len();
        let mut out = Smoothed {
            value: self.values.to_vec(),
            rate: vec![0.0; n],
            variance_share: vec![1.0; n],
        };
        for segment in self.segments {
            let own = segment.clone();
            let (time, values) = (&self.time[own.clone()], &self.values[own.clone()]);
            for (place, k) in own.enumerate() {
                let local = local_fit(time, values, place, self.sigma, self.reach_s[k]);
                out.value[k] = local.value;
                out.rate[k] = local.rate;
                out.variance_share[k] = local.variance_share;
            }
        }
        out
    }
}

#[derive(Clone, Copy)]
struct Local {
    value: f64,
    rate: f64,
    variance_share: f64,
}

/// Sums that are taken side by side.
const LANES: usize = 4;

/// Moments of the window grown outwards from one sample: sums of u, u², u³, u⁴, x, u x and u² x over offsets in time and value.
struct Moments {
    count: f64,
    sums: [f64; 7],
    time: f64,
    value: f64,
    /// Of an offset in time, 1/s.
    scale: f64,
}

impl Moments {
    #[inline(always)]
    fn terms(&self, time: f64, value: f64) -> [f64; 7] {
        let (u, x) = ((time - self.time) * self.scale, value - self.value);
        let square = u * u;
        [u, square, square * u, square * square, x, u * x, square * x]
    }

    #[inline(always)]
    fn take(&mut self, time: &[f64], values: &[f64]) {
        self.count += time.len() as f64;
        let mut lanes = [[0.0; LANES]; 7];
        let (times, values) = (time.chunks_exact(LANES), values.chunks_exact(LANES));
        for (t, x) in times.remainder().iter().zip(values.remainder()) {
            let terms = self.terms(*t, *x);
            for (sum, term) in self.sums.iter_mut().zip(terms) {
                *sum += term;
            }
        }
        for (t, x) in times.zip(values) {
            for lane in 0..LANES {
                let terms = self.terms(t[lane], x[lane]);
                for (sums, term) in lanes.iter_mut().zip(terms) {
                    sums[lane] += term;
                }
            }
        }
        for (sum, [a, b, c, d]) in self.sums.iter_mut().zip(lanes) {
            *sum += (a + b) + (c + d);
        }
    }

    /// Local quadratic (local line with fewer than five points) at offset zero.
    #[inline(always)]
    fn solve(&self) -> Option<Local> {
        let n = self.count;
        let [u1, u2, u3, u4, x0, x1, x2] = self.sums;
        let (value, rate, variance_share) = if n >= 5.0 {
            let c00 = u2 * u4 - u3 * u3;
            let c01 = u2 * u3 - u1 * u4;
            let c02 = u1 * u3 - u2 * u2;
            let determinant = n * c00 + u1 * c01 + u2 * c02;
            if determinant <= 1e-12 * n * u2 * u4 {
                return None;
            }
            let c11 = n * u4 - u2 * u2;
            let c12 = u1 * u2 - n * u3;
            let inverse = determinant.recip();
            (
                (c00 * x0 + c01 * x1 + c02 * x2) * inverse,
                (c01 * x0 + c11 * x1 + c12 * x2) * inverse,
                c00 * inverse,
            )
        } else {
            let determinant = n * u2 - u1 * u1;
            if determinant <= 1e-12 * n * u2 || n < 2.0 {
                return None;
            }
            let inverse = determinant.recip();
            (
                (u2 * x0 - u1 * x1) * inverse,
                (n * x1 - u1 * x0) * inverse,
                u2 * inverse,
            )
        };
        Some(Local {
            value: self.value + value,
            rate: rate * self.scale,
            variance_share,
        })
    }
}

/// The fit about sample `k` of one segment.
#[inline(always)]
fn local_fit(time: &[f64], values: &[f64], k: usize, sigma: f64, reach_s: f64) -> Local {
    let (at, value) = (time[k], values[k]);
    let mut best = Local {
        value,
        rate: 0.0,
        variance_share: 1.0,
    };
    let last = time.len() - 1;
    let mut moments = Moments {
        count: 1.0,
        sums: [0.0; 7],
        time: at,
        value,
        scale: 1.0 / (time[(k + 1).min(last)] - time[k.saturating_sub(1)]).max(1e-9),
    };
    // How many samples before and after it lie within reach.
    let most = HALF_WIDTHS[HALF_WIDTHS.len() - 1];
    let first = k.saturating_sub(most);
    let before = k - first - time[first..k].partition_point(|t| at - t > reach_s);
    let after = time[k + 1..(k + 1 + most).min(time.len())].partition_point(|t| t - at <= reach_s);
    let (mut low, mut high) = (value - CONFIDENCE * sigma, value + CONFIDENCE * sigma);
    let (mut behind, mut ahead) = (0, 0);
    let mut has_rate = false;
    for half_width in HALF_WIDTHS {
        let (to_behind, to_ahead) = (half_width.min(before), half_width.min(after));
        if (to_behind, to_ahead) == (behind, ahead) {
            break;
        }
        for grown in [k - to_behind..k - behind, k + 1 + ahead..k + 1 + to_ahead] {
            moments.take(&time[grown.clone()], &values[grown]);
        }
        (behind, ahead) = (to_behind, to_ahead);
        let Some(local) = moments.solve() else {
            continue;
        };
        if local.variance_share >= 1.0 {
            if !has_rate {
                best.rate = local.rate;
                has_rate = true;
            }
            continue;
        }
        let margin = CONFIDENCE * sigma * local.variance_share.sqrt();
        low = low.max(local.value - margin);
        high = high.min(local.value + margin);
        if low > high {
            if !has_rate {
                best.rate = local.rate;
            }
            break;
        }
        best = local;
        has_rate = true;
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    fn noisy(sigma: f64, truth: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let normal = Normal::new(0.0, sigma).unwrap();
        let time: Vec<f64> = (0..2000).map(|k| f64::from(k) * 0.002).collect();
        let clean: Vec<f64> = time.iter().map(|&t| truth(t)).collect();
        let measured = clean.iter().map(|c| c + normal.sample(&mut rng)).collect();
        (time, clean, measured)
    }

    #[test]
    fn noise_level_is_read_off_third_differences() {
        let (_, _, measured) = noisy(0.15, |t| 60.0 + 20.0 * (3.0 * t).sin());
        assert!((difference_sigma(&measured) - 0.15).abs() < 0.01);
    }

    #[test]
    fn lines_between_noisy_readings_are_as_noisy_as_the_readings_over_a_window() {
        let (time, _, white) = noisy(0.15, |t| 60.0 + 20.0 * (3.0 * t).sin());
        // Every fourth reading held, and lines between these: over a window twice the std of one reading.
        let held: Vec<f64> = (0..white.len()).map(|k| white[k / 4 * 4]).collect();
        let lines: Vec<f64> = (0..white.len() - 4)
            .map(|k| {
                let share = (k % 4) as f64 / 4.0;
                white[k / 4 * 4] * (1.0 - share) + white[k / 4 * 4 + 4] * share
            })
            .collect();
        for drawn in [held, lines] {
            let (own, fine) = (
                noise_sigma(&time[..drawn.len()], &drawn, 0.002),
                difference_sigma(&drawn),
            );
            // Means of six samples hold most of it.
            assert!(
                (0.2..0.33).contains(&own) && own > 1.3 * fine,
                "{own} {fine}"
            );
        }
        // What is neither is as before.
        assert!((noise_sigma(&time, &white, 0.002) - difference_sigma(&white)).abs() < 1e-15);
    }

    #[test]
    fn smoothing_cuts_noise_and_keeps_a_step() {
        let (time, clean, measured) = noisy(0.15, |t| {
            if t < 2.0 {
                60.0
            } else {
                60.0 - 400.0 * (t - 2.0).min(0.1)
            }
        });
        let reach = vec![0.05; time.len()];
        let all = 0..time.len();
        let s = smooth(&time, &measured, &[all], 0.15, &reach);
        let rms = |from: usize, to: usize| {
            let sum: f64 = (from..to).map(|k| (s.value[k] - clean[k]).powi(2)).sum();
            (sum / (to - from) as f64).sqrt()
        };
        assert!(rms(100, 900) < 0.06, "quiet part {}", rms(100, 900));
        assert!(rms(980, 1070) < 0.16, "transition {}", rms(980, 1070));
        assert!((s.rate[1025] + 400.0).abs() < 25.0, "rate {}", s.rate[1025]);
    }
}
