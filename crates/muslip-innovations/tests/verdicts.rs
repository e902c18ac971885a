//! What the verdicts say: as often false as stated, and of the right balance within a stated time.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failed step fails the test"
)]

mod simulation;

use muslip_innovations::detection::Band;
use muslip_innovations::monitor::{Balance, Monitor, Verdict};
use muslip_innovations::settings::Settings;
use simulation::{DT_S, MASS_KG, Plant, run, settings};

const BANDS: [Band; 2] = [Band::Fast, Band::Slow];

/// Alarms of each band and the windows that they were raised in, over all balances and seeds.
fn alarms(
    plant: &Plant,
    settings: &Settings<f64>,
    seeds: core::ops::Range<u64>,
) -> [(f64, f64); 2] {
    const SAMPLES: usize = 8000;
    let detection = &settings.detection;
    let slow = u32::from(detection.slow_block) * u32::from(detection.slow_window);
    let lengths = [u32::from(detection.fast_window), slow];
    let mut all = [(0.0, 0.0); 2];
    for seed in seeds {
        let mut monitor: Monitor<f64> = settings.build().unwrap();
        let mut formed = [0_u32; 3];
        run(plant, settings, seed, SAMPLES, |_, reading| {
            let told = monitor.step(DT_S, &reading).unwrap();
            for (n, x) in formed.iter_mut().zip([told.tyre, told.wheel, told.vehicle]) {
                *n += u32::from(x.is_some());
            }
        });
        for (balance, n) in Balance::ALL.into_iter().zip(formed) {
            for ((sum, band), length) in all.iter_mut().zip(BANDS).zip(lengths) {
                sum.0 += f64::from(monitor.alarms(balance, band));
                sum.1 += f64::from(n / length);
            }
        }
    }
    all
}

/// Holds the alarms of each band against the stated probability, within five standard errors of a count.
fn as_stated(what: &str, plant: &Plant, settings: &Settings<f64>) {
    let probability = settings.detection.false_alarm_probability;
    for ((raised, windows), band) in alarms(plant, settings, 0..60).into_iter().zip(BANDS) {
        let expected = probability * windows;
        println!("{what}, {band:?}: {raised} of {windows}, {expected:.1} stated");
        assert!(
            (raised - expected).abs() < 5.0 * expected.max(1.0).sqrt(),
            "{what}, {band:?}: {raised} of {windows}, {expected} stated"
        );
    }
}

fn at(probability: f64) -> Settings<f64> {
    let mut settings = settings();
    settings.detection.false_alarm_probability = probability;
    settings
}

#[test]
fn the_right_model_raises_as_many_false_alarms_as_stated() {
    as_stated("stops at 0.02", &Plant::default(), &at(0.02));
    as_stated("stops at 0.002", &Plant::default(), &at(0.002));
}

#[test]
fn noise_of_the_speeds_on_a_bent_curve_raises_no_more_alarms_than_stated() {
    // A drum at a low speed, where noise of the speeds weighs most and the curve's bend is felt.
    let drum = Plant {
        driven: true,
        speed_m_s: 6.0,
        torque_nm: 1000.0,
        ..Plant::default()
    };
    let mut settings = at(0.02);
    settings.rig.vehicle_mass_kg = None;
    as_stated("drum", &drum, &settings);
}

#[test]
fn speeds_whose_noise_remembers_raise_no_more_alarms_than_stated() {
    let mut settings = at(0.02);
    settings.sensors.vehicle_speed_coloured_m_s.std = 0.1;
    settings.sensors.wheel_speed_coloured_rad_s.std = 0.15;
    as_stated("coloured", &Plant::default(), &settings);
}

#[test]
fn at_the_usual_probability_two_hundred_stops_raise_no_alarm() {
    let settings = settings();
    let [fast, slow] = alarms(&Plant::default(), &settings, 100..300);
    // 0.02 expected of some 20,000 windows.
    assert!(fast.0 + slow.0 == 0.0, "{fast:?} {slow:?}");
}

