//! The three balances against dense algebra, their forming, and what they refuse.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failed step fails the test"
)]

mod dense;
mod simulation;

use dense::{Kind, Problem};
use muslip_innovations::detection::Band;
use muslip_innovations::monitor::{Balance, Innovations, Monitor, Verdict};
use muslip_innovations::reading::{Channel, Reading, StepError};
use muslip_innovations::settings::{Coloured, Setting, Settings, SettingsError};
use simulation::{DT_S, MASS_KG, Plant, RIG, rounded, run, settings};
use test_support::noise::Noise;

fn readings(seed: u64, samples: usize, plant: &Plant) -> Vec<Reading<f64>> {
    let mut all = Vec::new();
    run(plant, &settings(), seed, samples, |_, reading| {
        all.push(reading)
    });
    all
}

fn monitor() -> Monitor<f64> {
    settings().build().unwrap()
}

/// A monitor that has run for half a second.
fn warm() -> (Monitor<f64>, Vec<Reading<f64>>) {
    let mut monitor = monitor();
    let all = readings(5, 600, &Plant::default());
    for reading in &all[..500] {
        monitor.step(DT_S, reading).unwrap();
    }
    (monitor, all[500..].to_vec())
}

fn integrated(part: Coloured<f64>) -> (Kind, f64) {
    (Kind::Integrated(part.time_constant_s), part.std)
}

/// A balance in integrated form, from its rate and its level: innovations by dense algebra.
fn dense_level(
    parts: Vec<(Kind, f64)>,
    white: f64,
    rate: &[f64],
    scaled: &[f64],
    level: &[Option<f64>],
    gap: usize,
) -> Vec<Option<f64>> {
    let n = rate.len();
    let mut sum = 0.0;
    let z: Vec<f64> = (0..n)
        .map(|k| {
            if k > 0 {
                sum += 0.5 * (rate[k] + rate[k - 1]) * DT_S;
            }
            level[k].unwrap_or(0.0) - sum
        })
        .collect();
    let problem = Problem {
        parts,
        time: (0..n).map(|k| k as f64 * DT_S).collect(),
        rows: vec![vec![1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]; n],
        rates: scaled
            .iter()
            .map(|scaled| vec![0.0, 0.0, 1.0, 1.0, 1.0, 1.0, *scaled, 1.0])
            .collect(),
        white: vec![white * white; n],
        stretch: (0..n).map(|k| usize::from(k >= gap)).collect(),
        read: level.iter().map(Option::is_some).collect(),
    };
    problem.innovations(&z)
}

fn apart(got: &[Option<f64>], dense: &[Option<f64>]) -> f64 {
    let each = got.iter().zip(dense).enumerate();
    each.map(|(k, pair)| match pair {
        (Some(a), Some(b)) => (a - b).abs(),
        (None, None) => 0.0,
        other => panic!("at {k}: {other:?}"),
    })
    .fold(0.0, f64::max)
}

/// Parts of the wheel's noise, as the settings state them.
fn parts_of_wheel() -> Vec<(Kind, f64)> {
    let (s, own) = (settings().sensors, settings().unmodelled);
    let (radius, inertia) = (RIG.effective_radius_m, RIG.wheel_inertia_kg_m2);
    let (omega, drag) = (s.wheel_speed_coloured_rad_s, s.drag_force_coloured_n);
    let zero = (radius * own.drag_zero_run_std_n).hypot(own.torque_zero_run_std_nm);
    let walk = (radius * s.drag_force_std_n).hypot(s.brake_torque_std_nm);
    vec![
        (Kind::Walk, walk),
        (Kind::Forgetting(omega.time_constant_s), inertia * omega.std),
        (Kind::Integrated(drag.time_constant_s), radius * drag.std),
        integrated(own.torque_fast_nm),
        integrated(own.torque_slow_nm),
        integrated(own.torque_drift_nm),
        (Kind::IntegratedConstant, own.torque_scale_run_std),
        (Kind::IntegratedConstant, zero),
    ]
}

/// Parts of the vehicle's noise.
fn parts_of_vehicle() -> Vec<(Kind, f64)> {
    let (s, own) = (settings().sensors, settings().unmodelled);
    let speed = s.vehicle_speed_coloured_m_s;
    let zero = own.drag_zero_run_std_n.hypot(own.force_run_std_n);
    vec![
        (Kind::Walk, s.drag_force_std_n),
        (Kind::Forgetting(speed.time_constant_s), MASS_KG * speed.std),
        integrated(s.drag_force_coloured_n),
        integrated(own.force_fast_n),
        integrated(own.force_slow_n),
        integrated(own.force_drift_n),
        (Kind::IntegratedConstant, own.drag_scale_run_std),
        (Kind::IntegratedConstant, zero),
    ]
}

