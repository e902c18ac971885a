//! A campaign of one braked stop with nothing missing, for tests.

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use super::blocks::blocks;
use super::hypothesis::{Effort, Guess, Judged, judge};
use crate::campaign::{Rig, Run};
use crate::data::Data;
use crate::mechanism::Id;
use crate::model::{Model, Term};

pub const PEAK: f64 = 0.8;
pub const CRITICAL: f64 = 0.12;
const LOAD_N: f64 = 4000.0;
const STEPS: usize = 2000;
const STEP_S: f64 = 5e-3;
/// Steps of the simulation in one of the recording.
const INNER: usize = 10;
/// Memory of the drag's coloured noise.
const COLOUR_S: f64 = 0.03;

/// Standard deviations of the channels' white noise, and of the drag's that has a memory.
#[derive(Clone, Copy)]
pub struct Noise {
    pub wheel: f64,
    pub vehicle: f64,
    pub drag: f64,
    pub drag_coloured: f64,
    pub load: f64,
    pub torque: f64,
}

impl Noise {
    /// Of a common measuring chain: rad/s, m/s, N, N, N, N m.
    pub const TYPICAL: Self = Self {
        wheel: 0.3,
        vehicle: 1e-4,
        drag: 15.0,
        drag_coloured: 0.0,
        load: 40.0,
        torque: 5.0,
    };
    /// The same with a wheel speed that is read far better.
    pub const FINE_WHEEL: Self = Self {
        wheel: 0.02,
        ..Self::TYPICAL
    };
    /// None.
    pub const NONE: Self = Self {
        wheel: 0.0,
        vehicle: 1e-4,
        drag: 0.0,
        drag_coloured: 0.0,
        load: 0.0,
        torque: 0.0,
    };
}

/// What stands between a stop and its recording, each a time constant in s.
#[derive(Clone, Copy, Default)]
pub struct Lags {
    /// Of two poles of the wheel speed's sensor, the delay of both taken off.
    pub wheel_sensor_s: f64,
    /// Of the brake behind its reading.
    pub brake_s: f64,
}

/// A quarter car whose brake comes and goes four times while it coasts, free rolling in between.
pub fn stop(noise: Noise, seed: u64) -> Data {
    stop_with(noise, Lags::default(), seed)
}

/// The same with lags.
pub fn stop_with(noise: Noise, lags: Lags, seed: u64) -> Data {
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
    let (kept, mut drag_coloured) = ((-STEP_S / COLOUR_S).exp(), 0.0);
    let step = STEP_S / INNER as f64;
    let follow = |time_s: f64| {
        if time_s > 0.0 {
            1.0 - (-step / time_s).exp()
        } else {
            1.0
        }
    };
    let mut braking = 0.0;
    let mut poles = [omega; 2];
    let mut sensed = Vec::new();
    for k in 0..STEPS {
        let time = STEP_S * k as f64;
        let torque =
            600.0 * (2.0 * (0.4 * core::f64::consts::TAU * time).sin() - 0.8).clamp(0.0, 1.0);
        let force = |v: f64, omega: f64| {
            let x = (1.0 - rig.radius_m * omega / v) / CRITICAL;
            LOAD_N * PEAK * 2.0 * x / (1.0 + x * x)
        };
        run.time_s.push(time);
        run.wheel_speed_rad_s.push(white(noise.wheel));
        run.vehicle_speed_m_s.push(v + white(noise.vehicle));
        if noise.drag_coloured > 0.0 {
            drag_coloured *= kept;
            drag_coloured += white(noise.drag_coloured * (1.0 - kept * kept).sqrt());
        }
        let read = force(v, omega) + drag_coloured + white(noise.drag);
        run.drag_force_n.push(read);
        run.normal_force_n.push(LOAD_N + white(noise.load));
        torques.push(torque + white(noise.torque));
        for _ in 0..INNER {
            sensed.push(poles[1]);
            let f = force(v, omega);
            braking += follow(lags.brake_s) * (torque - braking);
            omega += step * (rig.radius_m * f - braking) / rig.wheel_inertia_kg_m2;
            v -= step * f / rig.mass_kg;
            let mut input = omega;
            for pole in &mut poles {
                *pole += follow(lags.wheel_sensor_s) * (input - *pole);
                input = *pole;
            }
        }
    }
    let late = (2.0 * lags.wheel_sensor_s / step).round() as usize;
    for (k, wheel) in run.wheel_speed_rad_s.iter_mut().enumerate() {
        *wheel += sensed[(INNER * k + late).min(sensed.len() - 1)];
    }
    run.brake_torque_nm = Some(torques);
    let mut data = Data::new(&rig, core::slice::from_ref(&run));
    data.blocks = blocks(&data.series);
    data
}

/// How hard a toy is tried.
pub const EFFORT: Effort = Effort {
    steps: 8,
    noise_steps: 20,
    noise_stride: 1,
};

/// The law alone with its noise.
pub fn settled(data: &Data) -> Judged {
    let law = Model::of_law(PEAK, CRITICAL);
    let mut base = judge(data, &law, &[], Guess::None, EFFORT).unwrap();
    for _ in 0..3 {
        let guess = Guess::Sizes(&base.parts);
        base = judge(data, &base.model, &[], guess, EFFORT).unwrap();
    }
    base
}

/// Entry of the first form of a mechanism.
pub fn entry_of(data: &Data, id: Id) -> usize {
    let entries = data.catalogue.entries();
    entries.iter().position(|m| m.id() == id).unwrap()
}

/// The entry of a mechanism's form.
pub fn entry_of_form(data: &Data, id: Id, form: &str) -> usize {
    let mut entries = data.catalogue.entries().iter();
    entries
        .position(|m| m.id() == id && m.form() == form)
        .unwrap()
}

/// A judged model with one term more.
pub fn with_term(data: &Data, judged: &Judged, id: Id, parameter: f64) -> Model {
    let mut model = judged.model.clone();
    model.terms.push(Term {
        entry: entry_of(data, id),
        parameters: vec![parameter],
    });
    model
}
