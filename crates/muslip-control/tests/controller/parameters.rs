//! Setting parameters, and zeros by a tare.

use muslip_record::{Answer, Command, Event, Parameters, Refusal, State, Telemetry};

use crate::bench::Bench;

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
    assert!(bench.status().stored);
    bench.flash.broken = true;
    parameters.estimator.friction_std = 0.05;
    assert_eq!(
        set(&mut bench, parameters),
        Answer::Refused(Refusal::Storage)
    );
    assert_eq!(*bench.controller.parameters(), parameters);
    assert!(!bench.status().stored);
    let mut bench = Bench::braking();
    let refused = set(&mut bench, parameters);
    assert_eq!(refused, Answer::Refused(Refusal::WrongState(State::Ramp)));
    assert_eq!(*bench.controller.parameters(), Parameters::default());
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
