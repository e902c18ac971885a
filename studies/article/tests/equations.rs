//! What the article says of its equations, as exact tests on the core's law and filter.
#![expect(clippy::unwrap_used, reason = "a failed step fails the test")]

use muslip::filter::mu_slip::{Covariance, State, update_reporting};
use muslip::law::{Rudd, TyreLaw};
use test_support::Tolerance;
use test_support::scenario::article::{CRITICAL_SLIP, FRICTION_STD, PEAK_FRICTION};

/// H = (∂mu/∂mup, ∂mu/∂sp) of the article's true curve.
fn h(slip: f64) -> (f64, f64) {
    h_of(PEAK_FRICTION, CRITICAL_SLIP, slip)
}

fn h_of(peak_friction: f64, critical_slip: f64, slip: f64) -> (f64, f64) {
    let law = Rudd::new(peak_friction, critical_slip).unwrap();
    let gradient = law.gradient(slip);
    (gradient[0], gradient[1])
}

#[test]
fn at_the_peak_the_observation_matrix_is_one_and_zero() {
    let (by_peak, by_slip) = h(CRITICAL_SLIP);
    assert!((by_peak - 1.0).abs() <= f64::EPSILON, "{by_peak:e}");
    assert_eq!(by_slip, 0.0);
    // With a slip that binary numbers hold, not even the last digit is off.
    assert_eq!(h_of(PEAK_FRICTION, 0.125, 0.125), (1.0, 0.0));
}

#[test]
fn both_sensitivities_are_equally_large_at_one_point_on_either_side_of_the_peak() {
    // Found by bisection, not by the closed form that the tool prints.
    let difference = |slip| {
        let (by_peak, by_slip) = h(slip);
        by_peak.abs() - by_slip.abs()
    };
    let root = |mut low: f64, mut high: f64| {
        assert!(difference(low) * difference(high) < 0.0);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if difference(low) * difference(middle) > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    };
    let (below, above) = (root(0.01, CRITICAL_SLIP), root(CRITICAL_SLIP, 1.0));
    let truth = study_article::TRUTH;
    let (told_below, told_above) = study_article::equal_sensitivity_slips(truth).unwrap();
    let near = Tolerance::absolute(1e-12);
    near.check("below the peak", told_below, below);
    near.check("above the peak", told_above, above);
    near.check("mirror images", below * above, CRITICAL_SLIP.powi(2));

    // One sign change on either side: there is no other such point.
    let changes = (1..2000)
        .map(|i| f64::from(i) / 2000.0)
        .filter(|&slip| difference(slip) * difference(slip + 1.0 / 2000.0) < 0.0)
        .count();
    assert_eq!(changes, 2);
    assert_eq!(
        study_article::equal_sensitivity_slips(muslip_analysis::fit::Curve {
            peak_friction: 0.1,
            critical_slip: 0.15
        }),
        None
    );
}

#[test]
fn sensitivity_to_critical_slip_is_extreme_between_slips_0_05_and_0_10() {
    let (mut extreme, mut at) = (0.0, 0.0);
    for i in 0..15_000 {
        let slip = f64::from(i) * 1e-5;
        let by_slip = h(slip).1;
        if by_slip < extreme {
            (extreme, at) = (by_slip, slip);
        }
    }
    assert!((0.05..=0.10).contains(&at));
    let expected = (2.0_f64.sqrt() - 1.0) * CRITICAL_SLIP;
    assert!((at - expected).abs() <= 1e-5, "{at} {expected}");
    // There r = s/sp = √2 - 1 and ∂mu/∂sp = 2 mup/sp r (r² - 1)/(1 + r²)², which is -mup/(2 sp).
    let least = h(expected).1;
    Tolerance::relative(1e-14).check("least", least, -PEAK_FRICTION / (2.0 * CRITICAL_SLIP));
}

#[test]
fn sensitivity_to_critical_slip_changes_sign_at_the_peak_and_nowhere_else() {
    for i in 1..=1000 {
        let slip = f64::from(i) / 1000.0;
        let by_slip = h(slip).1;
        if slip < CRITICAL_SLIP {
            assert!(by_slip < 0.0, "{slip}");
        } else if slip > CRITICAL_SLIP {
            assert!(by_slip > 0.0, "{slip}");
        } else {
            assert_eq!(by_slip, 0.0);
        }
    }
}

/// At the peak of an estimate without correlation peak friction is measured directly.
fn measured_directly(check: impl Fn(f64, f64, Covariance<f64>, Covariance<f64>)) {
    let state = State {
        peak_friction: PEAK_FRICTION,
        critical_slip: CRITICAL_SLIP,
    };
    for peak_std in [1e-3, 1e-2, 0.1, 0.6, 1.0] {
        for slip_std in [1e-3, 0.01, 0.2] {
            for noise_std in [0.01, 3.0 * FRICTION_STD, 1.0] {
                let before = Covariance::from_std(peak_std, slip_std);
                let (after, fusion) = update_reporting(
                    state,
                    before,
                    CRITICAL_SLIP,
                    PEAK_FRICTION + 0.02,
                    noise_std * noise_std,
                )
                .unwrap();
                let snr = peak_std * peak_std / fusion.noise_variance;
                check(snr, fusion.peak_friction_gain, before, after.covariance);
            }
        }
    }
}

#[test]
fn gain_of_a_state_measured_directly_is_snr_over_one_plus_snr() {
    measured_directly(|snr, gain, _, _| {
        Tolerance::relative(1e-14).check("gain", gain, snr / (1.0 + snr));
    });
}

#[test]
fn variance_of_a_state_measured_directly_shrinks_by_one_minus_the_gain() {
    measured_directly(|_, gain, before, after| {
        let shrinkage = after.p00 / before.p00;
        Tolerance::absolute(1e-14).check("shrinkage", shrinkage, 1.0 - gain);
        assert_eq!(after.p11, before.p11, "the other state learns nothing");
        assert_eq!(after.p01, 0.0);
    });
}
