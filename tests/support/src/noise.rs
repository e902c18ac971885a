//! Random numbers that are the same on every machine and every run.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// A seeded stream of random numbers.
#[derive(Debug, Clone)]
pub struct Noise {
    rng: ChaCha8Rng,
}

impl Noise {
    /// The stream of this seed.
    pub fn seeded(seed: u64) -> Self {
        Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
        }
    }

    /// The next normal number with mean 0 and this standard deviation.
    pub fn normal(&mut self, std: f64) -> f64 {
        let unit: f64 = self.rng.sample(StandardNormal);
        std * unit
    }

    /// The next number distributed evenly over `low..high`.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.rng.random::<f64>()
    }

    /// The next number whose logarithm is distributed evenly; both bounds positive.
    pub fn log_uniform(&mut self, low: f64, high: f64) -> f64 {
        self.uniform(low.ln(), high.ln()).exp()
    }

    /// A prior covariance of peak friction and critical slip: its p00, p01 and p11.
    pub fn covariance(&mut self) -> [f64; 3] {
        let (std0, std1) = (self.log_uniform(1e-3, 1.0), self.log_uniform(1e-3, 0.4));
        let correlation = self.uniform(-0.99, 0.99);
        [std0 * std0, correlation * std0 * std1, std1 * std1]
    }
}

#[cfg(test)]
mod tests {
    use super::Noise;

    #[test]
    fn a_seed_repeats_its_stream_and_no_other() {
        let stream = |seed| {
            let mut noise = Noise::seeded(seed);
            [noise.normal(1.0), noise.uniform(0.0, 1.0)]
        };
        assert_eq!(stream(1), stream(1));
        assert_ne!(stream(1), stream(2));
    }

    #[test]
    fn normal_numbers_have_the_stated_mean_and_spread() {
        let mut noise = Noise::seeded(7);
        let n = 20_000;
        let draws: Vec<f64> = (0..n).map(|_| noise.normal(2.0)).collect();
        let mean = draws.iter().sum::<f64>() / f64::from(n);
        let variance = draws.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / f64::from(n);
        // four standard errors of each
        assert!(mean.abs() < 4.0 * 2.0 / f64::from(n).sqrt());
        assert!((variance - 4.0).abs() < 4.0 * 4.0 * (2.0 / f64::from(n)).sqrt());
    }
}
