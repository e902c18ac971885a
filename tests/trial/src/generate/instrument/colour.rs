//! Coloured noise: white, autoregressive, and one over frequency.

use serde::{Deserialize, Serialize};

use crate::draw::Draw;

/// A channel's random error: shares of its variance that are white, of one time constant, and of one over frequency.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Colour {
    /// Standard deviation of the whole, in the channel's unit.
    pub std: f64,
    /// Share of the variance with a time constant.
    pub slow: f64,
    pub time_constant_s: f64,
    /// Share of the variance with a spectrum of one over frequency.
    pub flicker: f64,
}

/// Time constants whose sum, at equal variance, has a spectrum of one over frequency between 0.02 and 20 Hz.
const FLICKER_S: [f64; 4] = [0.01, 0.1, 1.0, 10.0];

impl Colour {
    /// White noise alone.
    pub fn white(std: f64) -> Colour {
        Colour {
            std,
            ..Colour::default()
        }
    }

    /// So many values, `period` apart.
    pub fn series(&self, samples: usize, period: f64, draw: &mut Draw) -> Vec<f64> {
        let white = (1.0 - self.slow - self.flicker).max(0.0).sqrt() * self.std;
        let mut out: Vec<f64> = (0..samples).map(|_| white * draw.normal()).collect();
        let mut add = |share: f64, time_constant: f64, draw: &mut Draw| {
            if share > 0.0 {
                let series = ornstein_uhlenbeck(
                    samples,
                    period,
                    time_constant,
                    share.sqrt() * self.std,
                    draw,
                );
                for (value, error) in out.iter_mut().zip(series) {
                    *value += error;
                }
            }
        };
        add(self.slow, self.time_constant_s, draw);
        for time_constant in FLICKER_S {
            add(self.flicker / FLICKER_S.len() as f64, time_constant, draw);
        }
        out
    }
}

/// An Ornstein-Uhlenbeck process at equal steps, stationary from the start.
pub fn ornstein_uhlenbeck(
    samples: usize,
    period: f64,
    time_constant: f64,
    std: f64,
    draw: &mut Draw,
) -> Vec<f64> {
    let keep = (-period / time_constant.max(1e-9)).exp();
    let fresh = (1.0 - keep * keep).sqrt();
    let mut state = draw.normal();
    (0..samples)
        .map(|_| {
            let now = std * state;
            state = keep * state + fresh * draw.normal();
            now
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coloured_noise_has_its_standard_deviation_and_its_correlation() {
        let mut draw = Draw::new(3, &[1]);
        let series = ornstein_uhlenbeck(400_000, 1e-3, 0.02, 2.0, &mut draw);
        let variance = series.iter().map(|x| x * x).sum::<f64>() / series.len() as f64;
        let lag = 20;
        let covariance = series
            .iter()
            .zip(&series[lag..])
            .map(|(a, b)| a * b)
            .sum::<f64>()
            / (series.len() - lag) as f64;
        assert!((variance / 4.0 - 1.0).abs() < 0.05, "{variance}");
        assert!(
            (covariance / variance - (-1f64).exp()).abs() < 0.03,
            "{}",
            covariance / variance
        );
    }

    #[test]
    fn shares_of_a_colour_add_up_to_its_variance() {
        let colour = Colour {
            std: 1.5,
            slow: 0.3,
            time_constant_s: 0.05,
            flicker: 0.2,
        };
        // Many short series: the slowest part hardly moves within one.
        let mut draw = Draw::new(4, &[1]);
        let (mut sum, mut count) = (0.0, 0.0);
        for _ in 0..4000 {
            for value in colour.series(20, 0.01, &mut draw) {
                sum += value * value;
                count += 1.0;
            }
        }
        assert!((sum / count / 2.25 - 1.0).abs() < 0.05, "{}", sum / count);
    }
}
