//! Batch fits of streams with outliers: what is attainable without being told which samples they are.

use muslip::filter::mu_slip::Covariance;
use muslip_analysis::fit::Curve;

use super::contenders::Outcome;
use super::streams::{OUTLIER, SIGMA, Stream};

/// Minus the logarithm of the density of one residual, in sigmas, but for a constant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Loss {
    /// Normal: no outliers.
    Squares,
    /// The density that the streams are made from, noise included: this share at ±10 sigma.
    Exact(f64),
    /// This share normal and ten times as wide: nothing is known of an outlier but its scale.
    Mixture(f64),
    /// Huber's, with this bend.
    Huber(f64),
    /// Tukey's biweight, with this end.
    Tukey(f64),
}

/// A loss at one residual: itself, its slope and the weight of a step of reweighted least squares.
struct At {
    loss: f64,
    slope: f64,
    weight: f64,
    /// Probability that the sample is no outlier.
    good: f64,
}

impl Loss {
    fn at(self, u: f64) -> At {
        let square = u * u;
        let weighted = |loss, weight, good| At {
            loss,
            slope: weight * u,
            weight,
            good,
        };
        match self {
            Self::Squares => weighted(0.5 * square, 1.0, 1.0),
            Self::Exact(share) => {
                // Relative to the good density's exp(-u²/2).
                let [below, above] = [-1.0, 1.0]
                    .map(|side| 0.5 * share * (OUTLIER * (side * u - 0.5 * OUTLIER)).exp());
                let sum = 1.0 - share + below + above;
                At {
                    loss: 0.5 * square - sum.ln(),
                    slope: u - OUTLIER * (above - below) / sum,
                    weight: 1.0,
                    good: (1.0 - share) / sum,
                }
            }
            Self::Mixture(share) => {
                let wide = 1.0 + OUTLIER * OUTLIER;
                let good = (1.0 - share) * (-0.5 * square).exp();
                let bad = share / wide.sqrt() * (-0.5 * square / wide).exp();
                let sum = good + bad;
                weighted(-sum.ln(), (good + bad / wide) / sum, good / sum)
            }
            Self::Huber(bend) => {
                let size = u.abs();
                if size < bend {
                    weighted(0.5 * square, 1.0, 1.0)
                } else {
                    weighted(bend * (size - 0.5 * bend), bend / size, 1.0)
                }
            }
            Self::Tukey(end) => {
                let rest = (1.0 - square / (end * end)).max(0.0);
                weighted(end * end / 6.0 * (1.0 - rest.powi(3)), rest * rest, 1.0)
            }
        }
    }

    /// Whether it is a likelihood that tells the noise as well as the curve.
    fn tells_noise(self) -> bool {
        matches!(self, Self::Squares | Self::Mixture(_))
    }

    fn total(self, curve: Curve, sigma: f64, stream: &Stream) -> f64 {
        residuals(curve, stream)
            .map(|residual| self.at(residual / sigma).loss)
            .sum()
    }
}

fn residuals(curve: Curve, stream: &Stream) -> impl Iterator<Item = f64> {
    stream
        .slips
        .iter()
        .zip(&stream.frictions)
        .map(move |(&slip, &friction)| friction - curve.friction(slip))
}

/// The curve of least absolute residuals at an sp: its mup is a weighted median.
fn least_absolute(critical_slip: f64, stream: &Stream) -> Curve {
    let unit = Curve {
        peak_friction: 1.0,
        critical_slip,
    };
    let mut ratios: Vec<(f64, f64)> = stream
        .slips
        .iter()
        .zip(&stream.frictions)
        .map(|(&slip, &friction)| (friction, unit.friction(slip)))
        .filter(|&(_, law)| law > 1e-9)
        .map(|(friction, law)| (friction / law, law))
        .collect();
    ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut half = 0.5 * ratios.iter().map(|(_, weight)| weight).sum::<f64>();
    let median = ratios.iter().find(|(_, weight)| {
        half -= weight;
        half <= 0.0
    });
    Curve {
        peak_friction: median.map_or(0.0, |(ratio, _)| *ratio),
        critical_slip,
    }
}

