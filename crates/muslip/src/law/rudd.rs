//! The two-parameter law of the mu-slip filter.

use super::error::validated;
use super::{LawError, Parameter, Peak, TyreLaw};
use crate::real::Real;

/// mu = 2 mup s / (sp (1 + (s/sp)²)), with its peak friction and the slip of the peak as parameters.
///
/// Source: R. Rudd, "Estimating the Mu Slip Curve via Extended Kalman Filtering", The Mathematica
/// Journal 11 (2011). Parameters: mup > 0 and sp > 0, both dimensionless.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(
        try_from = "Unchecked<T>",
        bound(deserialize = "T: Real + serde::Deserialize<'de>")
    )
)]
pub struct Rudd<T> {
    peak_friction: T,
    critical_slip: T,
}

/// As read, before validation.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct Unchecked<T> {
    peak_friction: T,
    critical_slip: T,
}

#[cfg(feature = "serde")]
impl<T: Real> TryFrom<Unchecked<T>> for Rudd<T> {
    type Error = LawError;

    fn try_from(raw: Unchecked<T>) -> Result<Self, LawError> {
        Self::new(raw.peak_friction, raw.critical_slip)
    }
}

/// Friction and its derivatives in the two parameters, at one slip: what a filter needs of a law.
///
/// [`Rudd::expansion`] makes one of the law itself, [`State::expansion`](crate::filter::mu_slip::State::expansion) of a filter's state. What stands between the law and a reading (a
/// low-pass filter, say) may change the five numbers alike: they are then those of the reading expected.
/// ∂²mu/∂mup² is zero. All dimensionless.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Expansion<T> {
    /// Friction mu.
    pub friction: T,
    /// ∂mu/∂mup.
    pub by_peak_friction: T,
    /// ∂mu/∂sp.
    pub by_critical_slip: T,
    /// ∂²mu/∂mup∂sp.
    pub by_both: T,
    /// ∂²mu/∂sp².
    pub by_critical_slip_twice: T,
}

impl<T: Real> Expansion<T> {
    /// True where all five are finite.
    pub fn is_finite(&self) -> bool {
        [
            self.friction,
            self.by_peak_friction,
            self.by_critical_slip,
            self.by_both,
            self.by_critical_slip_twice,
        ]
        .into_iter()
        .all(T::is_finite)
    }
}

/// The law and its derivatives at one slip.
///
/// Two divisions fewer than evaluating each by its textbook form: with w = 1/(sp² + s²),
///
/// ```text
/// ∂mu/∂mup      = 2 s sp w
/// mu            = mup ∂mu/∂mup
/// ∂²mu/∂mup∂sp  = 2 s (s² - sp²) w²
/// ∂mu/∂sp       = mup ∂²mu/∂mup∂sp
/// ∂²mu/∂sp²     = 2 mu (sp² - 3 s²) w²
/// ```
///
/// Nothing is validated here: the filter's state may pass through values that are no tyre.
#[inline(always)]
pub(crate) fn expand<T: Real>(peak_friction: T, critical_slip: T, slip_ratio: T) -> Expansion<T> {
    let sp2 = critical_slip * critical_slip;
    let s2 = slip_ratio * slip_ratio;
    let w = T::ONE / (sp2 + s2);
    let twice_slip_w = (slip_ratio + slip_ratio) * w;
    let by_peak_friction = twice_slip_w * critical_slip;
    let friction = peak_friction * by_peak_friction;
    let by_both = twice_slip_w * ((s2 - sp2) * w);
    let by_critical_slip = peak_friction * by_both;
    let by_critical_slip_twice = (friction + friction) * (((sp2 - s2) - (s2 + s2)) * (w * w));
    Expansion {
        friction,
        by_peak_friction,
        by_critical_slip,
        by_both,
        by_critical_slip_twice,
    }
}

impl<T: Real> Rudd<T> {
    /// The law with this peak friction (> 0) at this slip (> 0).
    ///
    /// # Errors
    /// [`LawError::NonFinite`] or [`LawError::OutOfRange`], naming the parameter.
    pub fn new(peak_friction: T, critical_slip: T) -> Result<Self, LawError> {
        Ok(Self {
            peak_friction: validated(
                peak_friction,
                Parameter::PeakFriction,
                peak_friction > T::ZERO,
            )?,
            critical_slip: validated(
                critical_slip,
                Parameter::CriticalSlip,
                critical_slip > T::ZERO,
            )?,
        })
    }

