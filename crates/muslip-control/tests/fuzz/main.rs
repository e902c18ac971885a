//! The controller under sequences of commands, damage and faults, against a model of it.
//!
//! A case is one sample with whatever arrives in it. `cargo xtask fuzz` runs 10^8 of them and prints its seed; a
//! failure repeats by that seed alone.
#![allow(
    clippy::panic,
    clippy::indexing_slicing,
    reason = "a failed step fails the test"
)]

mod model;
mod random;
mod rig;
mod wire;

use std::collections::BTreeMap;
use std::num::NonZero;
use std::thread;

use muslip_control::board::{Actuators, NotStored};
use muslip_control::brake::BrakeOutput;
use muslip_control::controller::{Controller, Identity};
use muslip_control::rates::Rates;
use muslip_record::{
    Answer, Envelope, FRAME_BYTES, FrameReader, LINK_BYTES_PER_SECOND, Parameters, SAMPLE_RATE_HZ,
    Telemetry,
};

use test_support::MemoryPort;

use model::{Heard, Model};
use random::Random;
use rig::Rig;
use wire::{Host, Sent};

/// Cases without another word.
const CASES: u64 = 100_000;
/// Samples from one start of a controller to the next.
const SAMPLES: u64 = 4_000;
/// Bytes that a sample brings.
const WIRE_BYTES: usize = (LINK_BYTES_PER_SECOND / SAMPLE_RATE_HZ) as usize;

/// How often each thing happened.
type Seen = BTreeMap<String, u64>;

/// More than any sample says.
const ROOMY_BYTES: usize = 4096;

struct Flash {
    broken: bool,
}

impl Actuators for Flash {
    fn actuate(&mut self, _: BrakeOutput) {}
    fn feed_watchdog(&mut self) {}
    fn store(&mut self, _: &Parameters) -> Result<(), NotStored> {
        if self.broken { Err(NotStored) } else { Ok(()) }
    }
}

/// A controller, its model, and what is between them.
struct Bench {
    controller: Controller,
    model: Model,
    rig: Rig,
    host: Host,
    output: BrakeOutput,
    reader: FrameReader,
    /// Number of the next frame if none is dropped, and frames dropped so far.
    numbers: (u16, u32),
    chatter: u64,
}

impl Bench {
    fn start(random: &mut Random) -> Self {
        let parameters = Parameters::default();
        let origin = wire::origin(random);
        let identity = Identity {
            rates: Rates::new(SAMPLE_RATE_HZ, 84_000_000),
            core_clock_hz: 168_000_000,
            emulated: false,
            watchdog_reset: false,
            reset_flags: 0,
            end: None,
            slow_clock: false,
            set_up: true,
            parameters: origin,
            brake_energy_j: 0,
        };
        let Ok(controller) = Controller::new(&parameters, identity) else {
            panic!("the defaults are refused");
        };
        Self {
            controller,
            model: Model::new(&parameters, origin),
            rig: Rig::new(random),
            host: Host::new(random),
            output: BrakeOutput::DUMPED,
            reader: FrameReader::new(),
            numbers: (0, 0),
            chatter: random.one_of(&[2, 20, 50, 80, 80, 120]),
        }
    }

    fn sample(&mut self, random: &mut Random, seen: &mut Seen) {
        let raw = self.rig.sample(random, self.output, &self.model.parameters);
        if self.host.is_quiet() && random.once_in(self.chatter) {
            self.host
                .speak(random, self.model.state, &self.model.parameters);
        }
        let before = self.model.state;
        self.output = self.controller.control(&raw);
        self.model.controlled(&raw, &self.controller, self.output);
        if self.model.state != before {
            count(seen, format!("{before:?} -> {:?}", self.model.state));
            if let Some(fault) = self.controller.fault() {
                count(seen, format!("fault {fault:?}"));
            }
        }
        let (taken, said) = self.communicate(random);
        let mut heard = self.hear(&said, seen);
        self.model
            .communicated(&taken, &mut heard, &self.controller);
        if random.once_in(3_000) {
            self.rig.stand(random.once_in(2));
        }
    }

    fn communicate(&mut self, random: &mut Random) -> (Vec<Sent>, Vec<u8>) {
        // A tight wire takes little of it at once: the rest waits, and what may not wait is dropped.
        let mut port = MemoryPort::new(if random.once_in(5) {
            random.one_of(&[0, 20, 60, FRAME_BYTES])
        } else {
            ROOMY_BYTES
        });
        let mut flash = Flash {
            broken: random.once_in(4),
        };
        let mut taken = Vec::new();
        for (byte, closed) in (0..WIRE_BYTES).map_while(|_| self.host.take()) {
            port.incoming.push_back(byte);
            taken.extend(closed);
        }
        self.controller.communicate(&mut port, &mut flash);
        assert!(port.incoming.is_empty());
        // What waits goes out before the next sample.
        port.capacity = ROOMY_BYTES;
        self.controller.communicate(&mut port, &mut flash);
        (taken, port.outgoing.into())
    }

