//! Properties of the two-state filter that hold for every update.
#![allow(clippy::unwrap_used, reason = "a failed step fails the test")]

use muslip::filter::mu_slip::{
    Config, Covariance, CovarianceForm, Estimate, MuSlipFilter, Range, State, UpdateError,
};
use muslip::filter::{Decision, Estimator, FrictionMeasurement};
use muslip::law::TyreLaw;
use proptest::prelude::*;
use test_support::{Noise, Tolerance};

/// Positive definite as the stored numbers are: products of two `f32` are exact in `f64`.
fn is_positive_definite(p: Covariance<f32>) -> bool {
    let [p00, p01, p11] = [p.p00, p.p01, p.p11].map(f64::from);
    p00 > 0.0 && p11 > 0.0 && p00 * p11 - p01 * p01 > 0.0 && (p00 * p11).is_finite()
}

/// What happened to a number of random updates.
#[derive(Debug, Default)]
struct Tally {
    updates: u64,
    refused: u64,
    corrupted: u64,
    widened: u64,
}

impl Tally {
    fn count(
        &mut self,
        prior: Covariance<f32>,
        filter: &MuSlipFilter<f32>,
        result: Result<Decision, UpdateError>,
    ) {
        self.updates += 1;
        match result {
            Ok(_) => {
                let (state, covariance) = (filter.state(), filter.covariance());
                let sound = state.is_finite() && is_positive_definite(covariance);
                self.corrupted += u64::from(!sound);
                let wider = covariance.p00 > prior.p00 || covariance.p11 > prior.p11;
                self.widened += u64::from(wider);
            }
            Err(_) => self.refused += 1,
        }
    }
}

fn started(noise_inflation: f32, range: Range) -> MuSlipFilter<f32> {
    Config {
        noise_inflation,
        ..Config::for_range(range)
    }
    .build()
    .unwrap()
}

/// Updates from unrelated random estimates, up to nearly singular ones and nearly exact measurements.
fn unrelated(seed: u64, updates: u64) -> Tally {
    let mut noise = Noise::seeded(seed);
    let mut tally = Tally::default();
    while tally.updates < updates {
        let state = State {
            peak_friction: noise.uniform(0.05, 1.2) as f32,
            critical_slip: noise.uniform(0.02, 0.5) as f32,
        };
        let (std0, std1) = (noise.log_uniform(1e-4, 1.0), noise.log_uniform(1e-4, 0.4));
        let independence = noise.log_uniform(1e-6, 1.0);
        let sign = noise.uniform(-1.0, 1.0).signum();
        let covariance = Covariance {
            p00: (std0 * std0) as f32,
            p01: (sign * (1.0 - independence) * std0 * std1) as f32,
            p11: (std1 * std1) as f32,
        };
        if !covariance.is_positive_definite() {
            continue;
        }
        let slip = noise.uniform(-0.05, 1.05) as f32;
        let friction = noise.uniform(-0.2, 1.4) as f32;
        let friction_std = noise.log_uniform(1e-4, 0.5) as f32;
        let mut filter = started(1.0, Range::Aircraft);
        filter.restore(Estimate { state, covariance }).unwrap();
        let result = filter.update(&FrictionMeasurement {
            slip_ratio: slip,
            friction,
            friction_std,
        });
        tally.count(covariance, &filter, result);
    }
    tally
}

/// Runs of up to 1000 updates, each on its own tyre (of a law that the filter does not have) with its
/// own noise, started as the filter is.
fn runs(seed: u64, updates: u64) -> Tally {
    let mut noise = Noise::seeded(seed);
    let mut tally = Tally::default();
    while tally.updates < updates {
        let range = if noise.uniform(0.0, 1.0) < 0.5 {
            Range::Aircraft
        } else {
            Range::Automotive
        };
        let mut filter = started(3.0, range);
        // Burckhardt's law where it rises from free rolling, else the Magic Formula.
        let (c1, c2, c3) = (
            noise.uniform(0.1, 1.3),
            noise.uniform(10.0, 90.0),
            noise.uniform(0.0, 0.5),
        );
        let (b, c, d, e) = (
            noise.uniform(5.0, 25.0),
            noise.uniform(1.1, 2.0),
            noise.uniform(0.1, 1.1),
            noise.uniform(-2.0, 1.0),
        );
        let std = noise.log_uniform(1e-3, 0.2);
        let length = noise.log_uniform(10.0, 1000.0) as u64;
        for _ in 0..length {
            let slip = noise.uniform(0.0, 1.0).powi(2);
            let law = if c1 * c2 > c3 {
                c1 * (1.0 - (-c2 * slip).exp()) - c3 * slip
            } else {
                let u = b * slip;
                d * (c * (u - e * (u - u.atan())).atan()).sin()
            };
            let friction = law + noise.normal(std);
            let prior = filter.covariance();
            let result = filter.update(&FrictionMeasurement {
                slip_ratio: slip as f32,
                friction: friction as f32,
                friction_std: std as f32,
            });
            tally.count(prior, &filter, result);
        }
    }
    tally
}

