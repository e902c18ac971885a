use core::fmt;

/// An input of an update.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Input {
    /// The prior state.
    State,
    /// The prior covariance.
    Covariance,
    /// The slip of the measurement.
    SlipRatio,
    /// The measured friction.
    Friction,
    /// The variance (or standard deviation) of the measured friction.
    Noise,
    /// The friction expected, or one of its derivatives.
    Expected,
}

/// Why an update was refused. State and covariance are what they were before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum UpdateError {
    /// An input is infinite or NaN.
    NonFinite(Input),
    /// The noise is zero or negative.
    NonPositiveNoise,
    /// The covariance handed in is not positive definite.
    PriorNotPositiveDefinite,
    /// The update would leave a covariance that is not positive definite in this precision: the
    /// measurement is far more certain than the prior, or the two states have become one.
    PosteriorNotPositiveDefinite,
    /// Finite inputs so large or small that a result is not finite.
    Overflow,
}

/// A field of [`Config`](super::Config).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ConfigParameter {
    /// `initial_state`: finite and positive.
    InitialState,
    /// `initial_covariance`: finite and positive definite.
    InitialCovariance,
    /// `noise_inflation`: finite and positive.
    NoiseInflation,
    /// `nis_gate`: positive and not NaN.
    NisGate,
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
            Self::State => "prior state",
            Self::Covariance => "prior covariance",
            Self::SlipRatio => "slip ratio",
            Self::Friction => "friction",
            Self::Noise => "measurement noise",
            Self::Expected => "expected friction",
        })
    }
}

impl fmt::Display for UpdateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NonFinite(input) => write!(f, "{input} is not finite"),
            Self::NonPositiveNoise => f.write_str("measurement noise is not positive"),
            Self::PriorNotPositiveDefinite => {
                f.write_str("prior covariance is not positive definite")
            }
            Self::PosteriorNotPositiveDefinite => {
                f.write_str("update would leave a covariance that is not positive definite")
            }
            Self::Overflow => f.write_str("update overflows"),
        }
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self::OutOfRange(parameter) = self;
        f.write_str(match parameter {
            ConfigParameter::InitialState => "initial state is not finite and positive",
            ConfigParameter::InitialCovariance => "initial covariance is not positive definite",
            ConfigParameter::NoiseInflation => "noise inflation is not finite and positive",
            ConfigParameter::NisGate => "gate on the normalised innovation is not positive",
        })
    }
}

impl core::error::Error for UpdateError {}
impl core::error::Error for ConfigError {}
