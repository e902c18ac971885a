//! Noise from the data: how large, how coloured, and where. Models are compared on whitened
//! innovations only, or slow noise would be read as physics.

use core::ops::Range;

use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Longest autoregression tried.
const MAX_ORDER: usize = 6;
/// The same for means over blocks, of which there are few.
const MAX_BLOCK_ORDER: usize = 10;
/// Residuals are clipped at this many standard deviations before the autoregression is fitted.
const CLIP: f64 = 3.5;
/// Innovations beyond this many standard deviations count linearly (Huber 1964).
pub const HUBER: f64 = 2.2;

/// Size of the tyre residual's noise by what it depends on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NoiseSize {
    /// Variance at rest in N², and the shares of the squared force and of the squared noise that slip brings
    /// into the force.
    pub parts: [f64; 3],
    /// Least variance in N².
    pub least: f64,
    /// Standard deviation in N where the parts say nothing.
    pub typical: f64,
}

impl NoiseSize {
    /// Standard deviation of one sample in N, from the force and from what slip noise does to it, both in N.
    #[must_use]
    pub fn sigma(&self, force: f64, slip_noise: f64) -> f64 {
        let [constant, force_share, slip_share] = self.parts;
        let variance = constant + force_share * force.powi(2) + slip_share * slip_noise.powi(2);
        if variance.is_finite() {
            variance.max(self.least).sqrt()
        } else {
            self.typical
        }
    }
}

/// A stationary noise model: d = (1 − θB)/(1 − Σ aᵢBⁱ) e with white e of standard deviation `sigma`, for means d
/// of `block` samples.
///
/// `theta` is the moving-average root that differencing a noisy speed leaves behind; it is zero for
/// the tyre balance. Wheel and vehicle are judged on means over several samples: sample by sample the noise of a
/// differenced speed drowns the slow noise that any effect has to be told from, and no short autoregression
/// describes both.
#[derive(Clone, Debug)]
pub struct Whitener {
    /// Samples that are averaged before anything else, at least one.
    pub block: usize,
    /// Moving-average root, 0..1.
    pub theta: f64,
    /// Autoregressive coefficients.
    pub ar: Vec<f64>,
    /// Standard deviation of the innovations.
    pub sigma: f64,
}

impl Whitener {
    /// White noise of unit variance.
    #[must_use]
    pub fn unit() -> Self {
        Self {
            block: 1,
            theta: 0.0,
            ar: Vec::new(),
            sigma: 1.0,
        }
    }

    /// Number of innovations that `apply` yields for these segments.
    #[must_use]
    pub fn count(&self, segments: &[Range<usize>]) -> usize {
        segments
            .iter()
            .map(|s| self.averages(s.len()).saturating_sub(self.ar.len()))
            .sum()
    }

    /// Appends the innovations of `x` (in units of `sigma`) to `out`, segment by segment; the first
    /// samples of a segment are conditioned on.
    pub fn apply(&self, x: &[f64], segments: &[Range<usize>], out: &mut Vec<f64>) {
        let order = self.ar.len();
        let scale = 1.0 / self.sigma;
        let mut moving = Vec::new();
        let mut means = Vec::new();
        for segment in segments {
            let mut part = &x[segment.clone()];
            if self.block > 1 {
                self.average(part, &mut means);
                part = &means;
            }
            if part.len() <= order {
                continue;
            }
            let u = if self.theta == 0.0 {
                part
            } else {
                let mut previous = 0.0;
                moving.clear();
                moving.extend(part.iter().map(|value| {
                    previous = value + self.theta * previous;
                    previous
                }));
                &moving[..]
            };
            // One pass a coefficient: each is a plain sum of two slices, which the compiler vectorises.
            let from = out.len();
            out.extend(u[order..].iter().map(|v| v * scale));
            let tail = &mut out[from..];
            for (i, a) in self.ar.iter().enumerate() {
                let share = a * scale;
                for (e, h) in tail.iter_mut().zip(&u[order - 1 - i..]) {
                    *e -= share * h;
                }
            }
            if self.theta > 0.0 {
                self.forget_start(tail);
            }
        }
    }

