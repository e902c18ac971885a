//! What guards the rig beyond its sensors' plain ranges.

use muslip_control::brake::BrakeOutput;
use muslip_control::controller::Identity;
use muslip_control::interlock::{DISAGREEING_MS, STUCK_SAMPLES};
use muslip_record::{Answer, Command, Fault, Parameters, Profile, Program, Refusal, State};

use crate::bench::{Bench, IDENTITY, RAMP, Rig, pressure_mv};

/// Samples until the brake is dumped, and the fault.
fn dumped(bench: &mut Bench, most: u32) -> (u32, Option<Fault>) {
    for sample in 1..=most {
        bench.run(1);
        if bench.output == BrakeOutput::DUMPED {
            return (sample, bench.controller.fault());
        }
    }
    panic!("the brake was never dumped");
}

#[test]
fn either_channel_of_the_emergency_stop_dumps_and_one_alone_is_a_fault_of_its_own() {
    for open in [[true, false], [false, true]] {
        let mut bench = Bench::braking();
        bench.rig.emergency_stop = open;
        assert_eq!(dumped(&mut bench, 5), (1, Some(Fault::EmergencyStop)));
        // Closed again it can be cleared, unless the channels have differed for too long.
        bench.run(101);
        let stands = 1 << Fault::StopChannels as u32;
        assert!(bench.status().standing & stands != 0);
    }
}

#[test]
fn arming_needs_an_emergency_stop_that_was_seen_to_work() {
    let mut bench = Bench::new();
    bench.stop_is_tested = false;
    bench.run(50);
    let untested = Answer::Refused(Refusal::StopUntested);
    assert_eq!(bench.say(Command::Arm), untested);
    for open in [[true, false], [false, true]] {
        bench.rig.emergency_stop = open;
        bench.run(20);
        bench.rig.emergency_stop = [false; 2];
        bench.run(20);
        assert_eq!(bench.say(Command::Arm), untested, "{open:?}");
    }
    bench.rig.emergency_stop = [true; 2];
    bench.run(20);
    bench.rig.emergency_stop = [false; 2];
    bench.run(20);
    // Parameters do not undo it.
    let parameters = Parameters::default();
    bench.say(Command::SetParameters { parameters });
    bench.run(20);
    assert_eq!(bench.say(Command::Arm), Answer::Done);
}

#[test]
fn a_fault_is_left_only_when_somebody_presses_the_button_at_the_rig_after_it() {
    let mut bench = Bench::braking();
    // Pressed before, and held.
    bench.rig.confirm = true;
    bench.run(10);
    bench.rig.emergency_stop = [true; 2];
    bench.run(10);
    bench.rig.emergency_stop = [false; 2];
    bench.run(10);
    let refused = Answer::Refused(Refusal::NotConfirmed);
    assert_eq!(bench.say(Command::ClearFault), refused);
    bench.confirm();
    assert_eq!(bench.say(Command::ClearFault), Answer::Done);
    assert_eq!(bench.state(), State::Idle);
    // The next fault needs another.
    assert_eq!(bench.say(Command::Arm), Answer::Done);
    bench.rig.supply_mv = 0;
    bench.run(10);
    bench.rig.supply_mv = 24_000;
    bench.run(10);
    assert_eq!(bench.say(Command::ClearFault), refused);
}

#[test]
fn a_dump_valves_output_that_is_not_what_it_was_told_is_found_on_the_second_sample() {
    let mut bench = Bench::braking();
    bench.rig.holds = Some(false);
    assert_eq!(dumped(&mut bench, 5), (2, Some(Fault::DumpOutput)));
    // One that stays high where it should dump: armed, before any brake.
    let mut bench = Bench::new();
    bench.run(50);
    assert_eq!(bench.say(Command::Arm), Answer::Done);
    bench.rig.holds = Some(true);
    bench.run(2);
    assert_eq!(bench.controller.fault(), Some(Fault::DumpOutput));
}

#[test]
fn a_single_stuck_channel_of_the_bridge_is_found_within_25_samples() {
    let mut bench = Bench::braking();
    bench.rig.stuck_drag = true;
    let (samples, fault) = dumped(&mut bench, 100);
    assert_eq!(fault, Some(Fault::BridgeFrozen));
    assert!((u32::from(STUCK_SAMPLES) - 1..=u32::from(STUCK_SAMPLES)).contains(&samples));
}

#[test]
fn a_force_that_jumps_three_times_is_out_of_range_and_a_single_glitch_is_not() {
    let glitch = |bench: &mut Bench| {
        bench.rig.drag_n = 9_000.0;
        bench.run(1);
        bench.rig.drag_n = 0.0;
    };
    let mut bench = Bench::braking();
    glitch(&mut bench);
    bench.run(100);
    assert!(bench.output.hold_pressure);
    glitch(&mut bench);
    bench.run(3);
    assert!(bench.output.hold_pressure);
    bench.rig.drag_n = 9_000.0;
    assert_eq!(dumped(&mut bench, 2), (1, Some(Fault::BridgeOutOfRange)));
}

#[test]
fn speeds_that_differ_while_the_wheel_rolls_freely_are_a_fault_after_2_s() {
    for factor in [0.94, 1.06] {
        let mut bench = Bench::new();
        bench.rig.wheel_rad_s *= factor;
        bench.start(RAMP);
        let mut samples = 0;
        while bench.state() == State::SpinUp {
            bench.run(1);
            samples += 1;
            assert!(samples < 3_000);
        }
        assert_eq!(bench.controller.fault(), Some(Fault::SpeedsDisagree));
        // Most of it since before the start.
        assert!(samples <= DISAGREEING_MS, "{samples}");
        assert!(samples > 1_800, "{samples}");
    }
    let mut bench = Bench::new();
    bench.rig.wheel_rad_s *= 1.02;
    bench.start(RAMP);
    bench.run(400);
    assert_eq!(bench.state(), State::Ramp);
}

