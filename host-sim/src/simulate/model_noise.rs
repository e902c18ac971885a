//! Noise of the drag reading as a repaired model describes it: size by force, and colour.

use std::collections::VecDeque;

use muslip_diagnose::repaired::NoiseModel;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use crate::recording::Channel;

/// A seeded stream of the noise of drag readings, at the sampling step that the model was fitted at.
#[derive(Debug, Clone)]
pub(super) struct DragNoise<'a> {
    model: &'a NoiseModel,
    /// Noise over its size in the samples before, newest first.
    before: VecDeque<f64>,
    random: ChaCha8Rng,
}

/// Samples after which the noise no longer knows that it began at zero.
const WARM_UP: usize = 500;

impl<'a> DragNoise<'a> {
    pub(super) fn new(model: &'a NoiseModel, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(Channel::DragForce as u64);
        let order = model.likelihood.as_ref().map_or(0, |l| l.colour.len());
        let mut noise = Self {
            model,
            before: VecDeque::from(vec![0.0; order]),
            random,
        };
        if order > 0 {
            for _ in 0..WARM_UP {
                noise.next(1.0);
            }
        }
        noise
    }

    /// Size for a force in N, the noise of slip left out, as [`Self::next`] takes it.
    pub(super) fn sigma(&self, force_n: f64) -> f64 {
        match &self.model.likelihood {
            Some(likelihood) => likelihood.size.sigma(force_n, 0.0),
            None => self
                .model
                .sigma_n
                .hypot(self.model.share_of_force * force_n),
        }
    }

    /// Noise of the next reading in N; `sigma` is its size in N before colour.
    pub(super) fn next(&mut self, sigma: f64) -> f64 {
        let draw: f64 = StandardNormal.sample(&mut self.random);
        let Some(likelihood) = &self.model.likelihood else {
            return sigma * draw;
        };
        let value = likelihood.innovation_sigma * draw
            + likelihood
                .colour
                .iter()
                .zip(&self.before)
                .map(|(a, b)| a * b)
                .sum::<f64>();
        self.before.push_front(value);
        self.before.truncate(likelihood.colour.len());
        sigma * value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use muslip_diagnose::proof::Likelihood;

    #[test]
    fn colour_and_size_are_those_of_the_model() {
        let mut likelihood = Likelihood {
            colour: vec![0.8],
            innovation_sigma: 2.0,
            ..Likelihood::default()
        };
        likelihood.size.parts = [100.0, 0.01, 0.0];
        let model = NoiseModel {
            likelihood: Some(likelihood),
            ..NoiseModel::default()
        };
        let mut noise = DragNoise::new(&model, 3);
        // 10 N at rest and a tenth of 240 N: 26 N.
        let sigma = noise.sigma(240.0);
        assert!((sigma - 26.0).abs() < 1e-12);
        let x: Vec<f64> = (0..50_000).map(|_| noise.next(sigma)).collect();
        let power = x.iter().map(|v| v * v).sum::<f64>();
        let neighbours = x.windows(2).map(|w| w[0] * w[1]).sum::<f64>();
        let expected = 26.0 * 2.0 / (1.0_f64 - 0.8 * 0.8).sqrt();
        let found = (power / x.len() as f64).sqrt();
        assert!(
            (neighbours / power - 0.8).abs() < 0.02,
            "{}",
            neighbours / power
        );
        assert!((found / expected - 1.0).abs() < 0.04, "{found} {expected}");
    }
}
