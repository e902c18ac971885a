//! What a diagnosis found to distort the samples, as a controller compensates it.

use serde::{Deserialize, Serialize};

/// Distortions to compensate before the estimator, each with its parameters; equations: the crate `muslip-compensate`.
///
/// They change what the estimate is made of, and nothing that an interlock or the state machine looks at.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct CompensationParameters {
    /// Another rolling radius than the wheel's.
    pub effective_radius: Option<RadiusCompensation>,
    /// The drag channel reports late by this in s, 0..=0.06.
    pub force_delay_s: Option<f32>,
    /// The drag channel is a low-pass filter of this time constant in s, ≥ 0.
    pub force_lag_s: Option<f32>,
    /// Share of the normal force in the drag reading, within ±1.
    pub load_crosstalk: Option<f32>,
    /// Friction changes with normal force.
    pub load_sensitivity: Option<LoadCompensation>,
    /// Friction changes with speed.
    pub speed_sensitivity: Option<SpeedCompensation>,
    /// Force builds up over a distance.
    pub relaxation: Option<RelaxationCompensation>,
    /// Friction changes with tread temperature.
    pub thermal_fade: Option<ThermalCompensation>,
}

/// Rolling radius over that of [`WheelParameters`](crate::WheelParameters), less one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RadiusCompensation {
    /// The same throughout.
    Constant {
        /// Within ±0.5.
        relative_error: f32,
    },
    /// relative_error + per_relative_load (Fz/mean - 1).
    WithLoad {
        /// Within ±0.5.
        relative_error: f32,
        /// Within ±0.5.
        per_relative_load: f32,
        /// In N, > 0.
        mean_normal_force_n: f32,
    },
    /// relative_error + per_relative_speed_squared ((v/mean)² - 1).
    WithSpeed {
        /// Within ±0.5.
        relative_error: f32,
        /// Within ±0.5.
        per_relative_speed_squared: f32,
        /// In m/s, > 0.
        mean_vehicle_speed_m_s: f32,
    },
}

/// Peak friction and slip at the peak times powers of Fz/mean.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LoadCompensation {
    /// Minus the exponent of the peak friction, within ±4.
    pub sensitivity: f32,
    /// Exponent of the slip at the peak, within ±4.
    pub critical_slip_exponent: f32,
    /// In N, > 0.
    pub mean_normal_force_n: f32,
}

/// A factor on friction by sliding speed |s v| or vehicle speed v.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SpeedCompensation {
    /// 1 + k |s v|.
    SlidingLinear {
        /// k in s/m.
        per_m_s: f32,
    },
    /// e^(k |s v|).
    SlidingExponential {
        /// k in s/m.
        per_m_s: f32,
    },
    /// 1 + k (v - mean).
    VehicleLinear {
        /// k in s/m.
        per_m_s: f32,
        /// In m/s.
        mean_vehicle_speed_m_s: f32,
    },
    /// e^(k (v - mean)).
    VehicleExponential {
        /// k in s/m.
        per_m_s: f32,
        /// In m/s.
        mean_vehicle_speed_m_s: f32,
    },
    /// floor + (1 - floor) e^(-|s v|/scale).
    SlidingWithFloor {
        /// Factor at high sliding speed, ≥ 0.
        floor: f32,
        /// In m/s, > 0.
        speed_scale_m_s: f32,
    },
}

/// Slip or force that follows over a rolling distance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RelaxationCompensation {
    /// The slip that the tyre feels.
    Slip {
        /// In m, ≥ 0.
        length_m: f32,
    },
    /// The force in the contact.
    Force {
        /// In m, ≥ 0.
        length_m: f32,
    },
}

/// A factor on friction by the temperature of the tread, which friction power warms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ThermalCompensation {
    /// In 1/s.
    pub sensitivity_per_s: f32,
    /// In 1/s².
    pub curvature_per_s2: f32,
    /// Of the cooling, in s, > 0.
    pub time_constant_s: f32,
    /// The power that warms the surrogate by 1 s a second, in W, > 0.
    pub reference_power_w: f32,
}

/// Which estimator runs, and on what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Estimating {
    /// The estimator.
    pub estimator: Estimator,
    /// What is compensated, bit by bit in the order of [`CompensationParameters`].
    pub compensated: u8,
}

/// A two-state estimator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Estimator {
    /// The efficient one.
    #[default]
    Efficient,
    /// The article's filter: where a low-pass filter on the force is compensated, behind which the efficient one does
    /// not stand.
    Article,
}
