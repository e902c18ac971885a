//! What a controller must do, written a second time and from its documents: states, answers, counters, dumps.

use std::collections::VecDeque;

use muslip_control::board::{BridgeQuality, RawSample};
use muslip_control::brake::BrakeOutput;
use muslip_control::ceiling::{CEILINGS, RANGES};
use muslip_control::controller::Controller;
use muslip_control::interlock::SILENT_MS;
use muslip_control::validate;
use muslip_record::{
    Answer, Command, Envelope, LinkCounters, Origin, Parameters, Profile, Program, Refusal, State,
    Status,
};

use crate::wire::Sent;

/// What the controller said in a sample, in order.
#[derive(Default)]
pub struct Heard {
    pub answers: VecDeque<(u16, Answer)>,
    /// With how many frames had been dropped before it.
    pub statuses: VecDeque<(Status, u32)>,
}

pub struct Model {
    pub state: State,
    pub parameters: Parameters,
    pub origin: Origin,
    pub link: LinkCounters,
    last: Option<(u16, Answer)>,
    newest: Option<u16>,
    silent: u32,
    stop_differs: u32,
    stop_seen_open: bool,
    stop_proven: bool,
    pressed: bool,
    confirmed: bool,
    /// A tare was begun: zeros may change.
    taring: bool,
    must_dump: Option<&'static str>,
}

impl Model {
    pub fn new(parameters: &Parameters, origin: Origin) -> Self {
        Self {
            state: State::Idle,
            parameters: *parameters,
            origin,
            link: LinkCounters::default(),
            last: None,
            newest: None,
            silent: u32::MAX,
            stop_differs: 0,
            stop_seen_open: false,
            stop_proven: false,
            pressed: true,
            confirmed: false,
            taring: false,
            must_dump: None,
        }
    }

    /// After the work of a sample: is what it did allowed?
    pub fn controlled(&mut self, raw: &RawSample, controller: &Controller, output: BrakeOutput) {
        self.silent = self.silent.saturating_add(1);
        self.stop(raw.emergency_stop);
        self.must_dump = self.dangerous(raw);
        let (before, after) = (self.state, controller.state());
        assert!(
            follows(before, after),
            "{before:?} -> {after:?} without a command"
        );
        let engaged = !matches!(before, State::Idle | State::Done | State::Fault);
        if engaged && let Some(why) = self.must_dump {
            assert_eq!(after, State::Fault, "{why} in {before:?}");
        }
        assert_eq!(
            controller.fault().is_some(),
            after == State::Fault,
            "{after:?} with {:?} latched",
            controller.fault()
        );
        let braking = |state| matches!(state, State::Ramp | State::Skid);
        if output.hold_pressure {
            assert!(
                braking(before) && braking(after),
                "{before:?} -> {after:?} brakes"
            );
        } else {
            assert_eq!(output, BrakeOutput::DUMPED);
        }
        let brake = &self.parameters.brake;
        assert!(f32::from(output.valve_duty) <= brake.duty_at_full * 65535.0 + 1.0);
        let pressed = raw.confirm && !self.pressed;
        self.pressed = raw.confirm;
        self.confirmed = after == State::Fault && (self.confirmed || pressed);
        self.state = after;
    }

    fn stop(&mut self, open: [bool; 2]) {
        let [a, b] = open;
        self.stop_differs = if a == b { 0 } else { self.stop_differs + 1 };
        if self.stop_differs > 100 {
            (self.stop_seen_open, self.stop_proven) = (false, false);
        }
        self.stop_seen_open |= a && b;
        self.stop_proven |= self.stop_seen_open && !a && !b;
    }

