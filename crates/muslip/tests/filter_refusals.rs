//! What the two-state filter refuses, and that a refusal changes nothing.
#![allow(clippy::unwrap_used, reason = "a failed step fails the test")]

use muslip::filter::mu_slip::{
    Config, Covariance, CovarianceForm, Estimate, Input, MuSlipFilter, Range, State, UpdateError,
    update_reporting,
};
use muslip::filter::{Estimator, FrictionMeasurement};
use muslip::real::Real;

const BAD: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

fn state() -> State<f32> {
    Range::Aircraft.initial_state()
}

fn covariance() -> Covariance<f32> {
    Range::Aircraft.initial_covariance()
}

/// The refusal of an update of any estimate and, where that may be a filter's, of the filter's own two.
fn refusal(
    state: State<f32>,
    covariance: Covariance<f32>,
    slip: f32,
    friction: f32,
    variance: f32,
) -> UpdateError {
    let refusal = update_reporting(state, covariance, slip, friction, variance).unwrap_err();
    let mut filter = Config {
        noise_inflation: 1.0,
        ..Config::default()
    }
    .build()
    .unwrap();
    if filter.restore(Estimate { state, covariance }).is_ok() && variance >= 0.0 {
        let before = filter;
        let measurement = FrictionMeasurement {
            slip_ratio: slip,
            friction,
            friction_std: variance.sqrt(),
        };
        assert_eq!(filter.update_reporting(&measurement), Err(refusal));
        assert_eq!(filter, before);
        match filter.update(&measurement) {
            Err(error) => assert_eq!((error, filter), (refusal, before)),
            // Whether the last digit of a variance is left over is rounding's, which is another in the lean update:
            // what it keeps is a variance that is too large, and sound.
            Ok(_) => {
                assert_eq!(refusal, UpdateError::PosteriorNotPositiveDefinite);
                assert!(filter.state().is_finite());
                assert!(filter.covariance().is_positive_definite());
                assert!(filter.covariance().p00 > variance);
            }
        }
    }
    refusal
}

#[test]
fn each_input_that_is_not_finite_is_named_at_every_slip() {
    // slip 0 makes H zero, which hides infinities from the gain
    for slip in [0.0, 0.1, 0.2, 1.0] {
        for bad in BAD {
            for change in [
                |x: &mut State<f32>, bad| x.peak_friction = bad,
                |x: &mut State<f32>, bad| x.critical_slip = bad,
            ] {
                let mut x = state();
                change(&mut x, bad);
                let got = refusal(x, covariance(), slip, 0.3, 0.0144);
                assert_eq!(got, UpdateError::NonFinite(Input::State));
            }
            for change in [
                |p: &mut Covariance<f32>, bad| p.p00 = bad,
                |p: &mut Covariance<f32>, bad| p.p01 = bad,
                |p: &mut Covariance<f32>, bad| p.p11 = bad,
            ] {
                let mut p = covariance();
                change(&mut p, bad);
                let got = refusal(state(), p, slip, 0.3, 0.0144);
                assert_eq!(got, UpdateError::NonFinite(Input::Covariance));
            }
            let named = |input| UpdateError::NonFinite(input);
            assert_eq!(
                refusal(state(), covariance(), bad, 0.3, 0.0144),
                named(Input::SlipRatio)
            );
            assert_eq!(
                refusal(state(), covariance(), slip, bad, 0.0144),
                named(Input::Friction)
            );
            assert_eq!(
                refusal(state(), covariance(), slip, 0.3, bad),
                named(Input::Noise)
            );
        }
    }
}

#[test]
fn noise_must_be_positive() {
    for variance in [0.0, -0.0, -0.01] {
        let got = refusal(state(), covariance(), 0.1, 0.3, variance);
        assert_eq!(got, UpdateError::NonPositiveNoise);
    }
}

#[test]
fn a_prior_that_is_not_positive_definite_is_refused() {
    for (p00, p01, p11) in [
        (-0.36, 0.0, 0.04),
        (0.36, 0.0, -0.04),
        (0.36, 0.13, 0.04),
        (0.36, -0.13, 0.04),
        (1.0, 2.0, 1.0),
        (0.0, 0.0, 0.04),
        (0.0, 0.0, 0.0),
    ] {
        for slip in [0.0, 0.05, 0.2, 0.9] {
            let p = Covariance { p00, p01, p11 };
            let got = refusal(state(), p, slip, 0.3, 0.0144);
            assert_eq!(got, UpdateError::PriorNotPositiveDefinite, "{p:?}");
        }
    }
}

