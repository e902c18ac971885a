//! What is known of the rig, its sensors and its noise, and the checks that make a monitor of it.

use core::fmt;

use muslip::law::Rudd;
use muslip::real::Real;
use muslip::sample::SampleLimits;

use crate::detection::Detection;

/// Wheel and vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rig<T> {
    /// Radius R at which the wheel rolls freely, in m, > 0.
    pub effective_radius_m: T,
    /// Inertia J of the wheel with all that turns with it, in kg m², > 0.
    pub wheel_inertia_kg_m2: T,
    /// Mass m in kg that this wheel's drag slows, > 0; `None` where something else keeps the speed, as on a driven drum:
    /// no balance of the vehicle is formed.
    pub vehicle_mass_kg: Option<T>,
}

/// Noise that remembers: an Ornstein-Uhlenbeck process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coloured<T> {
    /// Standard deviation, >= 0, in the unit of the field that holds it; 0: there is none.
    pub std: T,
    /// Time in s, > 0, in which its correlation falls to 1/e.
    pub time_constant_s: T,
}

impl<T: Real> Coloured<T> {
    fn new(std: T, time_constant_s: f64) -> Self {
        Self {
            std,
            time_constant_s: T::from_f64(time_constant_s),
        }
    }
}

/// Noise of the sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensors<T> {
    /// White noise of one reading of the wheel speed, in rad/s, > 0.
    pub wheel_speed_std_rad_s: T,
    /// White noise of one reading of the vehicle speed, in m/s, > 0.
    pub vehicle_speed_std_m_s: T,
    /// White noise of one reading of the drag, in N, > 0.
    pub drag_force_std_n: T,
    /// White noise of one reading of the normal force, in N, >= 0.
    pub normal_force_std_n: T,
    /// White noise of one reading of the brake torque, in N m, >= 0.
    pub brake_torque_std_nm: T,
    /// What of the wheel speed's error remembers, in rad/s.
    pub wheel_speed_coloured_rad_s: Coloured<T>,
    /// What of the vehicle speed's error remembers, in m/s.
    pub vehicle_speed_coloured_m_s: Coloured<T>,
    /// What of the drag's error remembers, in N.
    pub drag_force_coloured_n: Coloured<T>,
}

/// What the right model may still leave out: sizes at which it is not called wrong. Standard deviations, all >= 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unmodelled<T> {
    /// Friction about the law, quick, as a share of it.
    pub friction_fast: Coloured<T>,
    /// Friction about the law, slow, as a share of it.
    pub friction_slow: Coloured<T>,
    /// Friction of one run about the law, as a share of it.
    pub friction_run_std: T,
    /// The drag's zero in one run, in N.
    pub drag_zero_run_std_n: T,
    /// The slip's zero in one run, dimensionless: what the radius is off by.
    pub slip_run_std: T,
    /// Torque on the wheel, quick, in N m.
    pub torque_fast_nm: Coloured<T>,
    /// Torque on the wheel, slow, in N m.
    pub torque_slow_nm: Coloured<T>,
    /// Torque on the wheel, drifting, in N m.
    pub torque_drift_nm: Coloured<T>,
    /// Scale of the brake torque in one run, as a share of it.
    pub torque_scale_run_std: T,
    /// The torques' zero in one run, in N m.
    pub torque_zero_run_std_nm: T,
    /// Force on the vehicle, quick, in N.
    pub force_fast_n: Coloured<T>,
    /// Force on the vehicle, slow, in N.
    pub force_slow_n: Coloured<T>,
    /// Force on the vehicle, drifting, in N.
    pub force_drift_n: Coloured<T>,
    /// Scale of the drag in one run, as a share of it.
    pub drag_scale_run_std: T,
    /// Force on the vehicle in one run, in N.
    pub force_run_std_n: T,
}

/// When a balance is formed, and which of its readings are believed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Forming<T> {
    /// What a sample must satisfy. Below its vehicle speed no balance is formed, below its normal force or outside its
    /// slips none of the tyre.
    pub sample: SampleLimits<T>,
    /// Wheel speed in rad/s, > 0, below which the wheel may be locked: none of the tyre and none of the wheel.
    pub minimum_wheel_speed_rad_s: T,
    /// A step longer than this, in s, > 0, is a gap: what is integrated starts anew after it.
    pub longest_step_s: T,
    /// An innovation beyond so many standard deviations, 3 to 100, is not fused; it counts as evidence at this size.
    pub gate_stds: T,
}

