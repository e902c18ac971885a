//! The lean update against the one in full: the same but for rounding, and the same refusals.
#![allow(clippy::unwrap_used, reason = "a failed step fails the test")]

use muslip::filter::mu_slip::{
    Config, Covariance, Estimate, MuSlipFilter, State, UpdateError, update_reporting,
    update_unchecked,
};
use muslip::filter::{Decision, Estimator, FrictionMeasurement};
use test_support::noise::Noise;

#[test]
fn with_one_division_the_update_is_the_same() {
    let mut noise = Noise::seeded(11);
    for _ in 0..2000 {
        let state = State {
            peak_friction: noise.uniform(0.05, 1.2),
            critical_slip: noise.uniform(0.03, 0.4),
        };
        let (a, b) = (noise.uniform(0.01, 0.8), noise.uniform(0.005, 0.2));
        let covariance = Covariance {
            p00: a * a,
            p01: noise.uniform(-0.9, 0.9) * a * b,
            p11: b * b,
        };
        let (slip, friction) = (noise.uniform(0.0, 1.0), noise.uniform(-0.1, 1.2));
        let variance = noise.uniform(0.01, 0.2).powi(2);
        let Ok((
            Estimate {
                state: x,
                covariance: p,
            },
            _,
        )) = update_reporting(state, covariance, slip, friction, variance)
        else {
            continue;
        };
        let (y, q) = update_unchecked(state, covariance, slip, friction, variance);
        for (found, expected, scale) in [
            (y.peak_friction, x.peak_friction, a),
            (y.critical_slip, x.critical_slip, b),
            (q.p00, p.p00, a * a),
            (q.p01, p.p01, a * b),
            (q.p11, p.p11, b * b),
        ] {
            assert!((found - expected).abs() < 1e-12 * scale + 1e-13 * expected.abs());
        }
        // Single precision: against double.
        let narrow = State {
            peak_friction: state.peak_friction as f32,
            critical_slip: state.critical_slip as f32,
        };
        let narrow_covariance = Covariance {
            p00: covariance.p00 as f32,
            p01: covariance.p01 as f32,
            p11: covariance.p11 as f32,
        };
        let (y, q) = update_unchecked(
            narrow,
            narrow_covariance,
            slip as f32,
            friction as f32,
            variance as f32,
        );
        assert!((f64::from(y.peak_friction) - x.peak_friction).abs() < 1e-4 * a);
        assert!((f64::from(y.critical_slip) - x.critical_slip).abs() < 1e-4 * b);
        assert!((f64::from(q.p00) - p.p00).abs() < 1e-5 * a * a);
        assert!((f64::from(q.p11) - p.p11).abs() < 1e-5 * b * b);
    }
}

/// A number of any size and sign, or none: what a broken sensor may hand in.
fn wild(noise: &mut Noise) -> f32 {
    let sign = noise.uniform(-1.0, 1.0).signum() as f32;
    sign * match noise.uniform(0.0, 10.0) as u32 {
        0 => 0.0,
        1 => f32::NAN,
        2 => f32::INFINITY,
        3 => f32::MAX,
        4 => f32::MIN_POSITIVE,
        5 => noise.log_uniform(1e-45, 1e38) as f32,
        6 => noise.log_uniform(1e-12, 1e12) as f32,
        _ => noise.log_uniform(1e-3, 2.0) as f32,
    }
}

/// A number that a tyre may have, at times one of any size.
fn likely(noise: &mut Noise, low: f64, high: f64) -> f32 {
    if noise.uniform(0.0, 1.0) < 0.3 {
        wild(noise)
    } else {
        noise.log_uniform(low, high) as f32
    }
}

fn holds_a_sound_estimate(filter: &MuSlipFilter<f32>) -> bool {
    let again = filter.clone().restore(filter.estimate());
    again.is_ok()
}

#[test]
fn whatever_comes_in_a_refusal_is_that_of_the_update_in_full_and_what_is_kept_is_sound() {
    let mut noise = Noise::seeded(12);
    let (mut kept, mut refused, mut lean_alone) = (0, 0, 0);
    for _ in 0..400_000 {
        let mut filter: MuSlipFilter<f32> = Config {
            noise_inflation: 1.0,
            ..Config::default()
        }
        .build()
        .unwrap();
        let (a, b) = (
            likely(&mut noise, 1e-5, 10.0),
            likely(&mut noise, 1e-5, 10.0),
        );
        let estimate = Estimate {
            state: State {
                peak_friction: likely(&mut noise, 0.05, 1.2),
                critical_slip: likely(&mut noise, 0.01, 0.4),
            },
            covariance: Covariance {
                p00: a * a,
                // Up to the last correlation that is one.
                p01: (1.0 - noise.log_uniform(1e-8, 1.0) as f32) * a * b,
                p11: b * b,
            },
        };
        if filter.restore(estimate).is_err() {
            continue;
        }
        let before = filter;
        let measurement = FrictionMeasurement {
            slip_ratio: likely(&mut noise, 1e-3, 1.0),
            friction: likely(&mut noise, 1e-3, 1.5),
            friction_std: likely(&mut noise, 1e-6, 1.0),
        };
        let mut reporting = filter;
        let in_full = reporting.update_reporting(&measurement);
        match filter.update(&measurement) {
            Ok(decision) => {
                assert_eq!(decision, Decision::Accepted);
                assert!(
                    measurement.friction_std > 0.0,
                    "{estimate:?} {measurement:?}"
                );
                assert!(measurement.friction_std.is_finite() && measurement.friction.is_finite());
                assert!(measurement.slip_ratio.is_finite());
                assert!(
                    holds_a_sound_estimate(&filter),
                    "{estimate:?} {measurement:?}"
                );
                let (p, q) = (before.covariance(), filter.covariance());
                assert!(q.p00 <= p.p00 && q.p11 <= p.p11);
                kept += 1;
                // Within rounding of the limits one may keep what the other refuses.
                if let Err(error) = in_full {
                    assert!(
                        matches!(
                            error,
                            UpdateError::PosteriorNotPositiveDefinite | UpdateError::Overflow
                        ),
                        "{error:?} {estimate:?} {measurement:?}"
                    );
                    lean_alone += 1;
                }
            }
            Err(error) => {
                assert_eq!(in_full, Err(error), "{estimate:?} {measurement:?}");
                assert_eq!(filter, before);
                refused += 1;
            }
        }
    }
    assert!(kept > 50_000 && refused > 50_000, "{kept} {refused}");
    assert!(lean_alone < kept / 100, "{lean_alone} of {kept}");
}
