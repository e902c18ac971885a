//! Reference scenarios.

use crate::noise::Noise;

/// The article's run: a known curve measured at 41 known slips.
///
/// Source: R. Rudd, "Estimating the Mu Slip Curve via Extended Kalman Filtering", The Mathematica
/// Journal 11 (2011).
pub mod article {
    use super::Noise;

    /// Peak friction of the true curve.
    pub const PEAK_FRICTION: f64 = 0.35;
    /// Slip at its peak.
    pub const CRITICAL_SLIP: f64 = 0.15;
    /// Standard deviation of the friction noise.
    pub const FRICTION_STD: f64 = 0.04;

    /// The slips (i/40)² for i = 0..=40.
    pub fn slips() -> impl Iterator<Item = f64> {
        (0..=40).map(|i| (f64::from(i) / 40.0).powi(2))
    }

    /// Friction of the true curve.
    pub fn friction(slip_ratio: f64) -> f64 {
        let r = slip_ratio / CRITICAL_SLIP;
        2.0 * PEAK_FRICTION * r / (1.0 + r * r)
    }

    /// The 41 points (slip, friction) with the noise of a seed.
    pub fn measurements(seed: u64) -> Vec<(f64, f64)> {
        let mut noise = Noise::seeded(seed);
        slips()
            .map(|slip| (slip, friction(slip) + noise.normal(FRICTION_STD)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::article;

    #[test]
    fn the_article_runs_from_free_rolling_to_lock_over_41_points() {
        let slips: Vec<f64> = article::slips().collect();
        assert_eq!(slips.len(), 41);
        assert_eq!((slips[0], slips[40]), (0.0, 1.0));
        assert_eq!(article::friction(0.15), 0.35);
        assert_eq!(article::measurements(3).len(), 41);
    }
}
