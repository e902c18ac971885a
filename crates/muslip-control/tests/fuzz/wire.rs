//! What arrives: valid frames around anything, and everything that a wire makes of frames.

use std::collections::VecDeque;

use muslip_record::{
    BODY_BYTES, Command, Envelope, FRAME_BYTES, Origin, Parameters, Profile, Program, STEPS, State,
    encode,
};

use crate::random::Random;

/// What was put on the wire up to a closing zero.
#[derive(Debug, Clone)]
pub enum Sent {
    Command(Box<Envelope<Command>>),
    Corrupt,
    Oversized,
    Foreign,
}

/// A wire with a host at its other end.
pub struct Host {
    sequence: u16,
    bytes: VecDeque<u8>,
    sent: VecDeque<Sent>,
}

impl Host {
    pub fn new(random: &mut Random) -> Self {
        Self {
            sequence: random.bits() as u16,
            bytes: VecDeque::new(),
            sent: VecDeque::new(),
        }
    }

    pub fn is_quiet(&self) -> bool {
        self.bytes.is_empty()
    }

    /// The next byte; with a closing zero, what it closes.
    pub fn take(&mut self) -> Option<(u8, Option<Sent>)> {
        let byte = self.bytes.pop_front()?;
        let closed = if byte == 0 {
            self.sent.pop_front()
        } else {
            None
        };
        Some((byte, closed))
    }

    /// Puts something on the wire.
    pub fn speak(&mut self, random: &mut Random, state: State, parameters: &Parameters) {
        self.sequence = match random.below(40) {
            // Once more, a few lost, another host.
            0 => self.sequence,
            1 => self.sequence.wrapping_add(1 + random.below(300) as u16),
            2 => random.bits() as u16,
            _ => self.sequence.wrapping_add(1),
        };
        let command = command(random, state, parameters);
        let envelope = Envelope {
            sequence: self.sequence,
            body: command,
        };
        let mut buffer = [0; FRAME_BYTES];
        let Ok(frame) = encode(&envelope, &mut buffer) else {
            panic!("no frame for {envelope:?}");
        };
        let frame = frame.to_vec();
        match random.below(24) {
            0 => self.corrupt(random, frame),
            1 => self.cut(random, &frame),
            2 => {
                let length = FRAME_BYTES as u64 + 1 + random.below(100);
                self.bytes
                    .extend((0..length).map(|_| 1 + random.below(255) as u8));
                self.close(Sent::Oversized);
            }
            3 => self.anything(random),
            _ => {
                self.bytes.extend(&frame[..frame.len() - 1]);
                self.close(Sent::Command(Box::new(envelope)));
            }
        }
    }

    fn close(&mut self, sent: Sent) {
        self.bytes.push_back(0);
        self.sent.push_back(sent);
    }

    /// Another byte in it, and no zero, which would make two frames of it.
    fn corrupt(&mut self, random: &mut Random, mut frame: Vec<u8>) {
        frame.pop();
        let at = random.below(frame.len() as u64) as usize;
        let other = 1 + random.below(254) as u8;
        frame[at] = if other < frame[at] { other } else { other + 1 };
        self.bytes.extend(frame);
        self.close(Sent::Corrupt);
    }

    fn cut(&mut self, random: &mut Random, frame: &[u8]) {
        let kept = 1 + random.below(frame.len() as u64 - 2) as usize;
        self.bytes.extend(&frame[..kept]);
        self.close(Sent::Corrupt);
    }

    /// A whole frame around anything; what that is as a command, if it is one.
    fn anything(&mut self, random: &mut Random) {
        // An array has no length in front of it.
        let mut body = [0_u8; 32];
        for byte in &mut body {
            *byte = random.bits() as u8;
        }
        // Some with the number of a command where it belongs.
        body[0] &= 0x7F;
        body[1] = random.below(12) as u8;
        const { assert!(32 <= BODY_BYTES) };
        let sent = match postcard::take_from_bytes::<Envelope<Command>>(&body) {
            Ok((envelope, [])) => Sent::Command(Box::new(envelope)),
            _ => Sent::Foreign,
        };
        let mut buffer = [0; FRAME_BYTES];
        let Ok(frame) = encode(&body, &mut buffer) else {
            panic!("no frame for {body:?}");
        };
        self.bytes.extend(&frame[..frame.len() - 1]);
        self.close(sent);
    }
}

