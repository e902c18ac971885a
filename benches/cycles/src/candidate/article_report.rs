//! The article's filter with innovation, normalised innovation and checks of its inputs.

use muslip::filter::mu_slip::{Config, Fusion, MuSlipFilter, UpdateError};
use muslip::filter::{Estimator, FrictionMeasurement};

pub struct Memory {
    filter: MuSlipFilter<f32>,
    last: Option<Result<Fusion<f32>, UpdateError>>,
}

pub fn start() -> Memory {
    Memory {
        filter: Config::default().build().ok().unwrap(),
        last: None,
    }
}

#[inline(never)]
#[unsafe(no_mangle)]
pub fn update(memory: &mut Memory, slip: f32, friction: f32) {
    memory.last = Some(memory.filter.update_reporting(&FrictionMeasurement {
        slip_ratio: slip,
        friction,
        friction_std: 0.04,
    }));
}

pub fn answer(memory: &Memory) -> [f32; 2] {
    core::hint::black_box(&memory.last);
    let state = memory.filter.state();
    [state.peak_friction, state.critical_slip]
}
