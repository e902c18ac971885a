//! What the quarter-car filter does with inputs and situations that the tutorial leaves out.
#![expect(clippy::unwrap_used, reason = "a failed step fails the test")]

use muslip::filter::Decision;
use muslip_laws::burckhardt::DRY_ASPHALT;
use muslip_quarter_car::filter::{
    Channel, Config, ConfigError, ConfigParameter, Filter, Input, Measurement, Motion, Road,
    StepError, Vehicle,
};

const VEHICLE: Vehicle<f64> = Vehicle {
    radius_m: 0.3,
    inertia_kg_m2: 1.0,
    gravity_m_s2: 9.81,
};

fn config(speed: f64) -> Config<f64> {
    Config::tuned(VEHICLE, Road::Known(DRY_ASPHALT.law()), speed)
}

fn wheel(value: f64) -> Measurement<f64> {
    Measurement {
        channel: Channel::WheelSpeed,
        value,
        variance: 0.01,
    }
}

/// Brings the filter to a steady slip: consistent torque and readings.
fn braked(seconds: f64) -> (Filter<f64>, f64) {
    let mut filter = config(30.0).build().unwrap();
    let mut v = 30.0;
    for step in 0..(seconds / 0.005) as u32 {
        let t = f64::from(step) * 0.005;
        let slip = 0.12 * (1.0 - (-t / 0.06).exp());
        let (c1, c2, c3) = DRY_ASPHALT.coefficients();
        let mu = c1 * (1.0 - (-c2 * slip).exp()) - c3 * slip;
        filter.predict(0.3 * 450.0 * 9.81 * mu + 30.0).unwrap();
        v -= 0.005 * 9.81 * mu;
        // A hair of dither, as no reading repeats itself.
        let dither = if step % 2 == 0 { 0.01 } else { -0.01 };
        filter
            .update(&wheel(v * (1.0 - slip) / 0.3 + dither))
            .unwrap();
    }
    (filter, v)
}

#[test]
fn every_field_of_the_configuration_is_checked_and_named() {
    use ConfigParameter as P;
    let refused = |change: &dyn Fn(&mut Config<f64>), parameter| {
        let mut config = config(30.0);
        change(&mut config);
        assert_eq!(
            config.build().unwrap_err(),
            ConfigError::OutOfRange(parameter)
        );
    };
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        refused(&|c| c.vehicle.radius_m = bad, P::Radius);
        refused(&|c| c.vehicle.inertia_kg_m2 = bad, P::Inertia);
        refused(&|c| c.vehicle.gravity_m_s2 = bad, P::Gravity);
        refused(&|c| c.sample_time_s = bad, P::SampleTime);
        refused(&|c| c.initial_mass_kg = bad, P::InitialMass);
        refused(
            &|c| c.minimum_vehicle_speed_m_s = bad,
            P::MinimumVehicleSpeed,
        );
    }
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        refused(
            &|c| c.initial_vehicle_speed_m_s = bad,
            P::InitialVehicleSpeed,
        );
        refused(&|c| c.initial_std.mass_kg = bad, P::InitialStd);
        refused(&|c| c.process_std.friction = bad, P::ProcessStd);
    }
    for bad in [0.0, -1.0, f64::NAN] {
        refused(&|c| c.nis_gate = Some(bad), P::NisGate);
    }
}

