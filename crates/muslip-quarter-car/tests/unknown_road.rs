//! The bank of roads against its equations with dense matrices, the seeker of the peak, the guard against a
//! locked wheel: what they do and what they refuse.
#![allow(clippy::unwrap_used, reason = "a failed step fails the test")]

use muslip::filter::{FrictionMeasurement, mu_slip};
use muslip::law::TyreLaw;
use muslip_laws::burckhardt::{DRY_ASPHALT, PublishedSet, SNOW, WET_ASPHALT};
use muslip_quarter_car::filter::{
    Channel, Config, ConfigError, ConfigParameter, Filter, Measurement, Road, Vehicle,
};
use muslip_quarter_car::lock_guard::{self, Advice};
use muslip_quarter_car::peak_seeker::{self, ConfigError as SeekerError};
use muslip_quarter_car::road_bank::RoadBank;
use nalgebra::{SMatrix, SVector};
use test_support::{Noise, Tolerance};

const VEHICLE: Vehicle<f64> = Vehicle {
    radius_m: 0.3,
    inertia_kg_m2: 1.0,
    gravity_m_s2: 9.81,
};

fn filter(set: PublishedSet) -> Filter<f64> {
    let mut config = Config::tuned(VEHICLE, Road::Known(set.law()), 30.0);
    config.initial_std.mass_kg = 22.5;
    config.process_std.friction = 0.05;
    // The oracle below has no gate.
    config.nis_gate = None;
    config.keeps_slip_positive = false;
    config.build().unwrap()
}

fn bank() -> RoadBank<f64, 3> {
    RoadBank::new([DRY_ASPHALT, WET_ASPHALT, SNOW].map(filter), 0.01).unwrap()
}

/// Torque and wheel speed of a brake that works up to a slip on a road.
fn course(set: PublishedSet, slip_at_end: f64, seed: u64) -> Vec<(f64, f64)> {
    let law = set.law::<f64>();
    let mut noise = Noise::seeded(seed);
    let mut v = 30.0;
    let mut omega_before = 100.0;
    (0..200)
        .map(|step| {
            let t = f64::from(step) * 0.005;
            let slip = slip_at_end * (1.0 - (-t / 0.08).exp());
            let friction = law.friction(slip);
            v -= 0.005 * 9.81 * friction;
            let omega = v * (1.0 - slip) / 0.3;
            let torque = 0.3 * 450.0 * 9.81 * friction - (omega - omega_before) / 0.005;
            omega_before = omega;
            (torque.max(0.0), omega + noise.normal(0.1))
        })
        .collect()
}

#[test]
fn the_bank_finds_the_road_that_the_wheel_is_on() {
    for (index, set) in [DRY_ASPHALT, WET_ASPHALT, SNOW].into_iter().enumerate() {
        let slip = 0.9 * set.law::<f64>().peak().slip_ratio;
        for seed in 0..5 {
            let mut bank = bank();
            for (torque, omega) in course(set, slip, seed) {
                bank.step(torque, Some((omega, 0.04))).unwrap();
                let sum: f64 = bank.weights().iter().sum();
                assert!((sum - 1.0).abs() < 1e-12);
            }
            let weights = bank.weights();
            assert!(weights[index] > 0.8, "{} {weights:?}", set.name());
        }
    }
}

