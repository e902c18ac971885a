//! What the engine is given: the rig as its file describes it, and the recorded runs.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The rig and the base simulation's starting values, as declared by the user.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rig {
    /// Free-rolling radius in m: slip = (v − radius·ω)/v.
    pub radius_m: f64,
    /// Polar inertia of the wheel in kg m².
    pub wheel_inertia_kg_m2: f64,
    /// Translating mass in kg that the braked tyre slows.
    pub mass_kg: f64,
    /// Whether only the tyre's drag slows the vehicle, so that m dv/dt = −drag is expected.
    pub coasting: bool,
    /// Brake torque per pressure in N m/Pa, where declared.
    pub torque_per_pressure_nm_pa: Option<f64>,
    /// Starting value of the peak friction.
    pub peak_friction: f64,
    /// Starting value of the slip at the peak.
    pub critical_slip: f64,
    /// Whether the law's two parameters must stay at their starting values.
    pub law_fixed: bool,
    /// Declared 1-sigma noise by column name: a hint, possibly wrong.
    pub declared_noise: BTreeMap<String, f64>,
}

/// How a channel that was measured at other times was brought onto the recording's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum How {
    /// On straight lines between its readings.
    Interpolated,
    /// By its last reading.
    Held,
    /// Low-passed without delay, then read off.
    Decimated {
        /// Edge of the low-pass in Hz.
        edge_hz: f64,
    },
}

/// A channel that was measured at other times than the recording's.
#[derive(Clone, Debug, PartialEq)]
pub struct Resampled {
    /// Header of its column.
    pub column: String,
    /// Its own sampling interval in s.
    pub interval_s: f64,
    /// How it was brought onto the recording's times.
    pub how: How,
}

impl Resampled {
    /// Whether most of its values in the recording are no readings of their own.
    #[must_use]
    pub fn is_coarse(&self) -> bool {
        !matches!(self.how, How::Decimated { .. })
    }
}

/// One recording. A missing value is `NaN`; all columns have the length of `time_s`.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// Name shown in the results (the file's path as given).
    pub name: String,
    /// Time in s, strictly increasing.
    pub time_s: Vec<f64>,
    /// Wheel speed in rad/s.
    pub wheel_speed_rad_s: Vec<f64>,
    /// Vehicle speed in m/s.
    pub vehicle_speed_m_s: Vec<f64>,
    /// Drag in N; empty when only a prediction is wanted.
    pub drag_force_n: Vec<f64>,
    /// Normal force in N.
    pub normal_force_n: Vec<f64>,
    /// Measured brake torque in N m, where recorded.
    pub brake_torque_nm: Option<Vec<f64>>,
    /// Brake pressure in Pa, where recorded.
    pub brake_pressure_pa: Option<Vec<f64>>,
    /// Every other numeric column: a candidate to explain a mismatch.
    pub extra: Vec<(String, Vec<f64>)>,
    /// Channels that were measured at other times than `time_s`.
    pub resampled: Vec<Resampled>,
}

impl Run {
    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// The run without the samples that are not kept.
    #[must_use]
    pub fn only(self, kept: &[bool]) -> Self {
        let pick = |x: Vec<f64>| -> Vec<f64> {
            let kept = x.into_iter().zip(kept).filter(|(_, kept)| **kept);
            kept.map(|(x, _)| x).collect()
        };
        Self {
            name: self.name,
            time_s: pick(self.time_s),
            wheel_speed_rad_s: pick(self.wheel_speed_rad_s),
            vehicle_speed_m_s: pick(self.vehicle_speed_m_s),
            drag_force_n: pick(self.drag_force_n),
            normal_force_n: pick(self.normal_force_n),
            brake_torque_nm: self.brake_torque_nm.map(pick),
            brake_pressure_pa: self.brake_pressure_pa.map(pick),
            extra: self
                .extra
                .into_iter()
                .map(|(name, x)| (name, pick(x)))
                .collect(),
            resampled: self.resampled,
        }
    }

    /// The run with means over so many samples each; what is missing or no number is left out of them.
    #[must_use]
    pub fn averaged(self, samples: usize) -> Self {
        if samples <= 1 {
            return self;
        }
        let mean = |x: &Vec<f64>| -> Vec<f64> {
            x.chunks_exact(samples)
                .map(|c| {
                    let usable = || c.iter().filter(|v| v.abs() < 1e15);
                    usable().sum::<f64>() / usable().count() as f64
                })
                .collect()
        };
        Self {
            time_s: mean(&self.time_s),
            wheel_speed_rad_s: mean(&self.wheel_speed_rad_s),
            vehicle_speed_m_s: mean(&self.vehicle_speed_m_s),
            drag_force_n: mean(&self.drag_force_n),
            normal_force_n: mean(&self.normal_force_n),
            brake_torque_nm: self.brake_torque_nm.as_ref().map(mean),
            brake_pressure_pa: self.brake_pressure_pa.as_ref().map(mean),
            extra: self
                .extra
                .into_iter()
                .map(|(name, x)| (name, mean(&x)))
                .collect(),
            resampled: self.resampled,
            name: self.name,
        }
    }

    /// Whether the run has no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }
}
