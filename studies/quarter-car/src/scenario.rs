//! What a stop starts from: vehicle, road, brake, sensors, what goes wrong.

use host_sim::RigLaw;
use muslip_laws::Burckhardt;
use muslip_laws::burckhardt::{DRY_ASPHALT, SNOW, WET_ASPHALT};

use super::surface::Surface;

/// Gravity in m/s².
pub const GRAVITY_M_S2: f64 = 9.81;
/// Time between samples in s.
pub const SAMPLE_TIME_S: f64 = 0.005;
/// Steps of the plant's integration in one sample.
pub const STEPS_A_SAMPLE: u32 = 20;

/// A road: patches one after the other, each from a distance on.
#[derive(Debug, Clone, PartialEq)]
pub struct Road {
    /// Name in tables.
    pub name: &'static str,
    /// (distance in m from which it holds, the surface); the first from 0, ascending.
    pub patches: Vec<(f64, Surface)>,
}

impl Road {
    /// One surface throughout.
    pub fn of(name: &'static str, surface: impl Into<Surface>) -> Self {
        Self {
            name,
            patches: vec![(0.0, surface.into())],
        }
    }

    /// Dry asphalt.
    pub fn dry() -> Self {
        Self::of("dry", DRY_ASPHALT)
    }

    /// Wet asphalt.
    pub fn wet() -> Self {
        Self::of("wet", WET_ASPHALT)
    }

    /// Snow.
    pub fn snow() -> Self {
        Self::of("snow", SNOW)
    }

    /// Dry, wet from 15 m, dry again from 30 m.
    pub fn step() -> Self {
        Self::stepped(DRY_ASPHALT.into(), WET_ASPHALT.into())
    }

    fn stepped(dry: Surface, wet: Surface) -> Self {
        Self {
            name: "dry-wet-dry",
            patches: vec![(0.0, dry), (15.0, wet), (30.0, dry)],
        }
    }

    /// The four roads of the comparison.
    pub fn all() -> [Self; 4] {
        [Self::dry(), Self::wet(), Self::snow(), Self::step()]
    }

    /// The four roads under a tyre that no filter here has: the Magic Formula's.
    pub fn all_foreign() -> [Self; 4] {
        let [dry, wet, snow] = Surface::magic();
        [
            Self::of("dry", dry),
            Self::of("wet", wet),
            Self::of("snow", snow),
            Self::stepped(dry, wet),
        ]
    }

    fn surface_at(&self, distance_m: f64) -> Surface {
        self.patches
            .iter()
            .rev()
            .find(|(from, _)| *from <= distance_m)
            .or(self.patches.first())
            .map_or(DRY_ASPHALT.into(), |(_, surface)| *surface)
    }

    /// The law at a distance in m that a filter is told which knows the road.
    pub fn law_at(&self, distance_m: f64) -> Burckhardt<f64> {
        self.surface_at(distance_m).told
    }

    /// The law that is true at a distance in m.
    pub fn truth_at(&self, distance_m: f64) -> RigLaw {
        self.surface_at(distance_m).truth
    }

    /// True peak friction and its slip at a distance in m.
    pub fn peak_at(&self, distance_m: f64) -> (f64, f64) {
        let peak = self.truth_at(distance_m).peak();
        (peak.friction, peak.slip_ratio)
    }
}

/// The brake's actuator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Actuator {
    /// Largest torque in N m.
    pub maximum_torque_nm: f64,
    /// Largest rate in N m/s.
    pub maximum_rate_nm_s: f64,
    /// Samples between a demand and its effect.
    pub dead_samples: usize,
}

/// Noise of the sensors, 1 sigma.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorNoise {
    /// Wheel speed, rad/s.
    pub wheel_speed_rad_s: f64,
    /// Vehicle speed, m/s.
    pub vehicle_speed_m_s: f64,
    /// Drag, N.
    pub drag_force_n: f64,
    /// Normal force, N.
    pub normal_force_n: f64,
}

/// A time during which the wheel-speed sensor fails.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorFault {
    /// First instant in s.
    pub from_s: f64,
    /// Instant in s at which it is well again.
    pub until_s: f64,
    /// How it fails.
    pub kind: FaultKind,
}

/// How a sensor fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultKind {
    /// No reading.
    Missing,
    /// The last reading over and over.
    Frozen,
}

/// A stop.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// True quarter mass in kg.
    pub mass_kg: f64,
    /// True radius in m.
    pub radius_m: f64,
    /// True inertia in kg m².
    pub inertia_kg_m2: f64,
    /// Speed at the start in m/s.
    pub from_m_s: f64,
    /// Speed in m/s at which the stop is over.
    pub to_m_s: f64,
    /// The road.
    pub road: Road,
    /// Distance in m over which the tyre's force follows its slip; 0 where it does so at once.
    pub relaxation_length_m: f64,
    /// The brake.
    pub actuator: Actuator,
    /// The sensors.
    pub noise: SensorNoise,
    /// Samples by which every reading is late.
    pub late_samples: usize,
    /// What fails.
    pub fault: Option<SensorFault>,
    /// Seed of the noise.
    pub seed: u64,
}

impl Scenario {
    /// The comparison's stop on a road: 450 kg, 0.30 m, 1 kg m², 30 to 1 m/s, 3 kN m, 20 kN m/s.
    pub fn usual(road: Road, seed: u64) -> Self {
        Self {
            mass_kg: 450.0,
            radius_m: 0.30,
            inertia_kg_m2: 1.0,
            from_m_s: 30.0,
            to_m_s: 1.0,
            road,
            relaxation_length_m: 0.0,
            actuator: Actuator {
                maximum_torque_nm: 3000.0,
                maximum_rate_nm_s: 20_000.0,
                dead_samples: 0,
            },
            noise: SensorNoise {
                wheel_speed_rad_s: 0.1,
                vehicle_speed_m_s: 0.02,
                drag_force_n: 90.0,
                normal_force_n: 20.0,
            },
            late_samples: 0,
            fault: None,
            seed,
        }
    }

    /// The same stop on a tyre that no filter here has: the road's is of [`Road::all_foreign`], and its force follows
    /// slip over a relaxation length.
    pub fn foreign(road: Road, seed: u64) -> Self {
        Self {
            relaxation_length_m: FOREIGN_RELAXATION_M,
            ..Self::usual(road, seed)
        }
    }
}

/// Relaxation length of the foreign tyre in m: half the wheel's radius.
pub const FOREIGN_RELAXATION_M: f64 = 0.15;
