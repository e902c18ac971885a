//! Commands in, telemetry out.

use serde::{Deserialize, Serialize};

use crate::compensation::Estimating;
use crate::parameters::Parameters;

/// Levels that a stepped profile can hold.
pub const STEPS: usize = 8;

/// A numbered message.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Envelope<T> {
    /// Counts up by one a message and wraps.
    pub sequence: u16,
    /// The message.
    pub body: T,
}

/// What a host asks of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Command {
    /// Who is there? Answered by [`Telemetry::Hello`].
    Hello,
    /// Nothing but a sign of life: due every 250 ms while armed, each with a number of its own.
    KeepAlive,
    /// Idle or done to armed, if no interlock stands, the parameters are the rig's, and the emergency stop was tested.
    Arm,
    /// Armed to a run.
    Start {
        /// What to run.
        profile: Profile,
    },
    /// Ends a run: the brake is released.
    Stop,
    /// Takes the present bridge codes as no force; only while idle and at standstill.
    Tare,
    /// Unlatches the fault, if its cause is gone and somebody has pressed the button at the rig since.
    ClearFault,
    /// Takes new parameters, all or none, and stores them; only while idle.
    SetParameters {
        /// The parameters.
        parameters: Parameters,
    },
    /// Answered by [`Telemetry::Parameters`].
    ReadParameters,
    /// Answered by [`Telemetry::Status`].
    ReadStatus,
}

/// What a run does.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Profile {
    /// How the brake is worked.
    pub program: Program,
    /// Vehicle speed in m/s from which an application may begin, above 5.
    pub start_speed_m_s: f32,
    /// Slip from which the wheel counts as skidding: 0.05..=1.
    pub skid_slip: f32,
    /// How long a skid is held before the release in s, 0..=0.15: a locked tyre does not last.
    pub skid_hold_s: f32,
    /// Brake applications, 1..=100.
    pub applications: u8,
    /// Pause after each application in s, 0.1..=600.
    pub cool_s: f32,
}

/// How the brake is worked in one application.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Program {
    /// Pressure rises evenly until the wheel skids.
    Ramp {
        /// Share of full pressure a second, > 0 and at most 10.
        demand_per_s: f32,
    },
    /// Pressure is held at one level after another, or until the wheel skids.
    Steps {
        /// Shares of full pressure, each 0..=1.
        levels: [f32; STEPS],
        /// How many of them are used, 1..=8.
        count: u8,
        /// How long each is held in s, 0.01..=60.
        hold_s: f32,
    },
    /// Slip is held by the controller.
    SlipHold {
        /// Slip to hold, 0.01..=0.5.
        target_slip: f32,
        /// For how long in s, 0.01..=60.
        hold_s: f32,
    },
}

/// What the controller says.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Telemetry {
    /// Who is there.
    Hello(Hello),
    /// What became of a command.
    Answer {
        /// Number of the command's envelope.
        command: u16,
        /// The answer.
        answer: Answer,
    },
    /// One sample; 1,000 a second.
    Sample(Sample),
    /// The estimate; 100 a second.
    Estimate(Estimate),
    /// The quarter-car filter's estimate while slip is held; 100 a second.
    QuarterCar(QuarterCar),
    /// Something happened.
    Event {
        /// Sample at which it happened.
        tick: u32,
        /// What.
        event: Event,
    },
    /// Answer to [`Command::ReadStatus`].
    Status(Status),
    /// Answer to [`Command::ReadParameters`].
    Parameters(Parameters),
}

/// Who is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// [`PROTOCOL_VERSION`](crate::PROTOCOL_VERSION) of the controller.
    pub protocol_version: u16,
    /// [`SCHEMA_HASH`](crate::SCHEMA_HASH) of the controller.
    pub schema_hash: u32,
    /// Samples a second.
    pub sample_rate_hz: u32,
    /// Core clock in Hz.
    pub core_clock_hz: u32,
    /// True in the emulator, where sensors and brake are simulated.
    pub emulated: bool,
    /// What estimates.
    pub estimating: Estimating,
    /// How the program came to its end before the last reset, if it did.
    pub end: Option<PostMortem>,
}

