//! The controller: interlocks, state machine, estimates and link, put together.

use heapless::Vec;
use muslip::sample::RigSample;
use muslip_record::{
    Answer, Command, Event, Fault, Hello, Origin, PROTOCOL_VERSION, Parameters, PostMortem,
    Refusal, SAMPLES_PER_ESTIMATE, SCHEMA_HASH, Sample, State, Status, Telemetry,
};

use crate::board::{Actuators, BridgeQuality, NotStored, RawSample};
use crate::brake::BrakeOutput;
use crate::conversion::{Conversion, Converted, Tare};
use crate::estimation::Estimation;
use crate::interlock::{Circumstances, FaultSet, Interlocks};
use crate::link::{Arrival, Link, Port, Urgency};
use crate::number::whole_u32;
use crate::rates::Rates;
use crate::sequence::{Observed, Sequence};
use crate::slip_hold::{Refused, SlipHold};
use crate::validate;

/// Received bytes that are taken at once.
const RECEIVE_BYTES: u32 = 32;

/// What the board is and how it came up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Identity {
    /// How often it samples, and how finely it stamps edges.
    pub rates: Rates,
    /// Core clock in Hz.
    pub core_clock_hz: u32,
    /// True in the emulator.
    pub emulated: bool,
    /// The independent watchdog caused the reset, or a fault handler.
    pub watchdog_reset: bool,
    /// What caused the reset: the upper byte of the chip's RCC_CSR.
    pub reset_flags: u8,
    /// How the program came to its end before the reset, if it did.
    pub end: Option<PostMortem>,
    /// The core runs slower than it should.
    pub slow_clock: bool,
    /// Every register holds what start-up wrote to it.
    pub set_up: bool,
    /// Where the parameters come from.
    pub parameters: Origin,
    /// Energy in the brake in J before the reset, where memory has kept it; 0 after power-up.
    pub brake_energy_j: u32,
}

/// What the work has taken so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Resources {
    /// Most cycles of one sampling interrupt.
    pub worst_interrupt_cycles: u32,
    /// Most cycles of the host link's interrupt for one byte.
    pub worst_link_interrupt_cycles: u32,
    /// Most cycles of one sample's work in the main loop.
    pub worst_step_cycles: u32,
    /// Deepest stack in bytes.
    pub stack_used_bytes: u32,
}

/// Checked parameters that still make no controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BadParameters(pub u8);

/// The controller.
#[derive(Debug, Clone)]
pub struct Controller {
    identity: Identity,
    parameters: Parameters,
    conversion: Conversion,
    interlocks: Interlocks,
    sequence: Sequence,
    estimation: Estimation,
    slip_hold: Option<SlipHold>,
    link: Link,
    resources: Resources,
    tick: u32,
    sample: Option<Sample>,
    converted: Option<Converted>,
    standing: FaultSet,
    events: Vec<(u32, Event), 8>,
    tare: Option<Tare>,
    tared: bool,
    stop: bool,
    overran: bool,
    watchdog_reset: bool,
    /// Share of full torque demanded on the last sample.
    demand: f32,
    /// The button at the rig was pressed at the last sample, and has been since the fault.
    pressed: bool,
    confirmed: bool,
}

impl Controller {
    /// Idle, brake dumped; faulted after a reset by the watchdog.
    ///
    /// # Errors
    /// [`BadParameters`] with the number of the first field outside its range.
    pub fn new(parameters: &Parameters, identity: Identity) -> Result<Self, BadParameters> {
        validate::parameters(parameters).map_err(BadParameters)?;
        let estimation =
            Estimation::new(parameters, identity.rates).map_err(|_| BadParameters(NOISE_FIELD))?;
        let mut sequence = Sequence::new(identity.rates);
        if identity.watchdog_reset {
            sequence.fail(Fault::Watchdog);
        }
        Ok(Self {
            identity,
            parameters: *parameters,
            conversion: Conversion::new(parameters, identity.rates),
            interlocks: Interlocks::new(parameters, identity.rates).heated(identity.brake_energy_j),
            sequence,
            estimation,
            slip_hold: None,
            link: Link::new(),
            resources: Resources::default(),
            tick: 0,
            sample: None,
            converted: None,
            standing: FaultSet::default(),
            events: Vec::new(),
            tare: None,
            tared: false,
            stop: false,
            overran: false,
            watchdog_reset: identity.watchdog_reset,
            demand: 0.0,
            // Pressed all the time is no word of anybody.
            pressed: true,
            confirmed: false,
        })
    }

