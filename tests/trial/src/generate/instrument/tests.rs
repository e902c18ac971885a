use super::*;
use crate::generate::form::Needs;

/// A straight run: the wheel slows from 80 to 40 rad/s, the vehicle from 25 to 15 m/s, drag along a ramp.
fn seen() -> Seen {
    let dt = 1e-4;
    let count = 30_001;
    let mut seen = Seen {
        dt,
        ..Seen::default()
    };
    let (mut angle, mut distance) = (0.0, 0.0);
    for index in 0..count {
        let time = dt * index as f64;
        let (wheel, speed) = (80.0 - 40.0 * time / 3.0, 25.0 - 10.0 * time / 3.0);
        if index > 0 {
            angle += dt * (wheel + 0.5 * dt * 40.0 / 3.0);
            distance += dt * (speed + 0.5 * dt * 10.0 / 3.0);
        }
        seen.wheel.push(wheel);
        seen.speed.push(speed);
        seen.angle.push(angle);
        seen.distance.push(distance);
        seen.drag.push(1000.0 * time);
        seen.load.push(4000.0);
        seen.brake.push(300.0 * time);
    }
    seen
}

fn times() -> Vec<f64> {
    (500..2500).map(|k| 1e-3 * f64::from(k)).collect()
}

/// Mean delay of readings of a straight line of the given slope.
fn measured_delay(read: &[f64], truth: impl Fn(f64) -> f64, slope: f64) -> f64 {
    let times = times();
    read.iter()
        .zip(&times)
        .map(|(value, time)| -(value - truth(*time)) / slope)
        .sum::<f64>()
        / times.len() as f64
}

#[test]
fn every_sensor_is_as_late_as_it_says() {
    let seen = seen();
    let wheel = |time: f64| 80.0 - 40.0 * time / 3.0;
    let speed = |time: f64| 25.0 - 10.0 * time / 3.0;
    let wheels = [
        WheelSensor::ToneRing {
            pitch_errors: vec![0.0; 48],
            averaged: 1,
            timer_s: 1e-7,
        },
        WheelSensor::ToneRing {
            pitch_errors: vec![0.0; 24],
            averaged: 4,
            timer_s: 1e-7,
        },
        WheelSensor::Counts {
            lines: 2500.0,
            window_s: 0.02,
            held: false,
        },
        WheelSensor::Counts {
            lines: 2500.0,
            window_s: 0.02,
            held: true,
        },
        WheelSensor::Tacho {
            pole_s: 0.01,
            poles: 2,
            noise: Colour::default(),
            ripple: 0.0,
            order: 1.0,
        },
    ];
    for sensor in wheels {
        // Whole teeth and lines, no random part: what is left is the delay.
        let read = sensor.read(&seen, &times(), false);
        let found = measured_delay(&read, wheel, -40.0 / 3.0);
        // The tone ring's delay goes as one over speed: its mean over the run, by Simpson.
        let said =
            (sensor.delay(wheel(0.5)) + 4.0 * sensor.delay(wheel(1.5)) + sensor.delay(wheel(2.5)))
                / 6.0;
        assert!(
            (found - said).abs() < 6e-4,
            "{sensor:?}: {found} s instead of {said} s"
        );
    }
    let vehicles = [
        VehicleSensor::Gps {
            rate_hz: 20.0,
            latency_s: 0.05,
            pole_s: 0.02,
            interpolated: true,
            phase: 0.3,
        },
        VehicleSensor::Gps {
            rate_hz: 20.0,
            latency_s: 0.05,
            pole_s: 0.02,
            interpolated: false,
            phase: 0.3,
        },
        VehicleSensor::Optical { window_s: 0.03 },
        VehicleSensor::FifthWheel {
            step_m: 0.002,
            window_s: 0.04,
            held: true,
        },
        VehicleSensor::DrumEncoder {
            step_m: 0.002,
            window_s: 0.01,
        },
    ];
    for sensor in vehicles {
        let read = sensor.read(&seen, &times(), false);
        let found = measured_delay(&read, speed, -10.0 / 3.0);
        assert!(
            (found - sensor.delay()).abs() < 1e-3,
            "{sensor:?}: {found} s instead of {} s",
            sensor.delay()
        );
    }
    let card = Analogue {
        pole_s: 0.004,
        poles: 3,
        ..Analogue::default()
    };
    let read = card.read(&seen.drag, &seen, &times());
    let found = measured_delay(&read, |time| 1000.0 * time, 1000.0);
    assert!((found - card.delay()).abs() < 1e-5, "{found} s");
}

#[test]
fn counts_move_in_whole_steps_and_a_tone_ring_shows_its_pitch() {
    let seen = seen();
    let sensor = WheelSensor::Counts {
        lines: 100.0,
        window_s: 0.01,
        held: false,
    };
    let step = std::f64::consts::TAU / (100.0 * 0.01);
    for value in sensor.read(&seen, &times(), true) {
        let steps = value / step;
        assert!(
            (steps - steps.round()).abs() < 1e-6,
            "{value} is no whole number of steps"
        );
    }
    let mut pitch_errors = vec![0.0; 48];
    pitch_errors[7] = 0.02;
    let ring = WheelSensor::ToneRing {
        pitch_errors,
        averaged: 1,
        timer_s: 1e-9,
    };
    let (with, without) = (
        ring.read(&seen, &times(), true),
        ring.read(&seen, &times(), false),
    );
    // One tooth late: its period is 2 % long, the next 2 % short; all others are right.
    let off: Vec<f64> = with
        .iter()
        .zip(&without)
        .map(|(a, b)| a / b - 1.0)
        .collect();
    let low = off.iter().copied().fold(f64::INFINITY, f64::min);
    let high = off.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    assert!(
        (low + 0.0196).abs() < 2e-3 && (high - 0.0204).abs() < 2e-3,
        "{low} {high}"
    );
    let right = off.iter().filter(|x| x.abs() < 1e-4).count();
    assert!(right > 9 * off.len() / 10, "{right} of {}", off.len());
}