/// How the program came to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct PostMortem {
    /// What ended it.
    pub end: End,
    /// Where it was; after a panic the line of its source; 0 where that is not known.
    pub program_counter: u32,
    /// Where it would have returned to; 0 where that is not known.
    pub link_register: u32,
    /// The core's configurable fault status, CFSR.
    pub fault_status: u32,
    /// The core's hard fault status, HFSR.
    pub hard_fault_status: u32,
    /// Address that could not be accessed; 0 where that is not known.
    pub address: u32,
    /// Where the run was.
    pub state: State,
    /// Samples worked on since the start.
    pub tick: u32,
}

/// What ends a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum End {
    /// A hard fault.
    HardFault,
    /// The stack ran out.
    Stack,
    /// A panic.
    Panic,
    /// The crystal stopped.
    Crystal,
}

/// What became of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Answer {
    /// Done.
    Done,
    /// Not done; nothing changed.
    Refused(Refusal),
}

/// Why a command was not done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Refusal {
    /// Not in this state.
    WrongState(State),
    /// An interlock stands.
    Interlock(Fault),
    /// A field of the profile is outside its range.
    Profile,
    /// A parameter is outside its range, or two contradict each other; the number is the first such one
    /// in the order of the type's fields, counted from 0.
    Parameter(u8),
    /// The rig is moving.
    Moving,
    /// The flash could not be written; the parameters are taken until the next reset.
    Storage,
    /// The parameters in use are nobody's for this rig: see [`Origin`]. Set them first.
    Unconfirmed,
    /// The emergency stop has not been worked since the start: open it and close it once.
    StopUntested,
    /// Nobody has pressed the button at the rig since the fault.
    NotConfirmed,
}

/// Where a run is. The conditions of entry and exit are with the state machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum State {
    /// Brake dumped, waiting for a host.
    Idle,
    /// A host is in charge; brake dumped.
    Armed,
    /// Waiting for speed and a freely rolling wheel.
    SpinUp,
    /// The brake is being applied.
    Ramp,
    /// The wheel skids; held for a moment.
    Skid,
    /// Brake dumped, waiting for the wheel to roll again.
    Release,
    /// Pause after an application.
    Cool,
    /// All applications are done.
    Done,
    /// An interlock fired; brake dumped until the fault is cleared.
    Fault,
}

/// Why the brake was dumped. Lower numbers are named first when several stand at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Fault {
    /// The emergency stop's loop is open.
    EmergencyStop,
    /// Wheel locked longer than 0.2 s above 5 m/s.
    WheelLocked,
    /// Vehicle or wheel faster than its limit.
    Overspeed,
    /// The wheel's encoder gives no pulses although the wheel must be turning.
    WheelSensorLost,
    /// The wheel's speed changes faster than a wheel can, or runs backwards.
    WheelSensorOutOfRange,
    /// The vehicle's encoder gives no pulses although the vehicle must be moving.
    VehicleSensorLost,
    /// The vehicle's speed changes faster than a vehicle can, or runs backwards.
    VehicleSensorOutOfRange,
    /// The bridge ADC does not answer, or answers with a wrong checksum.
    BridgeLost,
    /// The bridge ADC gives the same codes again and again.
    BridgeFrozen,
    /// A bridge channel is at the end of its scale, or a force beyond its limit.
    BridgeOutOfRange,
    /// Normal force below its limit.
    NormalForceLost,
    /// No word from the host for 250 ms while armed.
    LinkSilent,
    /// The estimator refused its own state.
    EstimatorFault,
    /// A sample's work was not done in time.
    DeadlineMissed,
    /// Supply of the valves below its limit.
    BrownOut,
    /// The independent watchdog reset the controller.
    Watchdog,
    /// The core does not run at its full clock.
    Clock,
    /// The wheel did not roll freely again after a release, or the speed was never reached.
    Timeout,
    /// A register of the controller's chip does not hold what start-up wrote to it; the log names it.
    SetUp,
    /// The two channels of the emergency stop say different things.
    StopChannels,
    /// The dump valve's output is not at the level that it was told.
    DumpOutput,
    /// Wheel and vehicle differ by more than 5 % though the brake has long been dumped.
    SpeedsDisagree,
    /// The brake has taken up more energy than it bears.
    BrakeHot,
    /// The transmitter of the brake line's pressure reads what it never can.
    PressureLost,
    /// The brake line's pressure is not what the valves were told.
    PressureWrong,
}

/// Something that happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Event {
    /// The state changed.
    StateChanged {
        /// From.
        from: State,
        /// To.
        to: State,
    },
    /// A fault latched.
    Fault(Fault),
    /// New zeros were taken.
    Tared,
}

