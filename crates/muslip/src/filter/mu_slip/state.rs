use core::fmt;

use crate::law::{Expansion, LawError, Rudd, expand};
use crate::real::Real;

/// The state x = (mup, sp).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct State<T> {
    /// Peak friction mup, dimensionless.
    pub peak_friction: T,
    /// Slip at the peak sp, dimensionless.
    pub critical_slip: T,
}

/// The covariance P of the state, symmetric by construction.
///
/// | field | entry | meaning |
/// |---|---|---|
/// | `p00` | P11 | variance of peak friction |
/// | `p01` | P12 = P21 | covariance of peak friction and critical slip |
/// | `p11` | P22 | variance of critical slip |
///
/// All dimensionless.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Covariance<T> {
    /// Variance of peak friction.
    pub p00: T,
    /// Covariance of peak friction and critical slip.
    pub p01: T,
    /// Variance of critical slip.
    pub p11: T,
}

/// A matrix that is no covariance: its entries off the diagonal differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NotSymmetric;

impl fmt::Display for NotSymmetric {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("matrix is not symmetric")
    }
}

impl core::error::Error for NotSymmetric {}

/// State and covariance together: all that the filter carries from one sample to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Estimate<T> {
    /// The state.
    pub state: State<T>,
    /// Its covariance.
    pub covariance: Covariance<T>,
}

impl<T: Real> State<T> {
    /// The two numbers in the order mup, sp.
    pub fn to_array(self) -> [T; 2] {
        [self.peak_friction, self.critical_slip]
    }

    /// From the two numbers in the order mup, sp.
    pub fn from_array([peak_friction, critical_slip]: [T; 2]) -> Self {
        Self {
            peak_friction,
            critical_slip,
        }
    }

    /// True where both are finite.
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.peak_friction.is_finite() && self.critical_slip.is_finite()
    }

    /// True where both are finite and positive, as a tyre's are.
    pub fn is_physical(&self) -> bool {
        self.is_finite() && self.peak_friction > T::ZERO && self.critical_slip > T::ZERO
    }

    /// The tyre law of this state.
    ///
    /// # Errors
    /// [`LawError`] unless [`State::is_physical`].
    pub fn law(&self) -> Result<Rudd<T>, LawError> {
        Rudd::new(self.peak_friction, self.critical_slip)
    }

    /// Friction and its derivatives at a slip, whether or not the state is a tyre's.
    #[inline(always)]
    pub fn expansion(&self, slip_ratio: T) -> Expansion<T> {
        expand(self.peak_friction, self.critical_slip, slip_ratio)
    }
}

impl<T: Real> Covariance<T> {
    /// Uncorrelated, from two standard deviations (dimensionless).
    pub fn from_std(peak_friction_std: T, critical_slip_std: T) -> Self {
        Self {
            p00: peak_friction_std.squared(),
            p01: T::ZERO,
            p11: critical_slip_std.squared(),
        }
    }

    /// The two rows of P, which are its columns as well.
    pub fn rows(&self) -> [[T; 2]; 2] {
        [[self.p00, self.p01], [self.p01, self.p11]]
    }

    /// From the two rows of a matrix.
    ///
    /// # Errors
    /// [`NotSymmetric`] where the two entries off the diagonal differ, or are NaN.
    pub fn from_rows([[p00, p01], [p10, p11]]: [[T; 2]; 2]) -> Result<Self, NotSymmetric> {
        if p01 == p10 {
            Ok(Self { p00, p01, p11 })
        } else {
            Err(NotSymmetric)
        }
    }

    /// Variance of peak friction, P11.
    pub fn peak_friction_variance(&self) -> T {
        self.p00
    }

    /// Variance of critical slip, P22.
    pub fn critical_slip_variance(&self) -> T {
        self.p11
    }

    /// Covariance of the two, P12.
    pub fn cross_covariance(&self) -> T {
        self.p01
    }

    /// Standard deviation of peak friction.
    pub fn peak_friction_std(&self) -> T {
        self.p00.sqrt()
    }

