use core::fmt;

/// An input of a prediction or an update.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Input {
    /// The brake torque.
    BrakeTorque,
    /// The measured value.
    Measurement,
    /// The variance of a measurement or the standard deviation of a speed handed in.
    Noise,
    /// A state handed in.
    State,
    /// A covariance handed in.
    Covariance,
}

/// Why a prediction or an update was refused. State and covariance are what they were before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum StepError {
    /// An input is infinite or NaN.
    NonFinite(Input),
    /// The input is negative and may not be.
    Negative(Input),
    /// Finite inputs so large that a result is not finite, or a variance fell below zero by more than
    /// rounding.
    Overflow,
}

/// A field of [`Config`](super::Config).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ConfigParameter {
    /// `vehicle.radius_m`: finite and positive.
    Radius,
    /// `vehicle.inertia_kg_m2`: finite and positive.
    Inertia,
    /// `vehicle.gravity_m_s2`: finite and positive.
    Gravity,
    /// `sample_time_s`: finite and positive.
    SampleTime,
    /// `initial_vehicle_speed_m_s`: finite and at or above zero.
    InitialVehicleSpeed,
    /// `initial_mass_kg`: finite and positive.
    InitialMass,
    /// `initial_std`: finite and at or above zero each.
    InitialStd,
    /// `process_std`: finite and at or above zero each.
    ProcessStd,
    /// `minimum_vehicle_speed_m_s`: finite and positive.
    MinimumVehicleSpeed,
    /// `nis_gate`: positive and not NaN.
    NisGate,
    /// Probabilities or spans of a bank of roads: within their ranges.
    Bank,
}

/// Why a configuration is invalid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ConfigError {
    /// The field is outside the range that [`ConfigParameter`] states.
    OutOfRange(ConfigParameter),
}

impl fmt::Display for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::BrakeTorque => "brake torque",
            Self::Measurement => "measurement",
            Self::Noise => "measurement noise",
            Self::State => "state",
            Self::Covariance => "covariance",
        })
    }
}

impl fmt::Display for StepError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NonFinite(input) => write!(f, "{input} is not finite"),
            Self::Negative(input) => write!(f, "{input} is negative"),
            Self::Overflow => f.write_str("the result is not finite or has a negative variance"),
        }
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self::OutOfRange(parameter) = self;
        f.write_str(match parameter {
            ConfigParameter::Radius => "wheel radius is not finite and positive",
            ConfigParameter::Inertia => "wheel inertia is not finite and positive",
            ConfigParameter::Gravity => "gravity is not finite and positive",
            ConfigParameter::SampleTime => "sample time is not finite and positive",
            ConfigParameter::InitialVehicleSpeed => {
                "initial vehicle speed is not finite or is negative"
            }
            ConfigParameter::InitialMass => "initial mass is not finite and positive",
            ConfigParameter::InitialStd => {
                "an initial standard deviation is not finite or is negative"
            }
            ConfigParameter::ProcessStd => {
                "a process standard deviation is not finite or is negative"
            }
            ConfigParameter::MinimumVehicleSpeed => {
                "minimum vehicle speed is not finite and positive"
            }
            ConfigParameter::NisGate => "gate on the normalised innovation is not positive",
            ConfigParameter::Bank => "a probability of the bank of roads is outside its range",
        })
    }
}

impl core::error::Error for StepError {}
impl core::error::Error for ConfigError {}