#[test]
fn an_input_that_is_refused_leaves_the_filter_as_it_was() {
    let (filter, _) = braked(0.5);
    let mut tried = filter;
    for (torque, error) in [
        (f64::NAN, StepError::NonFinite(Input::BrakeTorque)),
        (f64::INFINITY, StepError::NonFinite(Input::BrakeTorque)),
        (-1.0, StepError::Negative(Input::BrakeTorque)),
        (1e308, StepError::Overflow),
    ] {
        // A torque beyond all bounds locks the wheel, which is no overflow; it must not do harm.
        match tried.predict(torque) {
            Err(got) => {
                assert_eq!(got, error);
                assert_eq!(tried, filter);
            }
            Ok(motion) => {
                assert_eq!((torque, motion), (1e308, Motion::Locked));
                tried = filter;
            }
        }
    }
    for (measurement, error) in [
        (wheel(f64::NAN), StepError::NonFinite(Input::Measurement)),
        (
            Measurement {
                variance: f64::NAN,
                ..wheel(80.0)
            },
            StepError::NonFinite(Input::Noise),
        ),
        (
            Measurement {
                variance: 0.0,
                ..wheel(80.0)
            },
            StepError::Negative(Input::Noise),
        ),
        (
            Measurement {
                variance: -0.01,
                ..wheel(80.0)
            },
            StepError::Negative(Input::Noise),
        ),
        (wheel(f64::MAX), StepError::Overflow),
    ] {
        assert_eq!(tried.update(&measurement), Err(error));
        assert_eq!(tried, filter);
    }
    let mut estimate = filter.estimate();
    estimate.state.friction = f64::NAN;
    assert!(tried.restore(estimate).is_err());
    let mut estimate = filter.estimate();
    estimate.covariance.p33 = -1.0;
    assert!(tried.restore(estimate).is_err());
    assert!(tried.restart(f64::NAN).is_err() && tried.restart(-1.0).is_err());
    assert_eq!(tried, filter);
}

#[test]
fn slip_has_no_value_near_zero_speed_and_nothing_divides_by_it() {
    for speed in [0.0, 1e-9, 0.1, 0.45] {
        let mut filter = config(speed).build().unwrap();
        assert_eq!(filter.motion(), Motion::Standstill);
        assert_eq!(filter.slip_ratio(), None);
        for step in 0..1000 {
            assert_eq!(filter.predict(1500.0), Ok(Motion::Standstill));
            filter
                .update(&wheel(if step % 2 == 0 { 0.1 } else { -0.1 }))
                .unwrap();
            assert!(filter.estimate().state.is_finite());
            assert!(filter.estimate().covariance.is_valid());
            assert!(filter.slip_ratio().is_none());
        }
        // No friction was known at the start, so none slows it; it does not move off either.
        assert!(filter.estimate().state.vehicle_speed_m_s < 0.5);
    }
}

#[test]
fn braking_runs_down_to_standstill_and_speed_never_turns() {
    let (mut filter, mut v) = braked(2.0);
    let mut stood = false;
    for step in 0..400 {
        filter.predict(1500.0).unwrap();
        v = (v - 0.005 * 9.81 * 1.15_f64).max(0.0);
        let dither = if step % 2 == 0 { 0.03 } else { -0.03 };
        filter.update(&wheel(v * 0.88 / 0.3 + dither)).unwrap();
        let state = filter.estimate().state;
        assert!(state.is_finite() && state.vehicle_speed_m_s >= 0.0);
        stood |= filter.motion() == Motion::Standstill;
    }
    assert!(stood && filter.slip_ratio().is_none());
    assert!(filter.estimate().state.vehicle_speed_m_s < 0.1);
}

#[test]
fn the_brake_s_torque_does_not_turn_a_standing_wheel() {
    let mut filter = config(0.0).build().unwrap();
    for torque in [0.0, 1.0, 3000.0] {
        for _ in 0..100 {
            filter.predict(torque).unwrap();
        }
        assert_eq!(filter.estimate().state.wheel_speed_rad_s, 0.0);
        assert_eq!(filter.estimate().state.vehicle_speed_m_s, 0.0);
    }
}

#[test]
fn a_locked_wheel_is_told_as_such_and_turns_again_when_released() {
    let (mut filter, _) = braked(0.5);
    let mut omega: f64 = filter.estimate().state.wheel_speed_rad_s;
    let mut locked_at = None;
    for step in 0..60 {
        let motion = filter.predict(3000.0).unwrap();
        omega = (omega - 0.005 * 1500.0).max(0.0);
        let dither = if step % 2 == 0 { 0.05 } else { -0.05 };
        filter.update(&wheel(omega + dither)).unwrap();
        assert!(filter.estimate().state.is_finite());
        if motion == Motion::Locked {
            locked_at.get_or_insert(step);
            assert_eq!(filter.slip_ratio(), Some(1.0));
            assert!(filter.estimate().state.wheel_speed_rad_s.abs() < 0.3);
        }
    }
    assert!(locked_at.is_some_and(|step| step < 30), "{locked_at:?}");
    // Released: the tyre spins it up, and slip is a number again.
    let mut spun = false;
    for step in 0..40 {
        let motion = filter.predict(0.0).unwrap();
        omega = (omega + 0.005 * 1000.0).min(60.0);
        let dither = if step % 2 == 0 { 0.05 } else { -0.05 };
        filter.update(&wheel(omega + dither)).unwrap();
        spun |= motion == Motion::Rolling;
    }
    assert!(spun && filter.slip_ratio().is_some_and(|slip| slip < 0.9));
}

