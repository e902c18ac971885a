//! Runs from arming to their end.

use muslip_control::brake::BrakeOutput;
use muslip_record::{Answer, Command, Event, Fault, Profile, Program, STEPS, State, Telemetry};

use crate::bench::{Bench, RAMP, Rig};

/// A wheel that slips as the demand says, at once: enough to walk through every state.
fn follow(bench: &mut Bench, samples: u32) -> Vec<State> {
    let mut states = vec![bench.state()];
    let mut slip: f64 = 0.0;
    for _ in 0..samples {
        let duty = f64::from(bench.output.valve_duty) / 65535.0;
        let demand = if bench.output.hold_pressure {
            (duty - 0.1) / 0.8
        } else {
            0.0
        };
        let target = if demand > 0.5 { 0.9 } else { demand * 0.2 };
        slip += (target - slip).clamp(-0.01, 0.01);
        bench.rig.wheel_rad_s = 20.0 * (1.0 - slip) / 0.31;
        bench.rig.drag_n = 4120.0 * 2.0 * 0.8 * slip / (0.14 * (1.0 + (slip / 0.14).powi(2)));
        bench.run(1);
        if *states.last().unwrap() != bench.state() {
            states.push(bench.state());
        }
    }
    states
}

#[test]
fn a_run_of_two_ramps_goes_through_every_state_and_ends_with_an_estimate() {
    let mut bench = Bench::new();
    bench.start(RAMP);
    let states = follow(&mut bench, 6000);
    use State::{Cool, Done, Ramp, Release, Skid, SpinUp};
    assert_eq!(
        states,
        [
            SpinUp, Ramp, Skid, Release, Cool, SpinUp, Ramp, Skid, Release, Cool, Done
        ],
        "{:?}",
        bench.controller.fault()
    );
    let estimate = bench.heard.iter().rev().find_map(|message| match message {
        Telemetry::Estimate(estimate) => Some(*estimate),
        _ => None,
    });
    let estimate = estimate.unwrap();
    assert!((estimate.peak_friction - 0.8).abs() < 0.01, "{estimate:?}");
    assert!(
        (estimate.critical_slip - 0.14).abs() < 0.005,
        "{estimate:?}"
    );
    assert!(estimate.updates > 1000);
    let events = bench.heard.iter().filter(|message| {
        matches!(
            message,
            Telemetry::Event {
                event: Event::StateChanged { .. },
                ..
            }
        )
    });
    // Those above, and armed and spin-up before them.
    assert_eq!(events.count(), 12);
}

#[test]
fn stopping_a_ramp_releases_the_brake_on_the_next_sample() {
    let mut bench = Bench::braking();
    bench.say(Command::Stop);
    bench.run(1);
    assert_eq!(bench.output, BrakeOutput::DUMPED);
    assert_eq!(bench.state(), State::Release);
    bench.run(60);
    assert_eq!(bench.state(), State::Cool);
    bench.say(Command::Stop);
    bench.run(1);
    assert_eq!(bench.state(), State::Done);
    bench.say(Command::Stop);
    bench.run(1);
    assert_eq!(bench.state(), State::Idle);
}

#[test]
fn steps_are_held_one_after_the_other() {
    let mut levels = [0.0; STEPS];
    levels[..3].copy_from_slice(&[0.1, 0.3, 0.2]);
    let mut bench = Bench::new();
    bench.start(Profile {
        program: Program::Steps {
            levels,
            count: 3,
            hold_s: 0.1,
        },
        applications: 1,
        ..RAMP
    });
    let mut duties = Vec::new();
    for _ in 0..700 {
        bench.run(1);
        if duties.last() != Some(&bench.output.valve_duty) {
            duties.push(bench.output.valve_duty);
        }
    }
    let duty = |level: f32| ((0.1 + 0.8 * level) * 65535.0) as u16;
    assert_eq!(duties, [0, duty(0.1), duty(0.3), duty(0.2), 0]);
}

#[test]
fn a_wheel_that_does_not_roll_again_after_a_release_is_a_fault() {
    let mut bench = Bench::braking();
    for _ in 0..200 {
        bench.rig.wheel_rad_s -= 0.1;
        bench.run(1);
    }
    bench.say(Command::Stop);
    bench.run(990);
    assert_eq!(bench.state(), State::Release);
    bench.run(20);
    assert_eq!(bench.controller.fault(), Some(Fault::Timeout));
}

#[test]
fn armed_without_a_start_for_60_s_is_idle_again() {
    let mut bench = Bench::new();
    bench.run(50);
    assert_eq!(bench.say(Command::Arm), Answer::Done);
    let since = bench.samples;
    while bench.state() == State::Armed && bench.samples < since + 70_000 {
        bench.run(1);
    }
    assert_eq!(bench.state(), State::Idle);
    assert_eq!(bench.samples - since, 60_001);
    assert_eq!(bench.controller.fault(), None);
}

#[test]
fn a_speed_that_is_not_reached_within_120_s_is_a_fault() {
    let mut bench = Bench::new();
    bench.rig = Rig::rolling(10.0);
    bench.start(RAMP);
    let since = bench.samples;
    while bench.state() == State::SpinUp && bench.samples < since + 130_000 {
        bench.run(1);
    }
    assert_eq!(bench.controller.fault(), Some(Fault::Timeout));
    assert_eq!(bench.output, BrakeOutput::DUMPED);
    let waited = bench.samples - since;
    assert!((120_000..=120_002).contains(&waited), "{waited}");
}