#[test]
fn wheel_and_vehicle_are_the_dense_innovations_of_their_integrated_balances() {
    let mut all = readings(3, 300, &Plant::default());
    // A slower sensor of the vehicle's speed, a wheel speed that is lost now and then, and one drag.
    for (k, reading) in all.iter_mut().enumerate() {
        reading.vehicle_speed_m_s = reading.vehicle_speed_m_s.filter(|_| k % 10 == 0);
        reading.wheel_speed_rad_s = reading.wheel_speed_rad_s.filter(|_| k % 7 != 3);
    }
    let lost = 150;
    let drag: Vec<f64> = all.iter().map(|r| r.drag_force_n.unwrap()).collect();
    let torque: Vec<f64> = all.iter().map(|r| r.brake_torque_nm.unwrap()).collect();
    all[lost].drag_force_n = None;
    let mut monitor = monitor();
    let told: Vec<Innovations<f64>> = all
        .iter()
        .map(|reading| monitor.step(DT_S, reading).unwrap())
        .collect();

    let s = settings().sensors;
    let (radius, inertia) = (RIG.effective_radius_m, RIG.wheel_inertia_kg_m2);
    let turned: Vec<f64> = drag
        .iter()
        .zip(&torque)
        .map(|(f, t)| radius * f - t)
        .collect();
    let spin = all.iter().map(|r| r.wheel_speed_rad_s.map(|x| inertia * x));
    let wheel = dense_level(
        parts_of_wheel(),
        inertia * s.wheel_speed_std_rad_s,
        &turned,
        &torque,
        &without(lost, spin),
        lost,
    );
    assert!(apart(&told.iter().map(|i| i.wheel).collect::<Vec<_>>(), &wheel) < 1e-6);

    let slowed: Vec<f64> = drag.iter().map(|f| -f).collect();
    let momentum = all.iter().map(|r| r.vehicle_speed_m_s.map(|x| MASS_KG * x));
    let vehicle = dense_level(
        parts_of_vehicle(),
        MASS_KG * s.vehicle_speed_std_m_s,
        &slowed,
        &drag,
        &without(lost, momentum),
        lost,
    );
    assert!(
        apart(
            &told.iter().map(|i| i.vehicle).collect::<Vec<_>>(),
            &vehicle
        ) < 1e-6
    );
}

/// Readings of a level without the one at which the rate was lost.
fn without(lost: usize, all: impl Iterator<Item = Option<f64>>) -> Vec<Option<f64>> {
    all.enumerate()
        .map(|(k, x)| x.filter(|_| k != lost))
        .collect()
}

#[test]
fn the_tyre_is_the_dense_innovation_of_drag_less_law_where_speeds_have_no_noise() {
    // Next to no noise of the speeds: the curve is taken at the slip as read.
    let mut settings = settings();
    let s = &mut settings.sensors;
    for std in [
        &mut s.wheel_speed_std_rad_s,
        &mut s.vehicle_speed_std_m_s,
        &mut s.wheel_speed_coloured_rad_s.std,
        &mut s.vehicle_speed_coloured_m_s.std,
    ] {
        *std = 1e-9;
    }
    s.normal_force_std_n = 0.0;
    let (sensors, own) = (settings.sensors, settings.unmodelled);
    let mut all = Vec::new();
    run(&Plant::default(), &settings, 4, 250, |_, reading| {
        all.push(reading)
    });
    let mut monitor: Monitor<f64> = settings.build().unwrap();
    let told: Vec<_> = all
        .iter()
        .map(|reading| monitor.step(DT_S, reading).unwrap().tyre)
        .collect();
    // The law once more, and its slope by differences.
    let law = |slip: f64| 0.9 * (2.0 * (slip / 0.12).atan()).sin();
    let (mut rows, mut left) = (vec![], vec![]);
    for r in &all {
        let (v, omega) = (r.vehicle_speed_m_s.unwrap(), r.wheel_speed_rad_s.unwrap());
        let (f, n) = (r.drag_force_n.unwrap(), r.normal_force_n.unwrap());
        let slip = 1.0 - RIG.effective_radius_m * omega / v;
        let force = n * law(slip);
        let slope = n * (law(slip + 1e-6) - law(slip - 1e-6)) / 2e-6;
        rows.push(vec![force, force, 1.0, force, 1.0, slope]);
        left.push(f - force);
    }
    let n = all.len();
    let forgetting = |part: Coloured<f64>| (Kind::Forgetting(part.time_constant_s), part.std);
    let problem = Problem {
        parts: vec![
            forgetting(own.friction_fast),
            forgetting(own.friction_slow),
            forgetting(sensors.drag_force_coloured_n),
            (Kind::Constant, own.friction_run_std),
            (Kind::Constant, own.drag_zero_run_std_n),
            (Kind::Constant, own.slip_run_std),
        ],
        time: (0..n).map(|k| k as f64 * DT_S).collect(),
        rows,
        rates: vec![vec![]; n],
        white: vec![sensors.drag_force_std_n.powi(2); n],
        stretch: vec![0; n],
        read: vec![true; n],
    };
    assert!(apart(&told, &problem.innovations(&left)) < 1e-5);
}

