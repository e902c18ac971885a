//! What no parameter may be set beyond, because an interlock would then never fire, or fire for no reason.
//!
//! Parameters come over the link. Those that an interlock compares with have a range here, at compile time; a value
//! outside it is refused like any other that is out of range. docs/rig.md prints [`CEILINGS`]. Those that a filter or the
//! slip loop reckons with have one as well ([`RANGES`]): beyond it a run would end as `EstimatorFault`.

/// The range of one parameter that an interlock, a filter or the slip loop uses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ceiling {
    /// The parameter, as in a parameters file.
    pub parameter: &'static str,
    /// Smallest value that is taken.
    pub lowest: f32,
    /// Largest value that is taken.
    pub highest: f32,
    /// Their unit.
    pub unit: &'static str,
    /// What would fail to fire beyond it, or fire for no reason.
    pub interlock: &'static str,
}

impl Ceiling {
    /// Whether a value is in the range; NaN is not.
    #[must_use]
    pub fn allows(&self, value: f32) -> bool {
        value >= self.lowest && value <= self.highest
    }
}

const fn ceiling(
    parameter: &'static str,
    (lowest, highest): (f32, f32),
    unit: &'static str,
    interlock: &'static str,
) -> Ceiling {
    assert!(lowest > 0.0 && highest > lowest && highest < f32::INFINITY);
    Ceiling {
        parameter,
        lowest,
        highest,
        unit,
        interlock,
    }
}

const WHEEL_SENSOR: &str = "WheelSensorLost, WheelSensorOutOfRange";

/// Free-rolling radius.
pub const EFFECTIVE_RADIUS_M: Ceiling =
    ceiling("wheel.effective_radius_m", (0.005, 2.0), "m", "WheelLocked");
/// Moment of inertia.
pub const INERTIA_KG_M2: Ceiling =
    ceiling("wheel.inertia_kg_m2", (1e-4, 1e4), "kg m²", WHEEL_SENSOR);
/// Radius of the vehicle's encoder.
pub const VEHICLE_ENCODER_RADIUS_M: Ceiling = ceiling(
    "vehicle_encoder_radius_m",
    (0.005, 10.0),
    "m",
    "Overspeed, WheelLocked",
);
/// Magnitude of a bridge's scale.
pub const NEWTON_PER_CODE: Ceiling = ceiling(
    "drag.newton_per_code, normal.newton_per_code",
    (1e-6, 0.1),
    "N, magnitude",
    "BridgeOutOfRange",
);
/// Torque of the brake.
pub const TORQUE_AT_FULL_NM: Ceiling = ceiling(
    "brake.torque_at_full_nm",
    (0.1, 200_000.0),
    "N m",
    WHEEL_SENSOR,
);
/// Overspeed of the vehicle.
pub const MAXIMUM_VEHICLE_SPEED_M_S: Ceiling = ceiling(
    "limits.maximum_vehicle_speed_m_s",
    (1.0, 120.0),
    "m/s",
    "Overspeed",
);
/// Overspeed of the wheel.
pub const MAXIMUM_WHEEL_SPEED_RAD_S: Ceiling = ceiling(
    "limits.maximum_wheel_speed_rad_s",
    (1.0, 2_000.0),
    "rad/s",
    "Overspeed",
);
/// Normal force that counts as lost.
pub const MINIMUM_NORMAL_FORCE_N: Ceiling = ceiling(
    "limits.minimum_normal_force_n",
    (10.0, 500_000.0),
    "N",
    "NormalForceLost",
);
/// Force that cannot be.
pub const MAXIMUM_FORCE_N: Ceiling = ceiling(
    "limits.maximum_force_n",
    (10.0, 1_000_000.0),
    "N",
    "BridgeOutOfRange",
);
/// Supply of the valves.
pub const MINIMUM_SUPPLY_V: Ceiling =
    ceiling("limits.minimum_supply_v", (10.0, 36.0), "V", "BrownOut");
