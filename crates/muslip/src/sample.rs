//! From one sample of the rig to one point of the mu-slip curve.

use core::fmt;

use crate::real::Real;

/// One sample of the four channels, all at the same instant.
///
/// | field | symbol | unit | sign |
/// |---|---|---|---|
/// | `wheel_speed_rad_s` | ω | rad/s | positive rolling forward |
/// | `vehicle_speed_m_s` | v | m/s | positive forward; the drum's surface on a drum rig |
/// | `drag_force_n` | Fx | N | positive when it slows the vehicle |
/// | `normal_force_n` | Fz | N | positive pressing the tyre on the road |
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RigSample<T> {
    /// Wheel speed ω in rad/s.
    pub wheel_speed_rad_s: T,
    /// Vehicle or drum surface speed v in m/s.
    pub vehicle_speed_m_s: T,
    /// Drag force Fx in N.
    pub drag_force_n: T,
    /// Normal force Fz in N.
    pub normal_force_n: T,
}

/// What a sample must satisfy to count as a measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SampleLimits<T> {
    /// Smallest vehicle speed in m/s at which slip is still a measurement; default 0.5.
    pub minimum_vehicle_speed_m_s: T,
    /// Smallest normal force in N at which friction is still a measurement; no default, see
    /// [`SampleLimits::for_median_normal_force`].
    pub minimum_normal_force_n: T,
    /// How far noise may carry slip outside 0..=1, dimensionless; default 0.05.
    pub slip_margin: T,
}

impl<T: Real> SampleLimits<T> {
    /// The usual limits with a given smallest normal force in N.
    #[inline]
    pub fn new(minimum_normal_force_n: T) -> Self {
        Self {
            minimum_vehicle_speed_m_s: T::HALF,
            minimum_normal_force_n,
            slip_margin: T::from_f64(0.05),
        }
    }

    /// The usual limits with the smallest normal force at 2 % of a recording's median, in N.
    #[inline]
    pub fn for_median_normal_force(median_normal_force_n: T) -> Self {
        Self::new(T::from_f64(0.02) * median_normal_force_n)
    }
}

/// One point of the mu-slip curve.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SlipFriction<T> {
    /// Slip (v - R ω)/v, dimensionless: 0 rolling freely, 1 locked, positive when braking.
    pub slip_ratio: T,
    /// Friction Fx/Fz, dimensionless.
    pub friction: T,
}

/// A quantity that was not finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Channel {
    /// Wheel speed ω.
    WheelSpeed,
    /// Vehicle speed v.
    VehicleSpeed,
    /// Drag force Fx.
    DragForce,
    /// Normal force Fz.
    NormalForce,
    /// The effective radius R of the wheel, not a channel but an input all the same.
    EffectiveRadius,
    /// The computed slip: its quotient overflowed.
    SlipRatio,
    /// The computed friction: its quotient overflowed.
    Friction,
}

/// Why a sample is no measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum SampleError {
    /// An input, or a quotient of finite inputs, is infinite or NaN.
    NonFinite {
        /// Which one.
        channel: Channel,
    },
    /// Vehicle speed at or below zero, or below the stated minimum.
    LowSpeed,
    /// Normal force at or below zero, or below the stated minimum.
    LowNormalForce,
    /// Slip outside 0..=1 by more than the stated margin.
    SlipOutOfRange,
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::WheelSpeed => "wheel speed",
            Self::VehicleSpeed => "vehicle speed",
            Self::DragForce => "drag force",
            Self::NormalForce => "normal force",
            Self::EffectiveRadius => "effective radius",
            Self::SlipRatio => "slip ratio",
            Self::Friction => "friction",
        })
    }
}

impl fmt::Display for SampleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NonFinite { channel } => write!(f, "{channel} is not finite"),
            Self::LowSpeed => f.write_str("vehicle speed is below the minimum"),
            Self::LowNormalForce => f.write_str("normal force is below the minimum"),
            Self::SlipOutOfRange => f.write_str("slip is outside 0 to 1 by more than the margin"),
        }
    }
}

impl core::error::Error for SampleError {}

