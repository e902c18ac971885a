//! A diagnosed model as parameters, and as the compensator that stands before the estimator.

use muslip_compensate::{
    Compensation, CompensationError, Compensator, EffectiveRadius, ForceDelay, ForceLag,
    LoadCrosstalk, LoadSensitivity, Parameter, Relaxation, SpeedSensitivity, ThermalFade,
};
use muslip_record::{
    CompensationParameters, RadiusCompensation, RelaxationCompensation, SAMPLE_RATE_HZ,
    SpeedCompensation,
};

use crate::rates::Rates;

/// Longest delay of the drag channel in s that can be compensated.
pub const MAXIMUM_DELAY_S: f32 = 0.06;

/// Samples that the delay line holds: the longest delay at the fastest sampling, both its ends, and two for rounding.
const LINE_SAMPLES: usize = 64;

/// The sampling at which most of that line is used: what fits then fits every board.
const FASTEST: Rates = Rates::new(SAMPLE_RATE_HZ, 84_000_000);

/// The compensator of a controller.
pub type RigCompensator = Compensator<f32, LINE_SAMPLES>;

/// Which are compensated, bit by bit in the order of the type's fields.
pub fn compensated(p: &CompensationParameters) -> u8 {
    let present = [
        p.effective_radius.is_some(),
        p.force_delay_s.is_some(),
        p.force_lag_s.is_some(),
        p.load_crosstalk.is_some(),
        p.load_sensitivity.is_some(),
        p.speed_sensitivity.is_some(),
        p.relaxation.is_some(),
        p.thermal_fade.is_some(),
    ];
    present
        .iter()
        .rev()
        .fold(0, |bits, &present| bits << 1 | u8::from(present))
}

/// Whether a reading is behind a low-pass filter: it is then not the law at its slip.
pub fn filters_force(p: &CompensationParameters) -> bool {
    p.force_lag_s.is_some() || matches!(p.relaxation, Some(RelaxationCompensation::Force { .. }))
}

/// The first effect whose parameters are outside their ranges, counted from 0 in the order of the type's fields.
///
/// # Errors
/// That number.
pub fn check(p: &CompensationParameters, effective_radius_m: f32) -> Result<(), u8> {
    let delays = 0.0..=MAXIMUM_DELAY_S;
    let delay_fits = p.force_delay_s.is_none_or(|delay| delays.contains(&delay));
    let fits = effects(p, FASTEST.sample_s()).fits::<LINE_SAMPLES>(effective_radius_m);
    match fits.map_err(number) {
        Ok(()) if delay_fits => Ok(()),
        Ok(()) => Err(1),
        Err(number) if delay_fits => Err(number),
        Err(number) => Err(number.min(1)),
    }
}

fn number(error: CompensationError) -> u8 {
    match error {
        CompensationError::OutOfRange(parameter) => match parameter {
            Parameter::LagTimeConstant => 2,
            Parameter::CrosstalkShare => 3,
            Parameter::LoadSensitivity => 4,
            Parameter::SpeedSensitivity => 5,
            Parameter::RelaxationLength => 6,
            Parameter::ThermalFade => 7,
            Parameter::Delay | Parameter::SamplingStep => 1,
            _ => 0,
        },
        _ => 1,
    }
}

/// As `muslip-compensate` takes it, on samples so many seconds apart.
pub fn effects(p: &CompensationParameters, sample_s: f32) -> Compensation<f32> {
    Compensation {
        effective_radius: p.effective_radius.map(radius),
        force_delay: p.force_delay_s.map(|delay_s| ForceDelay {
            delay_s,
            sampling_step_s: sample_s,
        }),
        force_lag: p
            .force_lag_s
            .map(|time_constant_s| ForceLag { time_constant_s }),
        load_crosstalk: p.load_crosstalk.map(|share| LoadCrosstalk { share }),
        load_sensitivity: p.load_sensitivity.map(|load| LoadSensitivity {
            sensitivity: load.sensitivity,
            critical_slip_exponent: load.critical_slip_exponent,
            mean_normal_force_n: load.mean_normal_force_n,
        }),
        speed_sensitivity: p.speed_sensitivity.map(speed),
        relaxation: p.relaxation.map(|relaxation| match relaxation {
            RelaxationCompensation::Slip { length_m } => Relaxation::Slip { length_m },
            RelaxationCompensation::Force { length_m } => Relaxation::Force { length_m },
        }),
        thermal_fade: p.thermal_fade.map(|heat| ThermalFade {
            sensitivity_per_s: heat.sensitivity_per_s,
            curvature_per_s2: heat.curvature_per_s2,
            time_constant_s: heat.time_constant_s,
            reference_power_w: heat.reference_power_w,
        }),
        ..Compensation::none()
    }
}

