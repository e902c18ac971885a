//! A guard against a locked wheel that an estimator takes for standstill.
//!
//! A wheel that stands says nothing of the vehicle's speed. Where the estimate has run down to standstill too
//! early, on a road more slippery than believed, a controller that trusts it would hold the brake and slide
//! on. The guard trusts the wheel alone: if it stands, the brake is opened for a moment; a wheel that then
//! turns was locked, one that does not was at rest.

use muslip::real::Real;

/// Configuration of the guard.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Config<T> {
    /// Wheel speed in rad/s below which the wheel may be standing, > 0 and above the sensor's noise.
    pub standing_rad_s: T,
    /// Samples in a row below it before the brake is opened, > 0.
    pub patience_samples: u8,
    /// Samples for which the brake is opened to see whether the wheel turns, > 0.
    pub proof_samples: u8,
}

/// What the guard says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Advice {
    /// The wheel turns, or has not stood for long: brake as you like.
    Free,
    /// Open the brake: the wheel stands and may be locked.
    Open,
    /// The wheel stood with the brake open: the vehicle is at rest. Until the wheel turns again.
    AtRest,
}

/// The guard.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LockGuard<T> {
    config: Config<T>,
    stood: u8,
    open_for: u8,
}

impl<T: Real> Config<T> {
    /// 1.5 rad/s, 10 samples, 30 samples.
    pub fn usual() -> Self {
        Self {
            standing_rad_s: T::from_f64(1.5),
            patience_samples: 10,
            proof_samples: 30,
        }
    }

    /// The guard; `None` where a field is outside its range.
    pub fn build(self) -> Option<LockGuard<T>> {
        let valid = self.standing_rad_s.is_finite()
            && self.standing_rad_s > T::ZERO
            && self.patience_samples > 0
            && self.proof_samples > 0;
        valid.then_some(LockGuard {
            config: self,
            stood: 0,
            open_for: 0,
        })
    }
}

impl<T: Real> LockGuard<T> {
    /// One sample: the wheel speed as read, in rad/s; a missing or non-finite reading changes nothing.
    pub fn step(&mut self, wheel_speed_rad_s: Option<T>) -> Advice {
        if let Some(speed) = wheel_speed_rad_s.filter(|speed| speed.is_finite()) {
            if speed.abs() >= self.config.standing_rad_s {
                self.stood = 0;
                self.open_for = 0;
            } else {
                self.stood = self.stood.saturating_add(1);
            }
        }
        if self.stood < self.config.patience_samples {
            return Advice::Free;
        }
        if self.open_for >= self.config.proof_samples {
            return Advice::AtRest;
        }
        self.open_for += 1;
        Advice::Open
    }
}
