//! The estimators side by side: prints `docs/estimators.md`'s part on accuracy.
//!
//! `cargo run --release -p host-sim --example estimators [SEEDS]`; without an argument 10,000 streams of
//! noise a curve.
#![allow(clippy::unwrap_used, reason = "a program that may end by panicking")]

use host_sim::fit::{Curve, fit_curve};
use muslip::filter::mu_slip::{Config as ArticleConfig, Covariance, Range, State};
use muslip::filter::{Estimator, FrictionMeasurement, efficient};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

const SIGMA: f64 = 0.04;
const PEAKS: [f64; 5] = [0.1, 0.2, 0.35, 0.6, 1.0];
const SLIPS: [f64; 5] = [0.10, 0.125, 0.15, 0.175, 0.20];

fn article_slips() -> Vec<f64> {
    (0..=40).map(|i| (f64::from(i) / 40.0).powi(2)).collect()
}

/// Ten applications in 10,000 samples: a ramp to skid, then a release.
fn rig_slips() -> Vec<f64> {
    (0..10_000)
        .map(|i| {
            let phase = f64::from(i % 1000) / 1000.0;
            if phase < 0.6 {
                (phase / 0.6).powi(3)
            } else if phase < 0.7 {
                1.0
            } else {
                ((1.0 - phase) / 0.3).powi(4)
            }
        })
        .collect()
}

/// A way to disturb a stream.
#[derive(Clone, Copy, Default)]
struct Disturbance {
    outliers: f64,
    slip_std: f64,
}

struct Stream {
    slips: Vec<f64>,
    frictions: Vec<f64>,
    clean: Vec<f64>,
}

fn stream(truth: Curve, slips: &[f64], disturbance: Disturbance, seed: u64) -> Stream {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let clean: Vec<f64> = slips
        .iter()
        .map(|&slip| truth.friction(slip) + SIGMA * rng.sample::<f64, _>(StandardNormal))
        .collect();
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x5eed_0000_0000);
    let frictions = clean
        .iter()
        .map(|&friction| {
            let (hit, side) = (rng.random::<f64>(), rng.random::<f64>());
            if hit < disturbance.outliers {
                friction + 10.0 * SIGMA * if side < 0.5 { -1.0 } else { 1.0 }
            } else {
                friction
            }
        })
        .collect();
    let slips = slips
        .iter()
        .map(|&slip| slip + disturbance.slip_std * rng.sample::<f64, _>(StandardNormal))
        .collect();
    Stream {
        slips,
        frictions,
        clean,
    }
}

/// What one estimator made of one stream: errors, normalised error squared, mean NIS, lag-1 correlation.
#[derive(Clone, Copy, Default)]
struct Outcome {
    error: [f64; 2],
    nees: f64,
    nis: f64,
    lag: f64,
}

fn nees(error: [f64; 2], p: Covariance<f64>) -> f64 {
    let determinant = p.p00 * p.p11 - p.p01 * p.p01;
    (p.p11 * error[0] * error[0] - 2.0 * p.p01 * error[0] * error[1] + p.p00 * error[1] * error[1])
        / determinant
}

fn range(truth: Curve) -> Range {
    if truth.peak_friction > 0.6 {
        Range::Automotive
    } else {
        Range::Aircraft
    }
}

fn errors(truth: Curve, state: State<f64>) -> [f64; 2] {
    [
        state.peak_friction - truth.peak_friction,
        state.critical_slip - truth.critical_slip,
    ]
}

/// Batch maximum likelihood on the stream without outliers.
fn batch(truth: Curve, stream: &Stream) -> Option<Outcome> {
    let start: State<f64> = range(truth).initial_state();
    let start = Curve {
        peak_friction: start.peak_friction,
        critical_slip: start.critical_slip,
    };
    let fit = fit_curve(&stream.slips, &stream.clean, start, 200).ok()?;
    let error = errors(
        truth,
        State {
            peak_friction: fit.curve.peak_friction,
            critical_slip: fit.curve.critical_slip,
        },
    );
    let (p00, p01, p11) = fit.covariance;
    (fit.converged && fit.curve.critical_slip < 2.0).then(|| Outcome {
        error,
        nees: nees(error, Covariance { p00, p01, p11 }),
        ..Outcome::default()
    })
}

