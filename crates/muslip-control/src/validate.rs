//! Parameters and profiles are checked as a whole before any of them is taken.

use muslip_record::{Parameters, Profile, Program};

use crate::ceiling;
use crate::compensation;
use crate::interlock::{LOCK_SPEED_M_S, wheel_change_rad_s2};

/// The first field outside its range, in the order of the type's fields counted from 0.
///
/// # Errors
/// That number.
pub fn parameters(p: &Parameters) -> Result<(), u8> {
    let pulses = |pulses: u16| (1..=10_000).contains(&pulses);
    let scale = |scale: f32| ceiling::NEWTON_PER_CODE.allows(scale.abs());
    let code = |code: i32| code.unsigned_abs() < 1 << 23;
    let checks = [
        ceiling::EFFECTIVE_RADIUS_M.allows(p.wheel.effective_radius_m),
        ceiling::INERTIA_KG_M2.allows(p.wheel.inertia_kg_m2),
        ceiling::VEHICLE_MASS_KG.allows(p.wheel.vehicle_mass_kg),
        pulses(p.wheel_encoder.pulses_per_revolution),
        true,
        pulses(p.vehicle_encoder.pulses_per_revolution),
        true,
        ceiling::VEHICLE_ENCODER_RADIUS_M.allows(p.vehicle_encoder_radius_m),
        scale(p.drag.newton_per_code),
        code(p.drag.zero_code),
        scale(p.normal.newton_per_code),
        code(p.normal.zero_code),
        p.brake.duty_at_zero >= 0.0,
        p.brake.duty_at_full > p.brake.duty_at_zero && p.brake.duty_at_full <= 1.0,
        ceiling::TORQUE_AT_FULL_NM.allows(p.brake.torque_at_full_nm),
        ceiling::MAXIMUM_VEHICLE_SPEED_M_S.allows(p.limits.maximum_vehicle_speed_m_s),
        ceiling::MAXIMUM_WHEEL_SPEED_RAD_S.allows(p.limits.maximum_wheel_speed_rad_s),
        ceiling::MINIMUM_NORMAL_FORCE_N.allows(p.limits.minimum_normal_force_n),
        ceiling::MAXIMUM_FORCE_N.allows(p.limits.maximum_force_n)
            && p.limits.maximum_force_n > p.limits.minimum_normal_force_n
            && ceiling::WHEEL_CHANGE_RAD_S2.allows(wheel_change_rad_s2(p)),
        ceiling::MINIMUM_SUPPLY_V.allows(p.limits.minimum_supply_v),
        true,
        ceiling::FRICTION_STD.allows(p.estimator.friction_std),
        ceiling::NOISE_INFLATION.allows(p.estimator.noise_inflation),
        p.estimator.skid_slip_minimum >= 0.0,
        p.estimator.skid_slip_maximum > p.estimator.skid_slip_minimum
            && p.estimator.skid_slip_maximum <= 1.05,
        ceiling::BANDWIDTH_RAD_S.allows(p.slip_control.bandwidth_rad_s),
        ceiling::INTEGRAL_TIME_S.allows(p.slip_control.integral_time_s),
        ceiling::TORQUE_RATE_NM_S.allows(p.slip_control.maximum_torque_rate_nm_s),
        ceiling::BRAKE_ENERGY_J.allows(p.brake_heat.maximum_energy_j),
        ceiling::COOLING_TIME_S.allows(p.brake_heat.cooling_time_s),
        ceiling::VOLT_AT_ZERO.allows(p.pressure.volt_at_zero),
        ceiling::VOLT_AT_FULL.allows(p.pressure.volt_at_full)
            && p.pressure.volt_at_full >= p.pressure.volt_at_zero + LEAST_PRESSURE_SPAN_V,
        ceiling::RESPONSE_S.allows(p.pressure.response_s),
    ];
    match (0..).zip(checks).find(|(_, good)| !good) {
        Some((number, _)) => Err(number),
        None => compensation::check(&p.compensation, p.wheel.effective_radius_m)
            .map_err(|number| COMPENSATION_FIELD + number),
    }
}

/// Number of the first effect that can be compensated among the parameters.
const COMPENSATION_FIELD: u8 = 33;

/// Least difference in V between the pressure transmitter's ends: with less its noise would be a pressure.
const LEAST_PRESSURE_SPAN_V: f32 = 0.5;

