//! Every interlock, and what follows from it.

use muslip_control::board::BridgeQuality;
use muslip_control::brake::BrakeOutput;
use muslip_control::controller::Identity;
use muslip_record::{Answer, Command, Event, Fault, Profile, Program, Refusal, State, Telemetry};

use crate::bench::{Bench, IDENTITY, RAMP, Rig};

/// Does something to the sensors of a braking rig, and counts the samples until the brake is dumped.
fn dumped_after(change: impl FnOnce(&mut Bench)) -> (u32, Fault) {
    let mut bench = Bench::braking();
    change(&mut bench);
    for sample in 1..=400 {
        bench.run(1);
        if bench.output == BrakeOutput::DUMPED {
            assert_eq!(bench.state(), State::Fault);
            let fault = bench.controller.fault().unwrap();
            let event = Telemetry::Event {
                tick: bench.samples as u32,
                event: Event::Fault(fault),
            };
            assert!(bench.heard.contains(&event), "{fault:?} is not told");
            // It stays dumped, whatever becomes of the sensors.
            bench.rig = Rig::rolling(20.0);
            bench.run(100);
            assert_eq!(bench.output, BrakeOutput::DUMPED);
            assert_eq!(bench.controller.fault(), Some(fault));
            return (sample, fault);
        }
    }
    panic!("the brake was never dumped");
}

#[test]
fn every_interlock_dumps_the_brake_on_the_sample_on_which_its_condition_holds() {
    let now = |fault| (1, fault);
    assert_eq!(
        dumped_after(|b| b.rig.emergency_stop = [true; 2]),
        now(Fault::EmergencyStop)
    );
    assert_eq!(
        dumped_after(|b| b.rig.quality = BridgeQuality::Bad),
        now(Fault::BridgeLost)
    );
    assert_eq!(
        dumped_after(|b| b.rig.quality = BridgeQuality::Stale),
        now(Fault::BridgeFrozen)
    );
    assert_eq!(
        dumped_after(|b| b.rig.drag_n = 15_100.0),
        now(Fault::BridgeOutOfRange)
    );
    assert_eq!(
        dumped_after(|b| b.rig.normal_n = 16_770.0),
        now(Fault::BridgeOutOfRange)
    );
    assert_eq!(
        dumped_after(|b| b.rig.normal_n = 499.0),
        now(Fault::NormalForceLost)
    );
    assert_eq!(
        dumped_after(|b| b.rig.supply_mv = 19_999),
        now(Fault::BrownOut)
    );
    assert_eq!(
        dumped_after(|b| b.rig.pressure_mv = Some(150)),
        now(Fault::PressureLost)
    );
    // More pressure than the valves were ever told, by its tenth sample.
    assert_eq!(
        dumped_after(|b| b.rig.pressure_mv = Some(2_000)),
        (10, Fault::PressureWrong)
    );
    assert_eq!(
        dumped_after(|b| b.rig.late = true),
        now(Fault::DeadlineMissed)
    );
    assert_eq!(
        dumped_after(|b| b.controller.overran()),
        now(Fault::DeadlineMissed)
    );
    assert_eq!(
        dumped_after(|b| b.rig.wheel_rad_s = 0.0),
        now(Fault::WheelSensorLost)
    );
    assert_eq!(
        dumped_after(|b| b.rig.vehicle_m_s = 0.0),
        now(Fault::VehicleSensorLost)
    );
    assert_eq!(
        dumped_after(|b| b.rig.wheel_rad_s = 200.0),
        now(Fault::Overspeed)
    );
    assert_eq!(
        dumped_after(|b| b.rig.wheel_rad_s = 110.0),
        now(Fault::WheelSensorOutOfRange)
    );
    assert_eq!(
        dumped_after(|b| b.rig.vehicle_m_s = 30.0),
        now(Fault::VehicleSensorOutOfRange)
    );
    // The fifth time that both codes are the same; the sample before the change was the first.
    assert_eq!(
        dumped_after(|b| b.rig.frozen = true),
        (4, Fault::BridgeFrozen)
    );
}

#[test]
fn a_vehicle_that_is_driven_too_fast_dumps_the_brake_at_its_limit() {
    let mut bench = Bench::new();
    bench.rig = Rig::rolling(44.5);
    bench.start(RAMP);
    bench.run(400);
    assert!(bench.output.hold_pressure);
    while bench.state() == State::Ramp {
        // 20 m/s² more.
        bench.rig.vehicle_m_s += 0.02;
        bench.rig.wheel_rad_s += 0.02 / 0.31;
        bench.run(1);
    }
    assert_eq!(bench.controller.fault(), Some(Fault::Overspeed));
    assert_eq!(bench.output, BrakeOutput::DUMPED);
    let speed = bench.rig.vehicle_m_s;
    assert!((45.0..45.05).contains(&speed), "{speed}");
}

