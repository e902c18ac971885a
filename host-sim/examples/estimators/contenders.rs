//! The estimators, each run over one stream.

use host_sim::fit::{Curve, fit_curve};
use muslip::filter::mu_slip::{Config as ArticleConfig, Covariance, State};
use muslip::filter::{Estimator, FrictionMeasurement, efficient};

use super::streams::{SIGMA, Stream, range};

/// What one estimator made of one stream: errors, normalised error squared, mean NIS, lag-1 correlation.
#[derive(Clone, Copy, Default)]
pub struct Outcome {
    pub error: [f64; 2],
    pub nees: f64,
    pub nis: f64,
    pub lag: f64,
}

pub fn nees(error: [f64; 2], p: Covariance<f64>) -> f64 {
    let determinant = p.p00 * p.p11 - p.p01 * p.p01;
    (p.p11 * error[0] * error[0] - 2.0 * p.p01 * error[0] * error[1] + p.p00 * error[1] * error[1])
        / determinant
}

pub fn errors(truth: Curve, state: State<f64>) -> [f64; 2] {
    [
        state.peak_friction - truth.peak_friction,
        state.critical_slip - truth.critical_slip,
    ]
}

/// Batch maximum likelihood on the stream without outliers.
pub fn batch(truth: Curve, stream: &Stream) -> Option<Outcome> {
    let start: State<f64> = range(truth).initial_state();
    let start = Curve {
        peak_friction: start.peak_friction,
        critical_slip: start.critical_slip,
    };
    let fit = fit_curve(&stream.slips, &stream.clean, start, 200).ok()?;
    let error = errors(
        truth,
        State {
            peak_friction: fit.curve.peak_friction,
            critical_slip: fit.curve.critical_slip,
        },
    );
    let (p00, p01, p11) = fit.covariance;
    (fit.converged && fit.curve.critical_slip < 2.0).then(|| Outcome {
        error,
        nees: nees(error, Covariance { p00, p01, p11 }),
        ..Outcome::default()
    })
}

/// The efficient estimator in single precision, told `declared` times the noise.
pub fn efficient_run(truth: Curve, stream: &Stream, declared: f64) -> Outcome {
    let mut filter = efficient::Config::<f32>::for_range(range(truth))
        .build()
        .unwrap();
    let (mut nis, mut lag, mut before, mut count) = (0.0, 0.0, 0.0, 0.0);
    for (index, (&slip, &friction)) in stream.slips.iter().zip(&stream.frictions).enumerate() {
        let fusion = filter
            .update(&FrictionMeasurement {
                slip_ratio: slip as f32,
                friction: friction as f32,
                friction_std: (declared * SIGMA) as f32,
            })
            .unwrap();
        let unit = f64::from(fusion.innovation) / f64::from(fusion.innovation_variance).sqrt();
        // Once the noise has been learnt: the second half.
        if 2 * index > stream.slips.len() {
            nis += unit * unit;
            lag += unit * before;
            count += 1.0;
        }
        before = unit;
    }
    let State {
        peak_friction,
        critical_slip,
    } = filter.state();
    let error = errors(
        truth,
        State {
            peak_friction: f64::from(peak_friction),
            critical_slip: f64::from(critical_slip),
        },
    );
    let p = filter.covariance();
    let p = Covariance {
        p00: f64::from(p.p00),
        p01: f64::from(p.p01),
        p11: f64::from(p.p11),
    };
    Outcome {
        error,
        nees: nees(error, p),
        nis: nis / count,
        lag: lag / nis,
    }
}

pub fn article_run(truth: Curve, stream: &Stream) -> Outcome {
    let mut filter = ArticleConfig::<f64>::for_range(range(truth))
        .build()
        .unwrap();
    for (&slip_ratio, &friction) in stream.slips.iter().zip(&stream.frictions) {
        let _ = filter.update(&FrictionMeasurement {
            slip_ratio,
            friction,
            friction_std: SIGMA,
        });
    }
    let error = errors(truth, filter.state());
    Outcome {
        error,
        nees: nees(error, filter.covariance()),
        ..Outcome::default()
    }
}

/// The iterated extended Kalman filter (ten relinearisations a sample), told the true noise.
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

/// The unscented filter (alpha 1, kappa 1, beta 0), told the true noise.
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

pub fn two_state(truth: Curve, x: [f64; 2], p: [f64; 3]) -> Outcome {
    let error = [x[0] - truth.peak_friction, x[1] - truth.critical_slip];
    let [p00, p01, p11] = p;
    Outcome {
        error,
        nees: nees(error, Covariance { p00, p01, p11 }),
        ..Outcome::default()
    }
}
