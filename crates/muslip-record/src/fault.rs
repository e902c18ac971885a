//! Faults, states and ends in order; not beside their types, whose source makes the schema's hash.

use crate::{End, Fault, State};

impl Fault {
    /// In the order of their numbers, which is the order in which they are named.
    pub const ALL: [Self; 25] = [
        Self::EmergencyStop,
        Self::WheelLocked,
        Self::Overspeed,
        Self::WheelSensorLost,
        Self::WheelSensorOutOfRange,
        Self::VehicleSensorLost,
        Self::VehicleSensorOutOfRange,
        Self::BridgeLost,
        Self::BridgeFrozen,
        Self::BridgeOutOfRange,
        Self::NormalForceLost,
        Self::LinkSilent,
        Self::EstimatorFault,
        Self::DeadlineMissed,
        Self::BrownOut,
        Self::Watchdog,
        Self::Clock,
        Self::Timeout,
        Self::SetUp,
        Self::StopChannels,
        Self::DumpOutput,
        Self::SpeedsDisagree,
        Self::BrakeHot,
        Self::PressureLost,
        Self::PressureWrong,
    ];
}

impl State {
    /// In the order of their numbers.
    pub const ALL: [Self; 9] = [
        Self::Idle,
        Self::Armed,
        Self::SpinUp,
        Self::Ramp,
        Self::Skid,
        Self::Release,
        Self::Cool,
        Self::Done,
        Self::Fault,
    ];
}

impl End {
    /// In the order of their numbers.
    pub const ALL: [Self; 4] = [Self::HardFault, Self::Stack, Self::Panic, Self::Crystal];
}
