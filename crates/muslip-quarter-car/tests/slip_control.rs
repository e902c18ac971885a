//! The slip controller: limits, windup, start, refusals, and the loop that it promises.

use muslip_quarter_car::slip_control::{Config, ConfigParameter, ControlError, Input, Limit};

fn config() -> Config<f64> {
    Config {
        setpoint_slip: 0.15,
        bandwidth_rad_s: 40.0,
        integral_time_s: 0.25,
        sample_time_s: 0.005,
        radius_m: 0.3,
        inertia_kg_m2: 1.0,
        maximum_torque_nm: 3000.0,
        maximum_torque_rate_nm_s: 20_000.0,
        minimum_vehicle_speed_m_s: 0.5,
    }
}

fn input(slip: f64) -> Input<f64> {
    Input {
        slip_ratio: Some(slip),
        vehicle_speed_m_s: 20.0,
        tyre_torque_nm: 0.0,
    }
}

#[test]
fn torque_keeps_within_range_and_rate_whatever_slip_does() {
    let mut controller = config().build().unwrap();
    let mut before = 0.0;
    for step in 0..2000 {
        let slip = match (step / 100) % 4 {
            0 => -5.0,
            1 => 5.0,
            2 => 0.15,
            _ => -1e6,
        };
        let output = controller.step(&input(slip)).unwrap();
        assert!((0.0..=3000.0).contains(&output.brake_torque_nm));
        assert!((output.brake_torque_nm - before).abs() <= 100.0 + 1e-9);
        before = output.brake_torque_nm;
    }
}

#[test]
fn a_second_at_the_limit_does_not_wind_up() {
    let mut controller = config().build().unwrap();
    let mut limits = [0; 2];
    for _ in 0..200 {
        match controller.step(&input(-3.0)).unwrap().limit {
            Limit::Rate => limits[0] += 1,
            Limit::Range => limits[1] += 1,
            limit => panic!("{limit:?}"),
        }
    }
    assert!(limits[0] >= 29 && limits[1] > 150, "{limits:?}");
    // Slip overshoots a little: the torque leaves the limit at once, as if it had never been there.
    let after = controller.step(&input(0.2)).unwrap();
    assert_eq!(after.limit, Limit::Rate);
    assert_eq!(after.brake_torque_nm, 2900.0);
}

#[test]
fn the_start_is_without_a_bump() {
    for (torque, slip) in [(0.0, 0.0), (800.0, 0.05), (1500.0, 0.3)] {
        let mut controller = config().build().unwrap();
        let first = Input {
            tyre_torque_nm: 700.0,
            ..input(slip)
        };
        controller.start(torque, &first).unwrap();
        let answered = controller.step(&first).unwrap().brake_torque_nm;
        assert!((answered - torque).abs() < 1e-9, "{answered} {torque}");
    }
}

#[test]
fn without_slip_the_torque_is_held() {
    let mut controller = config().build().unwrap();
    controller.step(&input(0.0)).unwrap();
    let held = controller.brake_torque_nm();
    let before = controller;
    for _ in 0..10 {
        let output = controller
            .step(&Input {
                slip_ratio: None,
                ..input(0.0)
            })
            .unwrap();
        assert_eq!((output.brake_torque_nm, output.limit), (held, Limit::Held));
    }
    assert_eq!(controller, before);
}

#[test]
fn what_is_not_finite_is_refused_and_changes_nothing() {
    let mut controller = config().build().unwrap();
    controller.step(&input(0.1)).unwrap();
    let before = controller;
    for bad in [f64::NAN, f64::INFINITY] {
        for refused in [
            input(bad),
            Input {
                vehicle_speed_m_s: bad,
                ..input(0.1)
            },
            Input {
                tyre_torque_nm: bad,
                ..input(0.1)
            },
        ] {
            assert_eq!(controller.step(&refused), Err(ControlError::NonFinite));
            assert_eq!(
                controller.start(0.0, &refused),
                Err(ControlError::NonFinite)
            );
        }
        assert_eq!(
            controller.start(bad, &input(0.1)),
            Err(ControlError::NonFinite)
        );
        assert_eq!(
            controller.set_setpoint_slip(bad),
            Err(ControlError::OutOfRange(ConfigParameter::SetpointSlip))
        );
    }
    assert_eq!(controller, before);
}

#[test]
fn every_field_of_the_configuration_is_checked_and_named() {
    use ConfigParameter as P;
    let refused = |change: &dyn Fn(&mut Config<f64>), parameter| {
        let mut config = config();
        change(&mut config);
        assert_eq!(
            config.build().unwrap_err(),
            ControlError::OutOfRange(parameter)
        );
    };
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        refused(&|c| c.setpoint_slip = bad, P::SetpointSlip);
        refused(&|c| c.bandwidth_rad_s = bad, P::Bandwidth);
        refused(&|c| c.integral_time_s = bad, P::IntegralTime);
        refused(&|c| c.sample_time_s = bad, P::SampleTime);
        refused(&|c| c.radius_m = bad, P::Radius);
        refused(&|c| c.inertia_kg_m2 = bad, P::Inertia);
        refused(&|c| c.maximum_torque_nm = bad, P::MaximumTorque);
        refused(&|c| c.maximum_torque_rate_nm_s = bad, P::MaximumTorqueRate);
        refused(
            &|c| c.minimum_vehicle_speed_m_s = bad,
            P::MinimumVehicleSpeed,
        );
    }
    refused(&|c| c.setpoint_slip = 1.0, P::SetpointSlip);
}

#[test]
fn slip_settles_with_the_bandwidth_on_both_sides_of_the_peak_and_at_every_speed() {
    // The wheel alone at constant vehicle speed, dλ/dt = R/(J v) (T - R F), friction with the given slope
    // around the setpoint, the tyre's torque told.
    for v in [3.0, 10.0, 30.0] {
        for slope in [4.0, 0.0, -0.5] {
            let mut controller = Config {
                integral_time_s: 1e9,
                maximum_torque_rate_nm_s: 1e9,
                ..config()
            }
            .build()
            .unwrap();
            let load = 4414.5;
            let mut slip: f64 = 0.14;
            for step in 0..40 {
                let exact = 0.15 - 0.01 * (-40.0_f64 * f64::from(step) * 0.005).exp();
                if slope == 0.0 {
                    // A sampled first-order loop against the continuous one.
                    assert!((slip - exact).abs() < 5e-4, "{v} {slip} {exact}");
                }
                assert!(slip < 0.151, "{v} {slope} {slip}");
                let tyre = |slip: f64| 0.3 * load * (1.1 + slope * (slip - 0.15));
                let output = controller
                    .step(&Input {
                        slip_ratio: Some(slip),
                        vehicle_speed_m_s: v,
                        tyre_torque_nm: tyre(slip),
                    })
                    .unwrap();
                for _ in 0..50 {
                    slip += 1e-4 * 0.3 / v * (output.brake_torque_nm - tyre(slip));
                }
            }
            assert!((slip - 0.15).abs() < 2e-3, "{v} {slope} {slip}");
        }
    }
}
