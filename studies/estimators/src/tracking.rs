//! Tracking of a change.

use muslip::filter::mu_slip::Range;
use muslip::filter::{Estimator, FrictionMeasurement, efficient};
use muslip_analysis::fit::Curve;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::page::Page;

/// The sample of the step, of 260.
const STEP: u32 = 200;
/// Fall of mup a sample.
const DRIFT: f64 = 0.001;

/// Follows a mup of the sample's number at an sp of 0.15 and calls back with each estimate.
fn follow(
    (memory, sigma): (f32, f64),
    samples: u32,
    seed: u64,
    peak_friction: impl Fn(u32) -> f64,
    mut see: impl FnMut(u32, f64),
) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut filter = efficient::Config::<f32> {
        memory: Some(memory),
        ..efficient::Config::for_range(Range::Automotive)
    }
    .build()
    .unwrap();
    for i in 0..samples {
        let truth = Curve {
            peak_friction: peak_friction(i),
            critical_slip: 0.15,
        };
        let slip = 0.21 - 0.19 * (f64::from(i) * 0.12 * std::f64::consts::TAU).cos();
        let friction = truth.friction(slip) + sigma * rng.sample::<f64, _>(StandardNormal);
        filter
            .update(&FrictionMeasurement {
                slip_ratio: slip as f32,
                friction: friction as f32,
                friction_std: sigma as f32,
            })
            .unwrap();
        see(i, f64::from(filter.state().peak_friction));
    }
}

/// Samples after the step until the estimate is within 10 % of 0.3 for good.
fn settling(setting: (f32, f64), seed: u64) -> u32 {
    let mut last_off = 0;
    let step = |i| if i < STEP { 0.8 } else { 0.3 };
    follow(setting, STEP + 60, seed, step, |i, found| {
        if i >= STEP && (found / 0.3 - 1.0).abs() > 0.1 {
            last_off = i + 1 - STEP;
        }
    });
    last_off
}

/// How many samples ago mup was what it is estimated to be, on average.
fn lag(setting: (f32, f64), seed: u64) -> f64 {
    let drift = |i| 0.9 - DRIFT * f64::from(i);
    let mut behind = 0.0;
    follow(setting, STEP + 400, seed, drift, |i, found| {
        if i >= STEP {
            behind += (found - drift(i)) / DRIFT / 400.0;
        }
    });
    behind
}

pub fn tracking(page: &mut Page, seeds: u64) {
    let seeds = seeds.min(2000);
    page.section("Tracking");
    page.paragraph(format!(
        "Slip swings between 0.02 and 0.4 twelve times a hundred samples; {seeds} streams. Samples after a step of mup from 0.8 to 0.3 until the estimate is within 10 % for good; samples that the estimate lags behind a drift of mup of {DRIFT} a sample."
    ));
    page.columns(&[
        "memory, samples",
        "sigma",
        "step: median",
        "95 % of streams",
        "within 20 samples, %",
        "lag behind the drift",
    ]);
    for setting in [(10.0, 0.02), (20.0, 0.02), (50.0, 0.02), (50.0, 0.04)] {
        let (memory, sigma) = setting;
        let mut settled: Vec<u32> = (0..seeds)
            .into_par_iter()
            .map(|seed| settling(setting, seed))
            .collect();
        settled.sort_unstable();
        let within =
            settled.partition_point(|&samples| samples <= 20) as f64 / settled.len() as f64;
        let most = settled[settled.len() * 95 / 100];
        let lags: f64 = (0..200_u64)
            .into_par_iter()
            .map(|seed| lag(setting, seed))
            .sum();
        let lag = lags / 200.0;
        page.row(&[
            memory.to_string(),
            sigma.to_string(),
            settled[settled.len() / 2].to_string(),
            most.to_string(),
            format!("{:.1}", 100.0 * within),
            format!("{lag:.1}"),
        ]);
        let name = format!("tracking, memory {memory}, sigma {sigma}");
        page.bar(
            &format!("{name}: samples after the step, 95 % of streams"),
            "at most 20",
            most.to_string(),
            most <= 20,
        );
        page.bar(
            &format!("{name}: lag behind the drift, samples"),
            "at most the memory, as stated",
            format!("{lag:.1}"),
            lag <= f64::from(memory),
        );
    }
    page.line("");
}
