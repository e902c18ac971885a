//! Sine and cosine in single precision, without double-precision arithmetic.
//!
//! The argument is reduced to a multiple k of π plus d in ±π/2 (Cody and Waite: π in three parts of
//! which k times the first two is exact), then sin d = d + d³ p(d²) with a cubic p.

/// Largest magnitude that is reduced exactly enough: k stays below 2¹², as the parts of π need.
const LIMIT: f32 = 4096.0;

/// Adding this rounds to an integer and leaves that integer's parity in the lowest bit.
const ROUND: f32 = 12_582_912.0; // 1.5 * 2^23

// π = PI_HIGH + PI_MIDDLE + PI_LOW to 3e-15; the first two have 12 significant bits.
const PI_HIGH: f32 = 3.140_625;
const PI_MIDDLE: f32 = 0.000_967_502_6;
const PI_LOW: f32 = 1.509_958e-7;

// Minimax in relative error on [0, π/2] (6.1e-9 before rounding), by iterated reweighted least squares
// of (sin x - x) / sin x on x³ (1, x², x⁴, x⁶) / sin x.
const S3: f32 = -0.166_666_6;
const S5: f32 = 0.008_333_066;
const S7: f32 = -0.000_198_095_38;
const S9: f32 = 2.605_631e-6;

/// Sine of `d` within ±π/2, relative error below 2 units in the last place.
#[inline]
fn sin_reduced(d: f32) -> f32 {
    let z = d * d;
    let p = ((S9 * z + S7) * z + S5) * z + S3;
    d + d * (z * p)
}

/// `value` with its sign flipped where the lowest bit of `parity` is set.
#[inline]
fn flip_if_odd(value: f32, parity: u32) -> f32 {
    f32::from_bits(value.to_bits() ^ (parity << 31))
}

#[inline]
pub(super) fn sin(x: f32) -> f32 {
    if !(-LIMIT..=LIMIT).contains(&x) {
        return f32::NAN;
    }
    let rounded = x * core::f32::consts::FRAC_1_PI + ROUND;
    let k = rounded - ROUND;
    let d = ((x - k * PI_HIGH) - k * PI_MIDDLE) - k * PI_LOW;
    flip_if_odd(sin_reduced(d), rounded.to_bits())
}

#[inline]
pub(super) fn cos(x: f32) -> f32 {
    if !(-LIMIT..=LIMIT).contains(&x) {
        return f32::NAN;
    }
    // x = (k + 1/2) π + d, hence cos x = (-1)^(k+1) sin d.
    let rounded = (x * core::f32::consts::FRAC_1_PI - 0.5) + ROUND;
    let k = (rounded - ROUND) + 0.5;
    let d = ((x - k * PI_HIGH) - k * PI_MIDDLE) - k * PI_LOW;
    flip_if_odd(sin_reduced(d), rounded.to_bits() ^ 1)
}

#[cfg(test)]
mod tests {
    use super::{LIMIT, cos, sin};

    /// Every `stride`-th single-precision number of magnitude `from..=to`, both signs.
    fn numbers(from: f32, to: f32, stride: usize) -> impl Iterator<Item = f32> {
        (from.to_bits()..=to.to_bits())
            .step_by(stride)
            .map(f32::from_bits)
            .flat_map(|x| [x, -x])
    }

    fn ulps(got: f32, exact: f64) -> f64 {
        let nearest = (exact as f32).abs();
        let spacing = f64::from(f32::from_bits(nearest.to_bits() + 1)) - f64::from(nearest);
        (f64::from(got) - exact).abs() / spacing
    }

    #[test]
    fn sine_is_within_two_and_a_half_ulp_inside_half_a_turn() {
        // 3.0 keeps clear of the zero at π, where only the absolute error is bounded.
        for x in numbers(1e-6, 3.0, 101) {
            let error = ulps(sin(x), libm::sin(f64::from(x)));
            assert!(error < 2.5, "sin {x}: {error} ulp");
        }
    }

    #[test]
    fn absolute_error_stays_below_2e_7_over_the_whole_range() {
        for x in numbers(1e-3, LIMIT, 331) {
            let sine_error = (f64::from(sin(x)) - libm::sin(f64::from(x))).abs();
            let cosine_error = (f64::from(cos(x)) - libm::cos(f64::from(x))).abs();
            assert!(sine_error < 2e-7, "sin {x}: {sine_error:e}");
            assert!(cosine_error < 2e-7, "cos {x}: {cosine_error:e}");
        }
    }

    #[test]
    fn zero_and_sign_are_exact() {
        assert_eq!(sin(0.0).to_bits(), 0.0_f32.to_bits());
        assert_eq!(cos(0.0), 1.0);
        for x in numbers(1e-6, 100.0, 9973) {
            assert_eq!(sin(-x), -sin(x));
        }
    }

    #[test]
    fn arguments_outside_the_range_give_nan() {
        for x in [LIMIT * 1.001, -1e30, f32::INFINITY, f32::NAN] {
            assert!(sin(x).is_nan() && cos(x).is_nan(), "{x}");
        }
    }
}