/// The first inconsistent verdict from the onset on, and after how many seconds.
fn first_alarm(plant: &Plant, seed: u64) -> Option<(Verdict, f64)> {
    let settings = settings();
    let mut monitor: Monitor<f64> = settings.build().unwrap();
    let mut first = None;
    run(plant, &settings, seed, 8000, |k, reading| {
        monitor.step(DT_S, &reading).unwrap();
        let verdict = monitor.verdict();
        if first.is_none() && matches!(verdict, Verdict::Inconsistent { .. }) {
            first = Some((verdict, (k + 1) as f64 * DT_S - plant.from_s));
        }
    });
    first
}

/// Every one of 20 runs raises this balance first, within so many seconds of the onset and not before it.
fn raises(plant: &Plant, expected: Balance, within_s: f64) {
    for seed in 1000..1020 {
        let first = first_alarm(plant, seed);
        let right = matches!(
            first,
            Some((Verdict::Inconsistent { balance, .. }, after))
                if balance == expected && after > 0.0 && after <= within_s
        );
        assert!(right, "{plant:?}, seed {seed}: {first:?}");
    }
}

#[test]
fn a_mass_off_by_a_tenth_raises_the_vehicle_within_two_slow_windows() {
    let plant = Plant {
        mass_kg: 1.1 * MASS_KG,
        ..Plant::default()
    };
    raises(&plant, Balance::Vehicle, 4.1);
}

#[test]
fn a_grade_of_five_percent_that_begins_on_the_way_raises_the_vehicle_within_a_second() {
    let plant = Plant {
        grade: 0.05,
        from_s: 2.0,
        ..Plant::default()
    };
    raises(&plant, Balance::Vehicle, 1.0);
}

#[test]
fn friction_lower_by_a_tenth_on_a_part_of_the_run_raises_the_tyre_within_half_a_second() {
    let plant = Plant {
        friction: 0.9,
        from_s: 1.0,
        ..Plant::default()
    };
    raises(&plant, Balance::Tyre, 0.52);
}

#[test]
fn friction_lower_by_four_percent_and_a_mass_off_by_seven_are_told_within_two_slow_windows() {
    let usual = Plant::default();
    let slippery = Plant {
        friction: 0.96,
        from_s: 1.0,
        ..usual
    };
    raises(&slippery, Balance::Tyre, 4.1);
    let heavy = Plant {
        mass_kg: 1.07 * MASS_KG,
        ..usual
    };
    raises(&heavy, Balance::Vehicle, 4.1);
}

#[test]
fn errors_that_the_stated_noise_allows_for_raise_nothing() {
    let plant = Plant {
        friction: 0.98,
        mass_kg: 1.03 * MASS_KG,
        from_s: 1.0,
        ..Plant::default()
    };
    for seed in 1000..1020 {
        assert_eq!(first_alarm(&plant, seed), None, "seed {seed}");
    }
}

#[test]
fn a_brake_torque_misread_by_a_tenth_raises_the_wheel_within_half_a_second() {
    let plant = Plant {
        torque: 1.1,
        from_s: 1.0,
        ..Plant::default()
    };
    raises(&plant, Balance::Wheel, 0.52);
}

#[test]
fn a_run_that_is_too_short_for_a_window_has_no_verdict() {
    let settings = settings();
    let mut monitor: Monitor<f64> = settings.build().unwrap();
    assert_eq!(monitor.verdict(), Verdict::NotFormed);
    run(&Plant::default(), &settings, 1, 255, |_, reading| {
        monitor.step(DT_S, &reading).unwrap();
    });
    assert_eq!(monitor.verdict(), Verdict::NotFormed);
    run(&Plant::default(), &settings, 1, 20, |_, reading| {
        monitor.step(DT_S, &reading).unwrap();
    });
    assert_eq!(monitor.verdict_of(Balance::Tyre), Verdict::Consistent);
}
