//! A diagnosed model as a controller's parameters.

use muslip_analysis::estimate::ModelUse;
use muslip_compensate::{EffectiveRadius, Relaxation, SpeedSensitivity};
use muslip_diagnose::repaired::Repaired;
use muslip_record::{
    CompensationParameters, LoadCompensation, RadiusCompensation, RelaxationCompensation,
    SAMPLE_RATE_HZ, SpeedCompensation, ThermalCompensation,
};

/// A model as a controller uses it.
pub struct Live {
    used: ModelUse,
    /// Radius in m that the model's relative errors refer to.
    radius_m: f64,
}

impl Live {
    /// Sorts a model's mechanisms into what a controller can compensate and what it cannot.
    pub fn new(model: &Repaired) -> Self {
        Self {
            used: ModelUse::on_a_rig(model, 1.0 / f64::from(SAMPLE_RATE_HZ)),
            radius_m: model.rig.radius_m,
        }
    }

    /// What becomes of each mechanism, a line each.
    pub fn in_words(&self) -> Vec<String> {
        let compensated = self
            .used
            .compensated()
            .map(|mechanism| format!("compensated: {}", mechanism.name()));
        let left = self
            .used
            .not_compensated()
            .map(|(mechanism, reason)| format!("not compensated: {}: {reason}", mechanism.name()));
        compensated.chain(left).collect()
    }

    /// The parameters, for a rig whose radius in m need not be the one that the model was made with.
    pub fn parameters(&self, effective_radius_m: f32) -> CompensationParameters {
        let effects = &self.used.compensation;
        let ratio = self.radius_m / f64::from(effective_radius_m);
        CompensationParameters {
            effective_radius: effects
                .effective_radius
                .map(|effect| radius(&effect, ratio)),
            force_delay_s: effects.force_delay.map(|effect| effect.delay_s as f32),
            force_lag_s: effects
                .force_lag
                .map(|effect| effect.time_constant_s as f32),
            load_crosstalk: effects.load_crosstalk.map(|effect| effect.share as f32),
            load_sensitivity: effects.load_sensitivity.map(|effect| LoadCompensation {
                sensitivity: effect.sensitivity as f32,
                critical_slip_exponent: effect.critical_slip_exponent as f32,
                mean_normal_force_n: effect.mean_normal_force_n as f32,
            }),
            speed_sensitivity: effects.speed_sensitivity.map(|effect| speed(&effect)),
            relaxation: effects.relaxation.map(|effect| match effect {
                Relaxation::Slip { length_m } => RelaxationCompensation::Slip {
                    length_m: length_m as f32,
                },
                Relaxation::Force { length_m } => RelaxationCompensation::Force {
                    length_m: length_m as f32,
                },
            }),
            thermal_fade: effects.thermal_fade.map(|effect| ThermalCompensation {
                sensitivity_per_s: effect.sensitivity_per_s as f32,
                curvature_per_s2: effect.curvature_per_s2 as f32,
                time_constant_s: effect.time_constant_s as f32,
                reference_power_w: effect.reference_power_w as f32,
            }),
        }
    }
}

/// R (1 + e) is what was found, whatever either side declares as R.
fn radius(effect: &EffectiveRadius<f64>, ratio: f64) -> RadiusCompensation {
    let error = |e: f64| (ratio * (1.0 + e) - 1.0) as f32;
    match *effect {
        EffectiveRadius::Constant { relative_error } => RadiusCompensation::Constant {
            relative_error: error(relative_error),
        },
        EffectiveRadius::WithLoad {
            relative_error,
            per_relative_load,
            mean_normal_force_n,
        } => RadiusCompensation::WithLoad {
            relative_error: error(relative_error),
            per_relative_load: (ratio * per_relative_load) as f32,
            mean_normal_force_n: mean_normal_force_n as f32,
        },
        EffectiveRadius::WithSpeed {
            relative_error,
            per_relative_speed_squared,
            mean_vehicle_speed_m_s,
        } => RadiusCompensation::WithSpeed {
            relative_error: error(relative_error),
            per_relative_speed_squared: (ratio * per_relative_speed_squared) as f32,
            mean_vehicle_speed_m_s: mean_vehicle_speed_m_s as f32,
        },
    }
}

fn speed(effect: &SpeedSensitivity<f64>) -> SpeedCompensation {
    match *effect {
        SpeedSensitivity::SlidingLinear { per_m_s } => SpeedCompensation::SlidingLinear {
            per_m_s: per_m_s as f32,
        },
        SpeedSensitivity::SlidingExponential { per_m_s } => SpeedCompensation::SlidingExponential {
            per_m_s: per_m_s as f32,
        },
        SpeedSensitivity::VehicleLinear {
            per_m_s,
            mean_vehicle_speed_m_s,
        } => SpeedCompensation::VehicleLinear {
            per_m_s: per_m_s as f32,
            mean_vehicle_speed_m_s: mean_vehicle_speed_m_s as f32,
        },
        SpeedSensitivity::VehicleExponential {
            per_m_s,
            mean_vehicle_speed_m_s,
        } => SpeedCompensation::VehicleExponential {
            per_m_s: per_m_s as f32,
            mean_vehicle_speed_m_s: mean_vehicle_speed_m_s as f32,
        },
        SpeedSensitivity::SlidingWithFloor {
            floor,
            speed_scale_m_s,
        } => SpeedCompensation::SlidingWithFloor {
            floor: floor as f32,
            speed_scale_m_s: speed_scale_m_s as f32,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_radius_found_is_the_same_length_on_a_rig_that_declares_another() {
        let found_m = 0.31 * 1.02;
        for declared_m in [0.31, 0.3] {
            let effect = EffectiveRadius::Constant {
                relative_error: 0.02,
            };
            let RadiusCompensation::Constant { relative_error } =
                radius(&effect, 0.31 / declared_m)
            else {
                panic!("another form");
            };
            let there_m = declared_m * (1.0 + f64::from(relative_error));
            assert!((there_m - found_m).abs() < 1e-7, "{there_m}");
        }
    }
}