    /// Where the run is.
    pub fn state(&self) -> State {
        self.sequence.state()
    }

    /// The latched fault.
    pub fn fault(&self) -> Option<Fault> {
        self.sequence.fault()
    }

    /// Energy in the brake in J, whole.
    pub fn brake_energy_j(&self) -> u32 {
        whole_u32(self.interlocks.brake_energy_j())
    }

    /// The parameters in use.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Says what the work has taken so far.
    pub fn set_resources(&mut self, resources: Resources) {
        self.resources = resources;
    }

    /// Says how many received bytes were lost before they were read, in all.
    pub fn set_overrun_bytes(&mut self, total: u32) {
        self.link.set_overrun_bytes(total);
    }

    /// Says that the sample just worked on took longer than a sample: a fault on the next.
    pub fn overran(&mut self) {
        self.overran = true;
    }

    /// The work of one sample, up to what the valves are told. Does no input or output.
    pub fn control(&mut self, raw: &RawSample) -> BrakeOutput {
        self.tick = self.tick.wrapping_add(1);
        self.link.tick();
        let converted = self.conversion.convert(raw);
        self.converted = Some(converted);

        let circumstances = Circumstances {
            silent_samples: self.link.silent_samples(),
            estimator_failed: self.estimation.failed(),
            overran: core::mem::take(&mut self.overran),
            watchdog_reset: self.watchdog_reset,
            slow_clock: self.identity.slow_clock,
            set_up_failed: !self.identity.set_up,
            timed_out: self.sequence.timed_out(),
            demand: self.demand,
        };
        self.standing = self.interlocks.check(raw, &converted, &circumstances);
        let before = self.sequence.state();
        if self.sequence.is_engaged()
            && let Some(fault) = self.standing.first()
        {
            self.sequence.fail(fault);
            self.event(Event::Fault(fault));
        }
        let held = core::mem::replace(&mut self.pressed, raw.confirm);
        let pressed = raw.confirm && !held;
        self.confirmed = self.sequence.state() == State::Fault && (self.confirmed || pressed);

        let point = self.estimation.observe(&converted.sample);
        let observed = Observed {
            slip_ratio: point.map(|point| point.slip_ratio),
            vehicle_speed_m_s: converted.sample.vehicle_speed_m_s,
            stop: core::mem::take(&mut self.stop),
        };
        let (parameters, estimation) = (&self.parameters, &mut self.estimation);
        let rates = self.identity.rates;
        let slip_hold = &mut self.slip_hold;
        let demand = self.sequence.step(&observed, |target| {
            hold_slip(slip_hold, parameters, target, &converted.sample, rates).unwrap_or_else(
                |Refused| {
                    // No demand on this sample, a fault on the next.
                    estimation.fail();
                    0.0
                },
            )
        });
        if self.sequence.state() != State::Ramp {
            self.slip_hold = None;
        }
        if matches!(before, State::Ramp | State::Skid | State::Release)
            && self.sequence.state() != State::Fault
        {
            self.estimation.update();
        }
        let after = self.sequence.state();
        if after != before {
            self.event(Event::StateChanged {
                from: before,
                to: after,
            });
        }

        let output = BrakeOutput::for_demand(demand, &self.parameters.brake);
        // What is not above 0 dumps.
        self.demand = if demand > 0.0 { demand.min(1.0) } else { 0.0 };
        self.sample = Some(Sample {
            tick: self.tick,
            wheel_speed_rad_s: converted.sample.wheel_speed_rad_s,
            vehicle_speed_m_s: converted.sample.vehicle_speed_m_s,
            drag_force_n: converted.sample.drag_force_n,
            normal_force_n: converted.sample.normal_force_n,
            brake_demand: demand,
            state: after,
        });
        self.tare(raw);
        output
    }

