use super::config::{Config, ConfigError};
use super::estimate::{Estimate, Expected};
use crate::filter::mu_slip::{Covariance, Fusion, Input, State, UpdateError};
use crate::filter::{Decision, Estimator, FrictionMeasurement, PeakEstimate};
use crate::real::Real;

/// One update without a check, for the cost table and the throughput example: a slip, friction or variance that
/// is not finite, or a variance that is not positive, makes the estimate wrong without an error.
#[doc(hidden)]
#[inline]
pub fn update_unchecked<T: Real>(
    filter: &mut EfficientFilter<T>,
    slip_ratio: T,
    friction: T,
    measurement_variance: T,
) {
    filter
        .estimate
        .fuse(&filter.config, slip_ratio, friction, measurement_variance);
}

/// The filter: a validated configuration and the present estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EfficientFilter<T> {
    config: Config<T>,
    estimate: Estimate<T>,
}

impl<T: Real> Config<T> {
    /// The filter, at its start.
    ///
    /// # Errors
    /// [`ConfigError`] naming the first field that is outside its range.
    pub fn build(self) -> Result<EfficientFilter<T>, ConfigError> {
        self.check()?;
        Ok(EfficientFilter {
            config: self,
            estimate: Estimate::start(&self),
        })
    }
}

impl<T: Real> EfficientFilter<T> {
    /// The configuration it was built from.
    pub fn config(&self) -> &Config<T> {
        &self.config
    }

    /// The present state.
    pub fn state(&self) -> State<T> {
        self.estimate.state()
    }

    /// The present covariance of (mup, sp).
    pub fn covariance(&self) -> Covariance<T> {
        let slip = self.state().critical_slip;
        let Covariance { p00, p01, p11 } = self.renewed().covariance();
        Covariance {
            p00,
            p01: slip * p01,
            p11: slip * slip * p11,
        }
    }

    /// Learnt over declared noise variance, within 0.15 to 10.
    pub fn noise_factor(&self) -> T {
        self.renewed().noise_factor()
    }

    /// The estimate with its noise taken anew, which an update does only now and then.
    fn renewed(&self) -> Estimate<T> {
        let mut estimate = self.estimate;
        estimate.renew(&self.config);
        estimate
    }

    /// Back to the start.
    pub fn reset(&mut self) {
        self.estimate = Estimate::start(&self.config);
    }
}

/// Less than the noise's variance over the declared one can be: the learnt one is held within 0.15.
const LEAST_NOISE: f64 = 0.1;

/// Variance of a measurement that can be taken.
fn checked_variance<T: Real>(measurement: &FrictionMeasurement<T>) -> Result<T, UpdateError> {
    for (value, input) in [
        (measurement.slip_ratio, Input::SlipRatio),
        (measurement.friction, Input::Friction),
        (measurement.friction_std, Input::Noise),
    ] {
        if !value.is_finite() {
            return Err(UpdateError::NonFinite(input));
        }
    }
    if measurement.friction_std <= T::ZERO {
        return Err(UpdateError::NonPositiveNoise);
    }
    Ok(measurement.friction_std * measurement.friction_std)
}

impl<T: Real> Estimator<T> for EfficientFilter<T> {
    type Measurement = FrictionMeasurement<T>;
    type Fusion = Fusion<T>;
    type Estimate = Estimate<T>;
    type Error = UpdateError;

    /// Corrects the estimate with one measured friction, or rejects it at the gate. The report is made only where a
    /// squared innovation might not be finite over its variance.
    fn update(&mut self, measurement: &FrictionMeasurement<T>) -> Result<Decision, UpdateError> {
        let variance = checked_variance(measurement)?;
        let FrictionMeasurement {
            slip_ratio,
            friction,
            ..
        } = *measurement;
        let State {
            peak_friction,
            critical_slip,
        } = self.state();
        let about_peak = slip_ratio * slip_ratio + critical_slip * critical_slip;
        let innovation =
            friction - peak_friction * (slip_ratio * (critical_slip + critical_slip) / about_peak);
        if !(innovation * innovation / (T::from_f64(LEAST_NOISE) * variance)).is_finite() {
            return Ok(self.update_reporting(measurement)?.decision);
        }
        let mut after = self.estimate;
        let decision = after.fuse(&self.config, slip_ratio, friction, variance);
        if !after.is_sound() {
            return Err(UpdateError::Overflow);
        }
        self.estimate = after;
        Ok(decision)
    }

    /// The innovation's variance is made with the noise as learnt. Gains are P Hᵀ/S with P before the
    /// update; the estimate itself moves by the likelihood's own step.
    fn update_reporting(
        &mut self,
        measurement: &FrictionMeasurement<T>,
    ) -> Result<Fusion<T>, UpdateError> {
        let variance = checked_variance(measurement)?;
        let FrictionMeasurement {
            slip_ratio,
            friction,
            ..
        } = *measurement;
        let before = self.covariance();
        let slip = self.state().critical_slip;
        let Expected {
            friction: predicted_friction,
            by_peak_friction,
            by_log_slip,
            signal,
            noise,
        } = self.renewed().expected(slip_ratio, variance);
        let innovation = friction - predicted_friction;
        let mut after = self.estimate;
        let decision = after.fuse(&self.config, slip_ratio, friction, variance);
        let innovation_variance = signal + noise;
        let inverse = T::ONE / innovation_variance;
        let (h0, h1) = (by_peak_friction, by_log_slip / slip);
        let nis = innovation * innovation * inverse;
        if !(after.is_sound() && nis.is_finite()) {
            return Err(UpdateError::Overflow);
        }
        self.estimate = after;
        let Covariance { p00, p01, p11 } = self.covariance();
        Ok(Fusion {
            slip_ratio,
            measured_friction: friction,
            predicted_friction,
            innovation,
            noise_variance: noise,
            pseudonoise_variance: T::ZERO,
            signal_before: signal,
            signal_after: h0 * (h0 * p00 + (h1 + h1) * p01) + h1 * h1 * p11,
            innovation_variance,
            peak_friction_gain: (before.p00 * h0 + before.p01 * h1) * inverse,
            critical_slip_gain: (before.p01 * h0 + before.p11 * h1) * inverse,
            nis,
            decision,
        })
    }

    fn estimate(&self) -> Estimate<T> {
        self.estimate
    }

    fn restore(&mut self, estimate: Estimate<T>) -> Result<(), UpdateError> {
        if !estimate.is_sound() {
            return Err(UpdateError::NonFinite(Input::State));
        }
        self.estimate = estimate;
        Ok(())
    }

    fn peak(&self) -> PeakEstimate<T> {
        let State {
            peak_friction,
            critical_slip,
        } = self.state();
        let covariance = self.covariance();
        let (peak_friction_std, critical_slip_std) = covariance.std();
        PeakEstimate {
            peak_friction,
            peak_friction_std,
            critical_slip,
            critical_slip_std,
            correlation: covariance.correlation(),
        }
    }
}