#[test]
fn a_brake_that_has_taken_up_all_it_bears_is_dumped_and_cools() {
    let mut bench = Bench::new();
    let mut parameters = Parameters::default();
    parameters.brake_heat.maximum_energy_j = 100_000.0;
    parameters.brake_heat.cooling_time_s = 10.0;
    bench.run(20);
    bench.say(Command::SetParameters { parameters });
    let levels = [0.5; muslip_record::STEPS];
    bench.start(Profile {
        program: Program::Steps {
            levels,
            count: 8,
            hold_s: 60.0,
        },
        skid_slip: 1.0,
        ..RAMP
    });
    while !bench.output.hold_pressure {
        bench.run(1);
    }
    // 1,000 N m at 64.5 rad/s are 64.5 kW: 1.68 s, with what cools meanwhile.
    let (samples, fault) = dumped(&mut bench, 3_000);
    assert_eq!(fault, Some(Fault::BrakeHot));
    assert!((1_600..1_750).contains(&samples), "{samples}");
    assert!(bench.status().brake_energy_j > 99_000);
    bench.confirm();
    assert_eq!(bench.say(Command::ClearFault), Answer::Done);
    bench.run(10_000);
    let left = bench.status().brake_energy_j;
    assert!((34_000..38_000).contains(&left), "{left}");
    // A reset of the parameters does not cool it.
    bench.say(Command::SetParameters { parameters });
    assert!(bench.status().brake_energy_j > 34_000);
}

#[test]
fn a_line_that_keeps_its_pressure_after_a_release_is_a_fault_of_the_valves() {
    let mut bench = Bench::braking();
    bench.rig.pressure_mv = Some(pressure_mv(bench.output));
    bench.run(600);
    // Stuck at what it had: the ramp has left it behind.
    assert_eq!(bench.controller.fault(), Some(Fault::PressureWrong));
    assert_eq!(bench.output, BrakeOutput::DUMPED);
    // It stands as long as there is pressure, and forbids what needs a line without.
    let mv = pressure_mv(BrakeOutput {
        valve_duty: u16::MAX / 2,
        hold_pressure: true,
    });
    bench.rig.pressure_mv = Some(mv);
    bench.run(500);
    bench.confirm();
    let stands = Answer::Refused(Refusal::Interlock(Fault::PressureWrong));
    assert_eq!(bench.say(Command::ClearFault), stands);
    bench.rig.pressure_mv = None;
    bench.run(5);
    assert_eq!(bench.say(Command::ClearFault), Answer::Done);
}

#[test]
fn a_valve_that_does_not_open_on_a_release_is_found_within_the_lines_response() {
    let mut bench = Bench::braking();
    while bench.output.valve_duty < u16::MAX / 3 {
        bench.run(1);
    }
    bench.rig.pressure_mv = Some(pressure_mv(bench.output));
    bench.say(Command::Stop);
    bench.run(1);
    assert_eq!(bench.output, BrakeOutput::DUMPED);
    // The tolerance's share of the response, and ten samples.
    let found = (1..100).find(|_| {
        bench.run(1);
        bench.controller.fault().is_some()
    });
    assert_eq!(bench.controller.fault(), Some(Fault::PressureWrong));
    assert!(
        found.is_some_and(|samples| (30..=50).contains(&samples)),
        "{found:?}"
    );
}

#[test]
fn slip_without_a_meaning_in_a_ramp_releases_the_brake_at_once() {
    let mut bench = Bench::braking();
    // Zeros in both forces' place: friction, and so the sample, has no meaning below the smallest normal force.
    bench.rig = Rig {
        normal_n: 0.0,
        ..bench.rig
    };
    let (samples, _) = dumped(&mut bench, 5);
    assert_eq!(samples, 1);
}

#[test]
fn a_wire_that_repeats_its_last_frames_does_not_keep_the_link_alive() {
    let mut bench = Bench::braking();
    bench.say(Command::KeepAlive);
    bench.keep_alive = false;
    bench.number -= 1;
    let last = bench.frame(Command::KeepAlive);
    bench.number -= 2;
    let before = bench.frame(Command::KeepAlive);
    for sample in 1..=300 {
        let bytes = if sample % 2 == 0 { &last } else { &before };
        bench.sample(bytes);
        if bench.output == BrakeOutput::DUMPED {
            assert_eq!(bench.controller.fault(), Some(Fault::LinkSilent));
            assert!((249..=252).contains(&sample), "{sample}");
            return;
        }
    }
    panic!("the brake was never dumped");
}

#[test]
fn a_brake_that_was_hot_before_a_reset_forbids_arming_after_it_until_it_has_cooled() {
    let hottest_j = Parameters::default().brake_heat.maximum_energy_j;
    let mut bench = Bench::with(Identity {
        brake_energy_j: 1_900_000,
        ..IDENTITY
    });
    assert!(hottest_j < 1_900_000.0);
    bench.run(50);
    let hot = Answer::Refused(Refusal::Interlock(Fault::BrakeHot));
    assert_eq!(bench.say(Command::Arm), hot);
    // 5 % of it leave in 6.2 s.
    bench.run(7_000);
    assert_eq!(bench.say(Command::Arm), Answer::Done);
}