/// Whether every field of a profile is within its range.
pub fn profile(profile: &Profile) -> bool {
    let within = |value: f32, low: f32, high: f32| value >= low && value <= high;
    let program = match &profile.program {
        Program::Ramp { demand_per_s } => *demand_per_s > 0.0 && *demand_per_s <= 10.0,
        Program::Steps {
            levels,
            count,
            hold_s,
        } => {
            (1..=levels.len()).contains(&usize::from(*count))
                && within(*hold_s, 0.01, 60.0)
                && levels.iter().all(|&level| within(level, 0.0, 1.0))
        }
        Program::SlipHold {
            target_slip,
            hold_s,
        } => within(*target_slip, 0.01, 0.5) && within(*hold_s, 0.01, 60.0),
    };
    program
        && profile.start_speed_m_s > LOCK_SPEED_M_S
        && profile.start_speed_m_s.is_finite()
        && within(profile.skid_slip, 0.05, 1.0)
        && within(profile.skid_hold_s, 0.0, 0.15)
        && (1..=100).contains(&profile.applications)
        && within(profile.cool_s, 0.1, 600.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    type Set = fn(&mut Parameters, f32);

    fn with(set: Set, value: f32) -> Parameters {
        let mut changed = Parameters::default();
        set(&mut changed, value);
        changed
    }

    const GOOD: Profile = Profile {
        program: Program::Ramp { demand_per_s: 0.5 },
        start_speed_m_s: 20.0,
        skid_slip: 0.5,
        skid_hold_s: 0.05,
        applications: 1,
        cool_s: 1.0,
    };

    /// Nothing beyond either end of a range is taken.
    fn refused_beyond(ranges: &[(u8, ceiling::Ceiling, Set)]) {
        for &(field, range, set) in ranges {
            for value in [
                range.lowest * 0.99,
                range.highest * 1.01,
                0.0,
                1e30,
                f32::INFINITY,
                f32::NAN,
            ] {
                assert_eq!(
                    parameters(&with(set, value)),
                    Err(field),
                    "{} {value}",
                    range.parameter
                );
            }
        }
    }

    #[test]
    fn defaults_pass_and_the_first_bad_field_is_named() {
        let good = Parameters::default();
        assert_eq!(parameters(&good), Ok(()));
        let refused = |change: fn(&mut Parameters)| {
            let mut changed = Parameters::default();
            change(&mut changed);
            parameters(&changed)
        };
        assert_eq!(refused(|p| p.wheel.effective_radius_m = f32::NAN), Err(0));
        assert_eq!(
            refused(|p| p.wheel_encoder.pulses_per_revolution = 0),
            Err(3)
        );
        assert_eq!(refused(|p| p.normal.zero_code = i32::MIN), Err(11));
        assert_eq!(refused(|p| p.brake.duty_at_full = 0.05), Err(13));
        assert_eq!(refused(|p| p.limits.maximum_force_n = 1.0), Err(18));
        assert_eq!(refused(|p| p.estimator.friction_std = 0.0), Err(21));
        assert_eq!(
            refused(|p| p.slip_control.integral_time_s = f32::INFINITY),
            Err(26)
        );
    }

    #[test]
    fn no_limit_that_an_interlock_uses_can_be_set_so_that_it_never_fires() {
        let limits: [(u8, ceiling::Ceiling, Set); 16] = [
            (0, ceiling::EFFECTIVE_RADIUS_M, |p, v| {
                p.wheel.effective_radius_m = v;
            }),
            (1, ceiling::INERTIA_KG_M2, |p, v| p.wheel.inertia_kg_m2 = v),
            (7, ceiling::VEHICLE_ENCODER_RADIUS_M, |p, v| {
                p.vehicle_encoder_radius_m = v;
            }),
            (8, ceiling::NEWTON_PER_CODE, |p, v| {
                p.drag.newton_per_code = -v;
            }),
            (10, ceiling::NEWTON_PER_CODE, |p, v| {
                p.normal.newton_per_code = v;
            }),
            (14, ceiling::TORQUE_AT_FULL_NM, |p, v| {
                p.brake.torque_at_full_nm = v;
            }),
            (15, ceiling::MAXIMUM_VEHICLE_SPEED_M_S, |p, v| {
                p.limits.maximum_vehicle_speed_m_s = v;
            }),
            (16, ceiling::MAXIMUM_WHEEL_SPEED_RAD_S, |p, v| {
                p.limits.maximum_wheel_speed_rad_s = v;
            }),
            (17, ceiling::MINIMUM_NORMAL_FORCE_N, |p, v| {
                p.limits.minimum_normal_force_n = v;
            }),
            (18, ceiling::MAXIMUM_FORCE_N, |p, v| {
                p.limits.maximum_force_n = v;
            }),
            (19, ceiling::MINIMUM_SUPPLY_V, |p, v| {
                p.limits.minimum_supply_v = v;
            }),
            (28, ceiling::BRAKE_ENERGY_J, |p, v| {
                p.brake_heat.maximum_energy_j = v;
            }),
            (29, ceiling::COOLING_TIME_S, |p, v| {
                p.brake_heat.cooling_time_s = v;
            }),
            (30, ceiling::VOLT_AT_ZERO, |p, v| {
                p.pressure.volt_at_zero = v;
            }),
            (31, ceiling::VOLT_AT_FULL, |p, v| {
                p.pressure.volt_at_full = v;
            }),
            (32, ceiling::RESPONSE_S, |p, v| p.pressure.response_s = v),
        ];
        refused_beyond(&limits);
        // Each within its range, and together a wheel that stops in a millisecond.
        let mut together = Parameters::default();
        together.wheel.inertia_kg_m2 = 0.05;
        assert_eq!(parameters(&together), Err(18));
        // And a transmitter whose whole range is noise.
        let mut narrow = Parameters::default();
        (narrow.pressure.volt_at_zero, narrow.pressure.volt_at_full) = (0.9, 1.39);
        assert_eq!(parameters(&narrow), Err(31));
    }

    #[test]
    fn nothing_that_a_filter_or_the_slip_loop_reckons_with_can_be_set_so_that_it_cannot() {
        let ranges: [(u8, ceiling::Ceiling, Set); 6] = [
            (2, ceiling::VEHICLE_MASS_KG, |p, v| {
                p.wheel.vehicle_mass_kg = v;
            }),
            (21, ceiling::FRICTION_STD, |p, v| {
                p.estimator.friction_std = v;
            }),
            (22, ceiling::NOISE_INFLATION, |p, v| {
                p.estimator.noise_inflation = v;
            }),
            (25, ceiling::BANDWIDTH_RAD_S, |p, v| {
                p.slip_control.bandwidth_rad_s = v;
            }),
            (26, ceiling::INTEGRAL_TIME_S, |p, v| {
                p.slip_control.integral_time_s = v;
            }),
            (27, ceiling::TORQUE_RATE_NM_S, |p, v| {
                p.slip_control.maximum_torque_rate_nm_s = v;
            }),
        ];
        assert_eq!(ranges.len(), ceiling::RANGES.len());
        refused_beyond(&ranges);
        for (_, range, set) in ranges {
            for end in [range.lowest, range.highest] {
                assert_eq!(parameters(&with(set, end)), Ok(()), "{}", range.parameter);
            }
        }
    }

    #[test]
    fn an_effect_that_cannot_be_compensated_has_a_number_behind_all_others() {
        let mut bad = Parameters::default();
        bad.compensation.force_delay_s = Some(-1.0);
        assert_eq!(parameters(&bad), Err(34));
    }

    #[test]
    fn every_other_range_holds_at_its_end_and_not_beyond() {
        type Change = fn(&mut Parameters);
        let ends: [(u8, Change, Change); 15] = [
            (
                3,
                |p| p.wheel_encoder.pulses_per_revolution = 1,
                |p| p.wheel_encoder.pulses_per_revolution = 0,
            ),
            (
                3,
                |p| p.wheel_encoder.pulses_per_revolution = 10_000,
                |p| p.wheel_encoder.pulses_per_revolution = 10_001,
            ),
            (
                5,
                |p| p.vehicle_encoder.pulses_per_revolution = 1,
                |p| p.vehicle_encoder.pulses_per_revolution = 0,
            ),
            (
                5,
                |p| p.vehicle_encoder.pulses_per_revolution = 10_000,
                |p| p.vehicle_encoder.pulses_per_revolution = 10_001,
            ),
            (
                9,
                |p| p.drag.zero_code = (1 << 23) - 1,
                |p| p.drag.zero_code = 1 << 23,
            ),
            (
                9,
                |p| p.drag.zero_code = 1 - (1 << 23),
                |p| p.drag.zero_code = -(1 << 23),
            ),
            (
                11,
                |p| p.normal.zero_code = (1 << 23) - 1,
                |p| p.normal.zero_code = 1 << 23,
            ),
            (
                12,
                |p| p.brake.duty_at_zero = 0.0,
                |p| p.brake.duty_at_zero = -f32::MIN_POSITIVE,
            ),
            (
                13,
                |p| p.brake.duty_at_full = p.brake.duty_at_zero.next_up(),
                |p| p.brake.duty_at_full = p.brake.duty_at_zero,
            ),
            (
                13,
                |p| p.brake.duty_at_full = 1.0,
                |p| p.brake.duty_at_full = 1.0_f32.next_up(),
            ),
            (
                18,
                |p| p.limits.minimum_normal_force_n = p.limits.maximum_force_n.next_down(),
                |p| p.limits.minimum_normal_force_n = p.limits.maximum_force_n,
            ),
            (
                23,
                |p| p.estimator.skid_slip_minimum = 0.0,
                |p| p.estimator.skid_slip_minimum = -f32::MIN_POSITIVE,
            ),
            (
                24,
                |p| p.estimator.skid_slip_maximum = p.estimator.skid_slip_minimum.next_up(),
                |p| p.estimator.skid_slip_maximum = p.estimator.skid_slip_minimum,
            ),
            (
                24,
                |p| p.estimator.skid_slip_maximum = 1.05,
                |p| p.estimator.skid_slip_maximum = 1.05_f32.next_up(),
            ),
            (
                31,
                |p| (p.pressure.volt_at_zero, p.pressure.volt_at_full) = (0.5, 1.0),
                |p| (p.pressure.volt_at_zero, p.pressure.volt_at_full) = (0.5, 1.0_f32.next_down()),
            ),
        ];
        for (row, (field, end, beyond)) in ends.into_iter().enumerate() {
            let changed = |change: Change| {
                let mut changed = Parameters::default();
                change(&mut changed);
                parameters(&changed)
            };
            assert_eq!(changed(end), Ok(()), "row {row}");
            assert_eq!(changed(beyond), Err(field), "row {row}");
        }
    }

    #[test]
    fn every_range_of_a_profile_holds_at_its_ends_and_not_beyond() {
        let ramp = |demand_per_s| Program::Ramp { demand_per_s };
        let steps = |level: f32, count, hold_s| Program::Steps {
            levels: [level; muslip_record::STEPS],
            count,
            hold_s,
        };
        let held = |target_slip, hold_s| Program::SlipHold {
            target_slip,
            hold_s,
        };
        let (up, down) = (f32::next_up, f32::next_down);
        for (end, beyond) in [
            (ramp(f32::MIN_POSITIVE), ramp(0.0)),
            (ramp(10.0), ramp(up(10.0))),
            (steps(0.0, 1, 1.0), steps(0.0, 0, 1.0)),
            (steps(0.0, 8, 1.0), steps(-f32::MIN_POSITIVE, 8, 1.0)),
            (steps(1.0, 8, 1.0), steps(up(1.0), 8, 1.0)),
            (steps(0.5, 8, 0.01), steps(0.5, 8, down(0.01))),
            (steps(0.5, 8, 60.0), steps(0.5, 8, up(60.0))),
            (held(0.01, 1.0), held(down(0.01), 1.0)),
            (held(0.5, 1.0), held(up(0.5), 1.0)),
            (held(0.1, 0.01), held(0.1, down(0.01))),
            (held(0.1, 60.0), held(0.1, up(60.0))),
        ] {
            let with = |program| profile(&Profile { program, ..GOOD });
            assert!(with(end), "{end:?}");
            assert!(!with(beyond), "{beyond:?}");
        }
        type Change = fn(&mut Profile, f32);
        let changes: [(Change, f32, f32); 8] = [
            (
                |p, v| p.start_speed_m_s = v,
                up(LOCK_SPEED_M_S),
                LOCK_SPEED_M_S,
            ),
            (|p, v| p.start_speed_m_s = v, f32::MAX, f32::INFINITY),
            (|p, v| p.skid_slip = v, 0.05, down(0.05)),
            (|p, v| p.skid_slip = v, 1.0, up(1.0)),
            (|p, v| p.skid_hold_s = v, 0.0, -f32::MIN_POSITIVE),
            (|p, v| p.skid_hold_s = v, 0.15, up(0.15)),
            (|p, v| p.cool_s = v, 0.1, down(0.1)),
            (|p, v| p.cool_s = v, 600.0, up(600.0)),
        ];
        for (row, (change, end, beyond)) in changes.into_iter().enumerate() {
            let with = |value| {
                let mut changed = GOOD;
                change(&mut changed, value);
                profile(&changed)
            };
            assert!(with(end), "row {row}");
            assert!(!with(beyond), "row {row}");
        }
        for (applications, allowed) in [(0, false), (1, true), (100, true), (101, false)] {
            let changed = Profile {
                applications,
                ..GOOD
            };
            assert_eq!(profile(&changed), allowed, "{applications}");
        }
    }

    #[test]
    fn profiles_outside_their_ranges_are_refused() {
        assert!(profile(&GOOD));
        assert!(!profile(&Profile {
            start_speed_m_s: 5.0,
            ..GOOD
        }));
        assert!(!profile(&Profile {
            skid_hold_s: 0.2,
            ..GOOD
        }));
        assert!(!profile(&Profile {
            skid_slip: f32::NAN,
            ..GOOD
        }));
        assert!(!profile(&Profile {
            applications: 0,
            ..GOOD
        }));
        let with = |program| profile(&Profile { program, ..GOOD });
        assert!(!with(Program::Ramp { demand_per_s: 0.0 }));
        let levels = [0.5; muslip_record::STEPS];
        assert!(with(Program::Steps {
            levels,
            count: 8,
            hold_s: 1.0
        }));
        assert!(!with(Program::Steps {
            levels,
            count: 9,
            hold_s: 1.0
        }));
        assert!(!with(Program::SlipHold {
            target_slip: 0.6,
            hold_s: 1.0
        }));
    }
}
