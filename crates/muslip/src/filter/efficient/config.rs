use core::fmt;

use super::filter::{EfficientFilter, Estimate};
use crate::filter::mu_slip::{Range, State};
use crate::real::Real;

/// Configuration of the efficient estimator.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Config<T> {
    /// State to start from; finite and positive, sp within 0.38 to 2.63 times [`Self::centre_slip`].
    pub initial_state: State<T>,
    /// The slip s0 that the sums are taken about, dimensionless, > 0; default √(0.1 · 0.2), the middle of
    /// the tyres' range. Estimates of sp are held within 0.38 to 2.63 times this.
    pub centre_slip: T,
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
    /// `initial_state`: finite, positive, sp within reach of the centre.
    InitialState,
    /// `centre_slip`: finite and positive.
    CentreSlip,
    /// `nis_gate`: positive and not NaN.
    NisGate,
    /// `memory`: above 4, finite.
    Memory,
}

/// A configuration that makes no filter.
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
            centre_slip: T::from_f64(0.141_421_356),
            nis_gate: Some(T::from_f64(16.0)),
            memory: None,
        }
    }

    /// The filter, at its start.
    ///
    /// # Errors
    /// [`ConfigError`] naming the first field that is outside its range.
    pub fn build(self) -> Result<EfficientFilter<T>, ConfigError> {
        let refuse = |parameter| Err(ConfigError::OutOfRange(parameter));
        let centre = self.centre_slip;
        if !(centre.is_finite() && centre > T::ZERO) {
            return refuse(ConfigParameter::CentreSlip);
        }
        let start = self.initial_state;
        let relative = start.critical_slip / centre;
        if !start.is_physical() || relative < T::from_f64(0.38) || relative > T::from_f64(2.63) {
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
        Ok(EfficientFilter::new(self, Estimate::start(&self)))
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
                "initial state is not finite, positive and within reach of the centre slip"
            }
            ConfigParameter::CentreSlip => "centre slip is not finite and positive",
            ConfigParameter::NisGate => "gate on the normalised innovation is not positive",
            ConfigParameter::Memory => "memory is not finite and above 4 samples",
        })
    }
}

impl core::error::Error for ConfigError {}
