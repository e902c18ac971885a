use super::config::{Config, CovarianceForm};
use super::error::{ConfigError, Input, UpdateError};
use super::state::{Covariance, Estimate, State};
use super::update::{Choices, Fusion, Inputs, lean};
use crate::filter::{Decision, Estimator, FrictionMeasurement, PeakEstimate};
use crate::law::Expansion;
use crate::real::Real;

/// The filter: a validated configuration and the present estimate.
///
/// Made by [`Config::build`]. The estimate is plain data, apart from the configuration: copy it with
/// [`Estimator::estimate`], put it back with [`Estimator::restore`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MuSlipFilter<T> {
    config: Config<T>,
    estimate: Estimate<T>,
    /// Inflated standard deviation from which an update is lean.
    lean_above: T,
}

impl<T: Real> Config<T> {
    /// The filter, at its start.
    ///
    /// # Errors
    /// [`ConfigError`] naming the first field that is outside its range.
    pub fn build(self) -> Result<MuSlipFilter<T>, ConfigError> {
        self.check()?;
        let start = Estimate {
            state: self.initial_state,
            covariance: self.initial_covariance,
        };
        Ok(MuSlipFilter::new(self, start))
    }
}

impl<T: Real> MuSlipFilter<T> {
    fn new(config: Config<T>, estimate: Estimate<T>) -> Self {
        let as_the_article = config.pseudonoise
            && config.covariance_form == CovarianceForm::Short
            && config.nis_gate.is_none();
        Self {
            config,
            estimate,
            lean_above: if as_the_article {
                // Its square is a positive number of full precision.
                T::EPSILON * T::EPSILON
            } else {
                // Above it a square is not finite, which is not sound.
                T::ONE / T::MIN_POSITIVE
            },
        }
    }

    /// The configuration it was built from.
    pub fn config(&self) -> &Config<T> {
        &self.config
    }

    /// The present state.
    pub fn state(&self) -> State<T> {
        self.estimate.state
    }

    /// The present covariance.
    pub fn covariance(&self) -> Covariance<T> {
        self.estimate.covariance
    }

    /// Back to the initial state and covariance.
    pub fn reset(&mut self) {
        self.estimate = Estimate {
            state: self.config.initial_state,
            covariance: self.config.initial_covariance,
        };
    }

    /// Corrects the estimate with a measurement that does not read the law at its slip but something made
    /// of it, which `expected` predicts at the present state; or rejects it at the gate.
    ///
    /// `Compensator::step` of the crate `muslip-compensate` makes both arguments. The slip is
    /// reported and not computed with. With the law's own expansion it is [`Estimator::update`], bit for
    /// bit.
    ///
    /// # Errors
    /// [`UpdateError`]; the estimate is exactly as it was before the call.
    pub fn update_expecting(
        &mut self,
        measurement: &FrictionMeasurement<T>,
        expected: Expansion<T>,
    ) -> Result<Fusion<T>, UpdateError> {
        if !expected.is_finite() {
            return Err(UpdateError::NonFinite(Input::Expected));
        }
        self.fuse(measurement, expected)
    }

    /// What an update does that is not lean, or that the lean arithmetic does not settle.
    #[cold]
    #[inline(never)]
    fn update_in_full(
        &mut self,
        measurement: &FrictionMeasurement<T>,
    ) -> Result<Decision, UpdateError> {
        Ok(self.update_reporting(measurement)?.decision)
    }

    #[inline(always)]
    fn fuse(
        &mut self,
        measurement: &FrictionMeasurement<T>,
        expected: Expansion<T>,
    ) -> Result<Fusion<T>, UpdateError> {
        // The square below would hide the sign.
        if measurement.friction_std <= T::ZERO {
            return Err(UpdateError::NonPositiveNoise);
        }
        let inflated_std = self.config.noise_inflation * measurement.friction_std;
        let inputs = Inputs {
            state: self.estimate.state,
            covariance: self.estimate.covariance,
            slip_ratio: measurement.slip_ratio,
            expected,
            friction: measurement.friction,
            measurement_variance: inflated_std * inflated_std,
        };
        let step = inputs.judged(inputs.step(self.choices()))?;
        let mut fusion = step.fusion;
        if self.config.nis_gate.is_some_and(|gate| fusion.nis > gate) {
            fusion.decision = Decision::Rejected;
            fusion.signal_after = fusion.signal_before;
        } else {
            self.estimate = Estimate {
                state: step.state,
                covariance: step.covariance,
            };
        }
        Ok(fusion)
    }

    fn choices(&self) -> Choices {
        Choices {
            pseudonoise: self.config.pseudonoise,
            covariance_form: self.config.covariance_form,
        }
    }
}

impl<T: Real> Estimator<T> for MuSlipFilter<T> {
    type Measurement = FrictionMeasurement<T>;
    type Fusion = Fusion<T>;
    type Estimate = Estimate<T>;
    type Error = UpdateError;

    /// Corrects the estimate with one measured friction, or rejects it at the gate.
    ///
    /// With the article's choices and no gate it is the lean arithmetic, one division, and all that may be wrong is
    /// judged by what comes out; only what does not pass, or other choices, take the way in full, which finds out
    /// why. See the [module](crate::filter::mu_slip) for what each check costs.
    #[inline]
    fn update(&mut self, measurement: &FrictionMeasurement<T>) -> Result<Decision, UpdateError> {
        let FrictionMeasurement {
            slip_ratio,
            friction,
            friction_std,
        } = *measurement;
        let inflated_std = self.config.noise_inflation * friction_std;
        let Estimate { state, covariance } = self.estimate;
        let step = lean(
            state,
            covariance,
            slip_ratio,
            friction,
            inflated_std * inflated_std,
        );
        if inflated_std > self.lean_above && step.is_sound() {
            self.estimate = Estimate {
                state: step.state,
                covariance: step.covariance,
            };
            Ok(Decision::Accepted)
        } else {
            self.update_in_full(measurement)
        }
    }

    fn update_reporting(
        &mut self,
        measurement: &FrictionMeasurement<T>,
    ) -> Result<Fusion<T>, UpdateError> {
        let expected = self.estimate.state.expansion(measurement.slip_ratio);
        self.fuse(measurement, expected)
    }

    fn estimate(&self) -> Estimate<T> {
        self.estimate
    }

    fn restore(&mut self, estimate: Estimate<T>) -> Result<(), UpdateError> {
        if !estimate.state.is_finite() {
            return Err(UpdateError::NonFinite(Input::State));
        }
        if !estimate.covariance.is_positive_definite() {
            return Err(UpdateError::PriorNotPositiveDefinite);
        }
        self.estimate = estimate;
        Ok(())
    }

    fn peak(&self) -> PeakEstimate<T> {
        let Estimate { state, covariance } = self.estimate;
        let (peak_friction_std, critical_slip_std) = covariance.std();
        PeakEstimate {
            peak_friction: state.peak_friction,
            peak_friction_std,
            critical_slip: state.critical_slip,
            critical_slip_std,
            correlation: covariance.correlation(),
        }
    }
}
