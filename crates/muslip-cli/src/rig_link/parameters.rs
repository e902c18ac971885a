//! A controller's parameters as a file.

use std::path::Path;

use muslip_record::{CompensationParameters, Parameters};
use muslip_recordings::input_error::{InputError, InputProblem, one_line, system_reason};

/// Names of the parameters in the order in which the controller counts them.
const NAMES: [&str; 41] = [
    "wheel.effective_radius_m",
    "wheel.inertia_kg_m2",
    "wheel.vehicle_mass_kg",
    "wheel_encoder.pulses_per_revolution",
    "wheel_encoder.reversed",
    "vehicle_encoder.pulses_per_revolution",
    "vehicle_encoder.reversed",
    "vehicle_encoder_radius_m",
    "drag.newton_per_code",
    "drag.zero_code",
    "normal.newton_per_code",
    "normal.zero_code",
    "brake.duty_at_zero",
    "brake.duty_at_full",
    "brake.torque_at_full_nm",
    "limits.maximum_vehicle_speed_m_s",
    "limits.maximum_wheel_speed_rad_s",
    "limits.minimum_normal_force_n",
    "limits.maximum_force_n",
    "limits.minimum_supply_v",
    "estimator.tyre_range",
    "estimator.friction_std",
    "estimator.noise_inflation",
    "estimator.skid_slip_minimum",
    "estimator.skid_slip_maximum",
    "slip_control.bandwidth_rad_s",
    "slip_control.integral_time_s",
    "slip_control.maximum_torque_rate_nm_s",
    "brake_heat.maximum_energy_j",
    "brake_heat.cooling_time_s",
    "pressure.volt_at_zero",
    "pressure.volt_at_full",
    "pressure.response_s",
    "compensation.effective_radius",
    "compensation.force_delay_s",
    "compensation.force_lag_s",
    "compensation.load_crosstalk",
    "compensation.load_sensitivity",
    "compensation.speed_sensitivity",
    "compensation.relaxation",
    "compensation.thermal_fade",
];

/// What can be compensated, in the order of its bits.
pub fn compensated(bits: u8) -> impl Iterator<Item = &'static str> {
    let names = NAMES
        .iter()
        .filter_map(|name| name.strip_prefix("compensation."));
    names
        .enumerate()
        .filter(move |(at, _)| bits & 1 << at != 0)
        .map(|(_, name)| name.trim_end_matches("_s"))
}

/// The name of the parameter that a controller refused by its number.
pub fn field_name(index: u8) -> &'static str {
    NAMES
        .get(usize::from(index))
        .copied()
        .unwrap_or("a parameter")
}

/// Reads parameters from a TOML file with every one of them; compensation only where there is some.
///
/// # Errors
/// [`InputError`]: the file is missing, is not TOML, or lacks a parameter.
pub fn parse_parameters(path: &Path) -> Result<Parameters, InputError> {
    let fail = |problem| InputError::whole_file(path, problem);
    let text = std::fs::read_to_string(path)
        .map_err(|error| fail(InputProblem::Unreadable(system_reason(&error))))?;
    toml::from_str(&text)
        .map_err(|error: toml::de::Error| fail(InputProblem::Toml(one_line(error.message()))))
}

/// Parameters as the text of such a file.
///
/// # Errors
/// A number that TOML cannot hold.
pub fn write_parameters(parameters: &Parameters) -> Result<String, toml::ser::Error> {
    toml::to_string(&TopLevelFirst::from(parameters))
}

/// TOML wants plain values before tables.
#[derive(serde::Serialize)]
struct TopLevelFirst {
    vehicle_encoder_radius_m: f32,
    wheel: muslip_record::WheelParameters,
    wheel_encoder: muslip_record::EncoderParameters,
    vehicle_encoder: muslip_record::EncoderParameters,
    drag: muslip_record::ForceParameters,
    normal: muslip_record::ForceParameters,
    brake: muslip_record::BrakeParameters,
    limits: muslip_record::LimitParameters,
    estimator: muslip_record::EstimatorParameters,
    slip_control: muslip_record::SlipControlParameters,
    brake_heat: muslip_record::HeatParameters,
    pressure: muslip_record::PressureParameters,
    #[serde(skip_serializing_if = "is_empty")]
    compensation: CompensationParameters,
}

