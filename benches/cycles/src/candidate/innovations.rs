//! One sample of all three balances: live innovations and their evidence.

use muslip::law::Rudd;
use muslip::sample::RigSample;
use muslip_innovations::detection::{Band, Detection};
use muslip_innovations::monitor::{Balance, Monitor};
use muslip_innovations::reading::Reading;
use muslip_innovations::settings::{Rig, Sensors, Settings};

const RADIUS_M: f32 = 0.31;
const SPEED_M_S: f32 = 20.0;
const LOAD_N: f32 = 4000.0;

pub struct Memory {
    monitor: Monitor<f32>,
    even: bool,
}

pub fn start() -> Memory {
    let rig = Rig {
        effective_radius_m: RADIUS_M,
        wheel_inertia_kg_m2: 1.2,
        vehicle_mass_kg: Some(400.0),
    };
    let law = Rudd::new(0.35, 0.15).ok().unwrap();
    // Speeds jump from point to point: so noisy that all readings are taken up, which is dearer than refusing them.
    let sensors = Sensors::white(20.0, 0.5, 160.0, 15.0, 5.0);
    let mut settings = Settings::usual(rig, law, sensors, 1600.0);
    // So short that windows of both bands close within the samples, on one and the same of them, too.
    settings.detection = Detection {
        fast_window: 8,
        slow_block: 1,
        slow_window: 8,
        ..Detection::usual()
    };
    Memory {
        monitor: settings.build().ok().unwrap(),
        even: false,
    }
}

#[inline(never)]
#[unsafe(no_mangle)]
pub fn update(memory: &mut Memory, slip: f32, friction: f32) {
    let drag = friction * LOAD_N;
    let sample = RigSample {
        wheel_speed_rad_s: SPEED_M_S * (1.0 - slip) / RADIUS_M,
        vehicle_speed_m_s: SPEED_M_S,
        drag_force_n: drag,
        normal_force_n: LOAD_N,
    };
    // No time step is that of before: the dearest case, for each asks for the parts' exponentials anew.
    memory.even = !memory.even;
    let dt_s = if memory.even { 0.001 } else { 0.0011 };
    let told = memory
        .monitor
        .step(dt_s, &Reading::new(&sample, Some(RADIUS_M * drag)));
    core::hint::black_box((told.is_ok(), memory.monitor.verdict()));
}

/// Mean squares of the fast band, of tyre and wheel.
pub fn answer(memory: &Memory) -> [f32; 2] {
    [Balance::Tyre, Balance::Wheel].map(|balance| {
        let statistics = memory.monitor.statistics(balance, Band::Fast);
        statistics.map_or(0.0, |statistics| statistics.mean_square)
    })
}