/// Slip and friction of one sample: s = (v - R ω)/v, mu = Fx/Fz.
///
/// `effective_radius_m` is the free-rolling radius R in m: with it, slip is 0 when nothing brakes.
/// Limits that are NaN refuse every sample. Cost: two divisions.
///
/// # Errors
/// In this order: [`SampleError::NonFinite`] if an input is not finite, [`SampleError::LowSpeed`],
/// [`SampleError::LowNormalForce`], [`SampleError::NonFinite`] if a quotient overflows,
/// [`SampleError::SlipOutOfRange`].
///
/// ```
/// use muslip::sample::{RigSample, SampleLimits, slip_friction};
///
/// let sample = RigSample {
///     wheel_speed_rad_s: 58.0_f32,
///     vehicle_speed_m_s: 20.0,
///     drag_force_n: 3200.0,
///     normal_force_n: 4000.0,
/// };
/// let point = slip_friction(&sample, 0.31, &SampleLimits::new(80.0))?;
/// assert!((point.slip_ratio - 0.101).abs() < 1e-6);
/// assert!((point.friction - 0.8).abs() < 1e-6);
/// # Ok::<(), muslip::sample::SampleError>(())
/// ```
#[inline]
pub fn slip_friction<T: Real>(
    sample: &RigSample<T>,
    effective_radius_m: T,
    limits: &SampleLimits<T>,
) -> Result<SlipFriction<T>, SampleError> {
    let RigSample {
        wheel_speed_rad_s: omega,
        vehicle_speed_m_s: v,
        drag_force_n: fx,
        normal_force_n: fz,
    } = *sample;
    finite(omega, Channel::WheelSpeed)?;
    finite(v, Channel::VehicleSpeed)?;
    finite(fx, Channel::DragForce)?;
    finite(fz, Channel::NormalForce)?;
    finite(effective_radius_m, Channel::EffectiveRadius)?;

    // Positive comparisons, so that a NaN limit refuses.
    let fast_enough = v > T::ZERO && v >= limits.minimum_vehicle_speed_m_s;
    if !fast_enough {
        return Err(SampleError::LowSpeed);
    }
    let pressed_enough = fz > T::ZERO && fz >= limits.minimum_normal_force_n;
    if !pressed_enough {
        return Err(SampleError::LowNormalForce);
    }

    let slip_ratio = slip_ratio(omega, v, effective_radius_m).ok_or(SampleError::NonFinite {
        channel: Channel::SlipRatio,
    })?;
    let friction = fx / fz;
    finite(friction, Channel::Friction)?;
    let inside = slip_ratio >= -limits.slip_margin && slip_ratio <= T::ONE + limits.slip_margin;
    if !inside {
        return Err(SampleError::SlipOutOfRange);
    }
    Ok(SlipFriction {
        slip_ratio,
        friction,
    })
}

/// Slip s = (v - R omega)/v of a wheel with no other check: 0 rolls freely, 1 is locked.
///
/// `wheel_speed_rad_s` (omega), `vehicle_speed_m_s` (v) and `effective_radius_m` (R) may be anything; `None` unless
/// v > 0 and the quotient is finite.
///
/// ```
/// use muslip::sample::slip_ratio;
///
/// assert_eq!(slip_ratio(0.0, 20.0, 0.31), Some(1.0));
/// assert_eq!(slip_ratio(58.0, 0.0, 0.31), None);
/// ```
#[inline]
pub fn slip_ratio<T: Real>(
    wheel_speed_rad_s: T,
    vehicle_speed_m_s: T,
    effective_radius_m: T,
) -> Option<T> {
    let slip_ratio =
        (vehicle_speed_m_s - effective_radius_m * wheel_speed_rad_s) / vehicle_speed_m_s;
    (vehicle_speed_m_s > T::ZERO && slip_ratio.is_finite()).then_some(slip_ratio)
}

#[inline]
fn finite<T: Real>(value: T, channel: Channel) -> Result<(), SampleError> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(SampleError::NonFinite { channel })
    }
}

#[cfg(test)]
mod tests {
    use super::{Channel, RigSample, SampleError, SampleLimits, slip_friction};

    const RADIUS_M: f64 = 0.31;

    fn sample() -> RigSample<f64> {
        RigSample {
            wheel_speed_rad_s: 58.0,
            vehicle_speed_m_s: 20.0,
            drag_force_n: 3200.0,
            normal_force_n: 4000.0,
        }
    }