    /// Number of averages of a segment of so many samples.
    #[must_use]
    pub fn averages(&self, samples: usize) -> usize {
        if self.block > 1 {
            (samples / self.block).saturating_sub(1)
        } else {
            samples
        }
    }

    /// Averages with triangular weights two blocks wide, one a block: the imbalance of a differenced speed becomes
    /// that of the difference of its means over two blocks, and no sample of the speed is lost.
    fn average(&self, x: &[f64], out: &mut Vec<f64>) {
        out.clear();
        let m = self.block;
        let share = 1.0 / (m * m) as f64;
        for pair in 0..self.averages(x.len()) {
            let both = &x[pair * m..(pair + 2) * m];
            let (rising, falling) = both.split_at(m);
            let mut sum = 0.0;
            for (i, (a, b)) in rising.iter().zip(falling).enumerate() {
                // Weights 1..m, then m−1..0: a sample of the difference lies between two of the speed.
                sum += (i + 1) as f64 * a + (m - 1 - i) as f64 * b;
            }
            out.push(sum * share);
        }
    }

    /// Takes out of a segment's innovations what the unknown sum before its first sample left in them: with a root
    /// near one it would stay for the whole segment, and look like a constant force.
    fn forget_start(&self, innovations: &mut [f64]) {
        let order = self.ar.len() as i32;
        let gain: f64 = 1.0
            - self
                .ar
                .iter()
                .zip(1..)
                .map(|(a, i)| a * self.theta.powi(-i))
                .sum::<f64>();
        let mut trace = gain * self.theta.powi(order + 1);
        let (mut along, mut power) = (0.0, 0.1);
        let first = trace;
        for e in innovations.iter() {
            along += trace * e;
            power += trace * trace;
            trace *= self.theta;
        }
        let share = along / power;
        trace = first;
        for e in innovations {
            *e -= share * trace;
            trace *= self.theta;
        }
    }

    /// Fits the autoregression (order by BIC) and the innovation size to residuals in which no
    /// mismatch is left, for a given block and moving-average root.
    #[must_use]
    pub fn fit(residual: &[f64], segments: &[Range<usize>], block: usize, theta: f64) -> Self {
        let unit = Self {
            block,
            theta,
            ar: Vec::new(),
            sigma: 1.0,
        };
        let mut u = Vec::with_capacity(residual.len());
        unit.apply(residual, segments, &mut u);
        let level = robust_sigma(&u);
        if !(level > 0.0) {
            return Self { sigma: 1.0, ..unit };
        }
        for value in &mut u {
            *value = value.clamp(-CLIP * level, CLIP * level);
        }
        let most = if block > 1 {
            MAX_BLOCK_ORDER
        } else {
            MAX_ORDER
        };
        let mut covariance = vec![0.0; most + 1];
        let mut start = 0;
        let mut count = 0.0;
        for segment in segments {
            let length = unit.averages(segment.len());
            let part = &u[start..start + length];
            start += length;
            count += part.len() as f64;
            for (lag, c) in covariance.iter_mut().enumerate() {
                if part.len() > lag {
                    *c += part
                        .iter()
                        .zip(&part[lag..])
                        .map(|(a, b)| a * b)
                        .sum::<f64>();
                }
            }
        }
        let mut best = (f64::INFINITY, Vec::new());
        for order in 0..=most {
            let (ar, variance) = levinson(&covariance, order);
            let bic = count * variance.max(1e-300).ln() + order as f64 * count.max(2.0).ln();
            if bic < best.0 - 1e-9 {
                best = (bic, ar);
            }
        }
        let mut fitted = Self {
            block,
            theta,
            ar: best.1,
            sigma: 1.0,
        };
        let mut e = Vec::with_capacity(residual.len());
        fitted.apply(residual, segments, &mut e);
        fitted.sigma = robust_sigma(&e).max(1e-300);
        fitted
    }
}

