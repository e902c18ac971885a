//! Any tyre law by its name on the command line.

use std::fmt;
use std::str::FromStr;

use muslip::law::{LawError, Peak, Rudd, TyreLaw};
use muslip_laws::burckhardt::{PUBLISHED_SETS, published_set};
use muslip_laws::{Burckhardt, MagicFormula};

/// A tyre law that the rig can run on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RigLaw {
    /// `rudd:MUP,SP`.
    Rudd(Rudd<f64>),
    /// `burckhardt:SURFACE` or `burckhardt:C1,C2,C3`.
    Burckhardt(Burckhardt<f64>),
    /// `magic-formula:B,C,D,E`.
    MagicFormula(MagicFormula<f64>),
}

impl RigLaw {
    /// Friction at a slip, dimensionless.
    pub fn friction(&self, slip_ratio: f64) -> f64 {
        match self {
            Self::Rudd(law) => law.friction(slip_ratio),
            Self::Burckhardt(law) => law.friction(slip_ratio),
            Self::MagicFormula(law) => law.friction(slip_ratio),
        }
    }

    /// Derivative of friction with respect to slip.
    pub fn slip_derivative(&self, slip_ratio: f64) -> f64 {
        match self {
            Self::Rudd(law) => law.slip_derivative(slip_ratio),
            Self::Burckhardt(law) => law.slip_derivative(slip_ratio),
            Self::MagicFormula(law) => law.slip_derivative(slip_ratio),
        }
    }

    /// The largest friction over slip 0..=1 and where it lies.
    pub fn peak(&self) -> Peak<f64> {
        match self {
            Self::Rudd(law) => law.peak(),
            Self::Burckhardt(law) => law.peak(),
            Self::MagicFormula(law) => law.peak(),
        }
    }
}

/// A tyre law that cannot be had.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LawTextError {
    /// No law of that name.
    #[error(
        "unknown tyre law {0:?} (known: rudd:MUP,SP, burckhardt:SURFACE, burckhardt:C1,C2,C3, magic-formula:B,C,D,E)"
    )]
    UnknownLaw(String),
    /// No published coefficients for that surface.
    #[error("unknown surface {found:?} (known: {known})")]
    UnknownSurface {
        /// The surface asked for.
        found: String,
        /// Those that there are.
        known: String,
    },
    /// Not the number of parameters that the law has.
    #[error("{law} takes {expected} numbers separated by commas")]
    ParameterCount {
        /// The law.
        law: &'static str,
        /// Its number of parameters.
        expected: usize,
    },
    /// A parameter outside its range.
    #[error(transparent)]
    Refused(#[from] LawError),
}

impl FromStr for RigLaw {
    type Err = LawTextError;

    fn from_str(text: &str) -> Result<Self, LawTextError> {
        let (name, rest) = text.split_once(':').unwrap_or((text, ""));
        match name {
            "rudd" => {
                let [peak_friction, critical_slip] = numbers("rudd", rest)?;
                Ok(Self::Rudd(Rudd::new(peak_friction, critical_slip)?))
            }
            "burckhardt" if rest.starts_with(|c: char| c.is_ascii_alphabetic()) => {
                match published_set(&rest.replace('-', "_")) {
                    Some(set) => Ok(Self::Burckhardt(set.law())),
                    None => Err(LawTextError::UnknownSurface {
                        found: rest.to_owned(),
                        known: PUBLISHED_SETS
                            .map(|set| set.name().replace('_', "-"))
                            .join(", "),
                    }),
                }
            }
            "burckhardt" => {
                let [c1, c2, c3] = numbers("burckhardt", rest)?;
                Ok(Self::Burckhardt(Burckhardt::new(c1, c2, c3)?))
            }
            "magic-formula" => {
                let [b, c, d, e] = numbers("magic-formula", rest)?;
                Ok(Self::MagicFormula(MagicFormula::new(b, c, d, e)?))
            }
            _ => Err(LawTextError::UnknownLaw(text.to_owned())),
        }
    }
}

fn numbers<const N: usize>(law: &'static str, text: &str) -> Result<[f64; N], LawTextError> {
    let wrong = LawTextError::ParameterCount { law, expected: N };
    let parsed: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    parsed
        .ok()
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or(wrong)
}

impl fmt::Display for RigLaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rudd(law) => write!(f, "rudd:{},{}", law.peak_friction(), law.critical_slip()),
            Self::Burckhardt(law) => {
                let (c1, c2, c3) = law.coefficients();
                write!(f, "burckhardt:{c1},{c2},{c3}")
            }
            Self::MagicFormula(law) => write!(
                f,
                "magic-formula:{},{},{},{}",
                law.stiffness_factor(),
                law.shape_factor(),
                law.peak_factor(),
                law.curvature_factor()
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_law_is_read_back_from_its_own_text() {
        for text in [
            "rudd:0.85,0.14",
            "burckhardt:1.2801,23.99,0.52",
            "magic-formula:12,1.65,0.9,0.3",
        ] {
            let law: RigLaw = text.parse().unwrap();
            assert_eq!(law.to_string(), text);
        }
        let by_name: RigLaw = "burckhardt:dry-asphalt".parse().unwrap();
        assert_eq!(by_name.to_string(), "burckhardt:1.2801,23.99,0.52");
    }

    #[test]
    fn what_is_no_law_is_refused_with_the_known_ones() {
        for text in [
            "",
            "rudd",
            "rudd:1",
            "rudd:1,2,3",
            "rudd:-1,0.1",
            "burckhardt:moon",
            "lugre:1",
            "magic-formula:1,2,3,x",
        ] {
            assert!(text.parse::<RigLaw>().is_err(), "{text}");
        }
        let error = "burckhardt:moon".parse::<RigLaw>().unwrap_err();
        assert!(error.to_string().contains("wet-cobblestone"));
    }
}