/// Change of the wheel's speed that brake and tyre can make, from torque, force limit, radius and inertia together: with
/// a larger one a lost sensor would pass for a wheel that stops within two samples.
pub const WHEEL_CHANGE_RAD_S2: Ceiling = ceiling(
    "1.5 (torque_at_full_nm + maximum_force_n effective_radius_m) / inertia_kg_m2",
    (1.0, 100_000.0),
    "rad/s²",
    WHEEL_SENSOR,
);

/// Energy that the brake bears.
pub const BRAKE_ENERGY_J: Ceiling =
    ceiling("brake_heat.maximum_energy_j", (1e3, 1e8), "J", "BrakeHot");
/// Time in which the brake cools.
pub const COOLING_TIME_S: Ceiling =
    ceiling("brake_heat.cooling_time_s", (1.0, 3_600.0), "s", "BrakeHot");

/// Pressure transmitter without pressure.
pub const VOLT_AT_ZERO: Ceiling = ceiling("pressure.volt_at_zero", (0.1, 1.0), "V", "PressureLost");
/// Pressure transmitter at full pressure.
pub const VOLT_AT_FULL: Ceiling = ceiling(
    "pressure.volt_at_full",
    (0.6, 3.1),
    "V",
    "PressureLost, PressureWrong",
);
/// Time in which the line's pressure follows.
pub const RESPONSE_S: Ceiling = ceiling("pressure.response_s", (0.01, 1.0), "s", "PressureWrong");

const ESTIMATOR: &str = "EstimatorFault";

/// Translating mass.
pub const VEHICLE_MASS_KG: Ceiling = ceiling("wheel.vehicle_mass_kg", (0.1, 1e6), "kg", ESTIMATOR);
/// Noise of a sample's friction.
pub const FRICTION_STD: Ceiling = ceiling("estimator.friction_std", (1e-3, 1.0), "-", ESTIMATOR);
/// Factor on it.
pub const NOISE_INFLATION: Ceiling =
    ceiling("estimator.noise_inflation", (1.0, 100.0), "-", ESTIMATOR);
/// Bandwidth of the slip loop.
pub const BANDWIDTH_RAD_S: Ceiling = ceiling(
    "slip_control.bandwidth_rad_s",
    (0.1, 1_000.0),
    "rad/s",
    ESTIMATOR,
);
/// Integral time of the slip loop.
pub const INTEGRAL_TIME_S: Ceiling = ceiling(
    "slip_control.integral_time_s",
    (1e-3, 100.0),
    "s",
    ESTIMATOR,
);
/// Fastest change of the torque that the slip loop asks for.
pub const TORQUE_RATE_NM_S: Ceiling = ceiling(
    "slip_control.maximum_torque_rate_nm_s",
    (1.0, 1e8),
    "N m/s",
    ESTIMATOR,
);

/// All that a filter or the slip loop uses, and no interlock.
pub const RANGES: [Ceiling; 6] = [
    VEHICLE_MASS_KG,
    FRICTION_STD,
    NOISE_INFLATION,
    BANDWIDTH_RAD_S,
    INTEGRAL_TIME_S,
    TORQUE_RATE_NM_S,
];

/// All that an interlock uses.
pub const CEILINGS: [Ceiling; 16] = [
    EFFECTIVE_RADIUS_M,
    INERTIA_KG_M2,
    VEHICLE_ENCODER_RADIUS_M,
    NEWTON_PER_CODE,
    TORQUE_AT_FULL_NM,
    MAXIMUM_VEHICLE_SPEED_M_S,
    MAXIMUM_WHEEL_SPEED_RAD_S,
    MINIMUM_NORMAL_FORCE_N,
    MAXIMUM_FORCE_N,
    MINIMUM_SUPPLY_V,
    WHEEL_CHANGE_RAD_S2,
    BRAKE_ENERGY_J,
    COOLING_TIME_S,
    VOLT_AT_ZERO,
    VOLT_AT_FULL,
    RESPONSE_S,
];