#[test]
fn a_frozen_reading_is_left_out_and_a_healthy_one_taken_again() {
    let (mut filter, _) = braked(0.5);
    let last = filter.estimate().state.wheel_speed_rad_s;
    assert_eq!(
        filter.update(&wheel(last)).unwrap().decision,
        Decision::Accepted
    );
    for _ in 0..10 {
        filter.predict(1500.0).unwrap();
        let before = filter.estimate();
        assert_eq!(
            filter.update(&wheel(last)).unwrap().decision,
            Decision::Rejected
        );
        assert_eq!(filter.estimate(), before);
    }
    let next = filter.estimate().state.wheel_speed_rad_s + 0.02;
    assert_eq!(
        filter.update(&wheel(next)).unwrap().decision,
        Decision::Accepted
    );
}

#[test]
fn a_wild_reading_is_rejected_but_not_for_ever() {
    let (filter, _) = braked(0.5);
    let mut tried = filter;
    let there = filter.estimate().state.wheel_speed_rad_s;
    for attempt in 0..6 {
        let dither = f64::from(attempt) * 1e-3;
        let fusion = tried.update(&wheel(there + 30.0 + dither)).unwrap();
        if attempt < 5 {
            assert_eq!(fusion.decision, Decision::Rejected);
            assert_eq!(tried.estimate(), filter.estimate());
        } else {
            assert_eq!(fusion.decision, Decision::Accepted);
        }
    }
}

#[test]
fn vehicle_speed_does_not_fall_below_the_wheel_s() {
    let (filter, _) = braked(0.5);
    let mut estimate = filter.estimate();
    estimate.state.vehicle_speed_m_s *= 0.5;
    let mut tried = filter;
    tried.restore(estimate).unwrap();
    let omega = estimate.state.wheel_speed_rad_s;
    tried.update(&wheel(omega + 0.01)).unwrap();
    let after = tried.estimate();
    assert!((after.state.vehicle_speed_m_s - 0.3 * after.state.wheel_speed_rad_s).abs() < 1e-9);
    // It says that it does not know.
    assert!(after.covariance.std().vehicle_speed_m_s > 5.0);
}

#[test]
fn a_restart_forgets_speeds_and_keeps_the_mass() {
    let (mut filter, _) = braked(1.0);
    let mass = filter.estimate().state.mass_kg;
    let mass_std = filter.estimate().covariance.std().mass_kg;
    assert!(mass_std < 75.0);
    filter.restart(50.0).unwrap();
    let after = filter.estimate();
    assert_eq!(after.state.vehicle_speed_m_s, 15.0);
    assert_eq!(after.state.mass_kg, mass);
    assert!((after.covariance.std().mass_kg - mass_std).abs() < 1e-9);
    assert_eq!(filter.motion(), Motion::Rolling);
}

#[test]
fn a_channel_outside_the_gate_is_believed_after_five_of_its_own_whatever_the_others_say() {
    let (mut filter, _) = braked(0.5);
    for round in 0..12 {
        filter.predict(900.0).unwrap();
        let wheel_speed = filter.estimate().state.wheel_speed_rad_s;
        let healthy = filter.update(&wheel(wheel_speed + 1e-4 * f64::from(round)));
        assert_eq!(healthy.unwrap().decision, Decision::Accepted);
        let off = filter.update(&Measurement {
            channel: Channel::NormalForce,
            // Far off in either direction, so that believing it once does not settle it.
            value: if round % 2 == 0 { 1e7 } else { -1e7 },
            variance: 1.0,
        });
        let expected = if round % 6 == 5 {
            Decision::Accepted
        } else {
            Decision::Rejected
        };
        assert_eq!(off.unwrap().decision, expected, "{round}");
    }
}