#[test]
fn a_step_of_the_bank_is_that_of_the_equations() {
    let mut bank = bank();
    for (count, (torque, omega)) in course(DRY_ASPHALT, 0.15, 3)
        .into_iter()
        .take(60)
        .enumerate()
    {
        // Mixing, written with vectors and matrices.
        let weights = bank.weights();
        let estimates = bank.filters().map(|filter| filter.estimate());
        let means = estimates.map(|estimate| SVector::from(estimate.state.to_array()));
        let spreads = estimates.map(|estimate| SMatrix::from(estimate.covariance.rows()));
        let mut expected = Vec::new();
        for j in 0..3 {
            let shares: [f64; 3] =
                std::array::from_fn(|i| weights[i] * if i == j { 0.99 } else { 0.005 });
            let c: f64 = shares.iter().sum();
            let mean = (0..3).fold(SVector::<f64, 5>::zeros(), |sum, i| {
                sum + means[i] * (shares[i] / c)
            });
            let spread = (0..3).fold(SMatrix::<f64, 5, 5>::zeros(), |sum, i| {
                let d = means[i] - mean;
                sum + (spreads[i] + d * d.transpose()) * (shares[i] / c)
            });
            let mut filter = bank.filters()[j];
            filter
                .restore(muslip_quarter_car::filter::Estimate {
                    state: muslip_quarter_car::filter::State::from_array(std::array::from_fn(
                        |i| mean[i],
                    )),
                    covariance: muslip_quarter_car::filter::Covariance::from_rows(
                        std::array::from_fn(|i| std::array::from_fn(|k| spread[(i, k)])),
                    ),
                })
                .unwrap();
            filter.predict(torque).unwrap();
            let fusion = filter
                .update(&Measurement {
                    channel: Channel::WheelSpeed,
                    value: omega,
                    variance: 0.04,
                })
                .unwrap();
            let likelihood =
                (-0.5 * fusion.nis.min(25.0)).exp() / fusion.innovation_variance.sqrt();
            expected.push((c * likelihood, filter));
        }
        bank.step(torque, Some((omega, 0.04))).unwrap();
        let total: f64 = expected.iter().map(|(weight, _)| weight).sum();
        for (j, (weight, filter)) in expected.iter().enumerate() {
            // The floor of 1e-6 on a weight is not in the equations.
            Tolerance::absolute(1e-5).check("weight", bank.weights()[j], weight / total);
            let (ours, theirs) = (bank.filters()[j].estimate(), filter.estimate());
            for i in 0..5 {
                Tolerance {
                    absolute: 1e-8,
                    relative: 1e-8,
                }
                .check(
                    &format!("state {i} at {count}"),
                    ours.state.to_array()[i],
                    theirs.state.to_array()[i],
                );
            }
        }
        let mixed = SVector::from(bank.estimate().state.to_array());
        let mean = (0..3).fold(SVector::<f64, 5>::zeros(), |sum, i| {
            sum + SVector::from(bank.filters()[i].estimate().state.to_array()) * bank.weights()[i]
        });
        assert!((mixed - mean).norm() < 1e-9);
    }
}

#[test]
fn a_bank_refuses_bad_input_and_stays_as_it_was() {
    for bad in [0.0, 1.0, -0.1, f64::NAN] {
        assert_eq!(
            RoadBank::new([filter(SNOW), filter(DRY_ASPHALT)], bad),
            Err(ConfigError::OutOfRange(ConfigParameter::Bank))
        );
    }
    assert!(RoadBank::new([filter(SNOW)], 0.01).is_err());
    let mut tried = bank();
    tried.step(100.0, Some((99.0, 0.04))).unwrap();
    let before = tried;
    assert!(tried.step(f64::NAN, Some((99.0, 0.04))).is_err());
    assert!(tried.step(-1.0, None).is_err());
    assert!(tried.step(100.0, Some((f64::NAN, 0.04))).is_err());
    assert!(tried.step(100.0, Some((99.0, 0.0))).is_err());
    assert_eq!(tried, before);
    // Without a reading the weights only drift towards each other.
    tried.step(100.0, None).unwrap();
    assert!(tried.weights().iter().all(|weight| *weight > 0.0));
}

fn point(set: PublishedSet, slip: f64, noise: &mut Noise) -> FrictionMeasurement<f64> {
    FrictionMeasurement {
        slip_ratio: slip,
        friction: set.law::<f64>().friction(slip) + noise.normal(0.02),
        friction_std: 0.02,
    }
}

