//! The article's noisy points, one stream of noise a seed.

use muslip_analysis::fit::Curve;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Points of a stream.
pub const POINTS: usize = 41;

/// Standard deviation of the friction noise, dimensionless.
pub const FRICTION_STD: f64 = 0.04;

/// The article's true curve.
pub const TRUTH: Curve = Curve {
    peak_friction: 0.35,
    critical_slip: 0.15,
};

/// The slips (i/40)² for i = 0..=40, dimensionless.
pub fn slips() -> [f64; POINTS] {
    std::array::from_fn(|index| (index as f64 / 40.0).powi(2))
}

/// Frictions of a true curve at [`slips`] with the noise of a seed.
///
/// The noise is ChaCha8's, seeded with this number; the same seed gives the same noise for every curve.
pub fn frictions(truth: Curve, seed: u64) -> [f64; POINTS] {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    slips().map(|slip| {
        let unit: f64 = rng.sample(StandardNormal);
        truth.friction(slip) + FRICTION_STD * unit
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_in_noise_alone() {
        let mean = |truth: Curve| {
            let (mut sum, mut squares) = (0.0, 0.0);
            for seed in 0..500 {
                for (slip, friction) in slips().into_iter().zip(frictions(truth, seed)) {
                    let noise = friction - truth.friction(slip);
                    sum += noise;
                    squares += noise * noise;
                }
            }
            let count = 500.0 * POINTS as f64;
            (sum / count, (squares / count).sqrt())
        };
        let (bias, std) = mean(TRUTH);
        // four standard errors of 20,500 numbers
        assert!(bias.abs() < 4.0 * FRICTION_STD / 143.0, "{bias}");
        assert!(
            (std / FRICTION_STD - 1.0).abs() < 4.0 / (2.0_f64 * 20_500.0).sqrt(),
            "{std}"
        );
        let other = Curve {
            peak_friction: 1.0,
            critical_slip: 0.1,
        };
        assert!((mean(other).0 - bias).abs() < 1e-12);
        assert_ne!(frictions(TRUTH, 1), frictions(TRUTH, 2));
    }
}
