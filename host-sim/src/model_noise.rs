//! Noise of the drag reading as a repaired model describes it: size by force, and colour.

use std::collections::VecDeque;

use muslip_diagnose::repaired::NoiseModel;
use muslip_recordings::recording::Channel;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// A seeded stream of the noise of drag readings, at the sampling step that the model was fitted at.
///
/// The likelihood's innovations are larger than the noise where slow noise is left in them, for its figures must not
/// promise too much. So of the likelihood only the colour and the dependence on force are taken, and the size is
/// that of the residuals.
#[derive(Debug, Clone)]
pub(super) struct DragNoise<'a> {
    model: &'a NoiseModel,
    /// Standard deviation of an innovation where that of the coloured noise is one.
    innovation: f64,
    /// Coloured noise of the samples before, newest first.
    before: VecDeque<f64>,
    random: ChaCha8Rng,
}

/// Samples after which the noise no longer knows that it began at zero, and its variance has settled.
const WARM_UP: usize = 2000;

impl<'a> DragNoise<'a> {
    pub(super) fn new(model: &'a NoiseModel, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(Channel::DragForce as u64);
        let order = model.likelihood.as_ref().map_or(0, |l| l.colour.len());
        let mut noise = Self {
            model,
            innovation: 1.0,
            before: VecDeque::from(vec![0.0; order]),
            random,
        };
        // Variance of the coloured noise for innovations of one: the sum of its squared response to a single one.
        let mut variance = 0.0;
        for step in 0..WARM_UP {
            variance += noise.coloured(if step == 0 { 1.0 } else { 0.0 }).powi(2);
        }
        noise.innovation = 1.0 / variance.sqrt();
        if order > 0 {
            for _ in 0..WARM_UP {
                noise.next(1.0);
            }
        }
        noise
    }

    /// The next coloured value from an innovation.
    fn coloured(&mut self, innovation: f64) -> f64 {
        let Some(likelihood) = &self.model.likelihood else {
            return innovation;
        };
        let past = likelihood.colour.iter().zip(&self.before);
        let value = innovation + past.map(|(a, b)| a * b).sum::<f64>();
        self.before.push_front(value);
        self.before.truncate(likelihood.colour.len());
        value
    }

    /// Standard deviation in N for what a model's likelihood says is its size in N.
    pub(super) fn of_size(&self, size_n: f64) -> f64 {
        match &self.model.likelihood {
            Some(likelihood) if likelihood.size.typical > 0.0 => {
                size_n * self.model.sigma_n / likelihood.size.typical
            }
            _ => size_n,
        }
    }

    /// Standard deviation in N at a force in N, the noise of slip left out.
    pub(super) fn sigma(&self, force_n: f64) -> f64 {
        match &self.model.likelihood {
            Some(likelihood) => self.of_size(likelihood.size.sigma(force_n, 0.0)),
            None => self
                .model
                .sigma_n
                .hypot(self.model.share_of_force * force_n),
        }
    }

    /// Noise of the next reading in N, of a standard deviation in N.
    pub(super) fn next(&mut self, sigma: f64) -> f64 {
        let draw: f64 = StandardNormal.sample(&mut self.random);
        sigma * self.coloured(self.innovation * draw)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use muslip_diagnose::repaired::Likelihood;

    #[test]
    fn colour_and_size_are_those_of_the_model() {
        let mut likelihood = Likelihood {
            colour: vec![0.8],
            innovation_sigma: 7.0,
            ..Likelihood::default()
        };
        likelihood.size.parts = [100.0, 0.01, 0.0];
        likelihood.size.typical = 20.0;
        let model = NoiseModel {
            sigma_n: 30.0,
            likelihood: Some(likelihood),
            ..NoiseModel::default()
        };
        let mut noise = DragNoise::new(&model, 3);
        // 10 N at rest and a tenth of 240 N: 26 N, where 20 N of the likelihood are 30 N of noise.
        let sigma = noise.sigma(240.0);
        assert!((sigma - 39.0).abs() < 1e-12);
        let x: Vec<f64> = (0..50_000).map(|_| noise.next(sigma)).collect();
        let power = x.iter().map(|v| v * v).sum::<f64>();
        let neighbours = x.windows(2).map(|w| w[0] * w[1]).sum::<f64>();
        let found = (power / x.len() as f64).sqrt();
        assert!(
            (neighbours / power - 0.8).abs() < 0.02,
            "{}",
            neighbours / power
        );
        assert!((found / sigma - 1.0).abs() < 0.04, "{found} {sigma}");
    }
}