/// One sample, in SI units, and what was done on it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Samples since the controller started.
    pub tick: u32,
    /// Wheel speed in rad/s.
    pub wheel_speed_rad_s: f32,
    /// Vehicle or drum surface speed in m/s.
    pub vehicle_speed_m_s: f32,
    /// Drag in N, positive when it slows the vehicle.
    pub drag_force_n: f32,
    /// Normal force in N.
    pub normal_force_n: f32,
    /// Share of full brake pressure demanded, 0..=1; 0 with the brake dumped.
    pub brake_demand: f32,
    /// Where the run is.
    pub state: State,
}

/// The estimate, with its covariance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Sample of which it is.
    pub tick: u32,
    /// Slip of that sample as the estimator takes it; NaN where it is no measurement.
    pub slip_ratio: f32,
    /// Friction of that sample as the estimator takes it; NaN where it is no measurement.
    pub friction: f32,
    /// Peak friction.
    pub peak_friction: f32,
    /// Slip at the peak.
    pub critical_slip: f32,
    /// Variance of the peak friction.
    pub p00: f32,
    /// Covariance of the two.
    pub p01: f32,
    /// Variance of the slip at the peak.
    pub p11: f32,
    /// Samples that went into it; those left out as outliers did not.
    pub updates: u32,
    /// What estimates.
    pub estimating: Estimating,
}

/// The quarter-car filter's estimate, with its covariance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct QuarterCar {
    /// Sample of which it is.
    pub tick: u32,
    /// Wheel speed in rad/s, vehicle speed in m/s, slip, friction, mass in kg.
    pub state: [f32; 5],
    /// Their covariance: the upper triangle, row by row.
    pub covariance: [f32; 15],
    /// Readings left out so far because they were too far off: wheel speed, vehicle speed, drag, normal force.
    pub rejected: [u16; 4],
}

/// What the link has seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct LinkCounters {
    /// Frames received whole.
    pub received: u32,
    /// Frames with a wrong checksum or a broken encoding.
    pub corrupt: u32,
    /// Frames longer than any may be.
    pub oversized: u32,
    /// Frames whose checksum is right and whose content is none of ours.
    pub foreign: u32,
    /// Frames received twice; answered again, not done again.
    pub duplicate: u32,
    /// Numbers missing between frames.
    pub lost: u32,
    /// Bytes that came faster than they could be taken.
    pub overrun_bytes: u32,
    /// Telemetry frames dropped because the wire was full.
    pub dropped: u32,
}

/// Where the parameters in use come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Origin {
    /// Built into the firmware: of no rig. Arming is refused.
    BuiltIn,
    /// The newest in flash.
    Stored,
    /// Those in flash before the newest, which are not whole. Arming is refused.
    Previous,
    /// Set since the reset, and lost with the next: they could not be stored.
    Unstored,
}

impl Origin {
    /// Whether somebody has set them for this rig, and they are the last that were set.
    #[must_use]
    pub const fn is_confirmed(self) -> bool {
        matches!(self, Self::Stored | Self::Unstored)
    }
}

/// Answer to [`Command::ReadStatus`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// Samples since the controller started.
    pub tick: u32,
    /// Where the run is.
    pub state: State,
    /// The latched fault.
    pub fault: Option<Fault>,
    /// Interlocks that stand now, bit by [`Fault`].
    pub standing: u32,
    /// What the link has seen.
    pub link: LinkCounters,
    /// Most cycles (instructions in the emulator) that one sampling interrupt took.
    pub worst_interrupt_cycles: u32,
    /// Most cycles that the host link's interrupt took for one byte.
    pub worst_link_interrupt_cycles: u32,
    /// Most cycles that one sample's work in the main loop took.
    pub worst_step_cycles: u32,
    /// Deepest stack so far in bytes.
    pub stack_used_bytes: u32,
    /// Energy in the brake as modelled, in J.
    pub brake_energy_j: u32,
    /// Where the parameters in use come from.
    pub parameters: Origin,
    /// What estimates.
    pub estimating: Estimating,
    /// What caused the last reset: bits 31 to 24 of the chip's RCC_CSR; 0 in the emulator.
    pub reset_flags: u8,
    /// How the program came to its end before the last reset, if it did.
    pub end: Option<PostMortem>,
}
