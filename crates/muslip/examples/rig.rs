//! A rig's loop: raw channels in, a thousand samples a second, the peak of the curve out.
//!
//! `cargo run -p muslip --example rig`. The tyre and its noise are made up here; on a rig `read` is the four channels.

use std::error::Error;

use muslip::filter::efficient::Config;
use muslip::filter::mu_slip::Range;
use muslip::filter::{Decision, Estimator, FrictionMeasurement};
use muslip::sample::{RigSample, SampleLimits, slip_friction};

/// Radius of the freely rolling wheel in m.
const EFFECTIVE_RADIUS_M: f32 = 0.31;
/// Load in N.
const LOAD_N: f32 = 4000.0;
/// Noise of the drag channel in N, one sigma.
const DRAG_STD_N: f32 = 80.0;

/// The tyre of this example: peak friction 0.85 at slip 0.13.
fn friction(slip: f32) -> f32 {
    let r = slip / 0.13;
    2.0 * 0.85 * r / (1.0 + r * r)
}

/// A brake applied over a second at 20 m/s, and released.
fn read(tick: u16, random: &mut u32) -> RigSample<f32> {
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

fn main() -> Result<(), Box<dyn Error>> {
    let limits = SampleLimits::for_median_normal_force(LOAD_N);
    let mut filter = Config::for_range(Range::Automotive).build()?;
    let mut random = 1;
    let (mut used, mut rejected, mut skipped) = (0, 0, 0);

    for tick in 0..1000 {
        let sample = read(tick, &mut random);
        // A wheel at standstill or without load is no measurement: the sample is passed over.
        let Ok(point) = slip_friction(&sample, EFFECTIVE_RADIUS_M, &limits) else {
            skipped += 1;
            continue;
        };
        // An error is a broken input; the estimate is what it was before.
        match filter.update(&FrictionMeasurement {
            slip_ratio: point.slip_ratio,
            friction: point.friction,
            friction_std: DRAG_STD_N / sample.normal_force_n,
        })? {
            Decision::Accepted => used += 1,
            Decision::Rejected => rejected += 1,
        }
    }

    let peak = filter.peak();
    println!("{used} samples used, {rejected} rejected, {skipped} skipped");
    println!(
        "peak friction {:.3} ± {:.3} (true 0.850)",
        peak.peak_friction, peak.peak_friction_std
    );
    println!(
        "at slip       {:.3} ± {:.3} (true 0.130)",
        peak.critical_slip, peak.critical_slip_std
    );
    Ok(())
}
