use muslip::real::Real;
use muslip::sample::SampleLimits;

use super::compensator::Compensator;
use super::effect::{
    EffectiveRadius, ForceDelay, ForceLag, LoadCrosstalk, LoadSensitivity, Relaxation,
    SpeedSensitivity, ThermalFade, ZeroDrift,
};
use super::error::{CompensationError, Figure};

/// Which effects to compensate, each with its figures.
///
/// Figures that make an effect vanish (no error, no share, no length) give exactly, bit for bit, the
/// update without it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Compensation<T> {
    /// Another rolling radius.
    pub effective_radius: Option<EffectiveRadius<T>>,
    /// A drag channel that reports late.
    pub force_delay: Option<ForceDelay<T>>,
    /// A drag channel behind a low-pass filter.
    pub force_lag: Option<ForceLag<T>>,
    /// A drag channel whose zero moves.
    pub zero_drift: Option<ZeroDrift<T>>,
    /// A share of the normal force in the drag reading.
    pub load_crosstalk: Option<LoadCrosstalk<T>>,
    /// Friction that changes with normal force.
    pub load_sensitivity: Option<LoadSensitivity<T>>,
    /// Friction that changes with speed.
    pub speed_sensitivity: Option<SpeedSensitivity<T>>,
    /// Force that builds up over a distance.
    pub relaxation: Option<Relaxation<T>>,
    /// Friction that changes with tread temperature.
    pub thermal_fade: Option<ThermalFade<T>>,
    /// A step longer than this, in s, is a gap: delay line, lag and relaxation start anew after it, the
    /// clock goes on and the tread cools. `None`: no step is.
    pub longest_step_s: Option<T>,
}

impl<T: Real> Compensation<T> {
    /// Nothing is compensated.
    pub const fn none() -> Self {
        Self {
            effective_radius: None,
            force_delay: None,
            force_lag: None,
            zero_drift: None,
            load_crosstalk: None,
            load_sensitivity: None,
            speed_sensitivity: None,
            relaxation: None,
            thermal_fade: None,
            longest_step_s: None,
        }
    }

    /// The compensator, before its first step, with room for `N` samples in its delay line.
    ///
    /// N may be 0 where no delay is compensated; else it must be at least
    /// ⌈[`delay_s`](ForceDelay::delay_s)/[`sampling_step_s`](ForceDelay::sampling_step_s)⌉ + 1, and more
    /// where the step jitters. `declared_radius_m` is the wheel's free-rolling radius in m, > 0, that
    /// relative errors refer to. Memory: 4 N + some 40 numbers.
    ///
    /// # Errors
    /// [`CompensationError::OutOfRange`] naming the first figure outside its range,
    /// [`CompensationError::DelayDoesNotFit`].
    pub fn build<const N: usize>(
        self,
        declared_radius_m: T,
        limits: SampleLimits<T>,
    ) -> Result<Compensator<T, N>, CompensationError> {
        self.check(declared_radius_m)
            .map_err(CompensationError::OutOfRange)?;
        let capacity = u32::try_from(N).unwrap_or(u32::MAX);
        if let Some(delay) = self.force_delay
            && delay.delay_s > T::ZERO
        {
            // A hair of tolerance, so that a delay of whole steps is not lost to rounding.
            let steps = delay.delay_s / delay.sampling_step_s * T::from_f64(1.0 - 1e-6);
            let room = T::from_f64(f64::from(capacity) - 1.0);
            let fits = steps <= room;
            if !fits {
                return Err(CompensationError::DelayDoesNotFit { capacity });
            }
        }
        Ok(Compensator::new(self, declared_radius_m, limits))
    }

    fn check(&self, declared_radius_m: T) -> Result<(), Figure> {
        if !(declared_radius_m > T::ZERO && declared_radius_m.is_finite()) {
            return Err(Figure::DeclaredRadius);
        }
        self.effective_radius.map_or(Ok(()), |e| e.check())?;
        self.force_delay.map_or(Ok(()), |e| e.check())?;
        self.force_lag.map_or(Ok(()), |e| e.check())?;
        self.zero_drift.map_or(Ok(()), |e| e.check())?;
        self.load_crosstalk.map_or(Ok(()), |e| e.check())?;
        self.load_sensitivity.map_or(Ok(()), |e| e.check())?;
        self.speed_sensitivity.map_or(Ok(()), |e| e.check())?;
        self.relaxation.map_or(Ok(()), |e| e.check())?;
        self.thermal_fade.map_or(Ok(()), |e| e.check())?;
        match self.longest_step_s {
            Some(step) if step > T::ZERO => Ok(()),
            Some(_) => Err(Figure::LongestStep),
            None => Ok(()),
        }
    }
}
