//! Calibration, limits and rig data: what differs from one rig to the next.

use serde::{Deserialize, Serialize};

use crate::compensation::CompensationParameters;

/// Everything that a rig sets. Sent, checked, taken and stored as a whole.
///
/// Ranges are checked by the controller before any of it is taken.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Parameters {
    /// The braked wheel.
    pub wheel: WheelParameters,
    /// Encoder or tone ring of the braked wheel.
    pub wheel_encoder: EncoderParameters,
    /// Encoder or tone ring of the drum or fifth wheel.
    pub vehicle_encoder: EncoderParameters,
    /// Radius of the drum or fifth wheel in m: its surface speed is the vehicle speed. 0.005..=10.
    pub vehicle_encoder_radius_m: f32,
    /// Bridge channel 0.
    pub drag: ForceParameters,
    /// Bridge channel 1.
    pub normal: ForceParameters,
    /// Valve and brake.
    pub brake: BrakeParameters,
    /// Limits of the interlocks.
    pub limits: LimitParameters,
    /// The two-state estimator.
    pub estimator: EstimatorParameters,
    /// Slip control.
    pub slip_control: SlipControlParameters,
    /// Heat of the brake.
    pub brake_heat: HeatParameters,
    /// Pressure of the brake's line.
    pub pressure: PressureParameters,
    /// What a diagnosis found, for the estimate; nothing in a file without it.
    #[serde(default)]
    pub compensation: CompensationParameters,
}

/// The braked wheel and what it slows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WheelParameters {
    /// Free-rolling radius R in m, 0.005..=2.
    pub effective_radius_m: f32,
    /// Moment of inertia J about the axle in kg m2, 0.0001..=10,000.
    pub inertia_kg_m2: f32,
    /// Translating mass m in kg (a drum's inertia over its radius squared), 0.1..=1,000,000.
    pub vehicle_mass_kg: f32,
}

/// An incremental encoder or a tone ring.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct EncoderParameters {
    /// Pulses of channel A a revolution, 1..=10,000.
    pub pulses_per_revolution: u16,
    /// True where the encoder counts down when the rig runs forward.
    pub reversed: bool,
}

/// One channel of the bridge: force = (code - zero_code) newton_per_code.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ForceParameters {
    /// Scale in N for each code of the 24-bit converter, of magnitude 1e-6..=0.1; negative where the bridge is wired
    /// the other way.
    pub newton_per_code: f32,
    /// Code with no force; set by a tare.
    pub zero_code: i32,
}

/// Valve and brake.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BrakeParameters {
    /// Duty of the proportional valve at which pressure begins, 0..1.
    pub duty_at_zero: f32,
    /// Duty at full pressure, above `duty_at_zero`, at most 1.
    pub duty_at_full: f32,
    /// Brake torque at full pressure in N m, > 0, at most 200,000.
    pub torque_at_full_nm: f32,
}

/// Limits of the interlocks. Each has a range of its own, so that no value switches its interlock off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LimitParameters {
    /// Overspeed of the vehicle or drum in m/s, 1..=120.
    pub maximum_vehicle_speed_m_s: f32,
    /// Overspeed of the wheel in rad/s, 1..=2,000.
    pub maximum_wheel_speed_rad_s: f32,
    /// Normal force in N below which it counts as lost while armed, 10..=500,000.
    pub minimum_normal_force_n: f32,
    /// Magnitude in N beyond which a force cannot be, above the one before, at most 1,000,000.
    pub maximum_force_n: f32,
    /// Supply of the valves in V below which it counts as browned out, 10..=36.
    pub minimum_supply_v: f32,
}

/// Range of tyres that the two-state estimator starts from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum TyreRange {
    /// Aircraft tyres on runways.
    Aircraft,
    /// Car tyres on roads.
    Automotive,
}

