use super::error::{ConfigError, ConfigParameter};
use super::state::{Covariance, State};
use crate::real::Real;

/// Range of tyres that the filter starts from: at the high end, with a standard deviation as large.
///
/// | range | mup | sp | x0 | P0 |
/// |---|---|---|---|---|
/// | aircraft | 0.1..=0.6 | 0.1..=0.2 | (0.6, 0.2) | diag(0.6², 0.2²) |
/// | automotive | 0.1..=1.0 | 0.1..=0.2 | (1.0, 0.2) | diag(1.0², 0.2²) |
///
/// From the high end the estimate comes down onto the curve; from the low end the pseudonoise is too
/// small and the filter too sure of itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
pub enum Range {
    /// Aircraft tyres on runways, as in the article.
    #[default]
    Aircraft,
    /// Car tyres on roads.
    Automotive,
}

impl Range {
    /// The state x0 to start from.
    pub fn initial_state<T: Real>(self) -> State<T> {
        let peak_friction = match self {
            Self::Aircraft => 0.6,
            Self::Automotive => 1.0,
        };
        State {
            peak_friction: T::from_f64(peak_friction),
            critical_slip: T::from_f64(0.2),
        }
    }

    /// The covariance P0 to start from: each standard deviation as large as the state.
    pub fn initial_covariance<T: Real>(self) -> Covariance<T> {
        let state = self.initial_state();
        Covariance::from_std(state.peak_friction, state.critical_slip)
    }
}

/// Which of two equal expressions computes the covariance after an update.
///
/// Both give the same number but for rounding. The short form is the article's and what `std` and
/// traces report. Joseph's form, a sum of squares, about doubles the multiplications of an update and
/// earns them where a measurement is far more certain than the prior. Largest relative error of a
/// variance in `f32` after one update of a random prior (standard deviations up to 1, correlation up to
/// ±0.99), by `cargo test -p muslip --test precision -- --nocapture`:
///
/// | inflated noise, std | short | Joseph |
/// |---|---|---|
/// | 0.05..0.3 | 5e-5 | below 5e-6 |
/// | 0.001..0.01 | 6e-2 | 6e-6 |
///
/// Runs from the stated starts stay within 1e-5 of `f64` in the short form down to a noise of 0.001.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
pub enum CovarianceForm {
    /// (I - K H) P.
    #[default]
    Short,
    /// (I - K H) P (I - K H)ᵀ + K R Kᵀ.
    Joseph,
}

/// Configuration of the filter; the default is the article's.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Config<T> {
    /// State x0; finite and positive.
    pub initial_state: State<T>,
    /// Covariance P0; positive definite.
    pub initial_covariance: Covariance<T>,
    /// Factor n on the standard deviation of each measurement, > 0; default 3. Above 1 it makes up for
    /// noise that is not white and a law that is not quite the tyre's.
    pub noise_inflation: T,
    /// Whether R includes the second-order pseudonoise; default true.
    pub pseudonoise: bool,
    /// How the covariance is computed; default short.
    pub covariance_form: CovarianceForm,
    /// Normalised innovation squared above which a measurement is rejected (9 is three sigma); default
    /// none, as in the article.
    pub nis_gate: Option<T>,
}

impl<T: Real> Config<T> {
    /// The article's filter, started for a range of tyres.
    pub fn for_range(range: Range) -> Self {
        Self {
            initial_state: range.initial_state(),
            initial_covariance: range.initial_covariance(),
            noise_inflation: T::from_f64(3.0),
            pseudonoise: true,
            covariance_form: CovarianceForm::Short,
            nis_gate: None,
        }
    }

    /// Whether every field is within its range.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        let refuse = |parameter| Err(ConfigError::OutOfRange(parameter));
        if !self.initial_state.is_physical() {
            return refuse(ConfigParameter::InitialState);
        }
        if !self.initial_covariance.is_positive_definite() {
            return refuse(ConfigParameter::InitialCovariance);
        }
        let inflation = self.noise_inflation;
        if !(inflation.is_finite() && inflation > T::ZERO) {
            return refuse(ConfigParameter::NoiseInflation);
        }
        if self.nis_gate.is_some_and(|gate| !passes_zero(gate)) {
            return refuse(ConfigParameter::NisGate);
        }
        Ok(())
    }
}

/// Positive, and so not NaN.
fn passes_zero<T: Real>(gate: T) -> bool {
    gate > T::ZERO
}

impl<T: Real> Default for Config<T> {
    fn default() -> Self {
        Self::for_range(Range::default())
    }
}

#[cfg(test)]
mod tests {
    use super::{Config, ConfigError, ConfigParameter, Range};

    #[test]
    fn ranges_start_at_their_high_end() {
        let aircraft = Config::<f64>::default();
        assert_eq!(aircraft, Config::for_range(Range::Aircraft));
        assert_eq!(aircraft.initial_state.peak_friction, 0.6);
        assert_eq!(aircraft.initial_state.critical_slip, 0.2);
        assert_eq!(aircraft.initial_covariance.p00, 0.6 * 0.6);
        assert_eq!(aircraft.initial_covariance.p01, 0.0);
        assert_eq!(aircraft.initial_covariance.p11, 0.2 * 0.2);
        let automotive = Config::<f64>::for_range(Range::Automotive);
        assert_eq!(automotive.initial_state.peak_friction, 1.0);
        assert_eq!(automotive.initial_covariance.p00, 1.0);
    }

    #[test]
    fn a_field_outside_its_range_is_named() {
        let refused = |change: fn(&mut Config<f32>)| {
            let mut config = Config::default();
            change(&mut config);
            let ConfigError::OutOfRange(parameter) = config.build().unwrap_err();
            parameter
        };
        assert_eq!(
            refused(|c| c.initial_state.critical_slip = 0.0),
            ConfigParameter::InitialState
        );
        assert_eq!(
            refused(|c| c.initial_covariance.p01 = 1.0),
            ConfigParameter::InitialCovariance
        );
        assert_eq!(
            refused(|c| c.noise_inflation = f32::NAN),
            ConfigParameter::NoiseInflation
        );
        assert_eq!(
            refused(|c| c.nis_gate = Some(f32::NAN)),
            ConfigParameter::NisGate
        );
    }
}
