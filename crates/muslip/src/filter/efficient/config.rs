use core::fmt;

use crate::filter::mu_slip::{Range, State};
use crate::real::Real;

/// Range that sp is held in: where the bins lie, and an octave beyond.
pub(super) const SLIPS: (f64, f64) = (1.0 / 64.0, 2.0);

/// Configuration of the efficient estimator.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Config<T> {
    /// State to start from; finite and positive, sp within 1/64 to 2, which estimates of it are held in, too.
    pub initial_state: State<T>,
    /// Normalised innovation squared above which a measurement is rejected; default 16 (four sigma).
    /// `None` believes every measurement, and suspects none.
    pub nis_gate: Option<T>,
    /// Number of samples after which a sample counts 1/e; > 4. `None`, the default, forgets nothing
    /// (but that sums are halved at 65,536 samples, which keeps single precision going).
    pub memory: Option<T>,
}

/// A field of [`Config`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ConfigParameter {
    /// `initial_state`: finite, positive, sp within 1/64 to 2.
    InitialState,
    /// `nis_gate`: positive and not NaN.
    NisGate,
    /// `memory`: above 4, finite.
    Memory,
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

impl<T: Real> Config<T> {
    /// Started for a range of tyres, as the article's filter is.
    pub fn for_range(range: Range) -> Self {
        Self {
            initial_state: range.initial_state(),
            nis_gate: Some(T::from_f64(16.0)),
            memory: None,
        }
    }

    /// Whether every field is within its range.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        let refuse = |parameter| Err(ConfigError::OutOfRange(parameter));
        let start = self.initial_state;
        let (least, most) = SLIPS;
        let slip = start.critical_slip;
        if !start.is_physical() || slip < T::from_f64(least) || slip > T::from_f64(most) {
            return refuse(ConfigParameter::InitialState);
        }
        if self.nis_gate.is_some_and(|gate| !positive(gate)) {
            return refuse(ConfigParameter::NisGate);
        }
        if self
            .memory
            .is_some_and(|memory| !(memory > T::from_f64(4.0) && memory.is_finite()))
        {
            return refuse(ConfigParameter::Memory);
        }
        Ok(())
    }
}

/// Positive, and so not NaN.
fn positive<T: Real>(value: T) -> bool {
    value > T::ZERO
}

impl<T: Real> Default for Config<T> {
    fn default() -> Self {
        Self::for_range(Range::default())
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self::OutOfRange(parameter) = self;
        f.write_str(match parameter {
            ConfigParameter::InitialState => {
                "initial state is not finite, positive and its slip within 1/64 to 2"
            }
            ConfigParameter::NisGate => "gate on the normalised innovation is not positive",
            ConfigParameter::Memory => "memory is not finite and above 4 samples",
        })
    }
}

impl core::error::Error for ConfigError {}
