//! A campaign of one braked stop with nothing missing, for tests.

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use super::blocks::blocks;
use crate::campaign::{Rig, Run};
use crate::data::Data;

pub(super) const PEAK: f64 = 0.8;
pub(super) const CRITICAL: f64 = 0.12;
const LOAD_N: f64 = 4000.0;
const STEPS: usize = 2000;
const STEP_S: f64 = 5e-3;
/// Steps of the simulation in one of the recording.
const INNER: usize = 10;

/// Standard deviations of the channels' white noise.
#[derive(Clone, Copy)]
pub(super) struct Noise {
    pub(super) wheel: f64,
    pub(super) drag: f64,
    pub(super) load: f64,
    pub(super) torque: f64,
}

impl Noise {
    /// Of a common measuring chain: rad/s, N, N, N m.
    pub(super) const TYPICAL: Self = Self {
        wheel: 0.3,
        drag: 15.0,
        load: 40.0,
        torque: 5.0,
    };
}

/// A quarter car whose brake comes and goes four times while it coasts, free rolling in between.
pub(super) fn stop(noise: Noise, seed: u64) -> Data {
    let rig = Rig {
        radius_m: 0.3,
        wheel_inertia_kg_m2: 1.2,
        mass_kg: LOAD_N / 9.81,
        coasting: true,
        peak_friction: PEAK,
        critical_slip: CRITICAL,
        ..Rig::default()
    };
    let mut draw = ChaCha8Rng::seed_from_u64(seed);
    let mut white = |std: f64| {
        let x: f64 = StandardNormal.sample(&mut draw);
        std * x
    };
    let (mut v, mut omega) = (40.0, 40.0 / rig.radius_m);
    let mut run = Run {
        name: "stop.csv".to_owned(),
        ..Run::default()
    };
    let mut torques = Vec::new();
    for k in 0..STEPS {
        let time = STEP_S * k as f64;
        let torque =
            600.0 * (2.0 * (0.4 * core::f64::consts::TAU * time).sin() - 0.8).clamp(0.0, 1.0);
        let force = |v: f64, omega: f64| {
            let x = (1.0 - rig.radius_m * omega / v) / CRITICAL;
            LOAD_N * PEAK * 2.0 * x / (1.0 + x * x)
        };
        run.time_s.push(time);
        run.wheel_speed_rad_s.push(omega + white(noise.wheel));
        run.vehicle_speed_m_s.push(v + white(1e-4));
        run.drag_force_n.push(force(v, omega) + white(noise.drag));
        run.normal_force_n.push(LOAD_N + white(noise.load));
        torques.push(torque + white(noise.torque));
        for _ in 0..INNER {
            let f = force(v, omega);
            let step = STEP_S / INNER as f64;
            omega += step * (rig.radius_m * f - torque) / rig.wheel_inertia_kg_m2;
            v -= step * f / rig.mass_kg;
        }
    }
    run.brake_torque_nm = Some(torques);
    let mut data = Data::new(&rig, core::slice::from_ref(&run));
    data.blocks = blocks(&data.series);
    data
}
