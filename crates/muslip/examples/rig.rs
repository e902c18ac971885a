//! A rig's loop: raw channels in, a thousand samples a second, the peak of the curve out.
//!
//! `cargo run -p muslip --example rig`. The tyre and its noise are made up here; on a rig `read` is the four channels.

use std::error::Error;

use muslip::filter::efficient::Config;
use muslip::filter::mu_slip::Range;
use muslip::filter::{Decision, Estimator, FrictionMeasurement};
use muslip::sample::{SampleLimits, slip_friction};

mod tyre;
use tyre::{DRAG_STD_N, EFFECTIVE_RADIUS_M, LOAD_N, read};

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
