//! The laws' analytic derivatives against dual numbers on a second transcription of each law.
//!
//! The transcriptions below follow the printed equations and share nothing with the crate.

#[path = "../../muslip/tests/derivatives/mod.rs"]
mod derivatives;

use derivatives::agrees;
use muslip::law::TyreLaw;
use muslip::real::Real;
use muslip_laws::{Burckhardt, MagicFormula};
use num_dual::DualNum;
use proptest::prelude::*;
use test_support::Tolerance;

fn burckhardt<D: DualNum<Primitive = f64> + Copy>([c1, c2, c3]: [D; 3], s: D) -> D {
    c1 * (-(-c2 * s).exp() + 1.0) - c3 * s
}

fn magic_formula<D: DualNum<Primitive = f64> + Copy>([b, c, d, e]: [D; 4], s: D) -> D {
    let x = b * s;
    d * (c * (x - e * (x - x.atan())).atan()).sin()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn burckhardt_agrees_with_dual_numbers(
        c1 in 0.04..1.5_f64, c2 in 4.0..310.0_f64, c3 in 0.0..0.15_f64, slip in 0.0..1.1_f64,
    ) {
        agrees(Burckhardt::new(c1, c2, c3).unwrap(), slip, burckhardt, burckhardt);
    }

    #[test]
    fn magic_formula_agrees_with_dual_numbers(
        b in 1.0..40.0_f64, c in 0.5..2.0_f64, d in 0.05..1.5_f64, e in -10.0..1.0_f64,
        slip in -1.1..1.1_f64,
    ) {
        let law = MagicFormula::new(b, c, d, e).unwrap();
        agrees(law, slip, magic_formula, magic_formula);
    }

    #[test]
    fn parameters_go_both_ways(
        b in 1.0..40.0_f64, c in 0.5..2.0_f64, d in 0.05..1.5_f64, e in -10.0..1.0_f64,
    ) {
        let law = MagicFormula::new(b, c, d, e).unwrap();
        prop_assert_eq!(MagicFormula::from_parameters(&law.parameters()), Ok(law));
        let law = Burckhardt::new(d, 10.0 + b, 0.1 * d).unwrap();
        prop_assert_eq!(Burckhardt::from_parameters(&law.parameters()), Ok(law));
    }

    #[test]
    fn single_precision_follows_double_within_a_few_roundings(
        b in 1.0..40.0_f32, c in 0.5..2.0_f32, d in 0.05..1.5_f32, e in -10.0..1.0_f32,
        slip in -1.1..1.1_f32,
    ) {
        let single = MagicFormula::new(b, c, d, e).unwrap().friction(slip);
        let wide = [b, c, d, e].map(f64::from);
        let double = magic_formula(wide, f64::from(slip));
        // Angle errors of a few roundings of y, whose terms reach |E| u; θ flattens as y grows.
        let near = Tolerance::absolute(4e-6 * f64::from(d));
        near.check("friction", f64::from(single), double);
    }

    #[test]
    fn no_slip_has_more_friction_than_the_peak(
        b in 1.0..40.0_f64, c in 0.5..2.0_f64, d in 0.05..1.5_f64, e in -10.0..1.0_f64,
        slip in 0.0..1.0_f64,
    ) {
        let law = MagicFormula::new(b, c, d, e).unwrap();
        let peak = law.peak();
        prop_assert!((0.0..=1.0).contains(&peak.slip_ratio));
        prop_assert!(law.friction(slip) <= peak.friction * (1.0 + 1e-14));
        prop_assert!(!peak.is_maximum || law.slip_derivative(peak.slip_ratio).abs() < 1e-9);
    }
}

#[test]
fn a_slip_that_is_not_finite_gives_a_friction_that_is_not_a_number_or_bounded() {
    let magic = MagicFormula::new(10.0, 1.9, 1.0, 0.97).unwrap();
    assert!(magic.friction(f64::NAN).is_nan());
    assert!(!Real::is_finite(
        Burckhardt::new(1.0, 20.0, 0.5)
            .unwrap()
            .friction(f64::INFINITY)
    ));
}