/// Everything that the balances need to know. `build` it into a [`Monitor`](crate::monitor::Monitor).
///
/// Sizes of noise are not fitted here, as a diagnosis of recordings does: false alarms are as stated only where
/// they are as stated. Too large they make the monitor blind, too small they raise alarms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings<T> {
    /// Wheel and vehicle.
    pub rig: Rig<T>,
    /// The tyre's law that the drag is held against.
    pub law: Rudd<T>,
    /// Noise of the sensors.
    pub sensors: Sensors<T>,
    /// What the right model may still leave out.
    pub unmodelled: Unmodelled<T>,
    /// When a balance is formed.
    pub forming: Forming<T>,
    /// How the evidence is weighed.
    pub detection: Detection<T>,
}

/// A setting, or a group of settings that are checked alike.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Setting {
    /// [`Rig::effective_radius_m`].
    EffectiveRadius,
    /// [`Rig::wheel_inertia_kg_m2`].
    WheelInertia,
    /// [`Rig::vehicle_mass_kg`].
    VehicleMass,
    /// [`Sensors`]: the white noise of a channel.
    SensorNoise,
    /// A part of the tyre's noise: of a sensor, or [`Unmodelled`].
    TyreNoise,
    /// A part of the wheel's noise.
    WheelNoise,
    /// A part of the vehicle's noise.
    VehicleNoise,
    /// [`Forming::sample`] or [`Forming::minimum_wheel_speed_rad_s`].
    Limits,
    /// [`Forming::longest_step_s`].
    LongestStep,
    /// [`Forming::gate_stds`].
    Gate,
    /// [`Detection`].
    Detection,
}

/// Settings of which no monitor can be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum SettingsError {
    /// The setting is not finite or outside the range that its field states.
    OutOfRange(Setting),
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::EffectiveRadius => "effective radius",
            Self::WheelInertia => "wheel inertia",
            Self::VehicleMass => "vehicle mass",
            Self::SensorNoise => "white noise of a sensor",
            Self::TyreNoise => "a part of the tyre's noise",
            Self::WheelNoise => "a part of the wheel's noise",
            Self::VehicleNoise => "a part of the vehicle's noise",
            Self::Limits => "limits of a sample",
            Self::LongestStep => "longest step",
            Self::Gate => "gate",
            Self::Detection => "window or probability of the detection",
        })
    }
}

impl fmt::Display for SettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutOfRange(setting) => write!(f, "{setting} is outside its range"),
        }
    }
}

impl core::error::Error for SettingsError {}

impl<T: Real> Sensors<T> {
    /// White noise of one reading of each channel; of the speeds three tenths, of the drag one tenth remember (for
    /// 0.02 s, 0.2 s and 0.07 s).
    pub fn white(
        wheel_speed_std_rad_s: T,
        vehicle_speed_std_m_s: T,
        drag_force_std_n: T,
        normal_force_std_n: T,
        brake_torque_std_nm: T,
    ) -> Self {
        let part = |share: f64, std: T| T::from_f64(share) * std;
        Self {
            wheel_speed_std_rad_s,
            vehicle_speed_std_m_s,
            drag_force_std_n,
            normal_force_std_n,
            brake_torque_std_nm,
            wheel_speed_coloured_rad_s: Coloured::new(part(0.3, wheel_speed_std_rad_s), 0.02),
            vehicle_speed_coloured_m_s: Coloured::new(part(0.3, vehicle_speed_std_m_s), 0.2),
            drag_force_coloured_n: Coloured::new(part(0.1, drag_force_std_n), 0.07),
        }
    }

    fn in_range(&self) -> bool {
        let square = |std: T| std * std;
        let seen = |std: T| std > T::ZERO && square(std) >= T::MIN_POSITIVE;
        let any = |std: T| std >= T::ZERO;
        let finite = |std: T| square(std).is_finite();
        let speeds = [self.wheel_speed_std_rad_s, self.vehicle_speed_std_m_s];
        let loads = [self.normal_force_std_n, self.brake_torque_std_nm];
        speeds.into_iter().all(|s| seen(s) && finite(s))
            && seen(self.drag_force_std_n)
            && finite(self.drag_force_std_n)
            && loads.into_iter().all(|s| any(s) && finite(s))
    }
}

