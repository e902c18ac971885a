//! Tracking of a change, and recordings that say little.

use host_sim::fit::Curve;
use muslip::filter::mu_slip::Range;
use muslip::filter::{Estimator, FrictionMeasurement, efficient};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::streams::SIGMA;

pub fn tracking(seeds: u64) {
    println!("### Tracking\n");
    println!("Slip swings between 0.02 and 0.4 twelve times a hundred samples, sigma 0.02.\n");
    println!(
        "| memory, samples | samples after a step of mup from 0.8 to 0.3 until within 10 % for good: median, 95 % | lag behind a drift of 0.001 a sample, in samples |\n| --- | --- | --- |"
    );
    for memory in [10.0_f32, 20.0, 50.0] {
        let config = efficient::Config::<f32> {
            memory: Some(memory),
            ..efficient::Config::for_range(Range::Automotive)
        };
        let mut settled: Vec<u32> = (0..seeds.min(2000))
            .into_par_iter()
            .map(|seed| {
                let step = |i| if i < 200 { 0.8 } else { 0.3 };
                tracked(&config, seed, 300, step)
                    .iter()
                    .enumerate()
                    .filter(|(i, (mup, peak))| {
                        (200..260).contains(i) && (peak / mup - 1.0).abs() > 0.1
                    })
                    .map(|(i, _)| i as u32 - 199)
                    .next_back()
                    .unwrap_or(0)
            })
            .collect();
        settled.sort_unstable();
        let lag: f64 = (0..200_u64)
            .into_par_iter()
            .map(|seed| {
                let drift = |i| 0.9 - 0.001 * f64::from(i);
                let behind: f64 = tracked(&config, seed, 600, drift)[200..]
                    .iter()
                    .map(|(mup, peak)| (peak - mup) / 0.001 / 400.0)
                    .sum();
                behind / 200.0
            })
            .sum();
        println!(
            "| {memory} | {}, {} | {lag:.0} |",
            settled[settled.len() / 2],
            settled[settled.len() * 95 / 100]
        );
    }
    println!();
}

/// True and estimated peak friction after each sample of a stream whose peak friction is `mup(i)`.
fn tracked(
    config: &efficient::Config<f32>,
    seed: u64,
    samples: u32,
    mup: impl Fn(u32) -> f64,
) -> Vec<(f64, f64)> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut filter = config.build().unwrap();
    (0..samples)
        .map(|i| {
            let slip = 0.21 - 0.19 * (f64::from(i) * 0.12 * std::f64::consts::TAU).cos();
            let truth = Curve {
                peak_friction: mup(i),
                critical_slip: 0.15,
            };
            let friction = truth.friction(slip) + 0.02 * rng.sample::<f64, _>(StandardNormal);
            let _ = filter.update(&FrictionMeasurement {
                slip_ratio: slip as f32,
                friction: friction as f32,
                friction_std: 0.02,
            });
            (truth.peak_friction, f64::from(filter.state().peak_friction))
        })
        .collect()
}

pub fn survival() {
    println!("### Recordings that say little\n");
    println!("mup 0.6, sp 0.15, sigma 0.04, 400 samples, one stream; start (0.6, 0.2).\n");
    println!(
        "| slips | mup, 1-sigma | sp, 1-sigma | truth within 2 sigma, %: mup, sp |\n| --- | --- | --- | --- |"
    );
    let truth = Curve {
        peak_friction: 0.6,
        critical_slip: 0.15,
    };
    type Slips = fn(u32) -> f64;
    let cases: [(&str, Slips); 5] = [
        ("0 to 0.03, never near the peak", |i| {
            0.03 * f64::from(i) / 400.0
        }),
        ("0 to 0.08, half way to the peak", |i| {
            0.08 * f64::from(i) / 400.0
        }),
        ("1 to 0, falling", |i| 1.0 - f64::from(i) / 400.0),
        ("all at 0.1", |_| 0.1),
        ("all at 0", |_| 0.0),
    ];
    for (name, slips) in cases {
        let mut sums = [0.0_f64; 6];
        const STREAMS: u64 = 300;
        for seed in 0..STREAMS {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut filter = efficient::Config::<f32>::default().build().unwrap();
            for i in 0..400 {
                let friction =
                    truth.friction(slips(i)) + SIGMA * rng.sample::<f64, _>(StandardNormal);
                filter
                    .update(&FrictionMeasurement {
                        slip_ratio: slips(i) as f32,
                        friction: friction as f32,
                        friction_std: SIGMA as f32,
                    })
                    .unwrap();
            }
            let peak = filter.peak();
            let within = |value: f32, std: f32, truth: f64| {
                f64::from(u8::from(
                    (f64::from(value) - truth).abs() < 2.0 * f64::from(std),
                ))
            };
            for (sum, value) in sums.iter_mut().zip([
                f64::from(peak.peak_friction),
                f64::from(peak.peak_friction_std),
                f64::from(peak.critical_slip),
                f64::from(peak.critical_slip_std),
                100.0 * within(peak.peak_friction, peak.peak_friction_std, 0.6),
                100.0 * within(peak.critical_slip, peak.critical_slip_std, 0.15),
            ]) {
                *sum += value / STREAMS as f64;
            }
        }
        let [mup, mup_std, sp, sp_std, mup_in, sp_in] = sums;
        println!(
            "| {name} | {mup:.3}, {mup_std:.3} | {sp:.3}, {sp_std:.3} | {mup_in:.0}, {sp_in:.0} |"
        );
    }
    println!();
}