#[test]
fn the_seeker_holds_slip_near_the_peak_and_notices_another_road() {
    let mut seeker = peak_seeker::Config::usual().build().unwrap();
    let mut noise = Noise::seeded(5);
    let mut slip = 0.0;
    let run = |seeker: &mut peak_seeker::PeakSeeker<f64>,
               set: PublishedSet,
               slip: &mut f64,
               noise: &mut Noise| {
        for _ in 0..200 {
            let setpoint = seeker.step(&point(set, *slip, noise)).unwrap();
            assert!((0.05..=0.18).contains(&setpoint));
            *slip += 0.1 * (setpoint - *slip);
        }
        let law = set.law::<f64>();
        let share = law.friction(*slip) / law.peak().friction;
        assert!(share > 0.93, "{} {slip} {share}", set.name());
    };
    run(&mut seeker, DRY_ASPHALT, &mut slip, &mut noise);
    let restarts = seeker.restarts();
    run(&mut seeker, WET_ASPHALT, &mut slip, &mut noise);
    assert!(seeker.restarts() > restarts, "the step went unnoticed");
    run(&mut seeker, DRY_ASPHALT, &mut slip, &mut noise);
}

#[test]
fn the_seeker_refuses_bad_input_and_stays_as_it_was() {
    let usual = peak_seeker::Config::<f64>::usual();
    for bad in [
        peak_seeker::Config {
            minimum_slip: 0.0,
            ..usual
        },
        peak_seeker::Config {
            maximum_slip: 1.0,
            ..usual
        },
        peak_seeker::Config {
            initial_slip: 0.5,
            ..usual
        },
        peak_seeker::Config {
            setpoint_share: f64::NAN,
            ..usual
        },
        peak_seeker::Config {
            innovation_weight: 1.5,
            ..usual
        },
        peak_seeker::Config {
            change_threshold: 0.0,
            ..usual
        },
    ] {
        assert_eq!(bad.build().unwrap_err(), SeekerError::OutOfRange);
    }
    let bad = peak_seeker::Config {
        filter: mu_slip::Config {
            noise_inflation: 0.0,
            ..usual.filter
        },
        ..usual
    };
    assert!(matches!(bad.build(), Err(SeekerError::Filter(_))));
    let mut seeker = usual.build().unwrap();
    let before = seeker;
    let mut bad = point(DRY_ASPHALT, 0.05, &mut Noise::seeded(1));
    bad.friction = f64::NAN;
    assert!(seeker.step(&bad).is_err());
    assert_eq!(seeker, before);
}

#[test]
fn the_guard_opens_the_brake_of_a_wheel_that_stands_and_tells_lock_from_rest() {
    let mut guard = lock_guard::Config::usual().build().unwrap();
    for _ in 0..100 {
        assert_eq!(guard.step(Some(50.0)), Advice::Free);
    }
    // Locked: it opens after ten samples, and the wheel turns.
    for _ in 0..9 {
        assert_eq!(guard.step(Some(0.1)), Advice::Free);
    }
    for _ in 0..5 {
        assert_eq!(guard.step(Some(-0.1)), Advice::Open);
    }
    assert_eq!(guard.step(Some(20.0)), Advice::Free);
    // At rest: open for thirty samples, then no more until the wheel turns.
    let told: Vec<Advice> = (0..60).map(|_| guard.step(Some(0.05))).collect();
    let count = |wanted| told.iter().filter(|advice| **advice == wanted).count();
    assert_eq!((count(Advice::Free), count(Advice::Open)), (9, 30));
    assert_eq!(count(Advice::AtRest), 21);
    assert_eq!(guard.step(Some(10.0)), Advice::Free);
    // A reading that is none changes nothing.
    let before = guard;
    assert_eq!(guard.step(None), Advice::Free);
    assert_eq!(guard.step(Some(f64::NAN)), Advice::Free);
    assert_eq!(guard, before);
    for bad in [0.0, -1.0, f64::NAN] {
        let config = lock_guard::Config {
            standing_rad_s: bad,
            ..lock_guard::Config::usual()
        };
        assert!(config.build().is_none());
    }
}