    /// The link's work after a sample: commands out of what was received, telemetry to the wire.
    pub fn communicate(&mut self, port: &mut impl Port, actuators: &mut impl Actuators) {
        self.link.flush(port);
        for _ in 0..self.identity.rates.link_bytes().div_ceil(RECEIVE_BYTES) {
            let mut buffer = [0; RECEIVE_BYTES as usize];
            let received = self.link.take(&mut buffer, port);
            for &byte in received {
                match self.link.receive(byte) {
                    Some(Arrival::Command(number, command)) => {
                        let answer = self.obey(&command, port, actuators);
                        self.link.answered(number, answer);
                        self.answer(number, answer, port);
                    }
                    Some(Arrival::Repeated(number, answer)) => self.answer(number, answer, port),
                    None => {}
                }
            }
            if received.is_empty() {
                break;
            }
        }
        if core::mem::take(&mut self.tared) {
            // Zeros that cannot be stored still hold until the next reset.
            self.store(actuators).ok();
        }
        // By reference: the queue's own iterator has an index that may panic.
        for &(tick, event) in &core::mem::take(&mut self.events) {
            self.link
                .send(Telemetry::Event { tick, event }, Urgency::Prompt, port);
        }
        if let Some(sample) = self.sample.take() {
            self.link
                .send(Telemetry::Sample(sample), Urgency::Stream, port);
            if self.tick.is_multiple_of(SAMPLES_PER_ESTIMATE) {
                let estimate = self.estimation.report(self.tick);
                self.link
                    .send(Telemetry::Estimate(estimate), Urgency::Stream, port);
                if let Some(slip_hold) = &self.slip_hold {
                    let report = slip_hold.report(self.tick);
                    self.link
                        .send(Telemetry::QuarterCar(report), Urgency::Stream, port);
                }
            }
        }
    }

    fn answer(&mut self, command: u16, answer: Answer, port: &mut impl Port) {
        self.link
            .send(Telemetry::Answer { command, answer }, Urgency::Prompt, port);
    }

    fn obey(
        &mut self,
        command: &Command,
        port: &mut impl Port,
        actuators: &mut impl Actuators,
    ) -> Answer {
        let done = match command {
            Command::KeepAlive => Ok(()),
            Command::Hello => {
                self.reply(Telemetry::Hello(self.hello()), port);
                Ok(())
            }
            Command::ReadParameters => {
                self.reply(Telemetry::Parameters(self.parameters), port);
                Ok(())
            }
            Command::ReadStatus => {
                self.reply(Telemetry::Status(self.status()), port);
                Ok(())
            }
            Command::Arm => self.arm(),
            Command::Start { profile } => self.start(profile),
            Command::Stop => {
                self.stop = true;
                Ok(())
            }
            Command::Tare => self.begin_tare(),
            Command::ClearFault => self.clear_fault(),
            Command::SetParameters { parameters } => self.set_parameters(parameters, actuators),
        };
        match done {
            Ok(()) => Answer::Done,
            Err(refusal) => Answer::Refused(refusal),
        }
    }

    fn reply(&mut self, message: Telemetry, port: &mut impl Port) {
        self.link.send(message, Urgency::Prompt, port);
    }

    fn hello(&self) -> Hello {
        Hello {
            protocol_version: PROTOCOL_VERSION,
            schema_hash: SCHEMA_HASH,
            sample_rate_hz: self.identity.rates.sample_hz(),
            core_clock_hz: self.identity.core_clock_hz,
            emulated: self.identity.emulated,
            estimating: self.estimation.estimating(),
            end: self.identity.end,
        }
    }

    fn status(&self) -> Status {
        Status {
            tick: self.tick,
            state: self.sequence.state(),
            fault: self.sequence.fault(),
            standing: self.standing.bits(),
            link: self.link.counters(),
            worst_interrupt_cycles: self.resources.worst_interrupt_cycles,
            worst_link_interrupt_cycles: self.resources.worst_link_interrupt_cycles,
            worst_step_cycles: self.resources.worst_step_cycles,
            stack_used_bytes: self.resources.stack_used_bytes,
            brake_energy_j: self.brake_energy_j(),
            parameters: self.identity.parameters,
            estimating: self.estimation.estimating(),
            reset_flags: self.identity.reset_flags,
            end: self.identity.end,
        }
    }

    fn arm(&mut self) -> Result<(), Refusal> {
        // The command itself is the host's word. No sample yet: nothing is known to be well.
        let standing = self.standing.without(Fault::LinkSilent);
        if self.tick == 0 {
            return Err(Refusal::WrongState(self.sequence.state()));
        }
        if !self.identity.parameters.is_confirmed() {
            return Err(Refusal::Unconfirmed);
        }
        if self.tare.is_some() {
            return Err(Refusal::Moving);
        }
        if let Some(fault) = standing.first() {
            return Err(Refusal::Interlock(fault));
        }
        if !self.interlocks.stop_is_proven() {
            return Err(Refusal::StopUntested);
        }
        let before = self.sequence.state();
        self.sequence.arm().map_err(Refusal::WrongState)?;
        self.changed(before);
        Ok(())
    }