/// The efficient estimator in single precision, told `declared` times the noise.
fn efficient_run(truth: Curve, stream: &Stream, declared: f64) -> Outcome {
    let mut filter = efficient::Config::<f32>::for_range(range(truth))
        .build()
        .unwrap();
    let (mut nis, mut lag, mut before, mut count) = (0.0, 0.0, 0.0, 0.0);
    for (index, (&slip, &friction)) in stream.slips.iter().zip(&stream.frictions).enumerate() {
        let fusion = filter
            .update(&FrictionMeasurement {
                slip_ratio: slip as f32,
                friction: friction as f32,
                friction_std: (declared * SIGMA) as f32,
            })
            .unwrap();
        let unit = f64::from(fusion.innovation) / f64::from(fusion.innovation_variance).sqrt();
        // Once the noise has been learnt: the second half.
        if 2 * index > stream.slips.len() {
            nis += unit * unit;
            lag += unit * before;
            count += 1.0;
        }
        before = unit;
    }
    let State {
        peak_friction,
        critical_slip,
    } = filter.state();
    let error = errors(
        truth,
        State {
            peak_friction: f64::from(peak_friction),
            critical_slip: f64::from(critical_slip),
        },
    );
    let p = filter.covariance();
    let p = Covariance {
        p00: f64::from(p.p00),
        p01: f64::from(p.p01),
        p11: f64::from(p.p11),
    };
    Outcome {
        error,
        nees: nees(error, p),
        nis: nis / count,
        lag: lag / nis,
    }
}

fn article_run(truth: Curve, stream: &Stream) -> Outcome {
    let mut filter = ArticleConfig::<f64>::for_range(range(truth))
        .build()
        .unwrap();
    for (&slip_ratio, &friction) in stream.slips.iter().zip(&stream.frictions) {
        let _ = filter.update(&FrictionMeasurement {
            slip_ratio,
            friction,
            friction_std: SIGMA,
        });
    }
    let error = errors(truth, filter.state());
    Outcome {
        error,
        nees: nees(error, filter.covariance()),
        ..Outcome::default()
    }
}

/// The iterated extended Kalman filter (ten relinearisations a sample), told the true noise.
fn iterated_run(truth: Curve, stream: &Stream) -> Outcome {
    let start: State<f64> = range(truth).initial_state();
    let mut x = [start.peak_friction, start.critical_slip];
    let mut p = [x[0] * x[0], 0.0, x[1] * x[1]];
    for (&s, &z) in stream.slips.iter().zip(&stream.frictions) {
        let mut at = x;
        let mut gain = [0.0; 2];
        let mut g = [0.0; 2];
        for _ in 0..10 {
            let curve = Curve {
                peak_friction: at[0],
                critical_slip: at[1],
            };
            let (h0, h1) = curve.gradient(s);
            g = [p[0] * h0 + p[1] * h1, p[1] * h0 + p[2] * h1];
            let variance = h0 * g[0] + h1 * g[1] + SIGMA * SIGMA;
            gain = g.map(|g| g / variance);
            let innovation = z - curve.friction(s) - h0 * (x[0] - at[0]) - h1 * (x[1] - at[1]);
            at = [x[0] + gain[0] * innovation, x[1] + gain[1] * innovation];
        }
        x = at;
        p = [
            p[0] - gain[0] * g[0],
            p[1] - gain[0] * g[1],
            p[2] - gain[1] * g[1],
        ];
    }
    two_state(truth, x, p)
}

/// The unscented filter (alpha 1, kappa 1, beta 0), told the true noise.
fn unscented_run(truth: Curve, stream: &Stream) -> Outcome {
    let start: State<f64> = range(truth).initial_state();
    let mut x = [start.peak_friction, start.critical_slip];
    let mut p = [x[0] * x[0], 0.0, x[1] * x[1]];
    for (&s, &z) in stream.slips.iter().zip(&stream.frictions) {
        // Cholesky factor of 3 P
        let l00 = (3.0 * p[0]).sqrt();
        let l10 = 3.0 * p[1] / l00;
        let l11 = (3.0 * p[2] - l10 * l10).max(1e-12).sqrt();
        let spread = [
            [0.0, 0.0],
            [l00, l10],
            [-l00, -l10],
            [0.0, l11],
            [0.0, -l11],
        ];
        let weights = [1.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0];
        let friction = spread.map(|d| {
            Curve {
                peak_friction: x[0] + d[0],
                critical_slip: x[1] + d[1],
            }
            .friction(s)
        });
        let mean: f64 = friction.iter().zip(weights).map(|(f, w)| f * w).sum();
        let (mut variance, mut g) = (SIGMA * SIGMA, [0.0; 2]);
        for ((f, w), d) in friction.iter().zip(weights).zip(spread) {
            variance += w * (f - mean).powi(2);
            g[0] += w * (f - mean) * d[0];
            g[1] += w * (f - mean) * d[1];
        }
        let gain = g.map(|g| g / variance);
        x = [x[0] + gain[0] * (z - mean), x[1] + gain[1] * (z - mean)];
        p = [
            p[0] - gain[0] * g[0],
            p[1] - gain[0] * g[1],
            p[2] - gain[1] * g[1],
        ];
    }
    two_state(truth, x, p)
}

