//! Setting parameters, and zeros by a tare.

use muslip_control::ceiling::{FRICTION_STD, NOISE_INFLATION};
use muslip_control::controller::Identity;
use muslip_record::{Answer, Command, Event, Origin, Parameters, Refusal, State, Telemetry};

use crate::bench::{Bench, IDENTITY, RAMP};

#[test]
fn parameters_are_taken_whole_or_not_at_all_and_only_at_rest() {
    let mut bench = Bench::new();
    let mut parameters = Parameters::default();
    parameters.limits.minimum_normal_force_n = 600.0;
    parameters.estimator.friction_std = -1.0;
    let set = |bench: &mut Bench, parameters| bench.say(Command::SetParameters { parameters });
    assert_eq!(
        set(&mut bench, parameters),
        Answer::Refused(Refusal::Parameter(21))
    );
    assert_eq!(*bench.controller.parameters(), Parameters::default());
    assert_eq!(bench.flash.stored, None);
    parameters.estimator.friction_std = 0.04;
    assert_eq!(set(&mut bench, parameters), Answer::Done);
    assert_eq!(bench.flash.stored, Some(parameters));
    assert_eq!(bench.status().parameters, Origin::Stored);
    bench.flash.broken = true;
    parameters.estimator.friction_std = 0.05;
    assert_eq!(
        set(&mut bench, parameters),
        Answer::Refused(Refusal::Storage)
    );
    assert_eq!(*bench.controller.parameters(), parameters);
    assert_eq!(bench.status().parameters, Origin::Unstored);
    let mut bench = Bench::braking();
    let refused = set(&mut bench, parameters);
    assert_eq!(refused, Answer::Refused(Refusal::WrongState(State::Ramp)));
    assert_eq!(*bench.controller.parameters(), Parameters::default());
}

#[test]
fn a_rig_that_rolls_arms_right_after_its_parameters_are_set() {
    let mut bench = Bench::new();
    bench.run(100);
    let parameters = Parameters::default();
    assert_eq!(
        bench.say(Command::SetParameters { parameters }),
        Answer::Done
    );
    assert_eq!(bench.say(Command::Arm), Answer::Done);
    bench.run(10);
    assert_eq!(bench.state(), State::Armed);
}

/// A skid on a road of peak 0.85 at slip 0.14 under noise of 3 %; true where it ended without a fault, and something was
/// estimated.
fn goes_through_a_skid(parameters: Parameters) -> bool {
    let mut bench = Bench::new();
    let set = bench.say(Command::SetParameters { parameters });
    assert_eq!(set, Answer::Done, "{parameters:?}");
    bench.start(RAMP);
    bench.run(400);
    assert_eq!(bench.state(), State::Ramp);
    let mut random = 1_u32;
    for sample in 0..400 {
        let slip = 0.6 * f64::from(sample) / 400.0;
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = f64::from(random >> 8) / f64::from(1 << 23) - 1.0;
        let share = slip / 0.14;
        bench.rig.wheel_rad_s = 20.0 * (1.0 - slip) / 0.31;
        bench.rig.drag_n = 4120.0 * (1.7 * share / (1.0 + share * share) + 0.05 * noise);
        bench.run(1);
    }
    let updates = bench.heard.iter().rev().find_map(|message| match message {
        Telemetry::Estimate(estimate) => Some(estimate.updates),
        _ => None,
    });
    bench.controller.fault().is_none() && updates.is_some_and(|updates| updates > 20)
}

#[test]
fn at_the_ends_of_its_range_the_estimator_goes_through_a_run() {
    for friction_std in [FRICTION_STD.lowest, 0.03, FRICTION_STD.highest] {
        for noise_inflation in [NOISE_INFLATION.lowest, NOISE_INFLATION.highest] {
            // The efficient estimator, and the article's filter.
            for force_lag_s in [None, Some(0.01)] {
                let mut parameters = Parameters::default();
                parameters.estimator.friction_std = friction_std;
                parameters.estimator.noise_inflation = noise_inflation;
                parameters.compensation.force_lag_s = force_lag_s;
                assert!(
                    goes_through_a_skid(parameters),
                    "{friction_std} {noise_inflation} {force_lag_s:?}"
                );
            }
        }
    }
}

#[test]
fn parameters_that_nobody_set_can_neither_be_armed_nor_tared_until_somebody_does() {
    for origin in [Origin::BuiltIn, Origin::Previous] {
        for broken in [false, true] {
            let mut bench = Bench::with(Identity {
                parameters: origin,
                ..IDENTITY
            });
            bench.flash.broken = broken;
            bench.run(50);
            let refused = Answer::Refused(Refusal::Unconfirmed);
            assert_eq!(bench.say(Command::Arm), refused);
            assert_eq!(bench.say(Command::Tare), refused);
            assert_eq!(bench.status().parameters, origin);
            let set = Command::SetParameters {
                parameters: Parameters::default(),
            };
            let answer = bench.say(set);
            if broken {
                assert_eq!(answer, Answer::Refused(Refusal::Storage));
            } else {
                assert_eq!(answer, Answer::Done);
            }
            bench.run(50);
            assert_eq!(bench.say(Command::Arm), Answer::Done);
        }
    }
}

#[test]
fn a_tare_needs_standstill_and_takes_the_mean() {
    let mut bench = Bench::new();
    bench.run(50);
    assert_eq!(bench.say(Command::Tare), Answer::Refused(Refusal::Moving));
    bench.rig.wheel_rad_s = 0.0;
    bench.rig.vehicle_m_s = 0.0;
    bench.rig.normal_n = 10.0;
    bench.rig.drag_n = -6.0;
    bench.run(400);
    assert_eq!(bench.say(Command::Tare), Answer::Done);
    bench.run(300);
    let stored = bench.flash.stored.unwrap();
    assert!((stored.drag.zero_code + 3000).abs() <= 6, "{stored:?}");
    assert!((stored.normal.zero_code - 5000).abs() <= 6, "{stored:?}");
    assert!(bench.heard.iter().any(|m| matches!(
        m,
        Telemetry::Event {
            event: Event::Tared,
            ..
        }
    )));
}
