//! The law's analytic derivatives against dual numbers on a second transcription of it.
//!
//! The transcription below follows the printed equation and shares nothing with the crate.

mod derivatives;

use derivatives::agrees;
use muslip::law::{Rudd, TyreLaw};
use num_dual::DualNum;
use proptest::prelude::*;

fn rudd<D: DualNum<Primitive = f64> + Copy>([peak_friction, critical_slip]: [D; 2], s: D) -> D {
    let r = s / critical_slip;
    peak_friction * s * 2.0 / (critical_slip * (r.powi(2) + 1.0))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn rudd_agrees_with_dual_numbers(
        peak_friction in 0.05..1.5_f64, critical_slip in 0.02..0.6_f64, slip in -1.1..1.1_f64,
    ) {
        let law = Rudd::new(peak_friction, critical_slip).unwrap();
        agrees(law, slip, rudd, rudd);
    }

    #[test]
    fn parameters_go_both_ways(peak_friction in 0.05..1.5_f64, critical_slip in 0.02..0.6_f64) {
        let law = Rudd::new(peak_friction, critical_slip).unwrap();
        prop_assert_eq!(Rudd::from_parameters(&law.parameters()), Ok(law));
    }
}

#[test]
fn a_slip_that_is_not_finite_gives_a_friction_that_is_not_a_number() {
    let rudd = Rudd::new(0.5, 0.1).unwrap();
    assert!(rudd.friction(f64::NAN).is_nan());
    assert!(rudd.friction(f64::INFINITY).is_nan());
}
