//! A tyre and its noise, made up: what the four channels of a rig would read.

use muslip::sample::RigSample;

/// Radius of the freely rolling wheel in m.
pub const EFFECTIVE_RADIUS_M: f32 = 0.31;
/// Load in N.
pub const LOAD_N: f32 = 4000.0;
/// Noise of the drag channel in N, one sigma.
pub const DRAG_STD_N: f32 = 80.0;

/// The tyre of these examples: peak friction 0.85 at slip 0.13.
fn friction(slip: f32) -> f32 {
    let r = slip / 0.13;
    2.0 * 0.85 * r / (1.0 + r * r)
}

/// A brake applied over a second at 20 m/s, and released.
pub fn read(tick: u16, random: &mut u32) -> RigSample<f32> {
    let phase = f32::from(tick) / 1000.0;
    let slip = if phase < 0.8 {
        0.35 * (phase / 0.8) * (phase / 0.8)
    } else {
        0.35 * (1.0 - phase) / 0.2
    };
    RigSample {
        wheel_speed_rad_s: 20.0 * (1.0 - slip) / EFFECTIVE_RADIUS_M,
        vehicle_speed_m_s: 20.0,
        drag_force_n: friction(slip) * LOAD_N + DRAG_STD_N * noise(random),
        normal_force_n: LOAD_N,
    }
}

/// About normal, mean 0 and deviation 1: twelve uniform numbers of a linear congruential generator.
fn noise(random: &mut u32) -> f32 {
    let mut sum = -6.0;
    for _ in 0..12 {
        *random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        sum += f32::from((*random >> 16) as u16) / 65_536.0;
    }
    sum
}