#[test]
fn a_locked_wheel_and_a_low_speed_form_no_balance_and_the_level_is_found_anew() {
    let (mut monitor, after) = warm();
    let mut locked = after[0];
    locked.wheel_speed_rad_s = Some(0.5);
    for _ in 0..50 {
        let told = monitor.step(DT_S, &locked).unwrap();
        assert!(told.tyre.is_none() && told.wheel.is_none() && told.vehicle.is_some());
    }
    // Wherever the wheel's speed is by now, the first reading says where and the second is an innovation.
    let told = monitor.step(DT_S, &after[1]).unwrap();
    assert!(told.tyre.is_some() && told.wheel.is_none());
    let told = monitor.step(DT_S, &after[2]).unwrap();
    assert!(told.wheel.unwrap().abs() < 6.0);

    let mut slow = after[0];
    slow.vehicle_speed_m_s = Some(1.0);
    let none = Innovations {
        tyre: None,
        wheel: None,
        vehicle: None,
    };
    assert_eq!(monitor.step(DT_S, &slow), Ok(none));
}

#[test]
fn missing_readings_and_gaps_form_nothing_and_are_no_errors() {
    let (mut monitor, after) = warm();
    let none = Innovations {
        tyre: None,
        wheel: None,
        vehicle: None,
    };
    assert_eq!(monitor.step(DT_S, &Reading::missing()), Ok(none));
    // A minute later.
    let told = monitor.step(60.0, &after[0]).unwrap();
    assert!(told.tyre.is_some() && told.wheel.is_none() && told.vehicle.is_none());
    let told = monitor.step(DT_S, &after[1]).unwrap();
    assert!(told.wheel.unwrap().abs() < 6.0 && told.vehicle.unwrap().abs() < 6.0);
}

#[test]
fn without_brake_torque_or_mass_their_balances_are_never_formed() {
    let mut settings = settings();
    settings.rig.vehicle_mass_kg = None;
    let mut monitor: Monitor<f64> = settings.build().unwrap();
    for mut reading in readings(8, 600, &Plant::default()) {
        reading.brake_torque_nm = None;
        let told = monitor.step(DT_S, &reading).unwrap();
        assert!(told.tyre.is_some() && told.wheel.is_none() && told.vehicle.is_none());
    }
    assert_eq!(monitor.verdict_of(Balance::Wheel), Verdict::NotFormed);
    assert_eq!(monitor.verdict_of(Balance::Vehicle), Verdict::NotFormed);
    assert_eq!(monitor.verdict(), Verdict::Consistent);
}

#[test]
fn bad_input_is_one_error_and_leaves_all_as_it_was() {
    let (mut monitor, after) = warm();
    let before = monitor;
    for dt in [0.0, -DT_S, f64::NAN, f64::INFINITY] {
        assert_eq!(monitor.step(dt, &after[0]), Err(StepError::TimeStep));
    }
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut refused = |change: fn(&mut Reading<f64>, f64), channel| {
            let mut reading = after[0];
            change(&mut reading, bad);
            assert_eq!(
                monitor.step(DT_S, &reading),
                Err(StepError::NonFinite { channel })
            );
        };
        refused(|r, x| r.wheel_speed_rad_s = Some(x), Channel::WheelSpeed);
        refused(|r, x| r.vehicle_speed_m_s = Some(x), Channel::VehicleSpeed);
        refused(|r, x| r.drag_force_n = Some(x), Channel::DragForce);
        refused(|r, x| r.normal_force_n = Some(x), Channel::NormalForce);
        refused(|r, x| r.brake_torque_nm = Some(x), Channel::BrakeTorque);
    }
    let mut huge = after[0];
    huge.vehicle_speed_m_s = Some(1e307);
    assert_eq!(monitor.step(DT_S, &huge), Err(StepError::Overflow));
    assert_eq!(monitor, before);
    monitor.step(DT_S, &after[0]).unwrap();
}