fn two_state(truth: Curve, x: [f64; 2], p: [f64; 3]) -> Outcome {
    let error = [x[0] - truth.peak_friction, x[1] - truth.critical_slip];
    let [p00, p01, p11] = p;
    Outcome {
        error,
        nees: nees(error, Covariance { p00, p01, p11 }),
        ..Outcome::default()
    }
}

/// Cramér-Rao bound of both standard deviations.
fn bound(truth: Curve, slips: &[f64]) -> [f64; 2] {
    let (mut a, mut b, mut c) = (0.0, 0.0, 0.0);
    for &slip in slips {
        let (h0, h1) = truth.gradient(slip);
        a += h0 * h0;
        b += h0 * h1;
        c += h1 * h1;
    }
    let determinant = a * c - b * b;
    [
        SIGMA * (c / determinant).sqrt(),
        SIGMA * (a / determinant).sqrt(),
    ]
}

/// Runs one estimator over one stream.
type Contender<'a> = dyn Fn(Curve, &Stream) -> Outcome + Sync + 'a;

/// Sums over streams.
struct Summary {
    rmse: [f64; 2],
    bias: [f64; 2],
    nees: f64,
    coverage: f64,
    nis: f64,
    lag: f64,
}

fn summary<'a>(outcomes: impl Iterator<Item = &'a Outcome>) -> Summary {
    let mut s = Summary {
        rmse: [0.0; 2],
        bias: [0.0; 2],
        nees: 0.0,
        coverage: 0.0,
        nis: 0.0,
        lag: 0.0,
    };
    let mut n = 0.0;
    for outcome in outcomes {
        n += 1.0;
        for index in 0..2 {
            s.rmse[index] += outcome.error[index].powi(2);
            s.bias[index] += outcome.error[index];
        }
        s.nees += outcome.nees;
        s.coverage += if outcome.nees < 1.0 { 1.0 } else { 0.0 };
        s.nis += outcome.nis;
        s.lag += outcome.lag;
    }
    s.rmse = s.rmse.map(|sum: f64| (sum / n).sqrt());
    s.bias = s.bias.map(|sum| sum / n);
    s.nees /= n;
    s.coverage /= n;
    s.nis /= n;
    s.lag /= n;
    s
}

fn grid() -> Vec<Curve> {
    PEAKS
        .iter()
        .flat_map(|&peak_friction| {
            SLIPS.iter().map(move |&critical_slip| Curve {
                peak_friction,
                critical_slip,
            })
        })
        .collect()
}