/// An estimate whose peak is uncertain and whose slip is not.
fn sharp<T: Real>() -> (State<T>, Covariance<T>) {
    let x = State {
        peak_friction: T::from_f64(0.6),
        critical_slip: T::from_f64(0.2),
    };
    let p = Covariance {
        p00: T::from_f64(0.36),
        p01: T::ZERO,
        p11: T::from_f64(1e-10),
    };
    (x, p)
}

#[test]
fn a_measurement_too_certain_for_the_precision_is_refused_and_not_clamped() {
    // At the peak H = (1, 0): the posterior variance of peak friction is the noise, 1e-16 of the prior's.
    let (x, p) = sharp::<f32>();
    assert_eq!(
        refusal(x, p, 0.2, 0.5, 1e-17),
        UpdateError::PosteriorNotPositiveDefinite
    );
    let mut refused = 0;
    for step in 1..100_u8 {
        let p = Covariance {
            p00: 0.01 * f32::from(step),
            ..p
        };
        let mut filter = Config {
            initial_state: x,
            initial_covariance: p,
            ..Config::default()
        }
        .build()
        .unwrap();
        let before = filter;
        let certain = FrictionMeasurement {
            slip_ratio: 0.2,
            friction: 0.5,
            friction_std: 1e-9,
        };
        if filter.update(&certain) == Err(UpdateError::PosteriorNotPositiveDefinite) {
            assert_eq!(filter, before);
            refused += 1;
        } else {
            assert!(filter.covariance().is_positive_definite());
        }
    }
    assert!(refused > 50, "{refused}");
    // Double precision can hold what single precision cannot.
    let (x, p) = sharp::<f64>();
    assert!(update_reporting(x, p, 0.2, 0.5, 1e-13).is_ok());
}

#[test]
fn overflow_of_finite_inputs_is_an_error() {
    assert_eq!(
        refusal(state(), covariance(), 1e30, 0.3, 0.0144),
        UpdateError::Overflow
    );
    let x = State {
        peak_friction: 0.6,
        critical_slip: 0.0,
    };
    assert_eq!(
        refusal(x, covariance(), 0.0, 0.3, 0.0144),
        UpdateError::Overflow
    );
}

/// The article's, which is lean, and two that are not.
fn filters() -> [MuSlipFilter<f32>; 3] {
    [
        (CovarianceForm::Short, None),
        (CovarianceForm::Short, Some(9.0)),
        (CovarianceForm::Joseph, Some(9.0)),
    ]
    .map(|(covariance_form, nis_gate)| {
        let config = Config {
            covariance_form,
            nis_gate,
            ..Config::default()
        };
        config.build().unwrap()
    })
}

#[test]
fn a_refusal_leaves_the_filter_as_it_was() {
    for mut filter in filters() {
        let good = FrictionMeasurement {
            slip_ratio: 0.1,
            friction: 0.4,
            friction_std: 0.04,
        };
        filter.update(&good).unwrap();
        let before = filter;
        for bad in BAD {
            let mut refused = |change: fn(&mut FrictionMeasurement<f32>, f32), input| {
                let mut measurement = good;
                change(&mut measurement, bad);
                let got = filter.update(&measurement);
                assert_eq!(got, Err(UpdateError::NonFinite(input)), "{measurement:?}");
                let got = filter.update_reporting(&measurement);
                assert_eq!(got, Err(UpdateError::NonFinite(input)), "{measurement:?}");
                assert_eq!(filter, before);
            };
            refused(|m, bad| m.slip_ratio = bad, Input::SlipRatio);
            refused(|m, bad| m.friction = bad, Input::Friction);
        }
        for friction_std in [0.0, -0.04, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let measurement = FrictionMeasurement {
                friction_std,
                ..good
            };
            assert!(filter.update(&measurement).is_err());
            assert_eq!(filter, before);
        }
        let unsound = Estimate {
            state: state(),
            covariance: Covariance {
                p00: 1.0,
                p01: 2.0,
                p11: 1.0,
            },
        };
        assert_eq!(
            filter.restore(unsound),
            Err(UpdateError::PriorNotPositiveDefinite)
        );
        assert_eq!(filter, before);
    }
}

#[test]
fn an_estimate_that_was_copied_out_can_be_restored() {
    for mut filter in filters() {
        let start = filter.estimate();
        let measurement = FrictionMeasurement {
            slip_ratio: 0.1,
            friction: 0.4,
            friction_std: 0.04,
        };
        filter.update(&measurement).unwrap();
        let later = filter.estimate();
        assert_ne!(start, later);
        filter.reset();
        assert_eq!(filter.estimate(), start);
        filter.restore(later).unwrap();
        assert_eq!(filter.estimate(), later);
        let peak = filter.peak();
        assert_eq!(peak.peak_friction, later.state.peak_friction);
        assert_eq!(peak.correlation, later.covariance.correlation());
    }
}
