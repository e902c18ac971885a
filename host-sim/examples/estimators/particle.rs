//! A particle filter as truth: the posterior mean, with no more approximation than the number of particles.

use host_sim::fit::Curve;
use muslip::filter::mu_slip::State;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;

use super::contenders::{Outcome, efficient_run, errors};
use super::streams::{Disturbance, SIGMA, Stream, article_slips, range};
use super::summary::run;

const PARTICLES: usize = 4000;
/// Share of its own place that a particle keeps when it is spread anew (Liu and West, 2001).
const SHRINKAGE: f64 = 0.98;

/// Particles in (mup, ln sp), told the true noise, from the efficient estimator's own prior: mup
/// N(start, start²) cut at zero, ln sp N(start, 0.7²).
fn particle_run(truth: Curve, stream: &Stream) -> Outcome {
    // Its own randomness, the same for every stream.
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let start: State<f64> = range(truth).initial_state();
    let mut normal = || rng.sample::<f64, _>(StandardNormal);
    let mut particles: Vec<[f64; 2]> = Vec::with_capacity(PARTICLES);
    while particles.len() < PARTICLES {
        let mup = start.peak_friction * (1.0 + normal());
        if mup > 0.0 {
            particles.push([mup, start.critical_slip.ln() + 0.7 * normal()]);
        }
    }
    let mut logarithms = vec![0.0_f64; PARTICLES];
    let mut weights = vec![1.0 / PARTICLES as f64; PARTICLES];
    for (&slip, &friction) in stream.slips.iter().zip(&stream.frictions) {
        for (logarithm, [mup, ln_sp]) in logarithms.iter_mut().zip(&particles) {
            let curve = Curve {
                peak_friction: *mup,
                critical_slip: ln_sp.exp(),
            };
            *logarithm -= 0.5 * ((friction - curve.friction(slip)) / SIGMA).powi(2);
        }
        let most = logarithms.iter().copied().fold(f64::MIN, f64::max);
        for (weight, logarithm) in weights.iter_mut().zip(&logarithms) {
            *weight = (logarithm - most).exp();
        }
        let total: f64 = weights.iter().sum();
        for weight in &mut weights {
            *weight /= total;
        }
        let effective = 1.0 / weights.iter().map(|weight| weight * weight).sum::<f64>();
        if effective < 0.5 * PARTICLES as f64 {
            particles = spread(&particles, &weights, &mut normal);
            logarithms.fill(0.0);
            weights.fill(1.0 / PARTICLES as f64);
        }
    }
    let mut state = State {
        peak_friction: 0.0,
        critical_slip: 0.0,
    };
    for ([mup, ln_sp], weight) in particles.iter().zip(&weights) {
        state.peak_friction += weight * mup;
        state.critical_slip += weight * ln_sp.exp();
    }
    Outcome {
        error: errors(truth, state),
        ..Outcome::default()
    }
}

/// Draws particles by weight, drawn towards their mean and spread so that mean and covariance stay.
fn spread(
    particles: &[[f64; 2]],
    weights: &[f64],
    normal: &mut impl FnMut() -> f64,
) -> Vec<[f64; 2]> {
    let mut mean = [0.0; 2];
    for (particle, weight) in particles.iter().zip(weights) {
        mean[0] += weight * particle[0];
        mean[1] += weight * particle[1];
    }
    let mut covariance = [0.0; 3];
    for (particle, weight) in particles.iter().zip(weights) {
        let off = [particle[0] - mean[0], particle[1] - mean[1]];
        covariance[0] += weight * off[0] * off[0];
        covariance[1] += weight * off[0] * off[1];
        covariance[2] += weight * off[1] * off[1];
    }
    let width = (1.0 - SHRINKAGE * SHRINKAGE).sqrt();
    let first = covariance[0].sqrt();
    let cross = covariance[1] / first;
    let second = (covariance[2] - cross * cross).max(0.0).sqrt();
    // Systematic: one step through the cumulated weights.
    let (mut source, mut sum) = (0, weights[0]);
    (0..particles.len())
        .map(|index| {
            let at = (index as f64 + 0.5) / particles.len() as f64;
            while sum < at && source + 1 < particles.len() {
                source += 1;
                sum += weights[source];
            }
            let (a, b) = (normal(), normal());
            [
                SHRINKAGE * particles[source][0] + (1.0 - SHRINKAGE) * mean[0] + width * first * a,
                SHRINKAGE * particles[source][1]
                    + (1.0 - SHRINKAGE) * mean[1]
                    + width * (cross * a + second * b),
            ]
        })
        .collect()
}

/// Prints the table.
pub fn particle(seeds: u64) {
    let seeds = (seeds / 20).max(50);
    println!("### A particle filter as truth\n");
    println!(
        "{PARTICLES} particles, the true noise, the efficient estimator's prior; 41 samples, {seeds} streams. RMSE over ML's on the same streams, mup and sp.\n"
    );
    println!("| mup | sp | particle filter | efficient |\n| --- | --- | --- | --- |");
    for (peak_friction, critical_slip) in [
        (0.1, 0.15),
        (0.35, 0.1),
        (0.35, 0.15),
        (0.6, 0.2),
        (1.0, 0.125),
    ] {
        let truth = Curve {
            peak_friction,
            critical_slip,
        };
        let (ml, others) = run(
            truth,
            &article_slips(),
            Disturbance::default(),
            seeds,
            [&particle_run, &|truth, stream| {
                efficient_run(truth, stream, 1.0)
            }],
        );
        let [particle, efficient] = others.map(|other| {
            format!(
                "{:.3}, {:.3}",
                other.rmse[0] / ml.rmse[0],
                other.rmse[1] / ml.rmse[1]
            )
        });
        println!("| {peak_friction} | {critical_slip} | {particle} | {efficient} |");
    }
    println!();
}