fn run<const N: usize>(
    truth: Curve,
    slips: &[f64],
    disturbance: Disturbance,
    seeds: u64,
    contenders: [&Contender<'_>; N],
) -> (Summary, [Summary; N]) {
    let outcomes: Vec<(Outcome, [Outcome; N])> = (0..seeds)
        .into_par_iter()
        .filter_map(|seed| {
            let stream = stream(truth, slips, disturbance, seed);
            // Streams on which the likelihood has no peak count for nobody.
            let batch = batch(truth, &stream)?;
            Some((batch, contenders.map(|contender| contender(truth, &stream))))
        })
        .collect();
    let batch = summary(outcomes.iter().map(|(batch, _)| batch));
    let others =
        std::array::from_fn(|which| summary(outcomes.iter().map(|(_, others)| &others[which])));
    (batch, others)
}

fn accuracy(seeds: u64) {
    let slips = article_slips();
    println!("### Over the article's range, 41 samples, sigma 0.04, {seeds} streams a curve\n");
    println!(
        "RMSE over the Cramér-Rao bound (mup, sp) of batch maximum likelihood (ML), the article's filter, an iterated extended and an unscented Kalman filter (both told the true noise); the efficient estimator in `f32` over ML on the same streams; its bias beyond ML's in sigmas of the bound; its mean NEES over ML's; how often its 1-sigma ellipse holds the truth (39.3 %); mean NIS and lag-1 correlation of the second half's innovations.\n"
    );
    println!(
        "| mup | sp | ML / bound | article / bound | iterated / bound | unscented / bound | efficient / ML | bias beyond ML's | NEES / ML's | ellipse, % | NIS | lag 1 |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let mut worst = [0.0_f64; 4];
    for truth in grid() {
        let limit = bound(truth, &slips);
        let (ml, [efficient, article, iterated, unscented]) = run(
            truth,
            &slips,
            Disturbance::default(),
            seeds,
            [
                &|truth, stream| efficient_run(truth, stream, 1.0),
                &article_run,
                &iterated_run,
                &unscented_run,
            ],
        );
        let over = |s: &Summary| {
            let ratio = |index: usize| {
                let ratio = s.rmse[index] / limit[index];
                if ratio < 100.0 {
                    format!("{ratio:.2}")
                } else {
                    ">100".to_owned()
                }
            };
            format!("{}, {}", ratio(0), ratio(1))
        };
        let ratio = [0, 1].map(|i| efficient.rmse[i] / ml.rmse[i]);
        let beyond = [0, 1].map(|i| (efficient.bias[i].abs() - ml.bias[i].abs()) / limit[i]);
        println!(
            "| {} | {} | {} | {} | {} | {} | {:.3}, {:.3} | {:+.3}, {:+.3} | {:.3} | {:.1} | {:.3} | {:+.3} |",
            truth.peak_friction,
            truth.critical_slip,
            over(&ml),
            over(&article),
            over(&iterated),
            over(&unscented),
            ratio[0],
            ratio[1],
            beyond[0],
            beyond[1],
            efficient.nees / ml.nees,
            100.0 * efficient.coverage,
            efficient.nis,
            efficient.lag
        );
        worst[0] = worst[0].max(ratio[0]).max(ratio[1]);
        worst[1] = worst[1].max(beyond[0]).max(beyond[1]);
        worst[2] = worst[2].max((efficient.nees / ml.nees - 1.0).abs());
        worst[3] = worst[3].max((100.0 * efficient.coverage - 39.3).abs());
    }
    println!(
        "\nWorst, beside the bar: RMSE {:.3} of ML's (1.03); bias {:+.3} sigma beyond ML's (0.05); NEES off ML's by {:.1} % (5); ellipse off 39.3 % by {:.1} (2).\n",
        worst[0],
        worst[1],
        100.0 * worst[2],
        worst[3]
    );
}

/// Worst ratios to batch maximum likelihood on streams without outliers, over the grid.
fn worst_over_grid(
    name: &str,
    bar: &str,
    slips: &[f64],
    disturbance: Disturbance,
    seeds: u64,
    declared: f64,
) {
    let mut ratio = [0.0_f64; 2];
    let mut at = [Curve {
        peak_friction: 0.0,
        critical_slip: 0.0,
    }; 2];
    let mut nees = 0.0_f64;
    let mut mean = 0.0;
    for truth in grid() {
        let (ml, [efficient]) = run(
            truth,
            slips,
            disturbance,
            seeds,
            [&|truth, stream| efficient_run(truth, stream, declared)],
        );
        for index in 0..2 {
            let here = efficient.rmse[index] / ml.rmse[index];
            mean += here / 50.0;
            if here > ratio[index] {
                ratio[index] = here;
                at[index] = truth;
            }
        }
        let off = efficient.nees / ml.nees - 1.0;
        if off.abs() > nees.abs() {
            nees = off;
        }
    }
    println!(
        "| {name} | {:.3} at ({}, {}) | {:.3} at ({}, {}) | {mean:.3} | {:+.1} % | {bar} |",
        ratio[0],
        at[0].peak_friction,
        at[0].critical_slip,
        ratio[1],
        at[1].peak_friction,
        at[1].critical_slip,
        100.0 * nees
    );
}

fn conditions(seeds: u64) {
    println!("### Under other conditions\n");
    println!(
        "RMSE of the efficient estimator (`f32`) over that of ML on the same streams; ML sees no outliers. The worst of the 25 curves, and the mean of both ratios over them.\n"
    );
    println!(
        "| condition | mup, worst | sp, worst | mean | NEES off ML's, worst | bar |\n| --- | --- | --- | --- | --- | --- |"
    );
    let short = article_slips();
    let long = rig_slips();
    let none = Disturbance::default();
    worst_over_grid(
        "noise declared half of what it is",
        "1.03; 5 %",
        &short,
        none,
        seeds,
        0.5,
    );
    worst_over_grid(
        "noise declared half as much again",
        "1.03; 5 %",
        &short,
        none,
        seeds,
        1.5,
    );
    let fewer = (seeds / 50).max(20);
    worst_over_grid(
        &format!("10,000 samples of a rig, {fewer} streams a curve"),
        "1.03; 5 %",
        &long,
        none,
        fewer,
        1.0,
    );
    let outliers = Disturbance {
        outliers: 0.05,
        ..none
    };
    worst_over_grid(
        "5 % outliers of 10 sigma, 41 samples",
        "1.10",
        &short,
        outliers,
        seeds,
        1.0,
    );
    worst_over_grid(
        &format!("5 % outliers of 10 sigma, 10,000 samples, {fewer} streams"),
        "1.10",
        &long,
        outliers,
        fewer,
        1.0,
    );
    println!();
    println!(
        "Slip noise is not modelled. Mean error of sp and mup in percent with a slip noise of 0.005 and 0.01 (1-sigma), 41 samples and 10,000, at mup 0.6, sp 0.15: ML takes the noisy slip as known, too.\n"
    );
    println!(
        "| slip noise | samples | efficient: mup, sp | ML: mup, sp | article: mup, sp |\n| --- | --- | --- | --- | --- |"
    );
    let truth = Curve {
        peak_friction: 0.6,
        critical_slip: 0.15,
    };
    for slip_std in [0.005, 0.01] {
        for (slips, seeds) in [(&short, seeds), (&long, fewer)] {
            let (ml, [efficient, article]) = run(
                truth,
                slips,
                Disturbance { slip_std, ..none },
                seeds,
                [
                    &|truth, stream| efficient_run(truth, stream, 1.0),
                    &article_run,
                ],
            );
            let percent = |s: &Summary| {
                format!(
                    "{:+.2}, {:+.2}",
                    100.0 * s.bias[0] / 0.6,
                    100.0 * s.bias[1] / 0.15
                )
            };
            println!(
                "| {slip_std} | {} | {} | {} | {} |",
                slips.len(),
                percent(&efficient),
                percent(&ml),
                percent(&article)
            );
        }
    }
    println!();
}

fn tracking(seeds: u64) {
    println!("### Tracking\n");
    println!("Slip swings between 0.02 and 0.4 twelve times a hundred samples, sigma 0.02.\n");
    println!(
        "| memory, samples | samples after a step of mup from 0.8 to 0.3 until within 10 % for good: median, 95 % | lag behind a drift of 0.001 a sample, in samples |\n| --- | --- | --- |"
    );
    for memory in [10.0_f32, 20.0, 50.0] {
        let slip = |i: u32| 0.21 - 0.19 * (f64::from(i) * 0.12 * std::f64::consts::TAU).cos();
        let config = efficient::Config::<f32> {
            memory: Some(memory),
            ..efficient::Config::for_range(Range::Automotive)
        };
        let mut settled: Vec<u32> = (0..seeds.min(2000))
            .into_par_iter()
            .map(|seed| {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                let mut filter = config.build().unwrap();
                let mut last_off = 0;
                for i in 0..300_u32 {
                    let mup = if i < 200 { 0.8 } else { 0.3 };
                    let truth = Curve {
                        peak_friction: mup,
                        critical_slip: 0.15,
                    };
                    let friction =
                        truth.friction(slip(i)) + 0.02 * rng.sample::<f64, _>(StandardNormal);
                    let _ = filter.update(&FrictionMeasurement {
                        slip_ratio: slip(i) as f32,
                        friction: friction as f32,
                        friction_std: 0.02,
                    });
                    if (200..260).contains(&i)
                        && (f64::from(filter.state().peak_friction) / 0.3 - 1.0).abs() > 0.1
                    {
                        last_off = i - 199;
                    }
                }
                last_off
            })
            .collect();
        settled.sort_unstable();
        let lag: f64 = (0..200_u64)
            .into_par_iter()
            .map(|seed| {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                let mut filter = config.build().unwrap();
                let mut behind = 0.0;
                for i in 0..600_u32 {
                    let mup = 0.9 - 0.001 * f64::from(i);
                    let truth = Curve {
                        peak_friction: mup,
                        critical_slip: 0.15,
                    };
                    let friction =
                        truth.friction(slip(i)) + 0.02 * rng.sample::<f64, _>(StandardNormal);
                    let _ = filter.update(&FrictionMeasurement {
                        slip_ratio: slip(i) as f32,
                        friction: friction as f32,
                        friction_std: 0.02,
                    });
                    if i >= 200 {
                        behind += (f64::from(filter.state().peak_friction) - mup) / 0.001 / 400.0;
                    }
                }
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

fn survival() {
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

fn main() {
    let seeds = std::env::args()
        .nth(1)
        .map_or(10_000, |text| text.parse().unwrap());
    println!(
        "## Accuracy\n\nPrinted by `cargo run --release -p host-sim --example estimators {seeds}`; ChaCha8 streams, seeds from 0.\n"
    );
    accuracy(seeds);
    conditions(seeds);
    tracking(seeds);
    survival();
}
