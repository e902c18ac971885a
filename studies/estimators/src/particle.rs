//! A particle filter as truth: the posterior, with no more approximation than the number of particles.
//!
//! Resample-move (W. R. Gilks and C. Berzuini, "Following a moving target: Monte Carlo inference for dynamic
//! Bayesian models", 2001): parameters do not move, so that resampling alone would soon leave a few distinct particles;
//! after it each takes a few steps of Metropolis that leave the posterior of the samples so far as it is.

use muslip_analysis::fit::Curve;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;

use super::posterior::{Posterior, Prior};
use super::streams::{SIGMA, Stream};

/// Steps of Metropolis after each resampling.
const MOVES: usize = 6;
/// Length of a proposal in standard deviations of the particles, 2.38/√2 (Roberts, Gelman and Gilks, 1997).
const PROPOSAL: f64 = 1.68;

/// One particle, with the logarithm of its posterior density.
#[derive(Clone, Copy)]
struct Particle {
    /// (mup, ln sp)
    place: [f64; 2],
    log_density: f64,
    weight: f64,
}

/// The posterior of a stream with the true noise, by so many particles with randomness of this seed.
pub fn particle_filter(prior: Prior, stream: &Stream, count: usize, seed: u64) -> Posterior {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut particles = Vec::with_capacity(count);
    while particles.len() < count {
        let place = prior.draw([rng.sample(StandardNormal), rng.sample(StandardNormal)]);
        let log_density = prior.log_density(place);
        if log_density.is_finite() {
            particles.push(Particle {
                place,
                log_density,
                weight: 1.0,
            });
        }
    }
    for samples in 1..=stream.slips.len() {
        let (slip, friction) = (stream.slips[samples - 1], stream.frictions[samples - 1]);
        for particle in &mut particles {
            let log = log_likelihood(particle.place, slip, friction);
            particle.log_density += log;
            particle.weight *= log.exp();
        }
        let total: f64 = particles.iter().map(|particle| particle.weight).sum();
        let mut squares = 0.0;
        for particle in &mut particles {
            particle.weight /= total;
            squares += particle.weight * particle.weight;
        }
        if 2.0 < squares * count as f64 {
            let shape = shape(&particles);
            particles = resampled(&particles, rng.random());
            let seen = stream.slips[..samples].iter().copied();
            let seen: Vec<(f64, f64)> = seen.zip(stream.frictions.iter().copied()).collect();
            for particle in &mut particles {
                for _ in 0..MOVES {
                    advance(particle, prior, &seen, shape, &mut rng);
                }
            }
        }
    }
    Posterior::of(particles.iter().map(|particle| {
        let [mup, ln_sp] = particle.place;
        ([mup, ln_sp.exp()], particle.weight)
    }))
}

fn log_likelihood([mup, ln_sp]: [f64; 2], slip: f64, friction: f64) -> f64 {
    let curve = Curve {
        peak_friction: mup,
        critical_slip: ln_sp.exp(),
    };
    -0.5 * ((friction - curve.friction(slip)) / SIGMA).powi(2)
}

/// Cholesky factor of the covariance of the particles' places.
fn shape(particles: &[Particle]) -> [f64; 3] {
    let covariance = Posterior::of(particles.iter().map(|p| (p.place, p.weight))).covariance;
    let first = covariance.p00.sqrt();
    let cross = covariance.p01 / first;
    [
        first,
        cross,
        (covariance.p11 - cross * cross).max(0.0).sqrt(),
    ]
}

/// Systematic resampling: one walk through the cumulated weights with an even stride.
fn resampled(particles: &[Particle], offset: f64) -> Vec<Particle> {
    let even = 1.0 / particles.len() as f64;
    let (mut source, mut sum) = (0, particles[0].weight);
    (0..particles.len())
        .map(|index| {
            let at = (index as f64 + offset) * even;
            while sum < at && source + 1 < particles.len() {
                source += 1;
                sum += particles[source].weight;
            }
            Particle {
                weight: even,
                ..particles[source]
            }
        })
        .collect()
}

/// One step of Metropolis.
fn advance(
    particle: &mut Particle,
    prior: Prior,
    seen: &[(f64, f64)],
    [first, cross, second]: [f64; 3],
    rng: &mut ChaCha8Rng,
) {
    let (a, b): (f64, f64) = (rng.sample(StandardNormal), rng.sample(StandardNormal));
    let [mup, ln_sp] = particle.place;
    let place = [
        mup + PROPOSAL * first * a,
        ln_sp + PROPOSAL * (cross * a + second * b),
    ];
    let chance = rng.random::<f64>().ln();
    let mut log_density = prior.log_density(place);
    if log_density == f64::NEG_INFINITY {
        return;
    }
    for &(slip, friction) in seen {
        log_density += log_likelihood(place, slip, friction);
        // No sample adds to it: what has fallen too low stays so.
        if log_density < particle.log_density + chance {
            return;
        }
    }
    particle.place = place;
    particle.log_density = log_density;
}

#[cfg(test)]
mod tests {
    use super::particle_filter;
    use crate::posterior::{Prior, dense};
    use crate::streams::{Disturbance, article_slips, range, stream};
    use muslip_analysis::fit::Curve;

    /// At mup 0.1 and sigma 0.04 the posterior is far from normal.
    #[test]
    fn particles_and_the_dense_grid_agree_within_the_particles_own_error() {
        for (peak_friction, critical_slip, seed) in [(0.1, 0.15, 0), (0.35, 0.1, 1), (1.0, 0.2, 2)]
        {
            let truth = Curve {
                peak_friction,
                critical_slip,
            };
            let stream = stream(truth, &article_slips(), Disturbance::default(), seed);
            let prior = Prior::of(range(truth));
            let grid = dense(prior, &stream);
            let halves = [1, 2].map(|seed| particle_filter(prior, &stream, 1500, seed));
            for i in 0..2 {
                let std = grid.std()[i];
                let off = (0.5 * (halves[0].mean[i] + halves[1].mean[i]) - grid.mean[i]) / std;
                let apart = (halves[0].mean[i] - halves[1].mean[i]).abs() / std;
                // 1/√3000 is 0.018.
                assert!(off.abs() < 0.09 && apart < 0.2, "{off} {apart}");
                for half in halves {
                    assert!((half.std()[i] / std - 1.0).abs() < 0.12);
                }
            }
        }
    }
}