    /// Peak friction mup, dimensionless.
    pub fn peak_friction(&self) -> T {
        self.peak_friction
    }

    /// Slip of the peak sp, dimensionless.
    pub fn critical_slip(&self) -> T {
        self.critical_slip
    }

    /// Friction and its derivatives at a slip.
    pub fn expansion(&self, slip_ratio: T) -> Expansion<T> {
        expand(self.peak_friction, self.critical_slip, slip_ratio)
    }
}

impl<T: Real> TyreLaw<T, 2> for Rudd<T> {
    const PARAMETER_NAMES: [&'static str; 2] = ["peak_friction", "critical_slip"];

    fn parameters(&self) -> [T; 2] {
        [self.peak_friction, self.critical_slip]
    }

    fn from_parameters(parameters: &[T; 2]) -> Result<Self, LawError> {
        let [peak_friction, critical_slip] = *parameters;
        Self::new(peak_friction, critical_slip)
    }

    fn friction(&self, slip_ratio: T) -> T {
        self.expansion(slip_ratio).friction
    }

    /// By the symmetry of the law in s and sp: 2 mup sp (sp² - s²) / (sp² + s²)².
    fn slip_derivative(&self, slip_ratio: T) -> T {
        let sp2 = self.critical_slip * self.critical_slip;
        let s2 = slip_ratio * slip_ratio;
        let w = T::ONE / (sp2 + s2);
        T::TWO * self.peak_friction * self.critical_slip * ((sp2 - s2) * w) * w
    }

    fn gradient(&self, slip_ratio: T) -> [T; 2] {
        let e = self.expansion(slip_ratio);
        [e.by_peak_friction, e.by_critical_slip]
    }

    fn hessian(&self, slip_ratio: T) -> [[T; 2]; 2] {
        let e = self.expansion(slip_ratio);
        [[T::ZERO, e.by_both], [e.by_both, e.by_critical_slip_twice]]
    }

    fn peak(&self) -> Peak<T> {
        if self.critical_slip <= T::ONE {
            Peak {
                friction: self.peak_friction,
                slip_ratio: self.critical_slip,
                is_maximum: true,
            }
        } else {
            Peak {
                friction: self.friction(T::ONE),
                slip_ratio: T::ONE,
                is_maximum: false,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{LawError, Parameter, Rudd, TyreLaw};

    #[test]
    fn at_the_peak_friction_and_derivatives_are_the_parameters_own() {
        let law = Rudd::new(0.35, 0.15).unwrap();
        assert!((law.friction(0.15) - 0.35_f64).abs() < 1e-16);
        assert_eq!(law.slip_derivative(0.15), 0.0);
        let g = law.gradient(0.15);
        assert!((g[0] - 1.0).abs() < 1e-15 && g[1] == 0.0);
        // d²mu/dsp² = -mup/sp² at the peak
        assert!((law.hessian(0.15)[1][1] + 0.35 / 0.0225).abs() < 1e-12);
    }

    #[test]
    fn the_law_is_odd_in_slip() {
        let law = Rudd::new(0.8_f32, 0.12).unwrap();
        for s in [0.01, 0.12, 0.5, 1.0] {
            assert_eq!(law.friction(-s), -law.friction(s));
            assert_eq!(law.slip_derivative(-s), law.slip_derivative(s));
        }
    }

    #[test]
    fn bad_parameters_are_named() {
        assert_eq!(
            Rudd::new(f32::NAN, 0.1),
            Err(LawError::NonFinite(Parameter::PeakFriction))
        );
        assert_eq!(
            Rudd::new(0.5_f32, 0.0),
            Err(LawError::OutOfRange(Parameter::CriticalSlip))
        );
    }

    #[test]
    fn a_critical_slip_beyond_lock_has_its_peak_at_lock() {
        let peak = Rudd::new(0.5, 2.0).unwrap().peak();
        assert_eq!((peak.slip_ratio, peak.is_maximum), (1.0, false));
        assert!((peak.friction - 0.4_f64).abs() < 1e-15);
    }
}