    /// Every frame is whole, every number of it finite, and those that are missing are counted.
    fn hear(&mut self, said: &[u8], seen: &mut Seen) -> Heard {
        let mut heard = Heard::default();
        for &byte in said {
            let Some(message) = self.reader.push::<Envelope<Telemetry>>(byte) else {
                continue;
            };
            let Ok(Envelope { sequence, body }) = message else {
                panic!("a broken frame: {message:?}");
            };
            let (expected, dropped) = self.numbers;
            let dropped = dropped + u32::from(sequence.wrapping_sub(expected));
            self.numbers = (sequence.wrapping_add(1), dropped);
            match body {
                Telemetry::Answer { command, answer } => {
                    count(seen, in_words(answer));
                    heard.answers.push_back((command, answer));
                }
                Telemetry::Status(status) => heard.statuses.push_back((status, dropped)),
                other => assert_finite(&other),
            }
        }
        heard
    }
}

fn in_words(answer: Answer) -> String {
    let words = format!("{answer:?}");
    words
        .trim_end_matches(|c: char| c.is_ascii_digit() || c == ')' || c == '(')
        .to_owned()
}

fn assert_finite(telemetry: &Telemetry) {
    let finite = match telemetry {
        Telemetry::Sample(s) => [
            s.wheel_speed_rad_s,
            s.vehicle_speed_m_s,
            s.drag_force_n,
            s.normal_force_n,
            s.brake_demand,
        ]
        .iter()
        .all(|x| x.is_finite()),
        Telemetry::Estimate(e) => [e.peak_friction, e.critical_slip, e.p00, e.p01, e.p11]
            .iter()
            .all(|x| x.is_finite()),
        Telemetry::QuarterCar(q) => q.state.iter().chain(&q.covariance).all(|x| x.is_finite()),
        _ => true,
    };
    assert!(finite, "{telemetry:?}");
}

fn count(seen: &mut Seen, what: String) {
    *seen.entry(what).or_default() += 1;
}

/// These starts of a controller, each with random numbers of its own.
fn run(seed: u64, starts: impl Iterator<Item = u64>) -> Seen {
    let mut seen = Seen::new();
    for start in starts {
        let mut random = Random::new((seed << 40) + start);
        let mut bench = Bench::start(&mut random);
        let mut telling = Telling { start, sample: 0 };
        for sample in 0..SAMPLES {
            telling.sample = sample;
            bench.sample(&mut random, &mut seen);
        }
    }
    seen
}

/// Says which case a panic is of.
struct Telling {
    start: u64,
    sample: u64,
}

impl Drop for Telling {
    fn drop(&mut self) {
        if thread::panicking() {
            eprintln!("in start {}, sample {}", self.start, self.sample);
        }
    }
}

fn setting(name: &str, default: u64) -> u64 {
    match std::env::var(name) {
        Ok(text) => text.parse().unwrap_or_else(|_| panic!("{name}={text}")),
        Err(_) => default,
    }
}

#[test]
fn no_sequence_of_commands_damage_and_faults_breaks_an_invariant() {
    let cases = setting("MUSLIP_FUZZ_CASES", CASES);
    let seed = setting("MUSLIP_FUZZ_SEED", 1);
    let starts = cases.div_ceil(SAMPLES);
    let threads = thread::available_parallelism().map_or(1, NonZero::get);
    let seen = thread::scope(|scope| {
        let workers: Vec<_> = (0..threads)
            .map(|worker| (worker as u64..starts).step_by(threads))
            .map(|starts| scope.spawn(move || run(seed, starts)))
            .collect();
        let mut all = Seen::new();
        for worker in workers {
            let Ok(seen) = worker.join() else {
                panic!("an invariant does not hold");
            };
            for (what, times) in seen {
                *all.entry(what).or_default() += times;
            }
        }
        all
    });
    println!("{} cases, seed {seed}", starts * SAMPLES);
    for (what, times) in &seen {
        println!("{times:>10}  {what}");
    }
    for what in [
        "Ramp -> Skid",
        "Ramp -> Fault",
        "Skid -> Release",
        "Release -> Cool",
        "Cool -> Done",
        "fault EmergencyStop",
        "fault LinkSilent",
        "fault DeadlineMissed",
        "Done",
        "Refused(Profile",
        "Refused(Storage",
        "Refused(Unconfirmed",
        "Refused(NotConfirmed",
    ] {
        assert!(seen.contains_key(what), "{what} did not happen");
    }
}
