use core::fmt;

use muslip::sample::{Channel, SampleError};

/// A parameter of a [`Compensation`](super::Compensation).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Parameter {
    /// The wheel's declared radius: finite, positive.
    DeclaredRadius,
    /// [`EffectiveRadius`](super::EffectiveRadius): errors within ±0.5, a positive mean.
    EffectiveRadius,
    /// [`ForceDelay::delay_s`](super::ForceDelay::delay_s): finite, not negative.
    Delay,
    /// [`ForceDelay::sampling_step_s`](super::ForceDelay::sampling_step_s): finite, positive.
    SamplingStep,
    /// [`ForceLag::time_constant_s`](super::ForceLag::time_constant_s): finite, not negative.
    LagTimeConstant,
    /// [`ZeroDrift`](super::ZeroDrift): finite, the time constant positive.
    ZeroDrift,
    /// [`LoadCrosstalk::share`](super::LoadCrosstalk::share): within ±1.
    CrosstalkShare,
    /// [`LoadSensitivity`](super::LoadSensitivity): exponents within ±4, a positive mean.
    LoadSensitivity,
    /// [`SpeedSensitivity`](super::SpeedSensitivity): finite, the floor not negative, the scale positive.
    SpeedSensitivity,
    /// [`Relaxation`](super::Relaxation): a length that is finite and not negative.
    RelaxationLength,
    /// [`ThermalFade`](super::ThermalFade): finite, time constant and reference power positive.
    ThermalFade,
    /// [`Compensation::longest_step_s`](super::Compensation::longest_step_s): positive.
    LongestStep,
}

/// A compensation that cannot be built.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum CompensationError {
    /// The parameter is not finite or outside the range that [`Parameter`] states.
    OutOfRange(Parameter),
    /// The delay line holds fewer samples than delay and sampling step need.
    DelayDoesNotFit {
        /// Samples that the delay line holds.
        capacity: u32,
    },
}

/// Why a step was refused. The compensator is what it was before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum StepError {
    /// The channel is infinite or NaN.
    NonFinite {
        /// Which one.
        channel: Channel,
    },
    /// The time step is not finite, or not positive (the first step's: negative).
    TimeStep,
    /// The filter's state is not finite.
    State,
    /// Samples follow each other so quickly that the delay line cannot hold all within the delay.
    DelayDoesNotFit,
    /// Finite inputs so large or small that a result is not finite.
    Overflow,
}

/// Why a sample that was taken is no measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum NoMeasurement {
    /// The sample fails the limits: too slow, too light, slip out of range.
    Sample(SampleError),
    /// The delay line does not reach back to when the reading was made.
    DelayLineFilling,
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::DeclaredRadius => "declared radius",
            Self::EffectiveRadius => "effective radius",
            Self::Delay => "force delay",
            Self::SamplingStep => "sampling step of the force delay",
            Self::LagTimeConstant => "time constant of the force lag",
            Self::ZeroDrift => "zero drift",
            Self::CrosstalkShare => "load crosstalk",
            Self::LoadSensitivity => "load sensitivity",
            Self::SpeedSensitivity => "speed sensitivity",
            Self::RelaxationLength => "relaxation length",
            Self::ThermalFade => "thermal fade",
            Self::LongestStep => "longest step",
        })
    }
}

impl fmt::Display for CompensationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutOfRange(parameter) => write!(f, "{parameter} is outside its range"),
            Self::DelayDoesNotFit { capacity } => {
                write!(f, "force delay is longer than {capacity} samples hold")
            }
        }
    }
}

impl fmt::Display for StepError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NonFinite { channel } => write!(f, "{channel} is not finite"),
            Self::TimeStep => f.write_str("time step is not finite and positive"),
            Self::State => f.write_str("the filter's state is not finite"),
            Self::DelayDoesNotFit => {
                f.write_str("force delay spans more samples than the delay line holds")
            }
            Self::Overflow => f.write_str("compensation overflows"),
        }
    }
}

impl fmt::Display for NoMeasurement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sample(error) => error.fmt(f),
            Self::DelayLineFilling => f.write_str("the delay line is filling"),
        }
    }
}

impl core::error::Error for CompensationError {}
impl core::error::Error for StepError {}
