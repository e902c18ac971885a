//! The efficient estimator beside the posterior itself.

use muslip::filter::efficient;
use muslip::filter::mu_slip::Covariance;
use muslip_analysis::fit::Curve;
use rayon::prelude::*;

use super::contenders::{batch, efficient_with_noise};
use super::page::{Page, pair, signed};
use super::particle::particle_filter;
use super::posterior::{Posterior, Prior, dense};
use super::streams::{Disturbance, article_slips, range, stream};

/// Particles of each half.
const HALF: usize = 8000;

const CURVES: [(f64, f64); 6] = [
    (0.1, 0.15),
    (0.2, 0.125),
    (0.35, 0.1),
    (0.35, 0.15),
    (0.6, 0.2),
    (1.0, 0.125),
];

/// What one stream says; pairs are of mup and sp, differences in standard deviations of the posterior.
struct Comparison {
    /// Half the difference of the halves: the error of their mean.
    monte_carlo: [f64; 2],
    particles_off_grid: [f64; 2],
    particles_std_over_grid: [f64; 2],
    efficient_off: [f64; 2],
    /// With the noise that it has learnt taken out, as the particles are told the true one.
    efficient_std_over: [f64; 2],
    correlation_off: f64,
    squares_of_particles: [f64; 2],
    squares_of_efficient: [f64; 2],
    squares_of_batch: [f64; 2],
}

/// `randomness` numbers the particles' own.
fn compare(truth: Curve, seed: u64, randomness: u64) -> Option<Comparison> {
    let stream = stream(truth, &article_slips(), Disturbance::default(), seed);
    let batch = batch(truth, &stream)?;
    let range = range(truth);
    let prior = Prior::of(range);
    let grid = dense(prior, &stream);
    let halves = [0, 1].map(|half| particle_filter(prior, &stream, HALF, 2 * randomness + half));
    let [one, other] = halves.map(|half| half.covariance);
    let both = Posterior {
        mean: [0, 1].map(|i| 0.5 * (halves[0].mean[i] + halves[1].mean[i])),
        // But for what the distance of the halves' means adds, a ten-thousandth.
        covariance: Covariance {
            p00: 0.5 * (one.p00 + other.p00),
            p01: 0.5 * (one.p01 + other.p01),
            p11: 0.5 * (one.p11 + other.p11),
        },
    };
    let std = both.std();
    let (efficient, noise_factor) =
        efficient_with_noise(efficient::Config::for_range(range), truth, &stream, 1.0);
    let p = efficient.covariance;
    let efficient_std = [p.p00, p.p11].map(|variance| (variance / noise_factor).sqrt());
    let correlation = |p: Covariance<f64>| p.p01 / (p.p00 * p.p11).sqrt();
    let truth = [truth.peak_friction, truth.critical_slip];
    let each = |of: &dyn Fn(usize) -> f64| [of(0), of(1)];
    Some(Comparison {
        monte_carlo: each(&|i| 0.5 * (halves[0].mean[i] - halves[1].mean[i]) / std[i]),
        particles_off_grid: each(&|i| (both.mean[i] - grid.mean[i]) / std[i]),
        particles_std_over_grid: each(&|i| std[i] / grid.std()[i]),
        efficient_off: each(&|i| (efficient.estimate[i] - both.mean[i]) / std[i]),
        efficient_std_over: each(&|i| efficient_std[i] / std[i]),
        correlation_off: correlation(p) - correlation(both.covariance),
        squares_of_particles: each(&|i| (both.mean[i] - truth[i]).powi(2)),
        squares_of_efficient: efficient.error.map(|error| error * error),
        squares_of_batch: batch.error.map(|error| error * error),
    })
}

/// Means over the streams of pairs.
fn mean(all: &[Comparison], of: impl Fn(&Comparison) -> [f64; 2]) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for comparison in all {
        let values = of(comparison);
        for i in 0..2 {
            sums[i] += values[i] / all.len() as f64;
        }
    }
    sums
}

fn root_mean_square(all: &[Comparison], of: impl Fn(&Comparison) -> [f64; 2]) -> [f64; 2] {
    mean(all, |comparison| of(comparison).map(|value| value * value)).map(f64::sqrt)
}

/// Prints the tables.
pub fn truth(page: &mut Page, seeds: u64) {
    let seeds = (seeds / 50).max(60);
    page.section("A particle filter as truth");
    page.paragraph(format!(
        "Posterior of (mup, sp) under the efficient estimator's own prior (mup N(start, start²) above zero, ln sp N(start, ½)) and the true noise, 41 samples, {seeds} streams a curve. Particles: resample-move (resampling at half the effective number, then six steps of Metropolis on all samples so far), two filters of {HALF} with independent randomness; half their difference is the Monte Carlo error of their mean. Grid: 300 by 300 points over where the posterior is, in another form of the law. All in standard deviations of the posterior; mup, sp."
    ));
    page.columns(&[
        "mup",
        "sp",
        "Monte Carlo error, rms",
        "particles - grid, rms",
        "std of particles / grid",
        "efficient - particles: mean",
        "rms",
        "std of efficient / particles, noise as told",
        "correlation, efficient - particles",
        "RMSE / ML: particles",
        "efficient",
    ]);
    let (mut errors, mut off, mut curves) = (0.0, 0.0, 0.0);
    let mut furthest: f64 = 0.0;
    for (number, (peak_friction, critical_slip)) in (0..).zip(CURVES) {
        let truth = Curve {
            peak_friction,
            critical_slip,
        };
        let all: Vec<Comparison> = (0..seeds)
            .into_par_iter()
            .filter_map(|seed| compare(truth, seed, number * seeds + seed))
            .collect();
        let monte_carlo = root_mean_square(&all, |c| c.monte_carlo);
        let off_grid = root_mean_square(&all, |c| c.particles_off_grid);
        let efficient_off = root_mean_square(&all, |c| c.efficient_off);
        let batch = mean(&all, |c| c.squares_of_batch);
        let over_batch = |squares: [f64; 2]| [0, 1].map(|i| (squares[i] / batch[i]).sqrt());
        page.row(&[
            peak_friction.to_string(),
            critical_slip.to_string(),
            pair(monte_carlo, 4),
            pair(off_grid, 4),
            pair(mean(&all, |c| c.particles_std_over_grid), 3),
            signed(mean(&all, |c| c.efficient_off), 3),
            pair(efficient_off, 3),
            pair(mean(&all, |c| c.efficient_std_over), 3),
            format!("{:+.3}", mean(&all, |c| [c.correlation_off; 2])[0]),
            pair(over_batch(mean(&all, |c| c.squares_of_particles)), 3),
            pair(over_batch(mean(&all, |c| c.squares_of_efficient)), 3),
        ]);
        for i in 0..2 {
            errors += monte_carlo[i].powi(2);
            off += off_grid[i].powi(2);
            curves += 0.5;
        }
        furthest = furthest.max(efficient_off[0]).max(efficient_off[1]);
    }
    let (errors, off): (f64, f64) = (
        (errors / curves / 2.0_f64).sqrt(),
        (off / curves / 2.0_f64).sqrt(),
    );
    page.line("");
    page.bar(
        "the particle filter is the truth: its distance from a dense grid, over its own Monte Carlo error",
        "0.8 to 1.2",
        format!(
            "{:.2} ({off:.4} over {errors:.4} standard deviations)",
            off / errors
        ),
        (0.8..1.2).contains(&(off / errors)),
    );
    page.bar(
        "efficient estimate beside the posterior mean of the particles, rms of the worst curve",
        "stated",
        format!("{furthest:.3} standard deviations"),
        true,
    );
}
