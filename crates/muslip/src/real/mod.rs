//! The scalar that everything here is generic over.
//!
//! One small trait instead of a numeric tower: a reader sees each function that costs a library call
//! on the target, and a test can put a dual number through the very code that runs on the wheel.
//! Host and target use the same `libm`, so they agree to the last bit up to the compiler's contraction.

mod sine;

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// Quarters of binades from 1/64 to 1.
pub(crate) const QUARTER_BINADES: usize = LAST_QUARTER as usize + 1;
const LAST_QUARTER: u32 = 23;
/// The first of them among all of an `f32`: four a binade from 2^-127, and 1/64 is 2^-6.
const FIRST_QUARTER: u32 = 4 * (127 - 6);

/// A real scalar: `f32` on the target, `f64` on the host, a dual number in tests.
///
/// Implementations may be wrappers that carry derivatives: nothing in this crate sends a value through
/// another type on its way, and [`Real::from_f64`] is only ever given constants.
pub trait Real:
    Copy
    + Debug
    + PartialEq
    + PartialOrd
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// 2.
    const TWO: Self;
    /// 1/2.
    const HALF: Self;
    /// Distance from 1 to the next larger number (relative spacing, dimensionless).
    const EPSILON: Self;
    /// Smallest positive number with full relative precision.
    const MIN_POSITIVE: Self;

    /// A constant, rounded to this type. Folded at compile time for `f32` and `f64`.
    fn from_f64(constant: f64) -> Self;
    /// e to the power of `self`.
    fn exp(self) -> Self;
    /// Natural logarithm; NaN below zero, minus infinity at zero.
    fn ln(self) -> Self;
    /// Square root; NaN below zero.
    fn sqrt(self) -> Self;
    /// Sine, argument in radians.
    ///
    /// `f32`: absolute error below 2e-7 for `|self| <= 4096`, NaN beyond; no double precision inside.
    fn sin(self) -> Self;
    /// Cosine, argument in radians. Range and error in `f32` as for [`Real::sin`].
    fn cos(self) -> Self;
    /// Arc tangent in radians, within ±π/2.
    fn atan(self) -> Self;
    /// Magnitude.
    fn abs(self) -> Self;
    /// True for numbers that are neither infinite nor NaN.
    fn is_finite(self) -> bool;

    /// Zero where [`Real::is_finite`], NaN where not: added to one side of a comparison it refuses what is not
    /// finite, for the price of a subtraction.
    #[inline]
    #[expect(clippy::eq_op, reason = "zero over zero is not a number")]
    fn zero_if_finite(self) -> Self {
        if self.is_finite() {
            Self::ZERO
        } else {
            Self::ZERO / Self::ZERO
        }
    }

    /// The smaller of two; `other` where `self` is NaN.
    #[inline]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }

    /// The larger of two; `other` where `self` is NaN.
    #[inline]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    /// `self` times itself.
    #[inline]
    fn squared(self) -> Self {
        self * self
    }

    /// The quarter of a binade that the magnitude lies in, and its middle.
    ///
    /// Counted from 0 at 1/64 to 23 below 1; what lies beyond counts to the first or the last, and NaN to
    /// either. `f32` reads it off its exponent and first two digits.
    #[inline]
    fn quarter_binade(self) -> (usize, Self) {
        let magnitude = self.abs();
        let mut index = 0;
        let mut middle = Self::middle_of_quarter_binade(0);
        // A quarter ends where the next begins: half a quarter beyond its middle.
        for next in 1..QUARTER_BINADES {
            let above = Self::middle_of_quarter_binade(next);
            let width = Self::from_f64(1.0 / 512.0 * f64::from(1 << (next / 4)));
            if magnitude < above - width {
                break;
            }
            (index, middle) = (next, above);
        }
        (index, middle)
    }

    /// The middle of a quarter of a binade, counted as [`Real::quarter_binade`] does.
    #[inline]
    fn middle_of_quarter_binade(index: usize) -> Self {
        let mut low = Self::from_f64(1.0 / 64.0);
        for _ in 0..index / 4 {
            low = low + low;
        }
        let quarters = [1.125, 1.375, 1.625, 1.875];
        low * Self::from_f64(quarters.get(index % 4).copied().unwrap_or_default())
    }
}

