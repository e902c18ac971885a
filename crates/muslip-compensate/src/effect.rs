//! The effects, each with its parameters, and what those must satisfy.

use muslip::real::Real;

use super::error::Parameter;

/// The wheel rolls on another radius than the declared one R: slip = (v - R (1 + e) ω)/v.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum EffectiveRadius<T> {
    /// e, the same throughout.
    Constant {
        /// e, dimensionless, within ±0.5.
        relative_error: T,
    },
    /// e + a (Fz/mean - 1).
    WithLoad {
        /// e at the mean normal force, dimensionless, within ±0.5.
        relative_error: T,
        /// a, dimensionless, within ±0.5.
        per_relative_load: T,
        /// Mean normal force in N, > 0.
        mean_normal_force_n: T,
    },
    /// e + a ((v/mean)² - 1).
    WithSpeed {
        /// e at the mean vehicle speed, dimensionless, within ±0.5.
        relative_error: T,
        /// a, dimensionless, within ±0.5.
        per_relative_speed_squared: T,
        /// Mean vehicle speed in m/s, > 0.
        mean_vehicle_speed_m_s: T,
    },
}

/// The drag channel reports late by a fixed time: reading(t) = drag(t - delay).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ForceDelay<T> {
    /// The delay in s, ≥ 0.
    pub delay_s: T,
    /// Usual time between samples in s, > 0: decides how many samples the delay line must hold.
    pub sampling_step_s: T,
}

/// The drag channel passes a first-order low-pass filter: τ d(reading)/dt + reading = drag.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ForceLag<T> {
    /// τ in s, ≥ 0.
    pub time_constant_s: T,
}

/// The drag channel's zero moves with time. t counts from the first step, plus `start_s`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ZeroDrift<T> {
    /// reading = drag + offset + slope t.
    Linear {
        /// Slope in N/s.
        slope_n_s: T,
        /// Offset in N.
        offset_n: T,
        /// t of the first step in s.
        start_s: T,
    },
    /// reading = drag + rise (1 - e^(-t/τ)).
    WarmUp {
        /// Rise in N.
        rise_n: T,
        /// τ in s, > 0.
        time_constant_s: T,
        /// t of the first step in s.
        start_s: T,
    },
}

/// The drag channel reads a share of the normal force: reading = drag + share Fz.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LoadCrosstalk<T> {
    /// The share, dimensionless, within ±1.
    pub share: T,
}

/// Peak friction, and perhaps the slip at the peak, change with normal force:
/// mup (Fz/mean)^(-k) and sp (Fz/mean)^c. What is estimated holds at the mean.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LoadSensitivity<T> {
    /// k, dimensionless, within ±4: minus d ln(peak friction)/d ln(normal force).
    pub sensitivity: T,
    /// c, dimensionless, within ±4; 0 where only the peak changes.
    pub critical_slip_exponent: T,
    /// Mean normal force in N, > 0.
    pub mean_normal_force_n: T,
}

/// Friction changes by a factor with the sliding speed |s v| or with the vehicle speed v. What is
/// estimated holds without sliding, or at the mean vehicle speed.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum SpeedSensitivity<T> {
    /// 1 + k |s v|.
    SlidingLinear {
        /// k in s/m.
        per_m_s: T,
    },
    /// e^(k |s v|).
    SlidingExponential {
        /// k in s/m.
        per_m_s: T,
    },
    /// 1 + k (v - mean).
    VehicleLinear {
        /// k in s/m.
        per_m_s: T,
        /// Mean vehicle speed in m/s.
        mean_vehicle_speed_m_s: T,
    },
    /// e^(k (v - mean)).
    VehicleExponential {
        /// k in s/m.
        per_m_s: T,
        /// Mean vehicle speed in m/s.
        mean_vehicle_speed_m_s: T,
    },
    /// floor + (1 - floor) e^(-|s v|/scale), after Stribeck.
    SlidingWithFloor {
        /// Factor at high sliding speed, dimensionless, ≥ 0.
        floor: T,
        /// Scale in m/s, > 0.
        speed_scale_m_s: T,
    },
}

/// Force builds up over a rolling distance L.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Relaxation<T> {
    /// The tyre feels s', L ds'/dt = v (s - s').
    Slip {
        /// L in m, ≥ 0.
        length_m: T,
    },
    /// L d(drag)/dt = v (Fz mu(s) - drag).
    Force {
        /// L in m, ≥ 0.
        length_m: T,
    },
}