    fn limits() -> SampleLimits<f64> {
        SampleLimits::for_median_normal_force(4000.0)
    }

    #[test]
    fn a_locked_wheel_slips_by_one_and_a_free_one_by_zero() {
        let mut s = sample();
        s.wheel_speed_rad_s = 0.0;
        assert_eq!(
            slip_friction(&s, RADIUS_M, &limits()).unwrap().slip_ratio,
            1.0
        );
        s.wheel_speed_rad_s = 20.0 / RADIUS_M;
        let free = slip_friction(&s, RADIUS_M, &limits()).unwrap();
        assert!(free.slip_ratio.abs() < 1e-15);
    }

    #[test]
    fn each_input_that_is_not_finite_is_named() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let refused = |change: fn(&mut RigSample<f64>, f64)| {
                let mut s = sample();
                change(&mut s, bad);
                slip_friction(&s, RADIUS_M, &limits())
            };
            let named = |channel| Err(SampleError::NonFinite { channel });
            assert_eq!(
                refused(|s, bad| s.wheel_speed_rad_s = bad),
                named(Channel::WheelSpeed)
            );
            assert_eq!(
                refused(|s, bad| s.vehicle_speed_m_s = bad),
                named(Channel::VehicleSpeed)
            );
            assert_eq!(
                refused(|s, bad| s.drag_force_n = bad),
                named(Channel::DragForce)
            );
            assert_eq!(
                refused(|s, bad| s.normal_force_n = bad),
                named(Channel::NormalForce)
            );
            assert_eq!(
                slip_friction(&sample(), bad, &limits()),
                named(Channel::EffectiveRadius)
            );
        }
    }

    #[test]
    fn low_speed_and_low_normal_force_are_refused_at_their_minimum_and_not_above() {
        let mut s = sample();
        s.vehicle_speed_m_s = 0.499;
        s.wheel_speed_rad_s = 1.0;
        assert_eq!(
            slip_friction(&s, RADIUS_M, &limits()),
            Err(SampleError::LowSpeed)
        );
        s.vehicle_speed_m_s = 0.5;
        assert!(slip_friction(&s, RADIUS_M, &limits()).is_ok());
        s.vehicle_speed_m_s = -20.0;
        assert_eq!(
            slip_friction(&s, RADIUS_M, &limits()),
            Err(SampleError::LowSpeed)
        );

        let mut s = sample();
        s.normal_force_n = 79.9;
        assert_eq!(
            slip_friction(&s, RADIUS_M, &limits()),
            Err(SampleError::LowNormalForce)
        );
        s.normal_force_n = 80.0;
        assert!(slip_friction(&s, RADIUS_M, &limits()).is_ok());
    }

    #[test]
    fn slip_beyond_the_margin_is_refused_on_both_sides() {
        let mut s = sample();
        for (slip, ok) in [(-0.06, false), (-0.04, true), (1.04, true), (1.06, false)] {
            s.wheel_speed_rad_s = 20.0 * (1.0 - slip) / RADIUS_M;
            let got = slip_friction(&s, RADIUS_M, &limits());
            assert_eq!(got.is_ok(), ok, "{slip}");
            if !ok {
                assert_eq!(got, Err(SampleError::SlipOutOfRange));
            }
        }
    }

    #[test]
    fn limits_of_zero_or_nan_let_nothing_unsound_through() {
        let mut s = sample();
        let open = SampleLimits {
            minimum_vehicle_speed_m_s: 0.0,
            minimum_normal_force_n: 0.0,
            slip_margin: 0.05,
        };
        s.vehicle_speed_m_s = 0.0;
        assert_eq!(
            slip_friction(&s, RADIUS_M, &open),
            Err(SampleError::LowSpeed)
        );
        let mut s = sample();
        s.normal_force_n = 1e-310;
        let channel = Channel::Friction;
        assert_eq!(
            slip_friction(&s, RADIUS_M, &open),
            Err(SampleError::NonFinite { channel })
        );
        let undefined = SampleLimits::new(f64::NAN);
        assert_eq!(
            slip_friction(&sample(), RADIUS_M, &undefined),
            Err(SampleError::LowNormalForce)
        );
    }
}