/// The two-state estimator.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct EstimatorParameters {
    /// Where it starts.
    pub tyre_range: TyreRange,
    /// Standard deviation of one sample's friction, 0.001..=1.
    pub friction_std: f32,
    /// Factor on it where the article's filter runs, 1..=100; 3 by default. The efficient estimator learns the noise.
    pub noise_inflation: f32,
    /// Smallest slip that is given to the estimator, 0..1.
    pub skid_slip_minimum: f32,
    /// Largest slip that is given to the estimator, above the smallest, at most 1.05.
    pub skid_slip_maximum: f32,
}

/// Slip control.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SlipControlParameters {
    /// Bandwidth of the slip loop in rad/s, 0.1..=1,000.
    pub bandwidth_rad_s: f32,
    /// Integral time in s, 0.001..=100.
    pub integral_time_s: f32,
    /// Fastest change of the brake torque in N m/s, 1..=100,000,000.
    pub maximum_torque_rate_nm_s: f32,
}

/// Heat of the brake: what its torque at the demand does on the wheel, less what leaves it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HeatParameters {
    /// Energy in J above the surroundings that the brake bears, 1,000..=100,000,000.
    pub maximum_energy_j: f32,
    /// Time in s after which 1/e of it is left, 1..=3,600.
    pub cooling_time_s: f32,
}

/// The transmitter of the brake line's pressure, as its voltage at the controller's pin, and how fast the line follows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PressureParameters {
    /// Volt without pressure, 0.1..=1: one that reads less than half of it is broken.
    pub volt_at_zero: f32,
    /// Volt at full pressure, 0.5 above the one before, at most 3.1.
    pub volt_at_full: f32,
    /// Time in s within which the line goes from no pressure to full and back, 0.01..=1.
    pub response_s: f32,
}

impl Default for Parameters {
    /// A car wheel on a drum of 2 m: the rig of the bundled recording with common encoders and bridges.
    /// Safe to start from, not a calibration.
    fn default() -> Self {
        Self {
            wheel: WheelParameters {
                effective_radius_m: 0.31,
                inertia_kg_m2: 1.25,
                vehicle_mass_kg: 420.0,
            },
            wheel_encoder: EncoderParameters {
                pulses_per_revolution: 500,
                reversed: false,
            },
            vehicle_encoder: EncoderParameters {
                pulses_per_revolution: 1000,
                reversed: false,
            },
            vehicle_encoder_radius_m: 1.0,
            drag: ForceParameters {
                newton_per_code: 0.002,
                zero_code: 0,
            },
            normal: ForceParameters {
                newton_per_code: 0.002,
                zero_code: 0,
            },
            brake: BrakeParameters {
                duty_at_zero: 0.1,
                duty_at_full: 0.9,
                torque_at_full_nm: 2000.0,
            },
            limits: LimitParameters {
                maximum_vehicle_speed_m_s: 45.0,
                maximum_wheel_speed_rad_s: 160.0,
                minimum_normal_force_n: 500.0,
                maximum_force_n: 15_000.0,
                minimum_supply_v: 20.0,
            },
            estimator: EstimatorParameters {
                tyre_range: TyreRange::Automotive,
                friction_std: 0.03,
                noise_inflation: 3.0,
                skid_slip_minimum: 0.01,
                skid_slip_maximum: 0.98,
            },
            slip_control: SlipControlParameters {
                bandwidth_rad_s: 20.0,
                integral_time_s: 0.3,
                maximum_torque_rate_nm_s: 10_000.0,
            },
            // A disc of 8 kg, 450 K warmer.
            brake_heat: HeatParameters {
                maximum_energy_j: 1_800_000.0,
                cooling_time_s: 120.0,
            },
            // 0.5 to 4.5 V behind a divider of 3 : 2.
            pressure: PressureParameters {
                volt_at_zero: 0.333,
                volt_at_full: 3.0,
                response_s: 0.2,
            },
            compensation: CompensationParameters::default(),
        }
    }
}
