//! `muslip simulate`: reproducible recordings of a rig that obeys its own balances.

use crate::common::{RIG, Scratch, number};
use muslip_recordings::recording::{Channel, Required, Run};

fn simulate(scratch: &Scratch, out: &str, more: &[&str]) -> Run {
    let arguments = [&["simulate", "--rig", "rig.toml", "--out", out][..], more].concat();
    scratch.output(&arguments);
    Run::read(&scratch.path(out), Required::DragIncluded).unwrap()
}

#[test]
fn the_same_arguments_give_the_same_bytes_and_another_seed_others() {
    let scratch = Scratch::with_rig(&format!("{RIG}\n[noise]\nwheel_speed_rad_s = 0.15\n"));
    for (name, seed) in [("a.csv", "7"), ("b.csv", "7"), ("c.csv", "8")] {
        simulate(&scratch, name, &["--seed", seed]);
    }
    assert_eq!(scratch.read("a.csv"), scratch.read("b.csv"));
    assert_ne!(scratch.read("a.csv"), scratch.read("c.csv"));
}

#[test]
fn the_first_line_of_a_recording_makes_it_again() {
    let scratch = Scratch::with_rig(RIG);
    simulate(
        &scratch,
        "a.csv",
        &["--law", "burckhardt:snow", "--duration", "2", "--seed", "3"],
    );
    let text = scratch.read("a.csv");
    let origin = text.lines().next().unwrap();
    let arguments: Vec<&str> = origin
        .split_once("muslip simulate ")
        .unwrap()
        .1
        .split(' ')
        .collect();
    simulate(&scratch, "b.csv", &arguments);
    assert_eq!(text, scratch.read("b.csv"));
}

#[test]
fn a_recording_obeys_the_three_balances() {
    let scratch = Scratch::with_rig(RIG);
    let run = simulate(
        &scratch,
        "run.csv",
        &["--rate-hz", "5000", "--law", "burckhardt:wet-asphalt"],
    );
    let column = |channel| run.channel(channel).unwrap();
    let (time, omega, v) = (
        column(Channel::Time),
        column(Channel::WheelSpeed),
        column(Channel::VehicleSpeed),
    );
    let (drag, torque) = (column(Channel::DragForce), column(Channel::BrakeTorque));
    let (mut wheel_error, mut vehicle_error) = (0.0_f64, 0.0_f64);
    for i in 1..run.rows() - 1 {
        let dt = time[i + 1] - time[i - 1];
        // Central differences; around lock and release the wheel's acceleration jumps.
        if omega[i - 1..=i + 1].iter().all(|omega| *omega > 5.0) {
            let acceleration = (omega[i + 1] - omega[i - 1]) / dt;
            wheel_error = wheel_error.max((1.25 * acceleration - 0.31 * drag[i] + torque[i]).abs());
        }
        let deceleration = (v[i + 1] - v[i - 1]) / dt;
        vehicle_error = vehicle_error.max((420.0 * deceleration + drag[i]).abs());
        // Published coefficients of wet asphalt, independent of the project's law.
        let slip = (v[i] - 0.31 * omega[i]) / v[i];
        let friction = 0.857 * (1.0 - (-33.822 * slip).exp()) - 0.347 * slip;
        if slip > 0.0 {
            assert!(
                (drag[i] - friction * 420.0 * 9.80665).abs() < 1e-2,
                "row {i}"
            );
        }
    }
    // Of torques around 1000 N m and forces around 3000 N.
    assert!(
        wheel_error < 10.0 && vehicle_error < 40.0,
        "{wheel_error} {vehicle_error}"
    );
}

#[test]
fn brake_columns_are_written_where_the_rig_has_a_brake() {
    let scratch = Scratch::with_rig(RIG);
    assert_eq!(
        simulate(&scratch, "with.csv", &[]).header().names().len(),
        7
    );
    let start = RIG.find("[brake]").unwrap();
    let end = RIG.find("[tyre]").unwrap();
    scratch.write("rig.toml", [&RIG[..start], &RIG[end..]].concat());
    let without = simulate(&scratch, "without.csv", &[]);
    assert_eq!(without.header().names().len(), 5);
}

#[test]
fn every_law_gives_its_own_peak() {
    let scratch = Scratch::with_rig(RIG);
    for (law, peak) in [
        ("rudd:0.6,0.1", 0.6),
        ("burckhardt:dry-asphalt", 1.17),
        ("burckhardt:0.4004,33.708,0.1204", 0.38),
        ("magic-formula:10,1.65,0.9,0.3", 0.9),
    ] {
        let run = simulate(&scratch, "run.csv", &["--law", law]);
        let drag = run.channel(Channel::DragForce).unwrap();
        let largest = drag.iter().copied().fold(0.0, f64::max) / (420.0 * 9.80665);
        assert!((largest - peak).abs() < 0.01, "{law}: {largest}");
    }
}

#[test]
fn a_small_rig_at_a_small_scale_runs_too() {
    let scratch = Scratch::with_rig(
        "[wheel]\nradius_m = 0.033\ninertia_kg_m2 = 1.0e-5\n[vehicle]\nmass_kg = 1.67\ncoasting = true\n\
         [tyre]\nlaw = \"rudd\"\npeak_friction = 0.8\ncritical_slip = 0.15\n[noise]\ndrag_force_n = 0.2\n",
    );
    simulate(&scratch, "run.csv", &["--duration", "1"]);
    let json = scratch.json(&["fit", "--rig", "rig.toml", "--json", "run.csv"]);
    assert!(
        (number(&json, "peak_friction.value") - 0.8).abs() < 0.02,
        "{json}"
    );
    assert!(
        (number(&json, "critical_slip.value") - 0.15).abs() < 0.01,
        "{json}"
    );
}

#[test]
fn arguments_without_sense_are_told_in_one_line() {
    let scratch = Scratch::with_rig(RIG);
    for (arguments, part) in [
        (
            &["--rate-hz", "0"][..],
            "rate = 0: must be finite and positive",
        ),
        (&["--duration", "nan"], "duration = NaN"),
        (
            &["--speed", "-3"],
            "speed = -3: must be finite and positive",
        ),
        (&["--law", "burckhardt:moon"], "unknown surface \"moon\""),
        (&["--law", "dugoff"], "unknown tyre law \"dugoff\""),
    ] {
        let all = [
            &["simulate", "--rig", "rig.toml", "--out", "run.csv"][..],
            arguments,
        ]
        .concat();
        let complaint = scratch.complaint(&all);
        assert!(complaint.contains(part), "{complaint}");
    }
    assert_eq!(scratch.files(), ["rig.toml"]);
}