    /// Standard deviation of critical slip.
    pub fn critical_slip_std(&self) -> T {
        self.p11.sqrt()
    }

    /// Standard deviations of (peak friction, critical slip).
    pub fn std(&self) -> (T, T) {
        (self.peak_friction_std(), self.critical_slip_std())
    }

    /// Correlation of the two, within ±1.
    pub fn correlation(&self) -> T {
        // Two roots rather than the root of a product, which may underflow.
        self.p01 / self.peak_friction_std() / self.critical_slip_std()
    }

    /// True where P is finite and positive definite with a margin for rounding.
    ///
    /// The determinant P11 P22 - P12² is compared with its own rounding error: P12² must stay below
    /// P11 P22 (1 - 4ε), ε being [`Real::EPSILON`], so that the numbers as stored have a positive
    /// determinant whatever the two products lost. That limits the magnitude of the correlation to
    /// 1 - 2ε. P11 P22 must not be so small that its product loses precision (in `f32`: standard
    /// deviations of some 1e-8, below the resolution of the state itself).
    #[inline]
    pub fn is_positive_definite(&self) -> bool {
        let (definite, product) = self.pivots();
        definite && product.is_finite()
    }

    /// Whether both pivots are positive, and P11 P22, which must be finite for that to be the answer.
    #[inline(always)]
    pub(super) fn pivots(&self) -> (bool, T) {
        let product = self.p00 * self.p11;
        // Added rather than compared: one comparison fewer in the loop of a controller. The product is
        // then positive, so P22 has the sign of P11.
        let least = self.p01 * self.p01 + Self::smallest_product();
        (
            self.p00 > T::ZERO && least < product * Self::margin(),
            product,
        )
    }

    /// P11 P22 below which it has lost digits.
    #[inline(always)]
    pub(super) fn smallest_product() -> T {
        T::MIN_POSITIVE / T::EPSILON
    }

    /// Factor on P11 P22 that allows for the rounding of the determinant.
    #[inline(always)]
    pub(super) fn margin() -> T {
        T::ONE - T::from_f64(4.0) * T::EPSILON
    }
}

#[cfg(test)]
mod tests {
    use super::{Covariance, NotSymmetric, State};

    #[test]
    fn arrays_go_both_ways() {
        let state = State {
            peak_friction: 0.6,
            critical_slip: 0.2,
        };
        assert_eq!(state.to_array(), [0.6, 0.2]);
        assert_eq!(State::from_array(state.to_array()), state);
        let p = Covariance {
            p00: 4.0,
            p01: 1.0,
            p11: 9.0,
        };
        assert_eq!(p.rows(), [[4.0, 1.0], [1.0, 9.0]]);
        assert_eq!(Covariance::from_rows(p.rows()), Ok(p));
        assert_eq!(
            Covariance::from_rows([[4.0, 1.0], [1.1, 9.0]]),
            Err(NotSymmetric)
        );
        assert_eq!(p.std(), (2.0, 3.0));
        assert!((p.correlation() - 1.0_f64 / 6.0).abs() < 1e-16);
    }

    #[test]
    fn definiteness_is_refused_within_rounding_of_the_limit() {
        let with_correlation = |rho: f32| Covariance {
            p00: 0.36,
            p01: rho * 0.6 * 0.2,
            p11: 0.04,
        };
        assert!(with_correlation(0.999_99).is_positive_definite());
        assert!(with_correlation(-0.999_99).is_positive_definite());
        assert!(!with_correlation(1.0).is_positive_definite());
        assert!(!with_correlation(1.1).is_positive_definite());
        assert!(!with_correlation(f32::NAN).is_positive_definite());
        for (p00, p11) in [
            (-1.0, -1.0),
            (0.0, 1.0),
            (1.0, 0.0),
            (f32::INFINITY, 1.0),
            (1e-20, 1e-20),
        ] {
            let p = Covariance {
                p00,
                p01: 0.0_f32,
                p11,
            };
            assert!(!p.is_positive_definite(), "{p:?}");
        }
    }
}