/// JᵀWJ of (mup, ln sp) in units of the noise, and its product with a step to be taken.
fn normal_equations(loss: Loss, curve: Curve, sigma: f64, stream: &Stream) -> ([f64; 3], [f64; 2]) {
    let (mut matrix, mut right) = ([0.0; 3], [0.0; 2]);
    for (&slip, residual) in stream.slips.iter().zip(residuals(curve, stream)) {
        let (h0, by_slip) = curve.gradient(slip);
        let h1 = by_slip * curve.critical_slip;
        let at = loss.at(residual / sigma);
        matrix[0] += at.weight * h0 * h0;
        matrix[1] += at.weight * h0 * h1;
        matrix[2] += at.weight * h1 * h1;
        right[0] += sigma * at.slope * h0;
        right[1] += sigma * at.slope * h1;
    }
    (matrix, right)
}

/// Steps of Gauss and Newton on a loss from a start, halved until the loss falls.
fn descend(loss: Loss, start: Curve, sigma: f64, stream: &Stream) -> (f64, Curve) {
    let (mut curve, mut best) = (start, loss.total(start, sigma, stream));
    for _ in 0..100 {
        let ([a, b, c], [r0, r1]) = normal_equations(loss, curve, sigma, stream);
        // Not singular where the samples do not tell sp.
        let c = c * (1.0 + 1e-6) + 1e-12;
        let determinant = a * c - b * b;
        let step = [
            (c * r0 - b * r1) / determinant,
            (a * r1 - b * r0) / determinant,
        ];
        if !(step[0].is_finite() && step[1].is_finite()) {
            break;
        }
        let before = best;
        let mut share = (1.0 / step[1].abs()).min(1.0);
        while share > 1e-4 {
            let there = Curve {
                peak_friction: curve.peak_friction + share * step[0],
                critical_slip: curve.critical_slip * (share * step[1]).exp(),
            };
            let total = loss.total(there, sigma, stream);
            if total <= best {
                (best, curve) = (total, there);
                break;
            }
            share *= 0.5;
        }
        if before - best < 1e-10 {
            break;
        }
    }
    (best, curve)
}

/// The best of descents from the most promising of many starts.
fn fit(loss: Loss, sigma: f64, stream: &Stream) -> Curve {
    const STARTS: i32 = 32;
    const PROMISING: usize = 8;
    let mut starts: Vec<(f64, Curve)> = (0..STARTS)
        .map(|index| {
            // sp from 0.03 to 0.6
            let sp = 0.03 * 20f64.powf(f64::from(index) / f64::from(STARTS - 1));
            let start = least_absolute(sp, stream);
            (loss.total(start, sigma, stream), start)
        })
        .collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    starts
        .into_iter()
        .take(PROMISING)
        .map(|(_, start)| descend(loss, start, sigma, stream))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .unwrap()
        .1
}

/// The noise from the median size of residuals, about the curve of nearly least absolute ones, which needs no scale.
fn noise_of_the_middle(stream: &Stream) -> f64 {
    let curve = fit(Loss::Huber(1e-3), SIGMA, stream);
    let mut sizes: Vec<f64> = residuals(curve, stream).map(f64::abs).collect();
    sizes.sort_by(f64::total_cmp);
    1.4826 * sizes[sizes.len().div_ceil(2)]
}

