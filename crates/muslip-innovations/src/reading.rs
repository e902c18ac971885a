//! What a step takes, and why it may refuse it.

use core::fmt;

use muslip::real::Real;
use muslip::sample::RigSample;

/// The readings of one instant. `None` where there is none: lost, refused by a check, or of a slower sensor.
///
/// Signs as in [`RigSample`]; brake torque is positive when it slows the wheel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading<T> {
    /// Wheel speed ω in rad/s.
    pub wheel_speed_rad_s: Option<T>,
    /// Vehicle or drum surface speed v in m/s.
    pub vehicle_speed_m_s: Option<T>,
    /// Drag force F in N.
    pub drag_force_n: Option<T>,
    /// Normal force N in N.
    pub normal_force_n: Option<T>,
    /// Brake torque T in N m. Never there: no balance of the wheel is formed.
    pub brake_torque_nm: Option<T>,
}

impl<T: Real> Reading<T> {
    /// All four channels of a rig, and its brake torque where that is measured.
    pub fn new(sample: &RigSample<T>, brake_torque_nm: Option<T>) -> Self {
        Self {
            wheel_speed_rad_s: Some(sample.wheel_speed_rad_s),
            vehicle_speed_m_s: Some(sample.vehicle_speed_m_s),
            drag_force_n: Some(sample.drag_force_n),
            normal_force_n: Some(sample.normal_force_n),
            brake_torque_nm,
        }
    }

    /// No reading at all: time passes.
    pub const fn missing() -> Self {
        Self {
            wheel_speed_rad_s: None,
            vehicle_speed_m_s: None,
            drag_force_n: None,
            normal_force_n: None,
            brake_torque_nm: None,
        }
    }

    /// All readings that are there are finite.
    pub(crate) fn check(&self) -> Result<(), StepError> {
        let channels = [
            (self.wheel_speed_rad_s, Channel::WheelSpeed),
            (self.vehicle_speed_m_s, Channel::VehicleSpeed),
            (self.drag_force_n, Channel::DragForce),
            (self.normal_force_n, Channel::NormalForce),
            (self.brake_torque_nm, Channel::BrakeTorque),
        ];
        for (value, channel) in channels {
            if value.is_some_and(|value| !value.is_finite()) {
                return Err(StepError::NonFinite { channel });
            }
        }
        Ok(())
    }

    /// The four channels of a sample where all are there.
    pub(crate) fn sample(&self) -> Option<RigSample<T>> {
        Some(RigSample {
            wheel_speed_rad_s: self.wheel_speed_rad_s?,
            vehicle_speed_m_s: self.vehicle_speed_m_s?,
            drag_force_n: self.drag_force_n?,
            normal_force_n: self.normal_force_n?,
        })
    }
}

/// A channel of a [`Reading`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Channel {
    /// Wheel speed ω.
    WheelSpeed,
    /// Vehicle speed v.
    VehicleSpeed,
    /// Drag force F.
    DragForce,
    /// Normal force N.
    NormalForce,
    /// Brake torque T.
    BrakeTorque,
}

/// Why a step was refused. All is what it was before the call.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum StepError {
    /// A reading is infinite or NaN.
    NonFinite {
        /// Of which channel.
        channel: Channel,
    },
    /// The time step is not finite or not positive (the first step's: negative).
    TimeStep,
    /// Finite readings so large that a result is not finite.
    Overflow,
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::WheelSpeed => "wheel speed",
            Self::VehicleSpeed => "vehicle speed",
            Self::DragForce => "drag force",
            Self::NormalForce => "normal force",
            Self::BrakeTorque => "brake torque",
        })
    }
}

impl fmt::Display for StepError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NonFinite { channel } => write!(f, "{channel} is not finite"),
            Self::TimeStep => f.write_str("time step is not finite and positive"),
            Self::Overflow => f.write_str("the balances overflow"),
        }
    }
}

impl core::error::Error for StepError {}