fn radius(radius: RadiusCompensation) -> EffectiveRadius<f32> {
    match radius {
        RadiusCompensation::Constant { relative_error } => {
            EffectiveRadius::Constant { relative_error }
        }
        RadiusCompensation::WithLoad {
            relative_error,
            per_relative_load,
            mean_normal_force_n,
        } => EffectiveRadius::WithLoad {
            relative_error,
            per_relative_load,
            mean_normal_force_n,
        },
        RadiusCompensation::WithSpeed {
            relative_error,
            per_relative_speed_squared,
            mean_vehicle_speed_m_s,
        } => EffectiveRadius::WithSpeed {
            relative_error,
            per_relative_speed_squared,
            mean_vehicle_speed_m_s,
        },
    }
}

fn speed(speed: SpeedCompensation) -> SpeedSensitivity<f32> {
    match speed {
        SpeedCompensation::SlidingLinear { per_m_s } => SpeedSensitivity::SlidingLinear { per_m_s },
        SpeedCompensation::SlidingExponential { per_m_s } => {
            SpeedSensitivity::SlidingExponential { per_m_s }
        }
        SpeedCompensation::VehicleLinear {
            per_m_s,
            mean_vehicle_speed_m_s,
        } => SpeedSensitivity::VehicleLinear {
            per_m_s,
            mean_vehicle_speed_m_s,
        },
        SpeedCompensation::VehicleExponential {
            per_m_s,
            mean_vehicle_speed_m_s,
        } => SpeedSensitivity::VehicleExponential {
            per_m_s,
            mean_vehicle_speed_m_s,
        },
        SpeedCompensation::SlidingWithFloor {
            floor,
            speed_scale_m_s,
        } => SpeedSensitivity::SlidingWithFloor {
            floor,
            speed_scale_m_s,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use muslip_record::{LoadCompensation, ThermalCompensation};

    type Set = fn(&mut CompensationParameters, f32);

    #[test]
    fn each_effect_out_of_its_range_is_told_by_its_number_and_has_its_bit() {
        let effects: [(Set, f32, f32); 8] = [
            (
                |p, v| {
                    p.effective_radius = Some(RadiusCompensation::Constant { relative_error: v });
                },
                0.02,
                0.6,
            ),
            (|p, v| p.force_delay_s = Some(v), MAXIMUM_DELAY_S, 0.061),
            (|p, v| p.force_lag_s = Some(v), 0.01, -0.01),
            (|p, v| p.load_crosstalk = Some(v), -0.03, 1.1),
            (
                |p, v| {
                    p.load_sensitivity = Some(LoadCompensation {
                        sensitivity: 0.1,
                        critical_slip_exponent: 0.0,
                        mean_normal_force_n: v,
                    });
                },
                4000.0,
                0.0,
            ),
            (
                |p, v| {
                    p.speed_sensitivity = Some(SpeedCompensation::SlidingWithFloor {
                        floor: 0.8,
                        speed_scale_m_s: v,
                    });
                },
                5.0,
                0.0,
            ),
            (
                |p, v| p.relaxation = Some(RelaxationCompensation::Slip { length_m: v }),
                0.3,
                -0.3,
            ),
            (
                |p, v| {
                    p.thermal_fade = Some(ThermalCompensation {
                        sensitivity_per_s: 0.1,
                        curvature_per_s2: 0.0,
                        time_constant_s: v,
                        reference_power_w: 1e4,
                    });
                },
                8.0,
                0.0,
            ),
        ];
        for (number, (set, good, bad)) in (0_u8..).zip(effects) {
            let mut p = CompensationParameters::default();
            set(&mut p, good);
            assert_eq!(check(&p, 0.31), Ok(()), "{number}");
            assert_eq!(compensated(&p), 1 << number);
            assert_eq!(filters_force(&p), number == 2);
            for value in [bad, f32::NAN, f32::INFINITY] {
                set(&mut p, value);
                assert_eq!(check(&p, 0.31), Err(number), "{number} {value}");
            }
        }
        assert_eq!(compensated(&CompensationParameters::default()), 0);
    }
}
