use muslip::real::Real;

use super::effect::{
    EffectiveRadius, ForceDelay, ForceLag, LoadCrosstalk, LoadSensitivity, Relaxation,
    SpeedSensitivity, ThermalFade, ZeroDrift,
};
use super::error::Parameter;

/// Which effects to compensate, each with its parameters.
///
/// Parameters that make an effect vanish (no error, no share, no length) give exactly, bit for bit, the
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

    pub(super) fn check(&self, declared_radius_m: T) -> Result<(), Parameter> {
        if !(declared_radius_m > T::ZERO && declared_radius_m.is_finite()) {
            return Err(Parameter::DeclaredRadius);
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
            Some(_) => Err(Parameter::LongestStep),
            None => Ok(()),
        }
    }
}