/// A command, as often as not one that does something in this state.
fn command(random: &mut Random, state: State, parameters: &Parameters) -> Command {
    if random.once_in(3) {
        match state {
            State::Idle | State::Done => return Command::Arm,
            State::Armed => {
                return Command::Start {
                    profile: profile(random),
                };
            }
            State::Fault => return Command::ClearFault,
            _ => {}
        }
    }
    match random.below(40) {
        0 => Command::Hello,
        1 => Command::Arm,
        2 | 3 => Command::Start {
            profile: profile(random),
        },
        4 if random.once_in(5) => Command::Stop,
        5 | 6 => Command::Tare,
        7 => Command::ClearFault,
        8 | 9 => Command::SetParameters {
            parameters: changed(random, parameters),
        },
        10 => Command::ReadParameters,
        11..16 => Command::ReadStatus,
        _ => Command::KeepAlive,
    }
}

fn profile(random: &mut Random) -> Profile {
    let hold_s = (0.05 + 0.3 * random.share()) as f32;
    let mut profile = Profile {
        program: match random.below(3) {
            0 => Program::Ramp {
                demand_per_s: (0.5 + 4.0 * random.share()) as f32,
            },
            1 => Program::Steps {
                levels: [0; STEPS].map(|_| (0.6 * random.share()) as f32),
                count: random.below(10) as u8,
                hold_s,
            },
            _ => Program::SlipHold {
                target_slip: (0.02 + 0.3 * random.share()) as f32,
                hold_s,
            },
        },
        start_speed_m_s: random.one_of(&[6.0, 15.0]),
        skid_slip: random.one_of(&[0.1, 0.3, 0.6, 1.0]),
        skid_hold_s: random.one_of(&[0.0, 0.05, 0.15]),
        applications: random.below(4) as u8,
        cool_s: 0.1,
    };
    if random.once_in(3) {
        let any = random.single();
        match random.below(7) {
            6 => profile.applications = random.bits() as u8,
            0 => profile.start_speed_m_s = any,
            1 => profile.skid_slip = any,
            2 => profile.skid_hold_s = any,
            3 => profile.cool_s = any,
            4 => profile.program = Program::Ramp { demand_per_s: any },
            _ => {
                profile.program = Program::SlipHold {
                    target_slip: any,
                    hold_s,
                }
            }
        }
    }
    profile
}

/// Parameters with some bytes of theirs changed, as far as they still are parameters.
fn changed(random: &mut Random, parameters: &Parameters) -> Parameters {
    let mut parameters = *parameters;
    match random.below(4) {
        0 => return Parameters::default(),
        1 => {}
        2 => {
            let any = random.single();
            let places: [&mut f32; 14] = [
                &mut parameters.wheel.effective_radius_m,
                &mut parameters.vehicle_encoder_radius_m,
                &mut parameters.drag.newton_per_code,
                &mut parameters.brake.duty_at_full,
                &mut parameters.brake.torque_at_full_nm,
                &mut parameters.limits.maximum_force_n,
                &mut parameters.limits.minimum_normal_force_n,
                &mut parameters.estimator.friction_std,
                &mut parameters.estimator.skid_slip_maximum,
                &mut parameters.slip_control.integral_time_s,
                &mut parameters.brake_heat.maximum_energy_j,
                &mut parameters.brake_heat.cooling_time_s,
                &mut parameters.pressure.volt_at_zero,
                &mut parameters.pressure.response_s,
            ];
            let at = random.below(14) as usize;
            if let Some(place) = places.into_iter().nth(at) {
                *place = any;
            }
        }
        _ => {
            let c = &mut parameters.compensation;
            let any = random.single();
            match random.below(4) {
                0 => c.force_delay_s = Some(0.05 * any),
                1 => c.force_lag_s = Some(0.02 * any),
                2 => c.load_crosstalk = Some(any),
                _ => *c = muslip_record::CompensationParameters::default(),
            }
        }
    }
    let mut bytes = [0; 256];
    let Ok(used) = postcard::to_slice(&parameters, &mut bytes).map(|used| used.len()) else {
        panic!("{parameters:?} is longer than a slot");
    };
    if random.once_in(2) {
        let at = random.below(used as u64) as usize;
        bytes[at] ^= 1 << random.below(8);
    }
    postcard::from_bytes(&bytes).unwrap_or(parameters)
}

/// Where a controller's parameters may come from when it starts.
pub fn origin(random: &mut Random) -> Origin {
    random.one_of(&[
        Origin::Stored,
        Origin::Stored,
        Origin::Stored,
        Origin::BuiltIn,
        Origin::Previous,
    ])
}