fn expect_sound(what: &str, tally: &Tally) {
    println!("{what}: {tally:?}");
    assert_eq!(tally.corrupted, 0, "{what}: {tally:?}");
    assert_eq!(tally.widened, 0, "{what}: {tally:?}");
}

#[test]
fn covariance_stays_positive_definite_and_narrows_over_a_hundred_thousand_updates() {
    expect_sound("unrelated", &unrelated(1, 50_000));
    let tally = runs(2, 50_000);
    expect_sound("runs", &tally);
    assert_eq!(tally.refused, 0, "{tally:?}");
}

#[test]
#[ignore = "ten million updates: run in release, as `cargo xtask test` does"]
fn covariance_stays_positive_definite_and_narrows_over_ten_million_updates() {
    expect_sound("unrelated", &unrelated(3, 5_000_000));
    let tally = runs(4, 5_000_000);
    expect_sound("runs", &tally);
    assert_eq!(tally.refused, 0, "{tally:?}");
}

/// What a filter of that configuration holds after one measurement, by the arithmetic in full.
fn after(config: Config<f64>, slip_ratio: f64, friction: f64) -> (State<f64>, Covariance<f64>) {
    let mut filter = config.build().unwrap();
    let friction_std = 0.04;
    filter
        .update_reporting(&FrictionMeasurement {
            slip_ratio,
            friction,
            friction_std,
        })
        .unwrap();
    (filter.state(), filter.covariance())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn a_measurement_at_zero_slip_says_nothing(friction in -0.5..0.5_f64) {
        let config = Config::default();
        let (state, covariance) = after(config, 0.0, friction);
        prop_assert_eq!(state, config.initial_state);
        prop_assert_eq!(covariance, config.initial_covariance);
    }

    #[test]
    fn driving_and_braking_mirror_each_other(slip in 0.0..1.0_f64, friction in -0.2..1.2_f64) {
        let config = Config::for_range(Range::Automotive);
        prop_assert_eq!(after(config, slip, friction), after(config, -slip, -friction));
    }

    #[test]
    fn a_measurement_that_was_predicted_moves_nothing_but_narrows(slip in 0.01..1.0_f64) {
        let config = Config::for_range(Range::Automotive);
        let predicted = config.initial_state.law().unwrap().friction(slip);
        let (state, covariance) = after(config, slip, predicted);
        prop_assert_eq!(state, config.initial_state);
        prop_assert!(covariance.p00 < config.initial_covariance.p00);
    }

    #[test]
    fn pseudonoise_and_inflation_only_ever_weaken_a_measurement(slip in 0.01..1.0_f64) {
        let article = Config::default();
        let bare = Config { pseudonoise: false, ..article };
        let true_noise = Config { noise_inflation: 1.0, ..bare };
        let [weak, middle, strong] = [article, bare, true_noise].map(|c| after(c, slip, 0.3).1);
        prop_assert!(weak.p00 >= middle.p00 && middle.p00 > strong.p00);
        prop_assert!(weak.p11 >= middle.p11 && middle.p11 >= strong.p11);
    }

    #[test]
    fn the_two_forms_of_the_covariance_agree(slip in 0.0..1.0_f64, friction in -0.2..1.2_f64) {
        let short = Config::default();
        let joseph = Config { covariance_form: CovarianceForm::Joseph, ..short };
        let (a, b) = (after(short, slip, friction), after(joseph, slip, friction));
        prop_assert_eq!(a.0, b.0);
        let near = Tolerance { absolute: 1e-16, relative: 1e-14 };
        near.check("P11", a.1.p00, b.1.p00);
        near.check("P12", a.1.p01, b.1.p01);
        near.check("P22", a.1.p11, b.1.p11);
    }

    #[test]
    fn the_gate_rejects_above_its_limit_only_and_leaves_the_estimate(
        slip in 0.0..1.0_f64, friction in -3.0..3.0_f64, gate in 0.01..9.0_f64,
    ) {
        let open = Config::default();
        let mut filter = open.build().unwrap();
        let measurement = FrictionMeasurement { slip_ratio: slip, friction, friction_std: 0.04 };
        let nis = filter.update_reporting(&measurement).unwrap().nis;
        let mut gated = Config { nis_gate: Some(gate), ..open }.build().unwrap();
        let mut quiet = gated;
        let fusion = gated.update_reporting(&measurement).unwrap();
        prop_assert_eq!(quiet.update(&measurement), Ok(fusion.decision));
        prop_assert_eq!(quiet, gated);
        if nis > gate {
            prop_assert_eq!(fusion.decision, Decision::Rejected);
            prop_assert_eq!(fusion.signal_after, fusion.signal_before);
            prop_assert_eq!(gated.state(), open.initial_state);
            prop_assert_eq!(gated.covariance(), open.initial_covariance);
        } else {
            prop_assert_eq!(fusion.decision, Decision::Accepted);
            prop_assert_eq!(gated.estimate(), filter.estimate());
        }
    }
}