    /// What must dump the brake on this very sample, of what can be seen in it alone.
    fn dangerous(&self, raw: &RawSample) -> Option<&'static str> {
        let limits = &self.parameters.limits;
        let normal = &self.parameters.normal;
        let code = f64::from(raw.bridge.codes[1]) - f64::from(normal.zero_code);
        let normal_n = code * f64::from(normal.newton_per_code);
        let least_n = f64::from(limits.minimum_normal_force_n);
        let conditions = [
            (raw.emergency_stop != [false; 2], "emergency stop"),
            (raw.late, "late"),
            (raw.bridge.quality != BridgeQuality::Fresh, "bridge"),
            (
                f64::from(raw.supply_mv) * 1e-3 < f64::from(limits.minimum_supply_v) - 1e-3,
                "supply",
            ),
            (
                raw.bridge.codes.iter().any(|code| code.abs() >= 0x7F_8000),
                "end of scale",
            ),
            (normal_n < least_n * 0.9999 - 0.1, "normal force"),
            (
                f64::from(raw.pressure_mv)
                    < 500.0 * f64::from(self.parameters.pressure.volt_at_zero) - 1.0
                    || raw.pressure_mv > 3_201,
                "pressure transmitter",
            ),
            (self.silent > SILENT_MS, "silence"),
        ];
        conditions
            .iter()
            .find(|(holds, _)| *holds)
            .map(|&(_, why)| why)
    }

    /// After the link's work: what was taken from the wire, and what was said.
    pub fn communicated(&mut self, taken: &[Sent], heard: &mut Heard, controller: &Controller) {
        for sent in taken {
            match sent {
                Sent::Corrupt => self.link.corrupt += 1,
                Sent::Oversized => self.link.oversized += 1,
                Sent::Foreign => self.link.foreign += 1,
                Sent::Command(envelope) => {
                    self.link.received += 1;
                    self.heard(envelope);
                    self.take(envelope, heard, controller);
                }
            }
        }
        assert!(heard.answers.is_empty() && heard.statuses.is_empty());
        self.tared(controller);
        assert_eq!(controller.state(), self.state, "after {taken:?}");
        assert!(
            same(controller.parameters(), &self.parameters),
            "neither old nor new: {:?} after {taken:?}",
            controller.parameters()
        );
    }

    fn heard(&mut self, envelope: &Envelope<Command>) {
        let ahead = self
            .newest
            .map(|newest| envelope.sequence.wrapping_sub(newest));
        let news = match ahead {
            None => true,
            Some(0) => false,
            Some(ahead) => ahead < 1 << 15 || envelope.body == Command::Hello,
        };
        if news {
            (self.silent, self.newest) = (0, Some(envelope.sequence));
        }
    }

    fn take(&mut self, envelope: &Envelope<Command>, heard: &mut Heard, controller: &Controller) {
        let Envelope { sequence, body } = envelope;
        let Some((number, answer)) = heard.answers.pop_front() else {
            panic!("no answer to {envelope:?}");
        };
        assert_eq!(number, *sequence);
        if *body != Command::Hello
            && let Some((last, answered)) = self.last
        {
            if last == *sequence {
                self.link.duplicate += 1;
                assert_eq!(answer, answered);
                return;
            }
            let missing = sequence.wrapping_sub(last).wrapping_sub(1);
            if missing < 1 << 15 {
                self.link.lost += u32::from(missing);
            }
        }
        if *body == Command::ReadStatus {
            self.link.dropped = self.status(heard);
        }
        self.done(body, answer, controller);
        self.last = Some((*sequence, answer));
    }

    /// Every counter is exact; how many frames were dropped, by the numbers that are missing.
    fn status(&self, heard: &mut Heard) -> u32 {
        let Some((status, dropped)) = heard.statuses.pop_front() else {
            panic!("no status");
        };
        let expected = LinkCounters {
            dropped,
            ..self.link
        };
        assert_eq!(status.link, expected);
        assert_eq!(status.state, self.state);
        assert_eq!(status.parameters.is_confirmed(), self.origin.is_confirmed());
        dropped
    }

    fn done(&mut self, command: &Command, answer: Answer, controller: &Controller) {
        let rest = matches!(self.state, State::Idle | State::Done);
        let refused = |refusal| Answer::Refused(refusal);
        let wrong_state = refused(Refusal::WrongState(self.state));
        let confirmed = self.origin.is_confirmed();
        match command {
            Command::Hello
            | Command::KeepAlive
            | Command::Stop
            | Command::ReadParameters
            | Command::ReadStatus => assert_eq!(answer, Answer::Done, "{command:?}"),
            Command::Arm if answer == Answer::Done => {
                assert!(rest && confirmed && self.stop_proven, "armed");
                let silence = self.must_dump == Some("silence");
                assert!(self.must_dump.is_none() || silence, "{:?}", self.must_dump);
                self.state = State::Armed;
            }
            Command::Arm if !confirmed => assert_eq!(answer, refused(Refusal::Unconfirmed)),
            Command::Start { profile } => {
                let expected = if !is_profile(profile) {
                    refused(Refusal::Profile)
                } else if self.state != State::Armed {
                    wrong_state
                } else {
                    self.state = State::SpinUp;
                    Answer::Done
                };
                assert_eq!(answer, expected, "{profile:?}");
            }
            Command::Tare if !rest => assert_eq!(answer, wrong_state),
            Command::Tare if !confirmed => assert_eq!(answer, refused(Refusal::Unconfirmed)),
            Command::Tare => self.taring |= answer == Answer::Done,
            Command::ClearFault if self.state != State::Fault => assert_eq!(answer, wrong_state),
            Command::ClearFault if answer == Answer::Done => {
                assert!(self.confirmed, "cleared from afar");
                self.state = State::Idle;
            }
            Command::SetParameters { .. } if !rest => assert_eq!(answer, wrong_state),
            Command::SetParameters { parameters } => self.set(parameters, answer, controller),
            Command::Arm | Command::ClearFault => {
                assert!(matches!(answer, Answer::Refused(_)));
            }
        }
    }

    fn set(&mut self, parameters: &Parameters, answer: Answer, controller: &Controller) {
        let storage = Answer::Refused(Refusal::Storage);
        if answer == Answer::Done || answer == storage {
            self.parameters = *parameters;
            self.taring = false;
            self.origin = if answer == Answer::Done {
                Origin::Stored
            } else {
                Origin::Unstored
            };
            assert!(controller.fault().is_none());
            assert_within_ceilings(parameters);
        } else {
            let field = validate::parameters(parameters).err();
            let told = matches!(answer, Answer::Refused(Refusal::Parameter(told))
                if field.is_none_or(|field| field == told));
            assert!(told, "{answer:?} to {parameters:?}");
        }
    }

    /// Zeros that a tare has taken, and nothing else.
    fn tared(&mut self, controller: &Controller) {
        if !self.taring {
            return;
        }
        let now = controller.parameters();
        let mut expected = self.parameters;
        expected.drag.zero_code = now.drag.zero_code;
        expected.normal.zero_code = now.normal.zero_code;
        self.parameters = expected;
    }
}

