//! Slip and friction from the raw channels.

use muslip::sample::{RigSample, SampleError, SampleLimits, SlipFriction, slip_friction};

pub struct Memory {
    limits: SampleLimits<f32>,
    last: Option<Result<SlipFriction<f32>, SampleError>>,
}

pub fn start() -> Memory {
    Memory {
        limits: SampleLimits::for_median_normal_force(4000.0),
        last: None,
    }
}

#[inline(never)]
#[unsafe(no_mangle)]
pub fn update(memory: &mut Memory, slip: f32, friction: f32) {
    // The raw channels of a wheel that has this much to do with the point.
    let sample = RigSample {
        wheel_speed_rad_s: 60.0 - slip,
        vehicle_speed_m_s: 20.0,
        drag_force_n: friction,
        normal_force_n: 4000.0,
    };
    memory.last = Some(slip_friction(&sample, 0.31, &memory.limits));
}

pub fn answer(memory: &Memory) -> [f32; 2] {
    match memory.last {
        Some(Ok(point)) => [point.friction, point.slip_ratio],
        _ => [0.0, 0.0],
    }
}