#[test]
fn loggers_out_of_step_read_earlier_signals() {
    let seen = seen();
    let mut chain = Instruments::ideal(ChainKind::Real);
    chain.vehicle_late_s = 0.02;
    chain.clock = 1e-4;
    let read = chain.read(&seen, &times(), RunSpread::default(), None);
    for (value, time) in read.speed.iter().zip(times()) {
        let truth = 25.0 - 10.0 / 3.0 * (time - 0.02 - 1e-4 * time);
        assert!((value - truth).abs() < 1e-9);
    }
    assert_eq!(chain.delays(60.0)[1], 0.02);
}

#[test]
fn a_chain_without_errors_is_deterministic_and_with_them_has_the_size_it_says() {
    let seen = seen();
    let mut chain = Instruments::ideal(ChainKind::Real);
    chain.drag.noise = Colour {
        std: 30.0,
        slow: 0.3,
        time_constant_s: 0.02,
        flicker: 0.0,
    };
    let clean = chain.read(&seen, &times(), RunSpread::default(), None);
    let mut sum = 0.0;
    for seed in 0..40 {
        let mut draw = Draw::new(seed, &[2]);
        let read = chain.read(&seen, &times(), RunSpread::default(), Some(&mut draw));
        sum += read
            .drag
            .iter()
            .zip(&clean.drag)
            .map(|(a, b)| (a - b).powi(2))
            .sum::<f64>()
            / read.drag.len() as f64;
    }
    assert!(((sum / 40.0).sqrt() / 30.0 - 1.0).abs() < 0.05);
    let again = chain.read(&seen, &times(), RunSpread::default(), None);
    assert_eq!(clean.drag, again.drag);
}

#[test]
fn a_chain_reads_what_was_as_late_as_it_says_to_the_very_end_of_a_run() {
    let seen = seen();
    for seed in 0..150 {
        let mut draw = Draw::new(seed, &[3]);
        let rig = Rig::draw(Needs::default(), &mut draw);
        let chain = Instruments::draw(ChainKind::Real, &rig, &mut draw);
        let end = 3.0 - chain.ahead_s();
        let times: Vec<f64> = (500..)
            .map(|k| 1e-3 * f64::from(k))
            .take_while(|time| *time <= end)
            .collect();
        let read = chain.read(&seen, &times, RunSpread::default(), None);
        for (index, time) in times.iter().enumerate() {
            let truth = |at: f64| (80.0 - 40.0 * at / 3.0, 25.0 - 10.0 * at / 3.0);
            let delays = chain.delays(truth(*time).0);
            let (wheel, vehicle) = (truth(time - delays[0]).0, truth(time - delays[1]).1);
            // Holds and windows are off by half of themselves at their edges.
            assert!(
                (read.wheel[index] / wheel - 1.0).abs() < 0.03
                    && (read.speed[index] / vehicle - 1.0).abs() < 0.03,
                "seed {seed} at {time} s: {} for {wheel}, {} for {vehicle}: {chain:?}",
                read.wheel[index],
                read.speed[index]
            );
        }
    }
}

#[test]
fn a_concealed_delay_is_the_same_behind_every_sensor() {
    let mut late = seen();
    late.vehicle_late.pure_s = 0.05;
    late.wheel_late.window_s = 0.04;
    let plain = seen();
    for seed in 0..60 {
        let mut draw = Draw::new(seed, &[6]);
        let rig = Rig::draw(Needs::default(), &mut draw);
        let chain = Instruments::draw(ChainKind::Real, &rig, &mut draw);
        let (with, without) = (
            chain.read(&late, &times(), RunSpread::default(), None),
            chain.read(&plain, &times(), RunSpread::default(), None),
        );
        // Straight lines: the same reading, so much higher, on the mean over holds.
        let mean = |a: &[f64], b: &[f64]| {
            a.iter().zip(b).map(|(a, b)| a - b).sum::<f64>() / a.len() as f64
        };
        let (vehicle, wheel) = (
            mean(&with.speed, &without.speed),
            mean(&with.wheel, &without.wheel),
        );
        assert!(
            (vehicle / (0.05 * 10.0 / 3.0) - 1.0).abs() < 0.05,
            "{vehicle}: {chain:?}"
        );
        assert!(
            (wheel / (0.02 * 40.0 / 3.0) - 1.0).abs() < 0.1,
            "{wheel}: {chain:?}"
        );
    }
}

#[test]
fn every_effect_of_the_chain_has_a_truth() {
    for (index, kind) in finding::FINDING_KINDS.into_iter().enumerate() {
        let mut draw = Draw::new(index as u64, &[4]);
        let rig = Rig::draw(Needs::default(), &mut draw);
        let chain = kind.instruments(&rig, &mut draw);
        let truth = kind.truth(&chain, (80.0, 25.0), Some(("column", 0.98)));
        assert!(!truth.is_empty());
        for entry in truth {
            assert!(entry.value.is_finite() && entry.value != 0.0, "{entry:?}");
            assert!(!entry.channel.is_empty() && !entry.finding.is_empty());
        }
    }
}
