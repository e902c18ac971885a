//! A setpoint for a road that nobody knows, where slip and friction are measured.
//!
//! The two-state filter of [`mu_slip`] follows peak friction and critical slip while
//! the brake is at work; a share of its critical slip is the setpoint. It has no process noise, so the
//! seeker starts it anew when friction no longer fits: when the mean of the last innovations, in standard
//! deviations, exceeds a threshold, the road is another one.

use muslip::filter::mu_slip::{self, Estimate, MuSlipFilter, UpdateError};
use muslip::filter::{Estimator, FrictionMeasurement, PeakEstimate};
use muslip::real::Real;

/// Configuration of the seeker.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Config<T> {
    /// The two-state filter, its start being that of every new road.
    pub filter: mu_slip::Config<T>,
    /// Setpoint as a share of the critical slip, dimensionless, > 0.
    pub setpoint_share: T,
    /// Smallest setpoint, dimensionless, > 0.
    pub minimum_slip: T,
    /// Largest setpoint, dimensionless, above the smallest and below 1; also where it starts.
    pub maximum_slip: T,
    /// Critical slip is believed once its standard deviation is below this share of it; until then the
    /// setpoint is [`Config::initial_slip`].
    pub believed_below: T,
    /// Setpoint while nothing is believed, within the smallest and the largest.
    pub initial_slip: T,
    /// Weight of the newest innovation in their running mean, within 0..=1.
    pub innovation_weight: T,
    /// Magnitude of that mean, in standard deviations of one innovation, above which the road is another.
    pub change_threshold: T,
}

/// A field of [`Config`] outside the range that it states.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ConfigError {
    /// The two-state filter's.
    Filter(mu_slip::ConfigError),
    /// A setpoint, share, weight or threshold.
    OutOfRange,
}

impl core::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Filter(error) => error.fmt(f),
            Self::OutOfRange => f.write_str(
                "a setpoint, share, weight or threshold of the peak seeker is outside its range",
            ),
        }
    }
}

impl core::error::Error for ConfigError {}

/// The seeker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PeakSeeker<T> {
    config: Config<T>,
    start: Estimate<T>,
    filter: MuSlipFilter<T>,
    mean_innovation: T,
    restarts: u16,
}

impl<T: Real> Config<T> {
    /// The configuration that docs/quarter-car.md judges.
    pub fn usual() -> Self {
        Self {
            filter: mu_slip::Config::for_range(mu_slip::Range::Automotive),
            setpoint_share: T::from_f64(0.9),
            minimum_slip: T::from_f64(0.05),
            maximum_slip: T::from_f64(0.18),
            believed_below: T::from_f64(0.15),
            initial_slip: T::from_f64(0.12),
            innovation_weight: T::from_f64(0.3),
            change_threshold: T::TWO,
        }
    }

    /// The seeker, at its start.
    ///
    /// # Errors
    /// [`ConfigError`].
    pub fn build(self) -> Result<PeakSeeker<T>, ConfigError> {
        let filter = self.filter.build().map_err(ConfigError::Filter)?;
        let within = self.minimum_slip > T::ZERO
            && self.minimum_slip <= self.initial_slip
            && self.initial_slip <= self.maximum_slip
            && self.maximum_slip < T::ONE;
        let positive = self.setpoint_share > T::ZERO
            && self.setpoint_share.is_finite()
            && self.believed_below > T::ZERO
            && self.change_threshold > T::ZERO;
        let weight = self.innovation_weight > T::ZERO && self.innovation_weight <= T::ONE;
        if !(within && positive && weight) {
            return Err(ConfigError::OutOfRange);
        }
        Ok(PeakSeeker {
            config: self,
            start: filter.estimate(),
            filter,
            mean_innovation: T::ZERO,
            restarts: 0,
        })
    }
}

impl<T: Real> PeakSeeker<T> {
    /// Takes one measured point of the curve and answers the slip to hold.
    ///
    /// # Errors
    /// [`UpdateError`] of the two-state filter; the seeker is as it was before.
    pub fn step(&mut self, point: &FrictionMeasurement<T>) -> Result<T, UpdateError> {
        let mut filter = self.filter;
        let fusion = filter.update_reporting(point)?;
        let scaled = fusion.innovation / fusion.innovation_variance.sqrt();
        let weight = self.config.innovation_weight;
        let mean = self.mean_innovation + weight * (scaled - self.mean_innovation);
        if !mean.is_finite() {
            return Err(UpdateError::Overflow);
        }
        if mean.abs() > self.config.change_threshold {
            let mut anew = self.filter;
            anew.restore(self.start)?;
            anew.update_reporting(point)?;
            self.filter = anew;
            self.mean_innovation = T::ZERO;
            self.restarts = self.restarts.saturating_add(1);
        } else {
            self.filter = filter;
            self.mean_innovation = mean;
        }
        Ok(self.setpoint_slip())
    }

    /// The slip to hold, dimensionless.
    pub fn setpoint_slip(&self) -> T {
        let peak = self.filter.peak();
        let believed = peak.critical_slip_std < self.config.believed_below * peak.critical_slip;
        if believed {
            (self.config.setpoint_share * peak.critical_slip)
                .max(self.config.minimum_slip)
                .min(self.config.maximum_slip)
        } else {
            self.config.initial_slip
        }
    }

    /// The peak as estimated now.
    pub fn peak(&self) -> PeakEstimate<T> {
        self.filter.peak()
    }

    /// How often the road was taken for another.
    pub fn restarts(&self) -> u16 {
        self.restarts
    }
}
