//! The Cramér-Rao bound of a stream.

use muslip_analysis::fit::Curve;

use super::stream::{FRICTION_STD, slips};

/// The smallest standard deviations that an estimator without bias can have (Cramér-Rao): the roots of
/// the diagonal of (Σ Hᵀ H / σ²)⁻¹, with H the gradient of friction at the true curve.
///
/// An estimator with bias, or one that starts from a prior, may lie below.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// Of peak friction, dimensionless.
    pub peak_friction_std: f64,
    /// Of critical slip, dimensionless.
    pub critical_slip_std: f64,
}

impl Bound {
    /// The bound of the article's slips and noise at a true curve.
    pub fn of(truth: Curve) -> Self {
        let (mut j11, mut j12, mut j22) = (0.0, 0.0, 0.0);
        for slip in slips() {
            let (by_peak, by_slip) = truth.gradient(slip);
            j11 += by_peak * by_peak;
            j12 += by_peak * by_slip;
            j22 += by_slip * by_slip;
        }
        let determinant = j11 * j22 - j12 * j12;
        Self {
            peak_friction_std: FRICTION_STD * (j22 / determinant).sqrt(),
            critical_slip_std: FRICTION_STD * (j11 / determinant).sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_of_critical_slip_shrinks_as_friction_grows_and_that_of_friction_does_not() {
        let at = |peak_friction| {
            Bound::of(Curve {
                peak_friction,
                critical_slip: 0.15,
            })
        };
        let (low, high) = (at(0.1), at(1.0));
        assert!((low.peak_friction_std / high.peak_friction_std - 1.0).abs() < 1e-12);
        assert!((low.critical_slip_std / high.critical_slip_std - 10.0).abs() < 1e-9);
    }
}
