//! The controller from its samples to its valves: runs, interlocks, link and parameters.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failed step fails the test"
)]

use muslip_control::board::{
    Actuators, BridgeQuality, BridgeReading, EncoderReading, NotStored, RawSample,
};
use muslip_control::brake::BrakeOutput;
use muslip_control::controller::{Controller, Identity};
use muslip_control::link::Transmit;
use muslip_record::{
    Answer, Command, Envelope, Event, FRAME_BYTES, Fault, FrameReader, Parameters, Profile,
    Program, Refusal, STEPS, State, Status, Telemetry, encode,
};

/// An encoder that turns.
#[derive(Default)]
struct Encoder {
    pulses: f64,
    edge_s: f64,
}

impl Encoder {
    fn turn(&mut self, now_s: f64, rad_s: f64, pulses_per_revolution: f64) -> EncoderReading {
        let rate = rad_s / std::f64::consts::TAU * pulses_per_revolution;
        let end = self.pulses + rate * 1e-3;
        if end.floor() > self.pulses.floor() {
            self.edge_s = now_s - (end - end.floor()) / rate;
        }
        self.pulses = end;
        let ticks = |s: f64| (s * 84e6) as u64 as u32;
        EncoderReading {
            edges: (self.pulses as u64 * 2 + 1) as u16,
            edge_ticks: ticks(self.edge_s),
            age_ticks: ticks(now_s).wrapping_sub(ticks(self.edge_s)),
        }
    }
}

/// What a test changes about the sensors.
#[derive(Clone, Copy)]
struct Rig {
    wheel_rad_s: f64,
    vehicle_m_s: f64,
    drag_n: f64,
    normal_n: f64,
    supply_mv: u16,
    emergency_stop: bool,
    quality: BridgeQuality,
    frozen: bool,
    late: bool,
}

impl Rig {
    fn rolling(vehicle_m_s: f64) -> Self {
        Self {
            wheel_rad_s: vehicle_m_s / 0.31,
            vehicle_m_s,
            drag_n: 0.0,
            normal_n: 4120.0,
            supply_mv: 24_000,
            emergency_stop: false,
            quality: BridgeQuality::Fresh,
            frozen: false,
            late: false,
        }
    }
}

#[derive(Default)]
struct Wire {
    bytes: Vec<u8>,
    room: usize,
}

impl Transmit for Wire {
    fn room(&self) -> usize {
        self.room
    }
    fn send(&mut self, bytes: &[u8]) {
        assert!(bytes.len() <= self.room);
        self.bytes.extend_from_slice(bytes);
    }
}

#[derive(Default)]
struct Flash {
    stored: Option<Parameters>,
    broken: bool,
}

impl Actuators for Flash {
    fn actuate(&mut self, _: BrakeOutput) {}
    fn feed_watchdog(&mut self) {}
    fn store(&mut self, parameters: &Parameters) -> Result<(), NotStored> {
        if self.broken {
            return Err(NotStored);
        }
        self.stored = Some(*parameters);
        Ok(())
    }
}

/// A controller with a host that speaks every 100 ms.
struct Bench {
    controller: Controller,
    rig: Rig,
    wheel: Encoder,
    vehicle: Encoder,
    flash: Flash,
    room: usize,
    samples: u64,
    number: u16,
    keep_alive: bool,
    frozen: RawSample,
    output: BrakeOutput,
    heard: Vec<Telemetry>,
}

const IDENTITY: Identity = Identity {
    core_clock_hz: 168_000_000,
    emulated: false,
    watchdog_reset: false,
    slow_clock: false,
    stored: false,
};

impl Bench {
    fn new() -> Self {
        Self::with(IDENTITY)
    }

    fn with(identity: Identity) -> Self {
        Self {
            controller: Controller::new(&Parameters::default(), identity).unwrap(),
            rig: Rig::rolling(20.0),
            wheel: Encoder::default(),
            vehicle: Encoder::default(),
            flash: Flash::default(),
            room: 4096,
            samples: 0,
            number: 0,
            keep_alive: true,
            frozen: RawSample::default(),
            output: BrakeOutput::DUMPED,
            heard: Vec::new(),
        }
    }

