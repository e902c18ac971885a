//! The estimators: behind a compensated model, and at their dearest.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use muslip_record::{
    CompensationParameters, Estimate, Estimator, LoadCompensation, Parameters, Profile, Program,
    RadiusCompensation, RelaxationCompensation, STEPS, SpeedCompensation, State,
    ThermalCompensation,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Found, LAW, RAMP};
use crate::bench::{Bench, Worst};
use crate::rig::Trouble;

/// Share of the load that the drag channel reads in addition.
const CROSSTALK: f32 = 0.05;
/// Load of the rig in N.
const LOAD_N: f64 = 420.0 * 9.806_65;

/// Every effect that can be compensated, with figures that leave the truth where it is but for the crosstalk.
fn everything() -> CompensationParameters {
    CompensationParameters {
        effective_radius: Some(RadiusCompensation::WithLoad {
            relative_error: 1e-4,
            per_relative_load: 1e-3,
            mean_normal_force_n: LOAD_N as f32,
        }),
        force_delay_s: Some(0.0005),
        force_lag_s: None,
        load_crosstalk: Some(CROSSTALK),
        load_sensitivity: Some(LoadCompensation {
            sensitivity: 0.1,
            critical_slip_exponent: 0.1,
            mean_normal_force_n: LOAD_N as f32,
        }),
        speed_sensitivity: Some(SpeedCompensation::SlidingWithFloor {
            floor: 0.999,
            speed_scale_m_s: 5.0,
        }),
        relaxation: Some(RelaxationCompensation::Slip { length_m: 0.001 }),
        thermal_fade: Some(ThermalCompensation {
            sensitivity_per_s: 1e-4,
            curvature_per_s2: 1e-5,
            time_constant_s: 5.0,
            reference_power_w: 2e4,
        }),
    }
}

/// A run of ramps with a drag channel that reads 5 % of the load in addition, and what is compensated of it.
fn estimated(
    image: &Path,
    compensation: CompensationParameters,
    worst: &mut Worst,
) -> Result<Estimate> {
    let mut bench = Bench::start(image, LAW, 13)?;
    bench.set_parameters(Parameters {
        compensation,
        ..Parameters::default()
    })?;
    bench.rig.trouble.drag_offset_n = f64::from(CROSSTALK) * LOAD_N;
    bench.begin(RAMP)?;
    bench.until(State::Done, 12_000)?;
    ensure!(bench.estimates_compared > 300);
    *worst = worst.most(bench.worst);
    bench.host.heard.estimate.context("no estimate")
}

/// What a diagnosed model says is compensated: the bias goes, and image and host agree bit for bit behind it.
pub fn compensation(image: &Path) -> Result<Found> {
    let mut worst = Worst::default();
    let plain = estimated(image, CompensationParameters::default(), &mut worst)?;
    ensure!(plain.peak_friction > 0.87, "there is no bias: {plain:?}");
    let mut lines = vec![format!("none {:.4}", plain.peak_friction)];
    let full = everything();
    for (compensation, estimator) in [
        (
            CompensationParameters {
                load_crosstalk: Some(CROSSTALK),
                ..CompensationParameters::default()
            },
            Estimator::Efficient,
        ),
        (full, Estimator::Efficient),
        (
            CompensationParameters {
                force_lag_s: Some(1e-4),
                relaxation: Some(RelaxationCompensation::Force { length_m: 0.001 }),
                ..full
            },
            Estimator::Article,
        ),
    ] {
        let estimate = estimated(image, compensation, &mut worst)?;
        let (friction, slip) = (estimate.peak_friction, estimate.critical_slip);
        let estimating = estimate.estimating;
        ensure!(
            (friction - 0.85).abs() < 0.02 && (slip - 0.14).abs() < 0.01,
            "{estimate:?}"
        );
        ensure!(estimating.estimator == estimator, "{estimating:?}");
        lines.push(format!(
            "{} effects behind the {estimator:?} one {friction:.4}",
            estimating.compensated.count_ones()
        ));
    }
    Ok(Found {
        line: format!(
            "peak friction (true 0.85), compensated: {}",
            lines.join(", ")
        ),
        worst,
    })
}

/// The drag at a slip on the road, in N.
fn drag_n(slip: f64) -> f64 {
    let ratio = slip / 0.14;
    LOAD_N * 2.0 * 0.85 * ratio / (1.0 + ratio * ratio)
}

/// Readings that make the efficient estimator do all that it ever does after one sample: every quarter of a binade of
/// slip, single glitches and bursts, noise that grows. Everything is compensated as well.
pub fn worst_estimate(image: &Path) -> Result<Found> {
    let mut worst = Worst::default();
    let (mut without, mut with) = (0, 0);
    for (seed, glitches, noise_n) in [
        (1, 0.0, 50.0),
        (2, 0.01, 50.0),
        (3, 0.1, 100.0),
        (4, 0.3, 400.0),
    ] {
        let mut bench = Bench::start(image, LAW, seed)?;
        bench.set_parameters(Parameters {
            compensation: everything(),
            ..Parameters::default()
        })?;
        bench.begin(Profile {
            program: Program::Steps {
                levels: [0.01; STEPS],
                count: 8,
                hold_s: 60.0,
            },
            skid_slip: 1.0,
            ..RAMP
        })?;
        bench.until(State::Ramp, 1_000)?;
        // Too little slip to be given to the estimator.
        let started = std::mem::take(&mut bench.worst.instructions);
        bench.run(200)?;
        without = without.max(bench.worst.instructions[1]);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut burst = 0;
        for sample in 0..2_500_u32 {
            // Up and down the axis, a quarter of a binade each sample.
            let place = f64::from((sample % 46).abs_diff(23));
            let slip = (0.9 * f64::exp2(-place / 4.0)).max(0.016);
            if random.random_bool(glitches) {
                burst = random.random_range(1..12);
            }
            burst = i32::max(burst - 1, 0);
            let off_n = if burst > 0 { 2_500.0 } else { 0.0 };
            // Twice as noisy in the end as it began.
            let noise_n = noise_n * (1.0 + f64::from(sample) / 2_500.0);
            bench.rig.trouble = Trouble {
                wheel_rad_s: Some(20.0 * (1.0 - slip) / 0.31),
                drag_n: Some(
                    drag_n(slip)
                        + f64::from(CROSSTALK) * LOAD_N
                        + noise_n * random.random_range(-1.7..1.7)
                        - off_n,
                ),
                ..Trouble::default()
            };
            bench.sample()?;
            ensure!(
                bench.brake.hold_pressure,
                "sample {sample}: {:?}",
                bench.host.heard.events
            );
        }
        with = with.max(bench.worst.instructions[1]);
        worst = worst.most(bench.worst).most(Worst {
            instructions: started,
            ..bench.worst
        });
    }
    ensure!(with > without, "the estimator takes nothing");
    Ok(Found {
        line: format!(
            "control {with} instructions at most, {without} without an update: {} for the dearest update of 10,000",
            with - without
        ),
        worst,
    })
}
