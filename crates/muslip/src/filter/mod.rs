//! Recursive estimators of the mu-slip curve.
//!
//! Every filter has a module of its own with its state, configuration and errors, and implements
//! [`Estimator`]: code that only wants the curve's peak need not know which one runs. A filter whose
//! measurement is another states it as its [`Estimator::Measurement`].

pub mod efficient;
pub mod mu_slip;

use crate::real::Real;

/// What every filter offers: one measurement in, and the estimate as plain data; what the measurement did, for
/// who asks.
///
/// ```
/// use muslip::filter::{Estimator, FrictionMeasurement, mu_slip::{Config, Range}};
///
/// fn run<E: Estimator<f32, Measurement = FrictionMeasurement<f32>>>(
///     filter: &mut E,
///     points: &[(f32, f32)],
/// ) -> Result<f32, E::Error> {
///     for &(slip_ratio, friction) in points {
///         let friction_std = 0.04;
///         filter.update(&FrictionMeasurement { slip_ratio, friction, friction_std })?;
///     }
///     Ok(filter.peak().peak_friction)
/// }
///
/// let mut filter = Config::for_range(Range::Automotive).build()?;
/// assert!(run(&mut filter, &[(0.05, 0.5), (0.15, 0.8)]).is_ok());
/// # Ok::<(), muslip::filter::mu_slip::ConfigError>(())
/// ```
pub trait Estimator<T: Real> {
    /// One measurement as this filter takes it.
    type Measurement;
    /// What one measurement did, for who asks.
    type Fusion;
    /// State and covariance: plain data that can be copied, logged and restored.
    type Estimate: Copy;
    /// Why a measurement or an estimate was refused.
    type Error;

    /// Corrects the estimate with one measurement.
    ///
    /// # Errors
    /// The filter's own; on any error the estimate is exactly as it was before the call.
    fn update(&mut self, measurement: &Self::Measurement) -> Result<Decision, Self::Error>;

    /// Corrects the estimate with one measurement, and tells what it did: equal to [`Estimator::update`] but
    /// for rounding, and dearer.
    ///
    /// # Errors
    /// As for [`Estimator::update`].
    fn update_reporting(
        &mut self,
        measurement: &Self::Measurement,
    ) -> Result<Self::Fusion, Self::Error>;

    /// The present estimate.
    fn estimate(&self) -> Self::Estimate;

    /// Replaces the estimate, for instance by one logged earlier.
    ///
    /// # Errors
    /// The filter's own, if the estimate is not one that an update could leave behind; nothing changes.
    fn restore(&mut self, estimate: Self::Estimate) -> Result<(), Self::Error>;

    /// The peak of the curve as estimated now.
    fn peak(&self) -> PeakEstimate<T>;
}

/// Whether a measurement changed the estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Decision {
    /// It did.
    Accepted,
    /// It failed the gate on the normalised innovation; the estimate is what it was.
    Rejected,
}

/// One measured point of the mu-slip curve with the uncertainty of its friction.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FrictionMeasurement<T> {
    /// Slip s, dimensionless, taken as known without error.
    pub slip_ratio: T,
    /// Friction z, dimensionless.
    pub friction: T,
    /// Standard deviation σ of the friction's noise, dimensionless, > 0; not inflated.
    pub friction_std: T,
}

/// The peak of the mu-slip curve with its uncertainty (one sigma).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PeakEstimate<T> {
    /// Peak friction, dimensionless.
    pub peak_friction: T,
    /// Its standard deviation.
    pub peak_friction_std: T,
    /// Slip at the peak, dimensionless.
    pub critical_slip: T,
    /// Its standard deviation.
    pub critical_slip_std: T,
    /// Correlation of the two, within ±1.
    pub correlation: T,
}