/// Friction changes with tread temperature: a factor e^(-c θ - c₂ θ²), with the temperature's surrogate θ
/// in s, dθ/dt = power/reference - θ/τ, zero at the first step. Power is the measured drag times the
/// sliding speed. What is estimated holds for the cold tread.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ThermalFade<T> {
    /// c in 1/s.
    pub sensitivity_per_s: T,
    /// c₂ in 1/s².
    pub curvature_per_s2: T,
    /// τ of the cooling in s, > 0.
    pub time_constant_s: T,
    /// The power that warms θ by 1 s a second, in W, > 0.
    pub reference_power_w: T,
}

/// The check of one parameter; the error names the parameter that is out of range.
type Checked = Result<(), Parameter>;

fn demand(holds: bool, parameter: Parameter) -> Checked {
    if holds { Ok(()) } else { Err(parameter) }
}

fn within<T: Real>(value: T, limit: f64) -> bool {
    value.abs() <= T::from_f64(limit)
}

fn positive<T: Real>(value: T) -> bool {
    value > T::ZERO && value.is_finite()
}

pub(super) fn not_negative<T: Real>(value: T) -> bool {
    value >= T::ZERO && value.is_finite()
}

impl<T: Real> EffectiveRadius<T> {
    pub(super) fn check(&self) -> Checked {
        let (error, slope, mean) = match *self {
            Self::Constant { relative_error } => (relative_error, T::ZERO, T::ONE),
            Self::WithLoad {
                relative_error,
                per_relative_load,
                mean_normal_force_n,
            } => (relative_error, per_relative_load, mean_normal_force_n),
            Self::WithSpeed {
                relative_error,
                per_relative_speed_squared,
                mean_vehicle_speed_m_s,
            } => (
                relative_error,
                per_relative_speed_squared,
                mean_vehicle_speed_m_s,
            ),
        };
        demand(
            within(error, 0.5) && within(slope, 0.5) && positive(mean),
            Parameter::EffectiveRadius,
        )
    }

    /// 1 + e at a normal force in N and a vehicle speed in m/s.
    #[inline]
    pub(super) fn factor(&self, normal_force_n: T, vehicle_speed_m_s: T) -> T {
        match *self {
            Self::Constant { relative_error } => T::ONE + relative_error,
            Self::WithLoad {
                relative_error,
                per_relative_load,
                mean_normal_force_n,
            } => {
                T::ONE
                    + relative_error
                    + per_relative_load * (normal_force_n / mean_normal_force_n - T::ONE)
            }
            Self::WithSpeed {
                relative_error,
                per_relative_speed_squared,
                mean_vehicle_speed_m_s,
            } => {
                let relative = vehicle_speed_m_s / mean_vehicle_speed_m_s;
                T::ONE
                    + relative_error
                    + per_relative_speed_squared * (relative * relative - T::ONE)
            }
        }
    }
}

impl<T: Real> ZeroDrift<T> {
    pub(super) fn check(&self) -> Checked {
        let sound = match *self {
            Self::Linear {
                slope_n_s,
                offset_n,
                start_s,
            } => slope_n_s.is_finite() && offset_n.is_finite() && start_s.is_finite(),
            Self::WarmUp {
                rise_n,
                time_constant_s,
                start_s,
            } => rise_n.is_finite() && positive(time_constant_s) && start_s.is_finite(),
        };
        demand(sound, Parameter::ZeroDrift)
    }

    /// The zero in N, `since_s` after the first step.
    #[inline]
    pub(super) fn zero_n(&self, since_s: T) -> T {
        match *self {
            Self::Linear {
                slope_n_s,
                offset_n,
                start_s,
            } => offset_n + slope_n_s * (start_s + since_s),
            Self::WarmUp {
                rise_n,
                time_constant_s,
                start_s,
            } => rise_n * (T::ONE - (-(start_s + since_s) / time_constant_s).exp()),
        }
    }
}

impl<T: Real> LoadCrosstalk<T> {
    pub(super) fn check(&self) -> Checked {
        demand(within(self.share, 1.0), Parameter::CrosstalkShare)
    }
}

