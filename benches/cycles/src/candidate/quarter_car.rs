//! One step of the quarter car's filter: a prediction and a correction with the wheel's speed.

use muslip_laws::burckhardt::DRY_ASPHALT;
use muslip_quarter_car::filter::{Channel, Config, Filter, Measurement, Road, Vehicle};

pub type Memory = Filter<f32>;

pub fn start() -> Memory {
    let vehicle = Vehicle {
        radius_m: 0.3,
        inertia_kg_m2: 1.0,
        gravity_m_s2: 9.81,
    };
    Config::tuned(vehicle, Road::Known(DRY_ASPHALT.law()), 30.0)
        .build()
        .ok()
        .unwrap()
}

#[inline(never)]
#[unsafe(no_mangle)]
pub fn update(memory: &mut Memory, slip: f32, friction: f32) {
    // A brake that is applied as the slips rise, and a wheel that slows with it.
    let predicted = memory.predict(1200.0 * slip);
    let corrected = memory.update(&Measurement {
        channel: Channel::WheelSpeed,
        value: 100.0 - 20.0 * slip + friction,
        variance: 0.25,
    });
    core::hint::black_box((predicted.is_ok(), corrected.is_ok()));
}

pub fn answer(memory: &Memory) -> [f32; 2] {
    let state = memory.estimate().state;
    [state.friction, state.slip_ratio]
}
