//! The efficient estimator.

use muslip::filter::efficient::{self, Config, EfficientFilter};

/// 0.04²
const VARIANCE: f32 = 0.0016;

pub type Memory = EfficientFilter<f32>;

pub fn start() -> Memory {
    Config::default().build().ok().unwrap()
}

#[inline(never)]
#[unsafe(no_mangle)]
pub fn update(memory: &mut Memory, slip: f32, friction: f32) {
    efficient::update_unchecked(memory, slip, friction, VARIANCE);
}

pub fn answer(memory: &Memory) -> [f32; 2] {
    let state = memory.state();
    [state.peak_friction, state.critical_slip]
}