impl Real for f32 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const TWO: Self = 2.0;
    const HALF: Self = 0.5;
    const EPSILON: Self = f32::EPSILON;
    const MIN_POSITIVE: Self = f32::MIN_POSITIVE;

    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rounding a constant to the working precision is the purpose"
    )]
    fn from_f64(constant: f64) -> Self {
        constant as f32
    }
    #[inline]
    fn exp(self) -> Self {
        libm::expf(self)
    }
    #[inline]
    fn ln(self) -> Self {
        libm::logf(self)
    }
    #[inline]
    fn sqrt(self) -> Self {
        libm::sqrtf(self)
    }
    // libm's sinf and cosf compute in double precision: over a thousand instructions of soft float on
    // a single-precision FPU.
    #[inline]
    fn sin(self) -> Self {
        sine::sin(self)
    }
    #[inline]
    fn cos(self) -> Self {
        sine::cos(self)
    }
    #[inline]
    fn atan(self) -> Self {
        libm::atanf(self)
    }
    #[inline]
    fn abs(self) -> Self {
        libm::fabsf(self)
    }
    #[inline]
    fn is_finite(self) -> bool {
        // On an FPU cheaper than taking the bits apart.
        libm::fabsf(self) <= f32::MAX
    }
    #[inline(always)]
    #[expect(clippy::eq_op, reason = "an infinity less itself is not a number")]
    fn zero_if_finite(self) -> Self {
        self - self
    }
    #[inline(always)]
    fn quarter_binade(self) -> (usize, Self) {
        // Without its sign a number's upper bits are its exponent and the first two digits: quarters of
        // binades, counted from 2^-127.
        let quarter = (self.to_bits() << 1) >> 22;
        let index = quarter.saturating_sub(FIRST_QUARTER).min(LAST_QUARTER) as usize;
        (index, Self::middle_of_quarter_binade(index))
    }
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "what is beyond the last is no quarter that anything lies in"
    )]
    fn middle_of_quarter_binade(index: usize) -> Self {
        f32::from_bits(((index as u32).wrapping_add(FIRST_QUARTER) << 21) | (1 << 20))
    }
}

impl Real for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const TWO: Self = 2.0;
    const HALF: Self = 0.5;
    const EPSILON: Self = f64::EPSILON;
    const MIN_POSITIVE: Self = f64::MIN_POSITIVE;

    #[inline(always)]
    fn from_f64(constant: f64) -> Self {
        constant
    }
    #[inline]
    fn exp(self) -> Self {
        libm::exp(self)
    }
    #[inline]
    fn ln(self) -> Self {
        libm::log(self)
    }
    #[inline]
    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }
    #[inline]
    fn sin(self) -> Self {
        libm::sin(self)
    }
    #[inline]
    fn cos(self) -> Self {
        libm::cos(self)
    }
    #[inline]
    fn atan(self) -> Self {
        libm::atan(self)
    }
    #[inline]
    fn abs(self) -> Self {
        libm::fabs(self)
    }
    #[inline]
    fn is_finite(self) -> bool {
        f64::is_finite(self)
    }
    #[inline(always)]
    #[expect(clippy::eq_op, reason = "an infinity less itself is not a number")]
    fn zero_if_finite(self) -> Self {
        self - self
    }
}

#[cfg(test)]
mod tests {
    use super::Real;

    #[test]
    fn min_and_max_ignore_nan_on_the_left() {
        assert_eq!(Real::min(f32::NAN, 2.0), 2.0);
        assert_eq!(Real::max(f64::NAN, 2.0), 2.0);
        assert_eq!(Real::min(1.0_f64, 2.0), 1.0);
        assert_eq!(Real::max(1.0_f32, 2.0), 2.0);
    }

    #[test]
    fn a_slip_lies_in_the_quarter_of_its_binade_in_either_precision() {
        for i in 0..20_000_u16 {
            let slip = f32::from(i) / 16_384.0;
            let (index, middle) = slip.quarter_binade();
            assert_eq!(
                (-f64::from(slip)).quarter_binade(),
                (index, f64::from(middle))
            );
            // Written a second time.
            let clamped = f64::from(slip).clamp(1.0 / 64.0, 0.999_999);
            let binade = 2.0_f64.powi(clamped.log2().floor() as i32);
            let quarter = ((clamped / binade - 1.0) * 4.0).floor();
            assert_eq!(f64::from(middle), binade * (1.0 + (quarter + 0.5) / 4.0));
            assert_eq!(index, (4.0 * (binade.log2() + 6.0) + quarter) as usize);
        }
        assert_eq!(f32::INFINITY.quarter_binade().0, 23);
    }

    #[test]
    fn what_is_not_finite_is_not_zero() {
        for finite in [0.0, -1.0, f32::MAX, f32::MIN_POSITIVE] {
            assert_eq!(finite.zero_if_finite(), 0.0);
            assert_eq!(f64::from(finite).zero_if_finite(), 0.0);
        }
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert!(bad.zero_if_finite().is_nan());
            assert!(f64::from(bad).zero_if_finite().is_nan());
        }
    }

    #[test]
    fn constants_are_rounded_to_the_nearest_number() {
        assert_eq!(<f32 as Real>::from_f64(0.1), 0.1_f32);
        assert_eq!(<f64 as Real>::from_f64(0.1), 0.1_f64);
    }
}