impl<T: Real> Unmodelled<T> {
    /// The largest sizes that sensors alone make plausible, by their white noise and the largest drag, in N, > 0.
    ///
    /// They are those to which the diagnosis of recordings bounds what it fits.
    pub fn usual(rig: &Rig<T>, sensors: &Sensors<T>, largest_drag_n: T) -> Self {
        let c = T::from_f64;
        let radius = rig.effective_radius_m;
        let force = sensors.drag_force_std_n;
        let torque = ((radius * force).squared() + sensors.brake_torque_std_nm.squared()).sqrt();
        Self {
            friction_fast: Coloured::new(c(0.003), 0.03),
            friction_slow: Coloured::new(c(0.003), 0.6),
            friction_run_std: c(0.005),
            drag_zero_run_std_n: c(0.002) * largest_drag_n,
            slip_run_std: c(5e-4),
            torque_fast_nm: Coloured::new(c(0.2) * torque, 0.03),
            torque_slow_nm: Coloured::new(c(0.1) * torque, 0.3),
            torque_drift_nm: Coloured::new(c(0.03) * torque, 3.0),
            torque_scale_run_std: c(0.005),
            torque_zero_run_std_nm: c(0.002) * largest_drag_n * radius,
            force_fast_n: Coloured::new(c(0.2) * force, 0.03),
            force_slow_n: Coloured::new(c(0.2) * force, 0.3),
            force_drift_n: Coloured::new(c(0.03) * force, 3.0),
            drag_scale_run_std: c(0.005),
            force_run_std_n: c(0.002) * largest_drag_n,
        }
    }
}

impl<T: Real> Forming<T> {
    /// From 2 m/s and 3 rad/s on, the given smallest normal force in N, gaps from 20 ms on, a gate of 6.
    pub fn usual(minimum_normal_force_n: T) -> Self {
        Self {
            sample: SampleLimits {
                minimum_vehicle_speed_m_s: T::TWO,
                ..SampleLimits::new(minimum_normal_force_n)
            },
            minimum_wheel_speed_rad_s: T::from_f64(3.0),
            longest_step_s: T::from_f64(0.02),
            gate_stds: T::from_f64(6.0),
        }
    }
}

impl<T: Real> Settings<T> {
    /// The usual settings; `largest_drag_n` is the largest drag that the rig sees, in N, > 0.
    pub fn usual(rig: Rig<T>, law: Rudd<T>, sensors: Sensors<T>, largest_drag_n: T) -> Self {
        Self {
            rig,
            law,
            sensors,
            unmodelled: Unmodelled::usual(&rig, &sensors, largest_drag_n),
            forming: Forming::usual(T::from_f64(0.02) * largest_drag_n),
            detection: Detection::usual(),
        }
    }

    pub(crate) fn check(&self) -> Result<(), Setting> {
        let positive = |x: T| x > T::ZERO && x.is_finite();
        let limits = &self.forming.sample;
        let checks = [
            (
                positive(self.rig.effective_radius_m),
                Setting::EffectiveRadius,
            ),
            (
                positive(self.rig.wheel_inertia_kg_m2),
                Setting::WheelInertia,
            ),
            (
                self.rig.vehicle_mass_kg.is_none_or(positive),
                Setting::VehicleMass,
            ),
            (self.sensors.in_range(), Setting::SensorNoise),
            (
                positive(limits.minimum_vehicle_speed_m_s)
                    && positive(limits.minimum_normal_force_n)
                    && limits.slip_margin >= T::ZERO
                    && limits.slip_margin.is_finite()
                    && positive(self.forming.minimum_wheel_speed_rad_s),
                Setting::Limits,
            ),
            (positive(self.forming.longest_step_s), Setting::LongestStep),
            (
                self.forming.gate_stds >= T::from_f64(3.0)
                    && self.forming.gate_stds <= T::from_f64(100.0),
                Setting::Gate,
            ),
            (self.detection.in_range(), Setting::Detection),
        ];
        match checks.iter().find(|(in_range, _)| !in_range) {
            Some((_, setting)) => Err(*setting),
            None => Ok(()),
        }
    }
}
