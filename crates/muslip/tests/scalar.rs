//! The crate's own code with a dual number as its scalar.

mod dual;

use dual::Dual;
use muslip::filter::mu_slip::{Config, Range, update_reporting};
use muslip::filter::{Estimator, FrictionMeasurement};
use muslip::law::{Rudd, TyreLaw};
use test_support::Tolerance;

const NEAR: Tolerance = Tolerance {
    absolute: 1e-12,
    relative: 1e-12,
};

#[test]
fn the_slope_of_the_law_is_the_derivative_of_its_friction() {
    let slip = Dual::of(0.23, 1.0);
    let seeds = |p: &[f64]| p.iter().map(|&v| Dual::of(v, 0.0)).collect::<Vec<_>>();
    let p = seeds(&[0.8, 0.14]);
    let law = Rudd::new(p[0], p[1]).unwrap();
    NEAR.check(
        "Rudd",
        law.friction(slip).0.eps,
        law.slip_derivative(slip).0.re,
    );
}

#[test]
fn the_gain_is_the_derivative_of_the_updated_state_by_the_measured_friction() {
    let (slip, friction, std) = (0.1, 0.4, 0.04);
    let constant = |v| Dual::of(v, 0.0);
    let mut filter = Config::<Dual>::default().build().unwrap();
    let measurement = FrictionMeasurement {
        slip_ratio: constant(slip),
        friction: Dual::of(friction, 1.0),
        friction_std: constant(std),
    };
    filter.update(&measurement).unwrap();
    let updated = filter.state();
    let (_, fusion) = update_reporting(
        Range::Aircraft.initial_state(),
        Range::Aircraft.initial_covariance(),
        slip,
        friction,
        (3.0 * std) * (3.0 * std),
    )
    .unwrap();
    NEAR.check(
        "peak friction",
        updated.peak_friction.0.eps,
        fusion.peak_friction_gain,
    );
    NEAR.check(
        "critical slip",
        updated.critical_slip.0.eps,
        fusion.critical_slip_gain,
    );
}
