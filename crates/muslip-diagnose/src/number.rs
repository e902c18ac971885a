//! Numbers the models are written in: plain `f64`, or forward dual numbers that carry the
//! derivatives in up to `N` parameters along.

use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// A number that every column and every reader of a file can take.
#[must_use]
pub fn finite_or_zero(x: f64) -> f64 {
    if x.is_finite() { x } else { 0.0 }
}

/// A scalar that the mechanisms' equations can be evaluated in.
pub trait Number:
    Copy
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
    + AddAssign
    + PartialEq
    + 'static
{
    /// A constant: its derivatives are zero.
    fn constant(value: f64) -> Self;
    /// The value without derivatives.
    fn value(self) -> f64;
    /// Natural exponential.
    fn exp(self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Sine and cosine.
    fn sin_cos(self) -> (Self, Self);
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// Power with a constant exponent.
    fn powf(self, exponent: f64) -> Self {
        (self.ln() * exponent).exp()
    }
    /// Square.
    fn squared(self) -> Self {
        self * self
    }
    /// Magnitude, with the derivative of the branch taken.
    fn abs(self) -> Self {
        if self.value() < 0.0 { -self } else { self }
    }
}

impl Number for f64 {
    fn constant(value: f64) -> Self {
        value
    }
    fn value(self) -> f64 {
        self
    }
    fn exp(self) -> Self {
        f64::exp(self)
    }
    fn ln(self) -> Self {
        f64::ln(self)
    }
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    fn sin_cos(self) -> (Self, Self) {
        f64::sin_cos(self)
    }
    fn tanh(self) -> Self {
        f64::tanh(self)
    }
}

/// A value and its derivatives in `N` parameters (forward mode).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<const N: usize> {
    /// Value.
    pub value: f64,
    /// Derivatives of the value in the parameters, in their order.
    pub slope: [f64; N],
}

impl<const N: usize> Dual<N> {
    /// The `index`-th parameter itself: derivative one in its own direction.
    #[must_use]
    pub fn variable(value: f64, index: usize) -> Self {
        let mut slope = [0.0; N];
        if let Some(own) = slope.get_mut(index) {
            *own = 1.0;
        }
        Self { value, slope }
    }

    #[inline(always)]
    fn chain(self, value: f64, derivative: f64) -> Self {
        let mut slope = self.slope;
        for d in &mut slope {
            *d *= derivative;
        }
        Self { value, slope }
    }

    #[inline(always)]
    fn combine(self, other: Self, value: f64, by_self: f64, by_other: f64) -> Self {
        let mut slope = self.slope;
        for (d, o) in slope.iter_mut().zip(other.slope) {
            *d = *d * by_self + o * by_other;
        }
        Self { value, slope }
    }
}

macro_rules! dual_operators {
    ($($trait:ident $method:ident |$a:ident, $b:ident| $value:expr, $da:expr, $db:expr;)*) => {$(
        impl<const N: usize> $trait for Dual<N> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let ($a, $b) = (self.value, other.value);
                self.combine(other, $value, $da, $db)
            }
        }
        impl<const N: usize> $trait<f64> for Dual<N> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                let ($a, $b) = (self.value, other);
                let _ = $b;
                self.chain($value, $da)
            }
        }
    )*};
}

dual_operators! {
    Add add |a, b| a + b, 1.0, 1.0;
    Sub sub |a, b| a - b, 1.0, -1.0;
    Mul mul |a, b| a * b, b, a;
    Div div |a, b| a / b, 1.0 / b, -a / (b * b);
}

impl<const N: usize> AddAssign for Dual<N> {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<const N: usize> Neg for Dual<N> {
    type Output = Self;
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}

impl<const N: usize> Number for Dual<N> {
    fn constant(value: f64) -> Self {
        Self {
            value,
            slope: [0.0; N],
        }
    }
    fn value(self) -> f64 {
        self.value
    }
    fn exp(self) -> Self {
        let e = self.value.exp();
        self.chain(e, e)
    }
    fn ln(self) -> Self {
        self.chain(self.value.ln(), 1.0 / self.value)
    }
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, 0.5 / root)
    }
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        (self.chain(sin, cos), self.chain(cos, -sin))
    }
    fn tanh(self) -> Self {
        let t = self.value.tanh();
        self.chain(t, 1.0 - t * t)
    }
}

/// Mean, and standard deviation of one value about it: nought of a single one, not a number of none.
#[must_use]
pub fn mean_and_std(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
    (mean, (squares / (n - 1.0).max(1.0)).sqrt())
}

/// The value that one of a thousand exceeds, of those that are numbers; none of none.
#[must_use]
pub fn largest_but_for_outliers(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|x| x.is_finite());
    let at = values.len().checked_sub(1)?.min(values.len() * 999 / 1000);
    Some(*values.select_nth_unstable_by(at, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn everything<T: Number>(x: T, y: T) -> T {
        let (s, c) = (x * y).sin_cos();
        (x.exp() / (y + 2.0) - s * c).tanh() + (x * x + 1.0).ln() * y.powf(1.7) - (y / 3.0).sqrt()
            + (x - y * 4.0).abs()
            + (-x).squared() * 0.5
    }

    #[test]
    fn slopes_agree_with_central_differences() {
        for (x, y) in [(0.3, 1.2), (-0.7, 0.4), (1.9, 2.5)] {
            let dual = everything(Dual::<2>::variable(x, 0), Dual::<2>::variable(y, 1));
            let h = 1e-6;
            let by_x = (everything(x + h, y) - everything(x - h, y)) / (2.0 * h);
            let by_y = (everything(x, y + h) - everything(x, y - h)) / (2.0 * h);
            assert!((dual.value - everything(x, y)).abs() < 1e-14);
            assert!((dual.slope[0] - by_x).abs() < 1e-7 * (1.0 + by_x.abs()));
            assert!((dual.slope[1] - by_y).abs() < 1e-7 * (1.0 + by_y.abs()));
        }
    }
}
