//! Noise of the drag readings about a model's prediction: how large, by what it depends on, and how coloured.

use core::ops::Range;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Longest autoregression tried.
const MAX_ORDER: usize = 6;
/// Passes of weighted least squares, and the square of a residual over its variance beyond which it counts no more.
const PASSES: usize = 4;
const CLIPPED_SQUARE: f64 = 10.0;
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

    /// Fits the size to what a model leaves, by the force and what slip noise does to it, both in N: three passes of
    /// weighted least squares on clipped squares, each part held non-negative.
    #[must_use]
    pub fn fitted(rest: &[f64], depends_on: &[[f64; 2]]) -> Self {
        let typical = robust_sigma(rest).max(1e-300);
        let least = 0.05 * typical * typical;
        let features: Vec<Vector3<f64>> = depends_on
            .iter()
            .map(|[force, slip]| Vector3::new(1.0, force * force, slip * slip))
            .collect();
        let mut parts = Vector3::new(typical * typical, 0.0, 0.0);
        for _ in 0..PASSES {
            let mut products = Matrix3::<f64>::zeros();
            let mut squares = Vector3::<f64>::zeros();
            for (f, r) in features.iter().zip(rest) {
                let variance = parts.dot(f).max(1e-4 * typical * typical);
                let weight = 1.0 / (variance * variance);
                products += weight * f * f.transpose();
                squares += weight * (r * r).min(CLIPPED_SQUARE * variance) * f;
            }
            parts = non_negative(&products, &squares);
        }
        Self {
            parts: parts.into(),
            least,
            typical,
        }
    }
}

/// Non-negative solution of three normal equations: what comes out negative is left out, one pass after the other.
fn non_negative(products: &Matrix3<f64>, right: &Vector3<f64>) -> Vector3<f64> {
    let mut active = [true; 3];
    loop {
        let places: Vec<usize> = (0..3)
            .filter(|i| active[*i] && products[(*i, *i)] > 0.0)
            .collect();
        let scale = |i: usize| products[(places[i], places[i])].sqrt();
        let matrix = DMatrix::from_fn(places.len(), places.len(), |i, j| {
            let value = products[(places[i], places[j])] / (scale(i) * scale(j));
            if i == j { value + 1e-9 } else { value }
        });
        let scaled = DVector::from_fn(places.len(), |i, _| right[places[i]] / scale(i));
        let mut solution = Vector3::zeros();
        let Some(solved) = matrix.cholesky().map(|c| c.solve(&scaled)) else {
            return solution;
        };
        let mut negative = false;
        for (i, &place) in places.iter().enumerate() {
            let value = solved[i] / scale(i);
            if value < 0.0 {
                active[place] = false;
                negative = true;
            } else {
                solution[place] = value;
            }
        }
        if !negative {
            return solution;
        }
    }
}

/// A stationary noise model: d = e/(1 − Σ aᵢBⁱ) with white e of standard deviation `sigma`.
#[derive(Clone, Debug)]
pub struct Whitener {
    /// Autoregressive coefficients.
    pub ar: Vec<f64>,
    /// Standard deviation of the innovations.
    pub sigma: f64,
}

impl Whitener {
    /// Appends the innovations of `x` (in units of `sigma`) to `out`, segment by segment; the first
    /// samples of a segment are conditioned on.
    pub fn apply(&self, x: &[f64], segments: &[Range<usize>], out: &mut Vec<f64>) {
        let order = self.ar.len();
        for segment in segments {
            let own = &x[segment.clone()];
            for k in order..own.len() {
                let past: f64 = self.ar.iter().zip(1..).map(|(a, i)| a * own[k - i]).sum();
                out.push((own[k] - past) / self.sigma);
            }
        }
    }

    /// Fits the autoregression (order by BIC) and the innovation size to residuals in which no
    /// mismatch is left.
    #[must_use]
    pub fn fit(residual: &[f64], segments: &[Range<usize>]) -> Self {
        let used: Vec<f64> = segments
            .iter()
            .flat_map(|s| residual[s.clone()].iter().copied())
            .collect();
        let level = robust_sigma(&used);
        if !(level > 0.0) {
            return Self {
                ar: Vec::new(),
                sigma: 1.0,
            };
        }
        let clipped: Vec<f64> = residual
            .iter()
            .map(|x| x.clamp(-CLIP * level, CLIP * level))
            .collect();
        let mut covariance = [0.0; MAX_ORDER + 1];
        for part in segments.iter().map(|s| &clipped[s.clone()]) {
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
        let count = used.len() as f64;
        let mut best = (f64::INFINITY, Vec::new());
        for order in 0..=MAX_ORDER {
            let (ar, variance) = levinson(&covariance, order);
            let bic = count * variance.max(1e-300).ln() + order as f64 * count.max(2.0).ln();
            if bic < best.0 - 1e-9 {
                best = (bic, ar);
            }
        }
        let mut fitted = Self {
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
    let median = crate::smooth::SIGMA_PER_MAD * crate::smooth::median_in_place(&mut magnitudes);
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

/// What a likelihood of drag readings needs beside the model's prediction.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Likelihood {
    /// Size of the noise of one sample.
    pub size: NoiseSize,
    /// Autoregressive coefficients of the noise over its size, at the fitted sampling step.
    pub colour: Vec<f64>,
    /// Standard deviation of the innovations over that size.
    pub innovation_sigma: f64,
}

impl Likelihood {
    /// What makes residuals over their size white.
    pub(crate) fn whitener(&self) -> Whitener {
        Whitener {
            ar: self.colour.clone(),
            sigma: self.innovation_sigma,
        }
    }
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
        let w = Whitener::fit(&x, &segments);
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
