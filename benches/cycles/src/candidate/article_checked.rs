//! The article's filter as the firmware calls it: every check of what it is given, no report.

use muslip::filter::mu_slip::{Config, MuSlipFilter};
use muslip::filter::{Estimator, FrictionMeasurement};

pub struct Memory {
    filter: MuSlipFilter<f32>,
    /// As a controller keeps the point that it has observed.
    measurement: FrictionMeasurement<f32>,
    failed: bool,
}

pub fn start() -> Memory {
    Memory {
        filter: Config::default().build().ok().unwrap(),
        measurement: FrictionMeasurement {
            slip_ratio: 0.0,
            friction: 0.0,
            friction_std: 0.04,
        },
        failed: false,
    }
}

#[inline(never)]
#[unsafe(no_mangle)]
pub fn update(memory: &mut Memory, slip: f32, friction: f32) {
    memory.measurement.slip_ratio = slip;
    memory.measurement.friction = friction;
    if memory.filter.update(&memory.measurement).is_err() {
        memory.failed = true;
    }
}

pub fn answer(memory: &Memory) -> [f32; 2] {
    core::hint::black_box(memory.failed);
    let state = memory.filter.state();
    [state.peak_friction, state.critical_slip]
}
