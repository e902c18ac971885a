//! A controller with a host, on a rig of a few figures.

use muslip_control::board::{
    Actuators, BridgeQuality, BridgeReading, EncoderReading, NotStored, RawSample,
};
use muslip_control::brake::BrakeOutput;
use muslip_control::controller::{Controller, Identity};
use muslip_control::rates::Rates;
use muslip_record::{
    Answer, Command, Envelope, FRAME_BYTES, FrameReader, Origin, Parameters, Profile, Program,
    State, Status, Telemetry, encode,
};
use test_support::MemoryPort;

/// An encoder that turns.
#[derive(Default)]
pub struct Encoder {
    pub pulses: f64,
    pub edge_s: f64,
}

impl Encoder {
    pub fn turn(
        &mut self,
        now_s: f64,
        rad_s: f64,
        pulses_per_revolution: f64,
        rates: Rates,
    ) -> EncoderReading {
        let rate = rad_s / std::f64::consts::TAU * pulses_per_revolution;
        let end = self.pulses + rate / f64::from(rates.sample_hz());
        if end.floor() > self.pulses.floor() {
            self.edge_s = now_s - (end - end.floor()) / rate;
        }
        self.pulses = end;
        let ticks = |s: f64| (s * f64::from(rates.edge_timer_hz())) as u64 as u32;
        EncoderReading {
            edges: (self.pulses as u64 * 2 + 1) as u16,
            edge_ticks: ticks(self.edge_s),
            age_ticks: ticks(now_s).wrapping_sub(ticks(self.edge_s)),
        }
    }
}

/// What a test changes about the sensors.
#[derive(Clone, Copy)]
pub struct Rig {
    pub wheel_rad_s: f64,
    pub vehicle_m_s: f64,
    pub drag_n: f64,
    pub normal_n: f64,
    pub supply_mv: u16,
    /// The pressure transmitter's mV, whatever the valves are told.
    pub pressure_mv: Option<u16>,
    pub emergency_stop: [bool; 2],
    /// The dump valve's output stays as it is, whatever it is told.
    pub holds: Option<bool>,
    /// The drag's code stays as it is.
    pub stuck_drag: bool,
    pub confirm: bool,
    pub quality: BridgeQuality,
    pub frozen: bool,
    pub late: bool,
    /// The wheel rocks on an edge: captures come and nothing is counted.
    pub wheel_rocks: bool,
}

impl Rig {
    pub fn rolling(vehicle_m_s: f64) -> Self {
        Self {
            wheel_rad_s: vehicle_m_s / 0.31,
            vehicle_m_s,
            drag_n: 0.0,
            normal_n: 4120.0,
            supply_mv: 24_000,
            pressure_mv: None,
            emergency_stop: [false; 2],
            holds: None,
            stuck_drag: false,
            confirm: false,
            quality: BridgeQuality::Fresh,
            frozen: false,
            late: false,
            wheel_rocks: false,
        }
    }
}

#[derive(Default)]
pub struct Flash {
    pub stored: Option<Parameters>,
    pub broken: bool,
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

/// What the pressure transmitter of the default parameters reads, of a line that follows at once.
pub fn pressure_mv(output: BrakeOutput) -> u16 {
    let share = (f64::from(output.valve_duty) / 65535.0 - 0.1) / 0.8;
    (333.0 + 2667.0 * share.clamp(0.0, 1.0)) as u16
}

/// A controller with a host that speaks every 100 ms.
pub struct Bench {
    pub rates: Rates,
    pub controller: Controller,
    pub rig: Rig,
    pub wheel: Encoder,
    pub vehicle: Encoder,
    pub flash: Flash,
    /// Bytes that the wire takes in a sample.
    pub room: usize,
    pub reader: FrameReader,
    pub samples: u64,
    pub number: u16,
    pub keep_alive: bool,
    pub stop_is_tested: bool,
    pub frozen: RawSample,
    pub output: BrakeOutput,
    pub heard: Vec<Telemetry>,
}

pub const IDENTITY: Identity = Identity {
    rates: Rates::new(1_000, 84_000_000),
    core_clock_hz: 168_000_000,
    emulated: false,
    watchdog_reset: false,
    reset_flags: 0,
    end: None,
    slow_clock: false,
    set_up: true,
    parameters: Origin::Stored,
    brake_energy_j: 0,
};

impl Bench {
    pub fn new() -> Self {
        Self::with(IDENTITY)
    }