fn levinson(covariance: &[f64], order: usize) -> (Vec<f64>, f64) {
    let mut ar = vec![0.0; order];
    let mut variance = covariance[0];
    for m in 0..order {
        if variance <= 0.0 {
            break;
        }
        let mut reflection = covariance[m + 1];
        for i in 0..m {
            reflection -= ar[i] * covariance[m - i];
        }
        let k = (reflection / variance).clamp(-0.999, 0.999);
        let previous = ar.clone();
        ar[m] = k;
        for i in 0..m {
            ar[i] = previous[i] - k * previous[m - 1 - i];
        }
        variance *= 1.0 - k * k;
    }
    (ar, variance / covariance[0].max(1e-300))
}

/// Standard deviation with tails clipped at 3.5 of it, so that outliers do not set the scale.
#[must_use]
pub fn robust_sigma(values: &[f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let mut magnitudes: Vec<f64> = values.iter().map(|v| v.abs()).collect();
    let median = 1.4826 * crate::smooth::median_in_place(&mut magnitudes);
    let n = values.len() as f64;
    let mut sigma = if median > 0.0 {
        median
    } else {
        (values.iter().map(|v| v * v).sum::<f64>() / n).sqrt()
    };
    for _ in 0..4 {
        let limit = CLIP * sigma;
        let sum: f64 = values.iter().map(|v| v.abs().min(limit).powi(2)).sum();
        // A normal variable clipped at 3.5 sigma keeps 0.9987 of its variance.
        sigma = (sum / n / 0.9987).sqrt();
    }
    sigma
}

/// Huber's loss of one innovation, in nats: e²/2 inside `HUBER`, linear beyond.
#[must_use]
pub fn loss(e: f64) -> f64 {
    let a = e.abs();
    if a <= HUBER {
        0.5 * e * e
    } else {
        HUBER * (a - 0.5 * HUBER)
    }
}

/// Weight of an innovation in the normal equations: derivative of the loss over e.
#[must_use]
pub fn weight(e: f64) -> f64 {
    let a = e.abs();
    if a <= HUBER { 1.0 } else { HUBER / a }
}

/// Probability of so large a Ljung-Box statistic if the innovations were white (20 lags, with the
/// variance of each autocorrelation taken robustly by clipping); `None` with too few of them.
#[must_use]
pub fn whiteness(innovations: &[f64]) -> Option<f64> {
    const LAGS: usize = 20;
    let n = innovations.len();
    if n < 5 * LAGS {
        return None;
    }
    let sigma = robust_sigma(innovations);
    if !(sigma > 0.0) {
        return None;
    }
    let clipped: Vec<f64> = innovations
        .iter()
        .map(|e| (e / sigma).clamp(-CLIP, CLIP))
        .collect();
    let power: f64 = clipped.iter().map(|e| e * e).sum();
    let mut q = 0.0;
    for lag in 1..=LAGS {
        let r = clipped
            .iter()
            .zip(&clipped[lag..])
            .map(|(a, b)| a * b)
            .sum::<f64>()
            / power;
        q += r * r / (n - lag) as f64;
    }
    q *= n as f64 * (n as f64 + 2.0);
    Some(chi_square_upper(q, LAGS as f64))
}

/// Upper tail of the chi-square distribution.
#[must_use]
pub fn chi_square_upper(x: f64, degrees: f64) -> f64 {
    ChiSquared::new(degrees).map_or(1.0, |d| d.sf(x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    #[test]
    fn coloured_noise_is_whitened_and_its_size_found() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let normal = Normal::new(0.0, 25.0).unwrap();
        let mut x = vec![0.0; 20_000];
        for k in 1..x.len() {
            x[k] = 0.8 * x[k - 1] + normal.sample(&mut rng);
        }
        let all = 0..x.len();
        let segments = [all];
        let w = Whitener::fit(&x, &segments, 1, 0.0);
        assert!((w.ar[0] - 0.8).abs() < 0.03, "{w:?}");
        assert!((w.sigma - 25.0).abs() < 0.6, "{w:?}");
        let mut e = Vec::new();
        w.apply(&x, &segments, &mut e);
        assert!(whiteness(&e).unwrap() > 0.01);
        assert!(whiteness(&x).unwrap() < 1e-6);
    }

    #[test]
    fn tail_agrees_with_the_published_quantile() {
        assert!((chi_square_upper(31.410, 20.0) - 0.05).abs() < 5e-4);
    }
}
