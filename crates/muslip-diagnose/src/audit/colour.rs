//! Noise with a memory, read off what a balance leaves.

use super::constants::{COLOURED_SHARE, LONGEST_COLOUR_S};
use super::finding::{Finding, Word};

/// Standard deviation and time constant of the part of residuals that lasts longer than two steps, where it is most of them.
#[must_use]
pub fn coloured(residual: &[Vec<f64>], step: f64) -> Option<(f64, f64)> {
    let most = (0.25 / step) as usize;
    let covariance = |lag: usize| -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for block in residual.iter().filter(|b| b.len() > 2 * most) {
            sum += block
                .iter()
                .zip(&block[lag..])
                .map(|(a, b)| a * b)
                .sum::<f64>();
            count += (block.len() - lag) as f64;
        }
        sum / f64::max(count, 1.0)
    };
    let whole = covariance(0);
    let (near, far) = (covariance(2), covariance(6));
    if !(near > 0.0 && far > 0.0 && far < near && whole > 0.0) {
        return None;
    }
    // An exponential through two lags.
    let time = 4.0 * step / (near / far).ln();
    let variance = near * (2.0 * step / time).exp();
    (variance > COLOURED_SHARE * whole && time < LONGEST_COLOUR_S && time > 4.0 * step)
        .then(|| (variance.min(whole).sqrt(), time))
}

/// The vehicle speed's coloured noise as a finding.
#[must_use]
pub fn of_vehicle(residual: &[Vec<f64>], step: f64, white: f64) -> Option<Finding> {
    let (std, time) = coloured(residual, step)?;
    let blocks = residual.iter().map(|b| b.len() as f64 * step).sum::<f64>() / time;
    (std > white && blocks > 40.0).then(|| {
        Finding::of("vehicle_speed_m_s", Word::ColouredNoise, (std, std / (0.5 * blocks).sqrt()), "m/s").saying(format!(
            "The noise of the vehicle speed has a slow part of {std:.4} m/s with a time constant of {time:.2} s."
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(keep: f64) -> Vec<f64> {
        let (mut state, mut x) = (7u64, 0.0);
        (0..20_000)
            .map(|_| {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                x = keep * x + ((state >> 11) as f64 / (1u64 << 53) as f64 - 0.5);
                x
            })
            .collect()
    }

    #[test]
    fn coloured_noise_has_its_size_and_time_and_white_noise_none() {
        assert!(coloured(&[noise(0.0)], 0.01).is_none());
        let keep = (-0.1f64).exp();
        let (std, time) = coloured(&[noise(keep)], 0.01).unwrap();
        let expected = (1.0 / 12.0 / (1.0 - keep * keep)).sqrt();
        assert!(
            (std / expected - 1.0).abs() < 0.1 && (time - 0.1).abs() < 0.02,
            "{std} {time}"
        );
        assert!(coloured(&[], 0.01).is_none());
    }
}