#[test]
fn random_readings_of_any_size_give_finite_innovations_or_an_error() {
    for seed in 0..200 {
        let mut draw = Noise::seeded(seed);
        let mut monitor: Monitor<f32> = single(&settings()).build().unwrap();
        for _ in 0..300 {
            let mut value = |usual: f32| {
                let kind = draw.uniform(0.0, 1.0);
                let wild = draw.log_uniform(1e-40, 1e38) as f32;
                match kind {
                    x if x < 0.05 => None,
                    x if x < 0.07 => Some(wild),
                    x if x < 0.09 => Some(-wild),
                    x if x < 0.10 => Some(f32::NAN),
                    _ => Some(usual * draw.uniform(0.5, 1.5) as f32),
                }
            };
            let reading = Reading {
                wheel_speed_rad_s: value(60.0),
                vehicle_speed_m_s: value(20.0),
                drag_force_n: value(1500.0),
                normal_force_n: value(4000.0),
                brake_torque_nm: value(450.0),
            };
            let dt = value(0.001).unwrap_or(0.0);
            let before = monitor;
            match monitor.step(dt, &reading) {
                Ok(told) => {
                    let each = [told.tyre, told.wheel, told.vehicle];
                    assert!(each.into_iter().flatten().all(f32::is_finite), "{told:?}");
                    assert_eq!(monitor, monitor, "a NaN in the state");
                }
                Err(_) => assert_eq!(monitor, before),
            }
        }
    }
}

/// The settings in single precision.
fn single(s: &Settings<f64>) -> Settings<f32> {
    let mass = s.rig.vehicle_mass_kg.unwrap() as f32;
    let rig = muslip_innovations::settings::Rig {
        effective_radius_m: s.rig.effective_radius_m as f32,
        wheel_inertia_kg_m2: s.rig.wheel_inertia_kg_m2 as f32,
        vehicle_mass_kg: Some(mass),
    };
    let law = muslip::law::Rudd::new(0.9, 0.12).unwrap();
    let sensors = muslip_innovations::settings::Sensors::white(0.05, 0.02, 20.0, 15.0, 5.0);
    Settings::usual(rig, law, sensors, 3600.0)
}

/// Two monitors of either precision on the same readings, and how far apart their innovations get, in sigma.
struct Pair {
    double: Monitor<f64>,
    single: Monitor<f32>,
    worst: [f64; 3],
}

impl Pair {
    fn new() -> Self {
        Self {
            double: monitor(),
            single: single(&settings()).build().unwrap(),
            worst: [0.0; 3],
        }
    }

    fn step(&mut self, dt: f32, reading: &Reading<f64>) {
        let reading: Reading<f32> = rounded(reading);
        let widened = |value: Option<f32>| value.map(f64::from);
        let wide = Reading {
            wheel_speed_rad_s: widened(reading.wheel_speed_rad_s),
            vehicle_speed_m_s: widened(reading.vehicle_speed_m_s),
            drag_force_n: widened(reading.drag_force_n),
            normal_force_n: widened(reading.normal_force_n),
            brake_torque_nm: widened(reading.brake_torque_nm),
        };
        let a = self.double.step(f64::from(dt), &wide).unwrap();
        let b = self.single.step(dt, &reading).unwrap();
        let pairs = [(a.tyre, b.tyre), (a.wheel, b.wheel), (a.vehicle, b.vehicle)];
        for (worst, pair) in self.worst.iter_mut().zip(pairs) {
            match pair {
                (Some(a), Some(b)) => *worst = worst.max((a - f64::from(b)).abs()),
                (None, None) => {}
                other => panic!("{other:?}"),
            }
        }
    }
}

