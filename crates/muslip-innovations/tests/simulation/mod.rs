//! A braked wheel and vehicle with noise of stated sizes: plant, law and noise of the tests' own.

#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::cast_precision_loss,
    reason = "each test file uses a part of it, and a failed step fails the test"
)]

use muslip::law::Rudd;
use muslip::real::Real;
use muslip_innovations::reading::Reading;
use muslip_innovations::settings::{Coloured, Rig, Sensors, Settings};
use test_support::noise::Noise;

pub const DT_S: f64 = 0.001;
pub const MASS_KG: f64 = 400.0;
pub const RIG: Rig<f64> = Rig {
    effective_radius_m: 0.31,
    wheel_inertia_kg_m2: 1.2,
    vehicle_mass_kg: Some(MASS_KG),
};
const LOAD_N: f64 = 4000.0;
const PEAK: f64 = 0.9;
const CRITICAL: f64 = 0.12;
/// Steps of the plant in a sample.
const STEPS: u32 = 10;

pub fn settings() -> Settings<f64> {
    let sensors = Sensors::white(0.05, 0.02, 20.0, 15.0, 5.0);
    Settings::usual(RIG, Rudd::new(PEAK, CRITICAL).unwrap(), sensors, 3600.0)
}

/// What the plant does that the model does not know of, from a time on.
#[derive(Debug, Clone, Copy)]
pub struct Plant {
    pub mass_kg: f64,
    /// Rise of the road, dimensionless.
    pub grade: f64,
    /// Friction over that of the law.
    pub friction: f64,
    /// Brake torque over its reading.
    pub torque: f64,
    /// All but the mass from here on, in s.
    pub from_s: f64,
    /// Speed at the start, in m/s.
    pub speed_m_s: f64,
    /// Peak brake torque in N m; applied and released over and over.
    pub torque_nm: f64,
    /// Whether the vehicle keeps its speed, as a drum does.
    pub driven: bool,
}

impl Default for Plant {
    fn default() -> Self {
        Self {
            mass_kg: MASS_KG,
            grade: 0.0,
            friction: 1.0,
            torque: 1.0,
            from_s: 0.0,
            speed_m_s: 40.0,
            torque_nm: 800.0,
            driven: false,
        }
    }
}

/// The law in another form: sin(2 atan x) is 2x/(1 + x²).
fn law(slip: f64) -> f64 {
    PEAK * (2.0 * (slip / CRITICAL).atan()).sin()
}

/// A process that forgets.
struct Forgetful {
    part: Coloured<f64>,
    now: f64,
}

impl Forgetful {
    fn new(part: Coloured<f64>, noise: &mut Noise) -> Self {
        let now = noise.normal(part.std);
        Self { part, now }
    }

    fn step(&mut self, noise: &mut Noise) -> f64 {
        let kept = (-DT_S / self.part.time_constant_s).exp();
        self.now = kept * self.now + noise.normal(self.part.std * (1.0 - kept * kept).sqrt());
        self.now
    }
}

/// All that noise and chance do to one run.
struct Chance {
    noise: Noise,
    parts: [Forgetful; 11],
    friction_run: f64,
    drag_zero: f64,
    slip_run: f64,
    torque_zero: f64,
    torque_scale: f64,
    force_run: f64,
}

impl Chance {
    fn new(settings: &Settings<f64>, seed: u64) -> Self {
        let mut noise = Noise::seeded(seed);
        let (s, own) = (&settings.sensors, &settings.unmodelled);
        let parts = [
            own.friction_fast,
            own.friction_slow,
            own.torque_fast_nm,
            own.torque_slow_nm,
            own.torque_drift_nm,
            own.force_fast_n,
            own.force_slow_n,
            own.force_drift_n,
            s.wheel_speed_coloured_rad_s,
            s.vehicle_speed_coloured_m_s,
            s.drag_force_coloured_n,
        ];
        Self {
            parts: parts.map(|part| Forgetful::new(part, &mut noise)),
            friction_run: noise.normal(own.friction_run_std),
            drag_zero: noise.normal(own.drag_zero_run_std_n),
            slip_run: noise.normal(own.slip_run_std),
            torque_zero: noise.normal(own.torque_zero_run_std_nm),
            torque_scale: noise.normal(own.torque_scale_run_std),
            force_run: noise.normal(own.force_run_std_n),
            noise,
        }
    }

    /// A reading of what is, by a sensor of this white noise.
    fn read(&mut self, value: f64, std: f64) -> Option<f64> {
        Some(value + self.noise.normal(std))
    }
}

/// Runs the plant, giving a reading each millisecond; its noise is what the settings state.
pub fn run(
    plant: &Plant,
    settings: &Settings<f64>,
    seed: u64,
    samples: usize,
    mut each: impl FnMut(usize, Reading<f64>),
) {
    let mut chance = Chance::new(settings, seed);
    let s = &settings.sensors;
    let mut speed = plant.speed_m_s;
    let mut spin = speed / RIG.effective_radius_m;
    for k in 0..samples {
        let time = k as f64 * DT_S;
        let concealed = |what: f64, usual: f64| if time >= plant.from_s { what } else { usual };
        let noise = &mut chance.noise;
        let now: [f64; 11] = core::array::from_fn(|i| chance.parts[i].step(noise));
        let load = LOAD_N * (1.0 + 0.02 * (3.0 * time).sin());
        let rough = (1.0 + now[0] + now[1] + chance.friction_run) * concealed(plant.friction, 1.0);
        let read_torque = plant.torque_nm * 0.5 * (1.0 - (2.0 * time).cos());
        let torque = read_torque * (1.0 + chance.torque_scale) * concealed(plant.torque, 1.0)
            - (now[2] + now[3] + now[4] + chance.torque_zero);
        let uphill = concealed(plant.grade, 0.0) * MASS_KG * 9.81;
        let pushed = now[5] + now[6] + now[7] + chance.force_run - uphill;
        let slip_run = chance.slip_run;
        let drag_of = |speed: f64, spin: f64| {
            let slip = (speed - RIG.effective_radius_m * spin) / speed.max(0.1);
            load * rough * law(slip + slip_run)
        };
        let drag = drag_of(speed, spin) + now[10] + chance.drag_zero;
        let reading = Reading {
            wheel_speed_rad_s: chance.read(spin + now[8], s.wheel_speed_std_rad_s),
            vehicle_speed_m_s: chance.read(speed + now[9], s.vehicle_speed_std_m_s),
            drag_force_n: chance.read(drag, s.drag_force_std_n),
            normal_force_n: chance.read(load, s.normal_force_std_n),
            brake_torque_nm: chance.read(read_torque, s.brake_torque_std_nm),
        };
        each(k, reading);
        let dt = DT_S / f64::from(STEPS);
        for _ in 0..STEPS {
            let drag = drag_of(speed, spin);
            let turned = (RIG.effective_radius_m * drag - torque) / RIG.wheel_inertia_kg_m2;
            spin = (spin + turned * dt).max(0.0);
            if !plant.driven {
                speed = (speed + (pushed - drag) / plant.mass_kg * dt).max(0.0);
            }
        }
    }
}

/// The same readings, rounded.
pub fn rounded<T: Real>(reading: &Reading<f64>) -> Reading<T> {
    let round = |value: Option<f64>| value.map(T::from_f64);
    Reading {
        wheel_speed_rad_s: round(reading.wheel_speed_rad_s),
        vehicle_speed_m_s: round(reading.vehicle_speed_m_s),
        drag_force_n: round(reading.drag_force_n),
        normal_force_n: round(reading.normal_force_n),
        brake_torque_nm: round(reading.brake_torque_nm),
    }
}