/// By bytes: some numbers of theirs may be NaN, which no two are.
fn same(a: &Parameters, b: &Parameters) -> bool {
    let bytes = |p: &Parameters| postcard::to_slice(p, &mut [0; 256]).map(|bytes| bytes.to_vec());
    bytes(a) == bytes(b)
}

/// Whether a state can follow another without a command.
fn follows(before: State, after: State) -> bool {
    use State::{Armed, Cool, Done, Fault, Idle, Ramp, Release, Skid, SpinUp};
    let next: &[State] = match before {
        Idle | Fault => &[],
        Armed => &[Idle, Fault],
        SpinUp => &[Ramp, Idle, Fault],
        Ramp => &[Skid, Release, Fault],
        Skid => &[Release, Fault],
        Release => &[Cool, Fault],
        Cool => &[SpinUp, Done, Fault],
        Done => &[Idle],
    };
    before == after || next.contains(&after)
}

/// The ranges of a profile as the wire types state them.
fn is_profile(p: &Profile) -> bool {
    let program = match p.program {
        Program::Ramp { demand_per_s } => demand_per_s > 0.0 && demand_per_s <= 10.0,
        Program::Steps {
            levels,
            count,
            hold_s,
        } => {
            (1..=8).contains(&count)
                && (0.01..=60.0).contains(&hold_s)
                && levels.iter().all(|level| (0.0..=1.0).contains(level))
        }
        Program::SlipHold {
            target_slip,
            hold_s,
        } => (0.01..=0.5).contains(&target_slip) && (0.01..=60.0).contains(&hold_s),
    };
    program
        && p.start_speed_m_s > 5.0
        && p.start_speed_m_s < f32::INFINITY
        && (0.05..=1.0).contains(&p.skid_slip)
        && (0.0..=0.15).contains(&p.skid_hold_s)
        && (1..=100).contains(&p.applications)
        && (0.1..=600.0).contains(&p.cool_s)
}

/// No limit of an interlock is taken that is outside the table of ceilings.
fn assert_within_ceilings(p: &Parameters) {
    let taken = [
        ("wheel.effective_radius_m", p.wheel.effective_radius_m),
        ("wheel.inertia_kg_m2", p.wheel.inertia_kg_m2),
        ("vehicle_encoder_radius_m", p.vehicle_encoder_radius_m),
        ("brake.torque_at_full_nm", p.brake.torque_at_full_nm),
        (
            "limits.maximum_vehicle_speed_m_s",
            p.limits.maximum_vehicle_speed_m_s,
        ),
        (
            "limits.maximum_wheel_speed_rad_s",
            p.limits.maximum_wheel_speed_rad_s,
        ),
        (
            "limits.minimum_normal_force_n",
            p.limits.minimum_normal_force_n,
        ),
        ("limits.maximum_force_n", p.limits.maximum_force_n),
        ("limits.minimum_supply_v", p.limits.minimum_supply_v),
        ("brake_heat.maximum_energy_j", p.brake_heat.maximum_energy_j),
        ("brake_heat.cooling_time_s", p.brake_heat.cooling_time_s),
        ("pressure.volt_at_zero", p.pressure.volt_at_zero),
        ("pressure.volt_at_full", p.pressure.volt_at_full),
        ("pressure.response_s", p.pressure.response_s),
        ("wheel.vehicle_mass_kg", p.wheel.vehicle_mass_kg),
        ("estimator.friction_std", p.estimator.friction_std),
        ("estimator.noise_inflation", p.estimator.noise_inflation),
        (
            "slip_control.bandwidth_rad_s",
            p.slip_control.bandwidth_rad_s,
        ),
        (
            "slip_control.integral_time_s",
            p.slip_control.integral_time_s,
        ),
        (
            "slip_control.maximum_torque_rate_nm_s",
            p.slip_control.maximum_torque_rate_nm_s,
        ),
    ];
    for (name, value) in taken {
        let ceiling = CEILINGS
            .iter()
            .chain(&RANGES)
            .find(|ceiling| ceiling.parameter == name);
        let within = ceiling.is_some_and(|ceiling| ceiling.allows(value));
        assert!(within, "{name} = {value} was taken");
    }
}
