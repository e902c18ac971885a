//! The article's filter, lean.

use muslip::filter::mu_slip::{Covariance, Range, State, update_unchecked};

/// (3 · 0.04)²
const INFLATED: f32 = 0.0144;

pub struct Memory {
    state: State<f32>,
    covariance: Covariance<f32>,
}

pub fn start() -> Memory {
    Memory {
        state: Range::Aircraft.initial_state(),
        covariance: Range::Aircraft.initial_covariance(),
    }
}

#[inline(never)]
#[unsafe(no_mangle)]
pub fn update(memory: &mut Memory, slip: f32, friction: f32) {
    (memory.state, memory.covariance) =
        update_unchecked(memory.state, memory.covariance, slip, friction, INFLATED);
}

pub fn answer(memory: &Memory) -> [f32; 2] {
    [memory.state.peak_friction, memory.state.critical_slip]
}
