//! The crate's own code with a dual number as its scalar: nothing in it sends a value through another
//! type, so derivatives come out of the very arithmetic that runs on the target.

use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use muslip::filter::mu_slip::{Range, State, update};
use muslip::law::{Burckhardt, MagicFormula, Rudd, TyreLaw};
use muslip::real::Real;
use num_dual::{Dual64, DualNum};
use test_support::Tolerance;

#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
struct Dual(Dual64);

impl Dual {
    const fn of(re: f64, eps: f64) -> Self {
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

const NEAR: Tolerance = Tolerance {
    absolute: 1e-12,
    relative: 1e-12,
};

#[test]
fn the_slope_of_each_law_is_the_derivative_of_its_friction() {
    let slip = Dual::of(0.23, 1.0);
    let seeds = |p: &[f64]| p.iter().map(|&v| Dual::of(v, 0.0)).collect::<Vec<_>>();
    let p = seeds(&[0.8, 0.14]);
    let law = Rudd::new(p[0], p[1]).unwrap();
    NEAR.check(
        "Rudd",
        law.friction(slip).0.eps,
        law.slip_derivative(slip).0.re,
    );
    let p = seeds(&[1.2801, 23.99, 0.52]);
    let law = Burckhardt::new(p[0], p[1], p[2]).unwrap();
    NEAR.check(
        "Burckhardt",
        law.friction(slip).0.eps,
        law.slip_derivative(slip).0.re,
    );
    let p = seeds(&[10.0, 1.9, 1.0, 0.97]);
    let law = MagicFormula::new(p[0], p[1], p[2], p[3]).unwrap();
    NEAR.check(
        "Magic Formula",
        law.friction(slip).0.eps,
        law.slip_derivative(slip).0.re,
    );
}

#[test]
fn the_peak_of_the_magic_formula_carries_derivatives() {
    let peak_at = |b: f64| {
        MagicFormula::new(b, 1.9, 1.0, 0.5)
            .unwrap()
            .peak()
            .slip_ratio
    };
    let dual = |v, eps| Dual::of(v, eps);
    let law = MagicFormula::new(
        dual(10.0, 1.0),
        dual(1.9, 0.0),
        dual(1.0, 0.0),
        dual(0.5, 0.0),
    );
    let got = law.unwrap().peak().slip_ratio.0.eps;
    let difference = (peak_at(10.0 + 1e-5) - peak_at(10.0 - 1e-5)) / 2e-5;
    Tolerance::relative(1e-7).check("by stiffness factor", got, difference);
}

#[test]
fn the_gain_is_the_derivative_of_the_updated_state_by_the_measured_friction() {
    let (slip, friction, variance) = (0.1, 0.4, 0.0144);
    let (x, p) = (
        Range::Aircraft.initial_state::<Dual>(),
        Range::Aircraft.initial_covariance::<Dual>(),
    );
    let constant = |v| Dual::of(v, 0.0);
    let (updated, _): (State<Dual>, _) = update(
        x,
        p,
        constant(slip),
        Dual::of(friction, 1.0),
        constant(variance),
    )
    .unwrap();
    let (_, fusion) = muslip::filter::mu_slip::update_reporting(
        Range::Aircraft.initial_state(),
        Range::Aircraft.initial_covariance(),
        slip,
        friction,
        variance,
    )
    .unwrap();
    NEAR.check(
        "peak friction",
        updated.peak_friction.0.eps,
        fusion.peak_friction_gain,
    );
    NEAR.check(
        "critical slip",
        updated.critical_slip.0.eps,
        fusion.critical_slip_gain,
    );
}