#[test]
fn ten_minutes_in_single_precision_stay_within_a_thousandth_sigma_of_double() {
    // A drum that keeps its speed: what it does is not the vehicle's balance.
    let plant = Plant {
        driven: true,
        speed_m_s: 25.0,
        ..Plant::default()
    };
    let mut pair = Pair::new();
    run(&plant, &settings(), 77, 600_000, |_, reading| {
        pair.step(DT_S as f32, &reading);
    });
    println!("f32 against f64 on a drum, worst: {:?} sigma", pair.worst);
    assert!(
        pair.worst[0] < 1e-3 && pair.worst[1] < 1e-3,
        "{:?}",
        pair.worst
    );
}

#[test]
fn ten_minutes_of_stops_in_single_precision_stay_within_a_thousandth_sigma_of_double() {
    let mut pair = Pair::new();
    for seed in 0..75 {
        // The way back to the start is a gap.
        pair.step(5.0, &Reading::missing());
        run(&Plant::default(), &settings(), seed, 8000, |_, reading| {
            pair.step(DT_S as f32, &reading);
        });
    }
    println!("f32 against f64 on stops, worst: {:?} sigma", pair.worst);
    assert!(
        pair.worst.into_iter().all(|worst| worst < 1e-3),
        "{:?}",
        pair.worst
    );
}

#[test]
fn a_wheel_speed_that_jumps_is_refused_ten_times_and_then_believed() {
    let (mut monitor, mut after) = warm();
    let alarms = monitor.alarms(Balance::Wheel, Band::Fast);
    for (k, reading) in after.iter_mut().enumerate() {
        reading.wheel_speed_rad_s = reading.wheel_speed_rad_s.map(|speed| speed + 5.0);
        let told = monitor.step(DT_S, reading).unwrap().wheel;
        match k {
            0..10 => assert!(told.unwrap() > 6.0, "{k}: {told:?}"),
            10 => assert!(told.is_none()),
            _ => assert!(told.unwrap().abs() < 6.0, "{k}: {told:?}"),
        }
    }
    // What was refused is evidence all the same: the window of readings 256 to 511 has it.
    assert!(monitor.alarms(Balance::Wheel, Band::Fast) > alarms);
}

#[test]
fn a_monitor_is_of_fixed_size_and_fits_into_two_and_a_half_kilobytes() {
    let bytes = size_of::<Monitor<f32>>();
    println!("{bytes} bytes in f32, {} in f64", size_of::<Monitor<f64>>());
    assert!(bytes <= 2560, "{bytes}");
}

#[test]
fn a_restart_is_as_good_as_new_and_another_law_is_kept() {
    let (mut monitor, _) = warm();
    let law = muslip::law::Rudd::new(0.5, 0.1).unwrap();
    monitor.set_law(law);
    monitor.restart();
    let expected = Settings { law, ..settings() };
    assert_eq!(monitor, expected.build().unwrap());
}

#[test]
fn settings_outside_their_range_are_refused_by_name() {
    let refused = |change: fn(&mut Settings<f64>), setting| {
        let mut settings = settings();
        change(&mut settings);
        assert_eq!(
            settings.build().unwrap_err(),
            SettingsError::OutOfRange(setting)
        );
    };
    refused(|s| s.rig.effective_radius_m = 0.0, Setting::EffectiveRadius);
    refused(
        |s| s.rig.wheel_inertia_kg_m2 = f64::NAN,
        Setting::WheelInertia,
    );
    refused(|s| s.rig.vehicle_mass_kg = Some(-1.0), Setting::VehicleMass);
    refused(|s| s.sensors.drag_force_std_n = 0.0, Setting::SensorNoise);
    refused(
        |s| s.sensors.brake_torque_std_nm = -1.0,
        Setting::SensorNoise,
    );
    refused(
        |s| s.unmodelled.friction_fast.time_constant_s = 0.0,
        Setting::TyreNoise,
    );
    refused(
        |s| s.unmodelled.torque_slow_nm.std = f64::NAN,
        Setting::WheelNoise,
    );
    refused(
        |s| s.unmodelled.force_run_std_n = f64::INFINITY,
        Setting::VehicleNoise,
    );
    refused(
        |s| s.forming.minimum_wheel_speed_rad_s = 0.0,
        Setting::Limits,
    );
    refused(|s| s.forming.longest_step_s = 0.0, Setting::LongestStep);
    refused(|s| s.forming.gate_stds = 1.0, Setting::Gate);
    refused(|s| s.detection.slow_block = 0, Setting::Detection);
    refused(
        |s| s.detection.false_alarm_probability = 0.5,
        Setting::Detection,
    );
}
