//! Kalman filters of other kinds, from the article's start, told the true noise.

use muslip::filter::mu_slip::{Covariance, State};
use muslip_analysis::fit::Curve;

use super::contenders::Outcome;
use super::streams::{SIGMA, Stream, range};

/// The iterated extended Kalman filter (ten relinearisations a sample).
pub fn iterated_run(truth: Curve, stream: &Stream) -> Outcome {
    let start: State<f64> = range(truth).initial_state();
    let mut x = [start.peak_friction, start.critical_slip];
    let mut p = [x[0] * x[0], 0.0, x[1] * x[1]];
    for (&s, &z) in stream.slips.iter().zip(&stream.frictions) {
        let mut at = x;
        let mut gain = [0.0; 2];
        let mut g = [0.0; 2];
        for _ in 0..10 {
            let curve = Curve {
                peak_friction: at[0],
                critical_slip: at[1],
            };
            let (h0, h1) = curve.gradient(s);
            g = [p[0] * h0 + p[1] * h1, p[1] * h0 + p[2] * h1];
            let variance = h0 * g[0] + h1 * g[1] + SIGMA * SIGMA;
            gain = g.map(|g| g / variance);
            let innovation = z - curve.friction(s) - h0 * (x[0] - at[0]) - h1 * (x[1] - at[1]);
            at = [x[0] + gain[0] * innovation, x[1] + gain[1] * innovation];
        }
        x = at;
        p = [
            p[0] - gain[0] * g[0],
            p[1] - gain[0] * g[1],
            p[2] - gain[1] * g[1],
        ];
    }
    two_state(truth, x, p)
}

/// The unscented filter (alpha 1, kappa 1, beta 0).
pub fn unscented_run(truth: Curve, stream: &Stream) -> Outcome {
    let start: State<f64> = range(truth).initial_state();
    let mut x = [start.peak_friction, start.critical_slip];
    let mut p = [x[0] * x[0], 0.0, x[1] * x[1]];
    for (&s, &z) in stream.slips.iter().zip(&stream.frictions) {
        // Cholesky factor of 3 P
        let l00 = (3.0 * p[0]).sqrt();
        let l10 = 3.0 * p[1] / l00;
        let l11 = (3.0 * p[2] - l10 * l10).max(1e-12).sqrt();
        let spread = [
            [0.0, 0.0],
            [l00, l10],
            [-l00, -l10],
            [0.0, l11],
            [0.0, -l11],
        ];
        let weights = [1.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0];
        let friction = spread.map(|d| {
            Curve {
                peak_friction: x[0] + d[0],
                critical_slip: x[1] + d[1],
            }
            .friction(s)
        });
        let mean: f64 = friction.iter().zip(weights).map(|(f, w)| f * w).sum();
        let (mut variance, mut g) = (SIGMA * SIGMA, [0.0; 2]);
        for ((f, w), d) in friction.iter().zip(weights).zip(spread) {
            variance += w * (f - mean).powi(2);
            g[0] += w * (f - mean) * d[0];
            g[1] += w * (f - mean) * d[1];
        }
        let gain = g.map(|g| g / variance);
        x = [x[0] + gain[0] * (z - mean), x[1] + gain[1] * (z - mean)];
        p = [
            p[0] - gain[0] * g[0],
            p[1] - gain[0] * g[1],
            p[2] - gain[1] * g[1],
        ];
    }
    two_state(truth, x, p)
}

fn two_state(truth: Curve, x: [f64; 2], [p00, p01, p11]: [f64; 3]) -> Outcome {
    Outcome::of(truth, x, Covariance { p00, p01, p11 })
}
