//! What the `serde` feature takes back.
#![cfg(feature = "serde")]

use muslip_laws::{Burckhardt, MagicFormula};

#[test]
fn laws_are_validated_on_the_way_in() {
    assert!(serde_json::from_str::<Burckhardt<f64>>(r#"{"c1":0.1,"c2":2.0,"c3":0.5}"#).is_err());
    let formula =
        r#"{"stiffness_factor":10,"shape_factor":2.5,"peak_factor":1,"curvature_factor":0}"#;
    assert!(serde_json::from_str::<MagicFormula<f32>>(formula).is_err());
}
