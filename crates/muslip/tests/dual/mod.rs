//! A dual number as the scalar of the crates: nothing in them may send a value through another type, so that
//! derivatives come out of the very arithmetic that runs on the target.

use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use muslip::real::Real;
use num_dual::{Dual64, DualNum};

/// A number with its derivative.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Dual(pub Dual64);

impl Dual {
    /// A value and its derivative.
    pub const fn of(re: f64, eps: f64) -> Self {
        Self(Dual64 { re, eps })
    }
}

macro_rules! operators {
    ($($op:ident $method:ident $assign:ident $assign_method:ident $sign:tt),*) => {$(
        impl $op for Dual {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self(self.0 $sign other.0)
            }
        }
        impl $assign for Dual {
            fn $assign_method(&mut self, other: Self) {
                *self = *self $sign other;
            }
        }
    )*};
}
operators!(
    Add add AddAssign add_assign +, Sub sub SubAssign sub_assign -,
    Mul mul MulAssign mul_assign *, Div div DivAssign div_assign /
);

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Real for Dual {
    const ZERO: Self = Self::of(0.0, 0.0);
    const ONE: Self = Self::of(1.0, 0.0);
    const TWO: Self = Self::of(2.0, 0.0);
    const HALF: Self = Self::of(0.5, 0.0);
    const EPSILON: Self = Self::of(f64::EPSILON, 0.0);
    const MIN_POSITIVE: Self = Self::of(f64::MIN_POSITIVE, 0.0);
    fn from_f64(constant: f64) -> Self {
        Self::of(constant, 0.0)
    }
    fn exp(self) -> Self {
        Self(self.0.exp())
    }
    fn ln(self) -> Self {
        Self(self.0.ln())
    }
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    fn sin(self) -> Self {
        Self(self.0.sin())
    }
    fn cos(self) -> Self {
        Self(self.0.cos())
    }
    fn atan(self) -> Self {
        Self(self.0.atan())
    }
    fn abs(self) -> Self {
        if self.0.re < 0.0 { -self } else { self }
    }
    fn is_finite(self) -> bool {
        self.0.re.is_finite() && self.0.eps.is_finite()
    }
}