fn is_empty(compensation: &CompensationParameters) -> bool {
    *compensation == CompensationParameters::default()
}

impl From<&Parameters> for TopLevelFirst {
    fn from(p: &Parameters) -> Self {
        Self {
            vehicle_encoder_radius_m: p.vehicle_encoder_radius_m,
            wheel: p.wheel,
            wheel_encoder: p.wheel_encoder,
            vehicle_encoder: p.vehicle_encoder,
            drag: p.drag,
            normal: p.normal,
            brake: p.brake,
            limits: p.limits,
            estimator: p.estimator,
            slip_control: p.slip_control,
            brake_heat: p.brake_heat,
            pressure: p.pressure,
            compensation: p.compensation,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_survive_their_file_and_a_file_that_lacks_one_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("parameters.toml");
        let text = write_parameters(&Parameters::default()).unwrap();
        std::fs::write(&path, &text).unwrap();
        assert_eq!(parse_parameters(&path).unwrap(), Parameters::default());
        let lacking = text.replace("zero_code", "zero");
        std::fs::write(&path, lacking).unwrap();
        let told = parse_parameters(&path).unwrap_err().to_string();
        assert!(told.contains("zero_code") && !told.contains('\n'), "{told}");
    }

    /// Everything compensated.
    fn full() -> Parameters {
        use muslip_record::{
            LoadCompensation, RadiusCompensation, RelaxationCompensation, SpeedCompensation,
            ThermalCompensation,
        };
        Parameters {
            compensation: CompensationParameters {
                effective_radius: Some(RadiusCompensation::WithLoad {
                    relative_error: 0.02,
                    per_relative_load: 0.01,
                    mean_normal_force_n: 4000.0,
                }),
                force_delay_s: Some(0.004),
                force_lag_s: Some(0.01),
                load_crosstalk: Some(0.03),
                load_sensitivity: Some(LoadCompensation {
                    sensitivity: 0.1,
                    critical_slip_exponent: 0.2,
                    mean_normal_force_n: 4000.0,
                }),
                speed_sensitivity: Some(SpeedCompensation::SlidingLinear { per_m_s: -0.01 }),
                relaxation: Some(RelaxationCompensation::Slip { length_m: 0.3 }),
                thermal_fade: Some(ThermalCompensation {
                    sensitivity_per_s: 0.1,
                    curvature_per_s2: 0.0,
                    time_constant_s: 8.0,
                    reference_power_w: 1e4,
                }),
            },
            ..Parameters::default()
        }
    }

    #[test]
    fn what_is_compensated_survives_the_file_and_a_file_of_before_compensates_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("parameters.toml");
        std::fs::write(&path, write_parameters(&full()).unwrap()).unwrap();
        assert_eq!(parse_parameters(&path).unwrap(), full());
        let before = write_parameters(&Parameters::default()).unwrap();
        assert!(!before.contains("compensation"), "{before}");
        assert_eq!(
            compensated(0b1000_0011).collect::<Vec<_>>(),
            ["effective_radius", "force_delay", "thermal_fade"]
        );
    }

    #[test]
    fn every_parameter_of_the_file_has_its_name_and_number() {
        let value: toml::Value = toml::from_str(&write_parameters(&full()).unwrap()).unwrap();
        let mut found = Vec::new();
        for (name, value) in value.as_table().unwrap() {
            match value.as_table() {
                Some(table) => found.extend(table.keys().map(|key| format!("{name}.{key}"))),
                None => found.push(name.clone()),
            }
        }
        found.sort();
        let mut names = NAMES.map(str::to_owned).to_vec();
        names.sort();
        assert_eq!(found, names);
        assert_eq!(field_name(21), "estimator.friction_std");
    }
}
