use core::fmt;

use crate::real::Real;

/// A parameter of one of the laws, here and in the crate `muslip-laws`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Parameter {
    /// mup of [`Rudd`](super::Rudd).
    PeakFriction,
    /// sp of [`Rudd`](super::Rudd).
    CriticalSlip,
    /// c1 of Burckhardt's law.
    C1,
    /// c2 of Burckhardt's law.
    C2,
    /// c3 of Burckhardt's law.
    C3,
    /// B of the Magic Formula.
    StiffnessFactor,
    /// C of the Magic Formula.
    ShapeFactor,
    /// D of the Magic Formula.
    PeakFactor,
    /// E of the Magic Formula.
    CurvatureFactor,
}

/// Why parameters make no law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum LawError {
    /// The parameter is infinite or NaN.
    NonFinite(Parameter),
    /// The parameter is outside the range that the law's constructor states.
    OutOfRange(Parameter),
    /// Friction does not rise from free rolling: c1 c2 <= c3 in Burckhardt's law.
    NeverRises,
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::PeakFriction => "peak friction",
            Self::CriticalSlip => "critical slip",
            Self::C1 => "c1",
            Self::C2 => "c2",
            Self::C3 => "c3",
            Self::StiffnessFactor => "stiffness factor B",
            Self::ShapeFactor => "shape factor C",
            Self::PeakFactor => "peak factor D",
            Self::CurvatureFactor => "curvature factor E",
        })
    }
}

impl fmt::Display for LawError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NonFinite(parameter) => write!(f, "{parameter} is not finite"),
            Self::OutOfRange(parameter) => write!(f, "{parameter} is outside its range"),
            Self::NeverRises => f.write_str("friction does not rise from free rolling"),
        }
    }
}

impl core::error::Error for LawError {}

/// `value` where it is finite and `in_range`: what a law's constructor does with each parameter.
///
/// # Errors
/// [`LawError::NonFinite`] or [`LawError::OutOfRange`] of `parameter`.
pub fn validated<T: Real>(value: T, parameter: Parameter, in_range: bool) -> Result<T, LawError> {
    if !value.is_finite() {
        Err(LawError::NonFinite(parameter))
    } else if !in_range {
        Err(LawError::OutOfRange(parameter))
    } else {
        Ok(value)
    }
}
