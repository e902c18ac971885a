//! The faults in order; not beside their type, whose source makes the schema's hash.

use crate::Fault;

impl Fault {
    /// In the order of their numbers, which is the order in which they are named.
    pub const ALL: [Self; 19] = [
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
    ];
}