    pub fn with(identity: Identity) -> Self {
        Self {
            rates: identity.rates,
            controller: Controller::new(&Parameters::default(), identity).unwrap(),
            rig: Rig::rolling(20.0),
            wheel: Encoder::default(),
            vehicle: Encoder::default(),
            flash: Flash::default(),
            room: 4096,
            reader: FrameReader::new(),
            samples: 0,
            number: 0,
            keep_alive: true,
            stop_is_tested: true,
            frozen: RawSample::default(),
            output: BrakeOutput::DUMPED,
            heard: Vec::new(),
        }
    }

    pub fn raw(&mut self) -> RawSample {
        let rates = self.rates;
        let now_s = self.samples as f64 / f64::from(rates.sample_hz());
        let code = |force: f64, noise: u64| (force / 0.002) as i32 + (noise % 7) as i32;
        if self.rig.wheel_rocks {
            self.wheel.edge_s = now_s - 1e-4;
        }
        let raw = RawSample {
            wheel: self.wheel.turn(now_s, self.rig.wheel_rad_s, 500.0, rates),
            vehicle: self
                .vehicle
                .turn(now_s, self.rig.vehicle_m_s, 1000.0, rates),
            bridge: BridgeReading {
                codes: [
                    code(
                        self.rig.drag_n,
                        if self.rig.stuck_drag { 0 } else { self.samples },
                    ),
                    code(self.rig.normal_n, self.samples / 2),
                ],
                quality: self.rig.quality,
            },
            supply_mv: self.rig.supply_mv,
            pressure_mv: self
                .rig
                .pressure_mv
                .unwrap_or_else(|| pressure_mv(self.output)),
            // Somebody tests it when the rig is switched on.
            emergency_stop: if self.stop_is_tested && (2..5).contains(&self.samples) {
                [true; 2]
            } else {
                self.rig.emergency_stop
            },
            holds: self.rig.holds.unwrap_or(self.output.hold_pressure),
            confirm: self.rig.confirm,
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
    pub fn sample(&mut self, bytes: &[u8]) -> BrakeOutput {
        self.samples += 1;
        let raw = self.raw();
        self.output = self.controller.control(&raw);
        let mut port = MemoryPort::new(self.room);
        port.incoming.extend(bytes);
        self.controller.communicate(&mut port, &mut self.flash);
        for byte in port.outgoing {
            if let Some(message) = self.reader.push::<Envelope<Telemetry>>(byte) {
                self.heard.push(message.unwrap().body);
            }
        }
        self.output
    }

    pub fn run(&mut self, samples: u32) {
        for _ in 0..samples {
            if self.keep_alive
                && self
                    .samples
                    .is_multiple_of(u64::from(self.rates.samples(100)))
            {
                self.say(Command::KeepAlive);
            } else {
                self.sample(&[]);
            }
        }
    }

    pub fn frame(&mut self, command: Command) -> Vec<u8> {
        self.number += 1;
        let mut buffer = [0; FRAME_BYTES];
        let envelope = Envelope {
            sequence: self.number,
            body: command,
        };
        encode(&envelope, &mut buffer).unwrap().to_vec()
    }

    /// Sends a command and answers what the controller did.
    pub fn say(&mut self, command: Command) -> Answer {
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

    pub fn status(&mut self) -> Status {
        self.say(Command::ReadStatus);
        let found = self.heard.iter().rev().find_map(|message| match message {
            Telemetry::Status(status) => Some(*status),
            _ => None,
        });
        found.unwrap()
    }

    pub fn state(&self) -> State {
        self.controller.state()
    }

    /// Somebody presses the button at the rig.
    pub fn confirm(&mut self) {
        for pressed in [false, true, false] {
            self.rig.confirm = pressed;
            self.run(5);
        }
    }

    /// Rolls until the meters know it, arms and starts.
    pub fn start(&mut self, profile: Profile) {
        self.run(50);
        assert_eq!(self.say(Command::Arm), Answer::Done);
        assert_eq!(self.say(Command::Start { profile }), Answer::Done);
    }

    /// Until the brake is at work.
    pub fn braking() -> Self {
        let mut bench = Self::new();
        bench.start(RAMP);
        bench.run(400);
        assert_eq!(bench.state(), State::Ramp);
        assert!(bench.output.hold_pressure && bench.output.valve_duty > 0);
        bench
    }
}

pub const RAMP: Profile = Profile {
    program: Program::Ramp { demand_per_s: 0.5 },
    start_speed_m_s: 15.0,
    skid_slip: 0.6,
    skid_hold_s: 0.05,
    applications: 2,
    cool_s: 0.2,
};
