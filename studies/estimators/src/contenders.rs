//! The estimators, each run over one stream.

use muslip::filter::mu_slip::{Config as ArticleConfig, Covariance, State};
use muslip::filter::{Estimator, FrictionMeasurement, efficient};
use muslip_analysis::fit::{Curve, fit_curve};

use super::innovations::{Innovations, Watch};
use super::streams::{SIGMA, Stream, range};

/// What one estimator made of one stream.
#[derive(Clone, Copy)]
pub struct Outcome {
    /// (mup, sp).
    pub estimate: [f64; 2],
    pub error: [f64; 2],
    pub covariance: Covariance<f64>,
    /// Normalised estimation error squared.
    pub nees: f64,
    /// Of estimators that have any.
    pub innovations: Innovations,
}

impl Outcome {
    pub fn of(truth: Curve, estimate: [f64; 2], covariance: Covariance<f64>) -> Self {
        let error = [
            estimate[0] - truth.peak_friction,
            estimate[1] - truth.critical_slip,
        ];
        let Covariance { p00, p01, p11 } = covariance;
        let [a, b] = error;
        Self {
            estimate,
            error,
            covariance,
            nees: (p11 * a * a - 2.0 * p01 * a * b + p00 * b * b) / (p00 * p11 - p01 * p01),
            innovations: Innovations::default(),
        }
    }
}

/// Batch maximum likelihood on the stream without outliers, or nothing where the likelihood has no peak.
pub fn batch(truth: Curve, stream: &Stream) -> Option<Outcome> {
    let start: State<f64> = range(truth).initial_state();
    let start = Curve {
        peak_friction: start.peak_friction,
        critical_slip: start.critical_slip,
    };
    let fit = fit_curve(&stream.slips, &stream.clean, start, 200).ok()?;
    let (p00, p01, p11) = fit.covariance;
    (fit.converged && fit.curve.critical_slip < 2.0).then(|| {
        let estimate = [fit.curve.peak_friction, fit.curve.critical_slip];
        Outcome::of(truth, estimate, Covariance { p00, p01, p11 })
    })
}

/// The efficient estimator in single precision, told `declared` times the noise, with its learnt over the
/// declared variance.
pub fn efficient_with_noise(
    config: efficient::Config<f32>,
    truth: Curve,
    stream: &Stream,
    declared: f64,
) -> (Outcome, f64) {
    let mut filter = config.build().unwrap();
    let mut watch = Watch::over(stream.slips.len());
    for (&slip, &friction) in stream.slips.iter().zip(&stream.frictions) {
        let fusion = filter
            .update_reporting(&FrictionMeasurement {
                slip_ratio: slip as f32,
                friction: friction as f32,
                friction_std: (declared * SIGMA) as f32,
            })
            .unwrap();
        watch.see(f64::from(fusion.innovation) / f64::from(fusion.innovation_variance).sqrt());
    }
    let State {
        peak_friction,
        critical_slip,
    } = filter.state();
    let p = filter.covariance();
    let outcome = Outcome::of(
        truth,
        [peak_friction, critical_slip].map(f64::from),
        Covariance {
            p00: f64::from(p.p00),
            p01: f64::from(p.p01),
            p11: f64::from(p.p11),
        },
    );
    (
        Outcome {
            innovations: watch.end(),
            ..outcome
        },
        f64::from(filter.noise_factor()),
    )
}

pub fn efficient_run(truth: Curve, stream: &Stream, declared: f64) -> Outcome {
    let config = efficient::Config::for_range(range(truth));
    efficient_with_noise(config, truth, stream, declared).0
}

/// The same without its gate: it believes every sample.
pub fn ungated_run(truth: Curve, stream: &Stream, declared: f64) -> Outcome {
    let config = efficient::Config {
        nis_gate: None,
        ..efficient::Config::for_range(range(truth))
    };
    efficient_with_noise(config, truth, stream, declared).0
}

pub fn article_run(truth: Curve, stream: &Stream) -> Outcome {
    let mut filter = ArticleConfig::<f64>::for_range(range(truth))
        .build()
        .unwrap();
    for (&slip_ratio, &friction) in stream.slips.iter().zip(&stream.frictions) {
        let _ = filter.update_reporting(&FrictionMeasurement {
            slip_ratio,
            friction,
            friction_std: SIGMA,
        });
    }
    let State {
        peak_friction,
        critical_slip,
    } = filter.state();
    Outcome::of(truth, [peak_friction, critical_slip], filter.covariance())
}
