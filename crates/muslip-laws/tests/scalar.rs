//! The laws with a dual number as their scalar.

#[path = "../../muslip/tests/dual/mod.rs"]
mod dual;

use dual::Dual;
use muslip::law::TyreLaw;
use muslip_laws::{Burckhardt, MagicFormula};
use test_support::Tolerance;

const NEAR: Tolerance = Tolerance {
    absolute: 1e-12,
    relative: 1e-12,
};

#[test]
fn the_slope_of_each_law_is_the_derivative_of_its_friction() {
    let slip = Dual::of(0.23, 1.0);
    let seeds = |p: &[f64]| p.iter().map(|&v| Dual::of(v, 0.0)).collect::<Vec<_>>();
    let p = seeds(&[1.2801, 23.99, 0.52]);
    let law = Burckhardt::new(p[0], p[1], p[2]).unwrap();
    NEAR.check(
        "Burckhardt",
        law.friction(slip).0.eps,
        law.slip_derivative(slip).0.re,
    );
    let p = seeds(&[10.0, 1.9, 1.0, 0.97]);
    let law = MagicFormula::new(p[0], p[1], p[2], p[3]).unwrap();
    NEAR.check(
        "Magic Formula",
        law.friction(slip).0.eps,
        law.slip_derivative(slip).0.re,
    );
}

#[test]
fn the_peak_of_the_magic_formula_carries_derivatives() {
    let peak_at = |b: f64| {
        MagicFormula::new(b, 1.9, 1.0, 0.5)
            .unwrap()
            .peak()
            .slip_ratio
    };
    let dual = |v, eps| Dual::of(v, eps);
    let law = MagicFormula::new(
        dual(10.0, 1.0),
        dual(1.9, 0.0),
        dual(1.0, 0.0),
        dual(0.5, 0.0),
    );
    let got = law.unwrap().peak().slip_ratio.0.eps;
    let difference = (peak_at(10.0 + 1e-5) - peak_at(10.0 - 1e-5)) / 2e-5;
    Tolerance::relative(1e-7).check("by stiffness factor", got, difference);
}