#[test]
fn a_silent_host_dumps_the_brake_after_250_ms() {
    let mut bench = Bench::braking();
    bench.say(Command::KeepAlive);
    bench.keep_alive = false;
    for sample in 1..=300 {
        bench.run(1);
        if bench.output == BrakeOutput::DUMPED {
            assert_eq!(bench.controller.fault(), Some(Fault::LinkSilent));
            // The word came on a sample; the 251st after it is the first that is more than 250 ms later.
            assert_eq!(sample, 251);
            return;
        }
    }
    panic!("the brake was never dumped");
}

#[test]
fn a_wheel_that_locks_is_released_after_two_tenths_of_a_second() {
    // Down to a stop as fast as a brake can do it; the profile never sees its skid begin.
    let mut bench = Bench::new();
    bench.start(Profile {
        skid_slip: 1.0,
        ..RAMP
    });
    bench.run(400);
    let mut locked_samples = 0;
    for _ in 0..1000 {
        bench.rig.wheel_rad_s = (bench.rig.wheel_rad_s - 1.0).max(0.0);
        bench.run(1);
        if bench.rig.wheel_rad_s == 0.0 && bench.state() == State::Ramp {
            locked_samples += 1;
        }
        if bench.state() == State::Fault {
            assert_eq!(bench.controller.fault(), Some(Fault::WheelLocked));
            assert_eq!(bench.output, BrakeOutput::DUMPED);
            // The last pulse came a moment before the wheel stood.
            assert!((180..=201).contains(&locked_samples), "{locked_samples}");
            return;
        }
    }
    panic!("the wheel stayed locked: {:?}", bench.state());
}

#[test]
fn a_locked_wheel_that_rocks_on_an_edge_is_released_as_well() {
    let mut bench = Bench::new();
    bench.start(Profile {
        skid_slip: 1.0,
        ..RAMP
    });
    bench.run(400);
    for sample in 0..1000 {
        bench.rig.wheel_rad_s = (bench.rig.wheel_rad_s - 1.0).max(0.0);
        bench.rig.wheel_rocks = bench.rig.wheel_rad_s == 0.0;
        bench.run(1);
        if bench.state() == State::Fault {
            assert_eq!(bench.controller.fault(), Some(Fault::WheelLocked));
            assert!((240..=266).contains(&sample), "{sample}");
            return;
        }
    }
    panic!("the wheel stayed locked: {:?}", bench.state());
}

#[test]
fn an_estimator_that_cannot_be_believed_is_a_fault() {
    let mut bench = Bench::new();
    bench.start(Profile {
        program: Program::SlipHold {
            target_slip: 0.05,
            hold_s: 5.0,
        },
        ..RAMP
    });
    bench.run(400);
    assert!(bench.output.hold_pressure);
    // A drag that is wrong in either direction, by less than its own interlocks see.
    let mut samples = 0;
    while bench.state() != State::Fault {
        bench.rig.drag_n = if samples % 2 == 0 { 3_500.0 } else { -3_500.0 };
        bench.run(1);
        samples += 1;
        assert!(samples < 200, "{:?}", bench.state());
    }
    assert_eq!(bench.controller.fault(), Some(Fault::EstimatorFault));
    assert_eq!(bench.output, BrakeOutput::DUMPED);
    // A new start needs the fault cleared, and begins a new estimate.
    bench.rig = Rig::rolling(20.0);
    bench.confirm();
    assert_eq!(bench.say(Command::ClearFault), Answer::Done);
    assert_eq!(bench.say(Command::Arm), Answer::Done);
}

#[test]
fn a_watchdog_reset_a_slow_clock_and_a_failed_set_up_forbid_arming() {
    let mut bench = Bench::with(Identity {
        watchdog_reset: true,
        ..IDENTITY
    });
    bench.run(10);
    assert_eq!(bench.controller.fault(), Some(Fault::Watchdog));
    bench.confirm();
    assert_eq!(bench.say(Command::ClearFault), Answer::Done);
    assert_eq!(bench.say(Command::Arm), Answer::Done);
    let mut bench = Bench::with(Identity {
        slow_clock: true,
        ..IDENTITY
    });
    bench.run(10);
    let refused = Answer::Refused(Refusal::Interlock(Fault::Clock));
    assert_eq!(bench.say(Command::Arm), refused);
    let mut bench = Bench::with(Identity {
        set_up: false,
        ..IDENTITY
    });
    bench.run(10);
    let refused = Answer::Refused(Refusal::Interlock(Fault::SetUp));
    assert_eq!(bench.say(Command::Arm), refused);
}
