//! What the sensors read of the truth: white Gaussian noise on every channel that the rig file gives
//! one.

use std::collections::BTreeMap;

use muslip_recordings::recording::Channel;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// The noise of a recording's channels.
///
/// Each channel draws from its own stream of one seed, so that a channel's noise does not change when
/// another one is added or left out.
#[derive(Debug, Clone)]
pub struct Sensors {
    channels: Vec<(f64, ChaCha8Rng)>,
}

impl Sensors {
    /// Noise for these channels; `sigma` holds 1-sigma in the channel's unit by the name of its column,
    /// and a channel that is not there reads the truth.
    pub fn new(channels: &[Channel], sigma: &BTreeMap<String, f64>, seed: u64) -> Self {
        let channels = channels
            .iter()
            .map(|&channel| {
                let sigma = sigma.get(channel.name()).copied().unwrap_or(0.0);
                let mut random = ChaCha8Rng::seed_from_u64(seed);
                random.set_stream(channel as u64);
                (sigma, random)
            })
            .collect();
        Self { channels }
    }

    /// Turns true values, in the order of the channels, into readings.
    pub fn read(&mut self, values: &mut [f64]) {
        for (value, (sigma, random)) in values.iter_mut().zip(&mut self.channels) {
            if *sigma > 0.0 {
                let draw: f64 = StandardNormal.sample(random);
                *value += *sigma * draw;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn readings(channels: &[Channel], seed: u64) -> Vec<Vec<f64>> {
        let sigma = BTreeMap::from([
            ("drag_force_n".to_owned(), 90.0),
            ("normal_force_n".to_owned(), 20.0),
        ]);
        let mut sensors = Sensors::new(channels, &sigma, seed);
        (0..20_000)
            .map(|_| {
                let mut row = vec![1.0; channels.len()];
                sensors.read(&mut row);
                row
            })
            .collect()
    }

    #[test]
    fn noise_has_the_declared_sigma_and_no_bias() {
        let rows = readings(&[Channel::Time, Channel::DragForce], 1);
        let n = rows.len() as f64;
        let mean = rows.iter().map(|row| row[1] - 1.0).sum::<f64>() / n;
        let variance = rows
            .iter()
            .map(|row| (row[1] - 1.0 - mean).powi(2))
            .sum::<f64>()
            / n;
        assert!(rows.iter().all(|row| row[0] == 1.0));
        assert!(mean.abs() < 4.0 * 90.0 / n.sqrt(), "{mean}");
        assert!((variance.sqrt() / 90.0 - 1.0).abs() < 0.02, "{variance}");
    }

    #[test]
    fn a_channel_reads_the_same_whatever_else_is_recorded() {
        let alone = readings(&[Channel::NormalForce], 7);
        let beside = readings(&[Channel::DragForce, Channel::NormalForce], 7);
        assert!(alone.iter().zip(&beside).all(|(a, b)| a[0] == b[1]));
        assert_ne!(alone, readings(&[Channel::NormalForce], 8));
    }
}