    fn start(&mut self, profile: &muslip_record::Profile) -> Result<(), Refusal> {
        if !validate::profile(profile) {
            return Err(Refusal::Profile);
        }
        let before = self.sequence.state();
        self.sequence.start(profile).map_err(Refusal::WrongState)?;
        self.changed(before);
        self.estimation.reset();
        self.stop = false;
        Ok(())
    }

    fn clear_fault(&mut self) -> Result<(), Refusal> {
        // What only the controller itself can end ends here.
        let standing = self
            .standing
            .without(Fault::LinkSilent)
            .without(Fault::EstimatorFault)
            .without(Fault::Watchdog)
            .without(Fault::Timeout);
        if let Some(fault) = self
            .sequence
            .fault()
            .filter(|&fault| standing.contains(fault))
        {
            return Err(Refusal::Interlock(fault));
        }
        // With the state: in another there is nothing to confirm.
        if self.sequence.state() == State::Fault && !self.confirmed {
            return Err(Refusal::NotConfirmed);
        }
        let before = self.sequence.state();
        self.sequence.clear().map_err(Refusal::WrongState)?;
        self.changed(before);
        self.estimation.reset();
        self.watchdog_reset = false;
        self.standing = standing;
        Ok(())
    }

    fn stands_still(&self) -> bool {
        self.converted
            .is_some_and(|now| now.wheel.rad_s == 0.0 && now.vehicle.rad_s == 0.0)
    }

    fn begin_tare(&mut self) -> Result<(), Refusal> {
        if !self.sequence.is_at_rest() {
            return Err(Refusal::WrongState(self.sequence.state()));
        }
        // A tare stores all parameters: it must not make a rig's of those that are nobody's.
        if !self.identity.parameters.is_confirmed() {
            return Err(Refusal::Unconfirmed);
        }
        if !self.stands_still() {
            return Err(Refusal::Moving);
        }
        for fault in [Fault::BridgeLost, Fault::BridgeFrozen] {
            if self.standing.contains(fault) {
                return Err(Refusal::Interlock(fault));
            }
        }
        self.tare = Some(Tare::default());
        Ok(())
    }

    /// Goes on with a tare; motion or a bad code ends it with nothing changed.
    fn tare(&mut self, raw: &RawSample) {
        let Some(mut tare) = self.tare.take() else {
            return;
        };
        if raw.bridge.quality != BridgeQuality::Fresh || !self.stands_still() {
            return;
        }
        match tare.push(raw.bridge.codes) {
            None => self.tare = Some(tare),
            Some([drag, normal]) => {
                self.parameters.drag.zero_code = drag;
                self.parameters.normal.zero_code = normal;
                self.conversion.set_zero_codes(drag, normal);
                self.tared = true;
                self.event(Event::Tared);
            }
        }
    }

    fn set_parameters(
        &mut self,
        parameters: &Parameters,
        actuators: &mut impl Actuators,
    ) -> Result<(), Refusal> {
        if !self.sequence.is_at_rest() {
            return Err(Refusal::WrongState(self.sequence.state()));
        }
        validate::parameters(parameters).map_err(Refusal::Parameter)?;
        self.estimation
            .take(parameters)
            .map_err(|_| Refusal::Parameter(NOISE_FIELD))?;
        self.parameters = *parameters;
        self.conversion.take(parameters);
        self.interlocks.take(parameters);
        self.tare = None;
        self.store(actuators).map_err(|NotStored| Refusal::Storage)
    }

    /// Stores the parameters in use, which somebody has just set.
    fn store(&mut self, actuators: &mut impl Actuators) -> Result<(), NotStored> {
        self.identity.parameters = Origin::Unstored;
        actuators.store(&self.parameters)?;
        self.identity.parameters = Origin::Stored;
        Ok(())
    }

    fn changed(&mut self, from: State) {
        let to = self.sequence.state();
        self.event(Event::StateChanged { from, to });
    }

    fn event(&mut self, event: Event) {
        // More than eight in one sample cannot happen; were it so, the first are the ones to keep.
        let _ = self.events.push((self.tick, event));
    }
}

/// A sample of slip hold, begun with the first.
fn hold_slip(
    slip_hold: &mut Option<SlipHold>,
    parameters: &Parameters,
    target_slip: f32,
    sample: &RigSample<f32>,
    rates: Rates,
) -> Result<f32, Refused> {
    let hold = match slip_hold {
        Some(hold) => hold,
        None => slip_hold.insert(SlipHold::new(parameters, target_slip, sample, rates)?),
    };
    hold.step(sample)
}

/// Number of the filter's noise among the parameters.
const NOISE_FIELD: u8 = 21;