/// A batch fit that learns the noise level too (but for [`Loss::Exact`], which knows it): by likelihood where the
/// loss is one, else from the median residual.
pub fn robust_run(loss: Loss, truth: Curve, stream: &Stream) -> Outcome {
    let mut sigma = match loss {
        Loss::Exact(_) => SIGMA,
        _ => noise_of_the_middle(stream),
    };
    let mut curve = fit(loss, sigma, stream);
    if loss.tells_noise() {
        for _ in 0..20 {
            let (mut sum, mut count) = (0.0, -2.0);
            for residual in residuals(curve, stream) {
                let good = loss.at(residual / sigma).good;
                sum += good * residual * residual;
                count += good;
            }
            sigma = (sum / count).sqrt();
            curve = descend(loss, curve, sigma, stream).1;
        }
    }
    let ([a, b, c], _) = normal_equations(loss, curve, sigma, stream);
    let scale = sigma * sigma / (a * c - b * b);
    let sp = curve.critical_slip;
    let covariance = Covariance {
        p00: scale * c,
        p01: -scale * b * sp,
        p11: scale * a * sp * sp,
    };
    Outcome::of(truth, [curve.peak_friction, sp], covariance)
}

/// Batch maximum likelihood on what is left of a stream when it is told which samples are outliers.
pub fn told_run(truth: Curve, stream: &Stream) -> Outcome {
    let keep = |of: &[f64]| -> Vec<f64> {
        of.iter()
            .zip(stream.frictions.iter().zip(&stream.clean))
            .filter(|(_, (friction, clean))| friction == clean)
            .map(|(value, _)| *value)
            .collect()
    };
    let rest = Stream {
        slips: keep(&stream.slips),
        frictions: keep(&stream.frictions),
        clean: keep(&stream.clean),
    };
    robust_run(Loss::Squares, truth, &rest)
}

#[cfg(test)]
mod tests {
    use super::super::contenders::batch;
    use super::super::streams::{Disturbance, article_slips, stream};
    use super::{Loss, robust_run};
    use muslip_analysis::fit::Curve;

    const TRUTH: Curve = Curve {
        peak_friction: 0.35,
        critical_slip: 0.1,
    };

    #[test]
    fn slopes_are_the_derivatives_of_the_losses() {
        for loss in [
            Loss::Squares,
            Loss::Exact(0.05),
            Loss::Mixture(0.05),
            Loss::Huber(1.345),
            Loss::Tukey(4.685),
        ] {
            for u in [-11.0, -4.9, -2.6, -0.3, 0.0, 1.2, 3.1, 4.0, 9.7] {
                let h = 1e-5;
                let by_difference = (loss.at(u + h).loss - loss.at(u - h).loss) / (2.0 * h);
                assert!(
                    (loss.at(u).slope - by_difference).abs() < 1e-6,
                    "{loss:?} {u}"
                );
            }
        }
    }

    #[test]
    fn without_outliers_least_squares_is_the_batch_fit() {
        for seed in 0..20 {
            let stream = stream(TRUTH, &article_slips(), Disturbance::default(), seed);
            let ours = robust_run(Loss::Squares, TRUTH, &stream);
            let batch = batch(TRUTH, &stream).unwrap();
            for i in 0..2 {
                assert!(
                    (ours.estimate[i] - batch.estimate[i]).abs() < 1e-5,
                    "{seed}"
                );
            }
            assert!((ours.nees / batch.nees - 1.0).abs() < 1e-2);
        }
    }

    /// An outlier whose size is known is taken back whole.
    #[test]
    fn the_density_of_the_streams_finds_what_the_clean_ones_say() {
        let outliers = Disturbance {
            outliers: 0.05,
            ..Disturbance::default()
        };
        for seed in 0..20 {
            let stream = stream(TRUTH, &article_slips(), outliers, seed);
            let found = robust_run(Loss::Exact(0.05), TRUTH, &stream);
            let clean = batch(TRUTH, &stream).unwrap();
            for i in 0..2 {
                let off = (found.estimate[i] - clean.estimate[i]).abs();
                assert!(
                    off < 0.1 * [clean.covariance.p00, clean.covariance.p11][i].sqrt(),
                    "{seed}"
                );
            }
        }
    }
}