    fn raw(&mut self) -> RawSample {
        let now_s = self.samples as f64 * 1e-3;
        let code = |force: f64, noise: u64| (force / 0.002) as i32 + (noise % 7) as i32;
        let raw = RawSample {
            wheel: self.wheel.turn(now_s, self.rig.wheel_rad_s, 500.0),
            vehicle: self.vehicle.turn(now_s, self.rig.vehicle_m_s, 1000.0),
            bridge: BridgeReading {
                codes: [
                    code(self.rig.drag_n, self.samples),
                    code(self.rig.normal_n, self.samples / 2),
                ],
                quality: self.rig.quality,
            },
            supply_mv: self.rig.supply_mv,
            emergency_stop: self.rig.emergency_stop,
            late: self.rig.late,
        };
        if self.rig.frozen {
            RawSample {
                bridge: self.frozen.bridge,
                ..raw
            }
        } else {
            self.frozen = raw;
            raw
        }
    }

    /// One sample with these bytes received.
    fn sample(&mut self, bytes: &[u8]) -> BrakeOutput {
        self.samples += 1;
        let raw = self.raw();
        self.output = self.controller.control(&raw);
        let mut incoming = bytes.iter().copied();
        let mut wire = Wire {
            bytes: Vec::new(),
            room: self.room,
        };
        self.controller
            .communicate(|| incoming.next(), &mut wire, &mut self.flash);
        let mut reader = FrameReader::new();
        for &byte in &wire.bytes {
            if let Some(message) = reader.push::<Envelope<Telemetry>>(byte) {
                self.heard.push(message.unwrap().body);
            }
        }
        self.output
    }

    fn run(&mut self, samples: u32) {
        for _ in 0..samples {
            if self.keep_alive && self.samples.is_multiple_of(100) {
                self.say(Command::KeepAlive);
            } else {
                self.sample(&[]);
            }
        }
    }

    fn frame(&mut self, command: Command) -> Vec<u8> {
        self.number += 1;
        let mut buffer = [0; FRAME_BYTES];
        let envelope = Envelope {
            sequence: self.number,
            body: command,
        };
        encode(&envelope, &mut buffer).unwrap().to_vec()
    }

    /// Sends a command and answers what the controller did.
    fn say(&mut self, command: Command) -> Answer {
        let bytes = self.frame(command);
        let number = self.number;
        for chunk in bytes.chunks(92) {
            self.sample(chunk);
        }
        let answer = self.heard.iter().rev().find_map(|message| match message {
            Telemetry::Answer { command, answer } if *command == number => Some(*answer),
            _ => None,
        });
        answer.unwrap()
    }

    fn status(&mut self) -> Status {
        self.say(Command::ReadStatus);
        let found = self.heard.iter().rev().find_map(|message| match message {
            Telemetry::Status(status) => Some(*status),
            _ => None,
        });
        found.unwrap()
    }

    fn state(&self) -> State {
        self.controller.state()
    }

    /// Rolls until the meters know it, arms and starts.
    fn start(&mut self, profile: Profile) {
        self.run(50);
        assert_eq!(self.say(Command::Arm), Answer::Done);
        assert_eq!(self.say(Command::Start { profile }), Answer::Done);
    }

    /// Until the brake is at work.
    fn braking() -> Self {
        let mut bench = Self::new();
        bench.start(RAMP);
        bench.run(400);
        assert_eq!(bench.state(), State::Ramp);
        assert!(bench.output.hold_pressure && bench.output.valve_duty > 0);
        bench
    }
}

