//! What the `serde` feature writes and takes back.
#![cfg(feature = "serde")]

use muslip::filter::Estimator;
use muslip::filter::mu_slip::{Config, Estimate, Range};
use muslip::law::Rudd;

#[test]
fn an_estimate_survives_a_round_trip_and_reads_in_words() {
    let estimate = Config::<f64>::default().build().unwrap().estimate();
    let text = serde_json::to_string(&estimate).unwrap();
    assert!(text.contains(r#""state":{"peak_friction":0.6,"critical_slip":0.2}"#));
    assert_eq!(
        serde_json::from_str::<Estimate<f64>>(&text).unwrap(),
        estimate
    );
}

#[test]
fn a_configuration_survives_a_round_trip() {
    let config = Config::<f32>::for_range(Range::Automotive);
    let text = serde_json::to_string(&config).unwrap();
    assert!(text.contains(r#""covariance_form":"short""#));
    assert_eq!(serde_json::from_str::<Config<f32>>(&text).unwrap(), config);
}

#[test]
fn a_law_is_validated_on_the_way_in() {
    let law = Rudd::new(0.8, 0.14).unwrap();
    let text = serde_json::to_string(&law).unwrap();
    assert_eq!(serde_json::from_str::<Rudd<f64>>(&text).unwrap(), law);
    let refusal = serde_json::from_str::<Rudd<f64>>(r#"{"peak_friction":0.8,"critical_slip":0.0}"#);
    assert!(refusal.unwrap_err().to_string().contains("critical slip"));
}
