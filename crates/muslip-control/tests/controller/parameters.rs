//! Setting parameters, and zeros by a tare.

use muslip_control::controller::Identity;
use muslip_record::{Answer, Command, Event, Origin, Parameters, Refusal, State, Telemetry};

use crate::bench::{Bench, IDENTITY};

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