const RAMP: Profile = Profile {
    program: Program::Ramp { demand_per_s: 0.5 },
    start_speed_m_s: 15.0,
    skid_slip: 0.6,
    skid_hold_s: 0.05,
    applications: 2,
    cool_s: 0.2,
};

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
        dumped_after(|b| b.rig.emergency_stop = true),
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
fn an_estimator_that_refuses_its_own_state_is_a_fault() {
    let mut bench = Bench::new();
    let mut parameters = Parameters::default();
    parameters.estimator.friction_std = 1e-30;
    assert_eq!(
        bench.say(Command::SetParameters { parameters }),
        Answer::Done
    );
    bench.start(RAMP);
    bench.run(400);
    bench.rig.wheel_rad_s *= 0.98;
    bench.rig.drag_n = 1000.0;
    bench.run(2);
    assert_eq!(bench.controller.fault(), Some(Fault::EstimatorFault));
    assert_eq!(bench.output, BrakeOutput::DUMPED);
    // A new start needs the fault cleared, and begins a new estimate.
    bench.rig = Rig::rolling(20.0);
    bench.run(10);
    assert_eq!(bench.say(Command::ClearFault), Answer::Done);
    assert_eq!(bench.say(Command::Arm), Answer::Done);
}

#[test]
fn a_watchdog_reset_and_a_slow_clock_forbid_arming() {
    let mut bench = Bench::with(Identity {
        watchdog_reset: true,
        ..IDENTITY
    });
    bench.run(10);
    assert_eq!(bench.controller.fault(), Some(Fault::Watchdog));
    assert_eq!(bench.say(Command::ClearFault), Answer::Done);
    assert_eq!(bench.say(Command::Arm), Answer::Done);
    let mut bench = Bench::with(Identity {
        slow_clock: true,
        ..IDENTITY
    });
    bench.run(10);
    let refused = Answer::Refused(Refusal::Interlock(Fault::Clock));
    assert_eq!(bench.say(Command::Arm), refused);
}

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
fn a_repeated_command_is_answered_again_and_done_once() {
    let mut bench = Bench::new();
    bench.run(50);
    let frame = bench.frame(Command::Arm);
    bench.sample(&frame);
    assert_eq!(bench.state(), State::Armed);
    bench.heard.clear();
    bench.sample(&frame);
    // Done once more it would have been refused: it is armed already.
    let number = bench.number;
    assert!(bench.heard.contains(&Telemetry::Answer {
        command: number,
        answer: Answer::Done
    }));
    bench.number += 3;
    let link = bench.status().link;
    assert_eq!((link.duplicate, link.lost), (1, 3));
}

#[test]
fn a_wire_without_room_drops_telemetry_and_counts_it_and_control_goes_on() {
    let mut bench = Bench::braking();
    let before = bench.status().link.dropped;
    bench.room = 0;
    let duty = bench.output.valve_duty;
    let mut keep_alive = 0;
    for _ in 0..200 {
        keep_alive += 1;
        if keep_alive % 100 == 0 {
            let bytes = bench.frame(Command::KeepAlive);
            bench.sample(&bytes);
        } else {
            bench.sample(&[]);
        }
    }
    assert!(bench.output.valve_duty > duty);
    bench.room = 4096;
    let dropped = bench.status().link.dropped - before;
    // A sample each, an estimate every tenth, two answers.
    assert_eq!(dropped, 200 + 20 + 2);
}

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

#[test]
fn one_byte_in_ten_corrupted_is_counted_and_does_not_disturb_a_run() {
    let mut bench = Bench::new();
    bench.keep_alive = false;
    bench.start(RAMP);
    let mut random = 1_u32;
    let mut next = || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        random >> 8
    };
    for index in 0..400 {
        let mut bytes = Vec::new();
        if index % 20 == 0 {
            bytes = bench.frame(Command::KeepAlive);
        } else if index % 3 == 0 {
            bytes = bench.frame(Command::ReadStatus);
        }
        for byte in &mut bytes {
            if next() % 10 == 0 {
                *byte ^= (next() % 255) as u8 + 1;
            }
        }
        bench.sample(&bytes);
    }
    assert_eq!(bench.state(), State::Ramp, "{:?}", bench.controller.fault());
    // A frame that lost its closing zero would swallow the next.
    bench.sample(&[0]);
    let link = bench.status().link;
    assert!(
        link.corrupt > 30 && link.lost > 30 && link.received > 30,
        "{link:?}"
    );
}
