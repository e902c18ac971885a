//! The unchecked update against the checked one.

use muslip::filter::mu_slip::{Covariance, State, update, update_unchecked};
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
        let Ok((x, p)) = update(state, covariance, slip, friction, variance) else {
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