impl<T: Real> LoadSensitivity<T> {
    pub(super) fn check(&self) -> Checked {
        demand(
            within(self.sensitivity, 4.0)
                && within(self.critical_slip_exponent, 4.0)
                && positive(self.mean_normal_force_n),
            Parameter::LoadSensitivity,
        )
    }

    /// Factors on peak friction and on the slip at the peak, at a normal force in N (> 0).
    #[inline]
    pub(super) fn factors(&self, normal_force_n: T) -> (T, T) {
        let log = (normal_force_n / self.mean_normal_force_n).ln();
        let critical_slip = if self.critical_slip_exponent == T::ZERO {
            T::ONE
        } else {
            (self.critical_slip_exponent * log).exp()
        };
        ((-(self.sensitivity * log)).exp(), critical_slip)
    }
}

impl<T: Real> SpeedSensitivity<T> {
    pub(super) fn check(&self) -> Checked {
        let sound = match *self {
            Self::SlidingLinear { per_m_s } | Self::SlidingExponential { per_m_s } => {
                per_m_s.is_finite()
            }
            Self::VehicleLinear {
                per_m_s,
                mean_vehicle_speed_m_s,
            }
            | Self::VehicleExponential {
                per_m_s,
                mean_vehicle_speed_m_s,
            } => per_m_s.is_finite() && mean_vehicle_speed_m_s.is_finite(),
            Self::SlidingWithFloor {
                floor,
                speed_scale_m_s,
            } => not_negative(floor) && positive(speed_scale_m_s),
        };
        demand(sound, Parameter::SpeedSensitivity)
    }

    /// Factor on friction at a slip and a vehicle speed in m/s.
    #[inline]
    pub(super) fn factor(&self, slip_ratio: T, vehicle_speed_m_s: T) -> T {
        let v = vehicle_speed_m_s;
        let sliding = (slip_ratio * v).abs();
        match *self {
            Self::SlidingLinear { per_m_s } => T::ONE + per_m_s * sliding,
            Self::SlidingExponential { per_m_s } => (per_m_s * sliding).exp(),
            Self::VehicleLinear {
                per_m_s,
                mean_vehicle_speed_m_s,
            } => T::ONE + per_m_s * (v - mean_vehicle_speed_m_s),
            Self::VehicleExponential {
                per_m_s,
                mean_vehicle_speed_m_s,
            } => (per_m_s * (v - mean_vehicle_speed_m_s)).exp(),
            Self::SlidingWithFloor {
                floor,
                speed_scale_m_s,
            } => floor + (T::ONE - floor) * (-(sliding / speed_scale_m_s)).exp(),
        }
    }
}

impl<T: Real> Relaxation<T> {
    pub(super) fn check(&self) -> Checked {
        let (Self::Slip { length_m } | Self::Force { length_m }) = *self;
        demand(not_negative(length_m), Parameter::RelaxationLength)
    }
}

impl<T: Real> ThermalFade<T> {
    pub(super) fn check(&self) -> Checked {
        demand(
            self.sensitivity_per_s.is_finite()
                && self.curvature_per_s2.is_finite()
                && positive(self.time_constant_s)
                && positive(self.reference_power_w),
            Parameter::ThermalFade,
        )
    }

    /// Factor on friction at a temperature surrogate in s; at most e².
    #[inline]
    pub(super) fn factor(&self, temperature_s: T) -> T {
        let theta = temperature_s;
        let exponent = -(self.sensitivity_per_s + self.curvature_per_s2 * theta) * theta;
        exponent.min(T::TWO).exp()
    }

    /// The temperature surrogate in s after `dt_s` of a power in W.
    #[inline]
    pub(super) fn warmed(&self, temperature_s: T, power_w: T, dt_s: T) -> T {
        let settled = self.time_constant_s * power_w / self.reference_power_w;
        let stay = (-dt_s / self.time_constant_s).exp();
        settled + (temperature_s - settled) * stay
    }
}

impl<T: Real> ForceDelay<T> {
    pub(super) fn check(&self) -> Checked {
        demand(not_negative(self.delay_s), Parameter::Delay)?;
        demand(positive(self.sampling_step_s), Parameter::SamplingStep)
    }
}

impl<T: Real> ForceLag<T> {
    pub(super) fn check(&self) -> Checked {
        demand(
            not_negative(self.time_constant_s),
            Parameter::LagTimeConstant,
        )
    }
}
