//! Filter runs a second on one core: 41 samples each, one by one, in lanes, and by nalgebra.
//!
//! `cargo run --release -p muslip --example throughput`
#![allow(
    clippy::unwrap_used,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "a program that measures"
)]

use std::hint::black_box;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};
use std::time::Instant;

use muslip::filter::efficient;
use muslip::filter::mu_slip::{Range, update_unchecked};
use muslip::real::Real;
use nalgebra::{Matrix2, RowVector2, Vector2};
use test_support::noise::Noise;

const POINTS: usize = 41;
const LANES: usize = 16;
const VARIANCE: f32 = 0.0144;

/// Runs side by side: the very same code, an array for each number.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
struct Lanes([f32; LANES]);

impl Lanes {
    #[inline(always)]
    fn map(self, f: impl Fn(f32) -> f32) -> Self {
        Self(self.0.map(f))
    }
    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let mut out = self.0;
        for (a, b) in out.iter_mut().zip(other.0) {
            *a = f(*a, b);
        }
        Self(out)
    }
}

macro_rules! operator {
    ($op:ident $f:ident $assign:ident $g:ident) => {
        impl $op for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $f(self, other: Self) -> Self {
                self.with(other, |a, b| a.$f(b))
            }
        }
        impl $assign for Lanes {
            #[inline(always)]
            fn $g(&mut self, other: Self) {
                *self = $op::$f(*self, other);
            }
        }
    };
}
operator!(Add add AddAssign add_assign);
operator!(Sub sub SubAssign sub_assign);
operator!(Mul mul MulAssign mul_assign);
operator!(Div div DivAssign div_assign);

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(Neg::neg)
    }
}

impl Real for Lanes {
    const ZERO: Self = Self([0.0; LANES]);
    const ONE: Self = Self([1.0; LANES]);
    const TWO: Self = Self([2.0; LANES]);
    const HALF: Self = Self([0.5; LANES]);
    const EPSILON: Self = Self([f32::EPSILON; LANES]);
    const MIN_POSITIVE: Self = Self([f32::MIN_POSITIVE; LANES]);
    #[inline(always)]
    fn from_f64(constant: f64) -> Self {
        Self([constant as f32; LANES])
    }
    fn exp(self) -> Self {
        self.map(f32::exp)
    }
    fn ln(self) -> Self {
        self.map(f32::ln)
    }
    fn sqrt(self) -> Self {
        self.map(f32::sqrt)
    }
    fn sin(self) -> Self {
        self.map(f32::sin)
    }
    fn cos(self) -> Self {
        self.map(f32::cos)
    }
    fn atan(self) -> Self {
        self.map(f32::atan)
    }
    fn abs(self) -> Self {
        self.map(f32::abs)
    }
    fn is_finite(self) -> bool {
        self.0.iter().all(|value| value.is_finite())
    }
}

/// Runs a second of a body that makes `each` runs a call.
fn rate(each: usize, mut body: impl FnMut()) -> f64 {
    body();
    let start = Instant::now();
    let mut runs = 0;
    while start.elapsed().as_secs_f64() < 1.0 {
        for _ in 0..64 {
            body();
        }
        runs += 64 * each;
    }
    runs as f64 / start.elapsed().as_secs_f64()
}

fn main() {
    let mut noise = Noise::seeded(1);
    let slips: [f32; POINTS] = std::array::from_fn(|i| (i as f32 / 40.0).powi(2));
    let frictions: [Lanes; POINTS] = std::array::from_fn(|i| {
        let r = slips[i] / 0.15;
        Lanes(std::array::from_fn(|_| {
            0.7 * r / (1.0 + r * r) + noise.normal(0.04) as f32
        }))
    });
    let one = || {
        let mut x = Range::Aircraft.initial_state::<f32>();
        let mut p = Range::Aircraft.initial_covariance::<f32>();
        for (slip, friction) in black_box(&slips).iter().zip(black_box(&frictions)) {
            (x, p) = update_unchecked(x, p, *slip, friction.0[0], VARIANCE);
        }
        black_box((x, p));
        x.peak_friction
    };
    let lanes = || {
        let mut x = Range::Aircraft.initial_state::<Lanes>();
        let mut p = Range::Aircraft.initial_covariance::<Lanes>();
        let variance = Lanes([VARIANCE; LANES]);
        for (slip, friction) in black_box(&slips).iter().zip(black_box(&frictions)) {
            (x, p) = update_unchecked(x, p, Lanes([*slip; LANES]), *friction, variance);
        }
        black_box((x, p));
        x.peak_friction.0[0]
    };
    let by_nalgebra = || {
        let mut x = Vector2::new(0.6_f32, 0.2);
        let mut p = Matrix2::new(0.36_f32, 0.0, 0.0, 0.04);
        for (&s, friction) in black_box(&slips).iter().zip(black_box(&frictions)) {
            let (s2, sp2) = (s * s, x[1] * x[1]);
            let w = 1.0 / (sp2 + s2);
            let h0 = 2.0 * s * x[1] * w;
            let mu = x[0] * h0;
            let both = 2.0 * s * (s2 - sp2) * w * w;
            let h = RowVector2::new(h0, x[0] * both);
            let second = mu * (sp2 - 3.0 * s2) * w * w;
            let pd = p[(1, 1)];
            let r = VARIANCE + pd * (both * both * p[(0, 0)] + second * second * pd);
            let pht = p * h.transpose();
            let k = pht / ((h * pht)[0] + r);
            x += k * (friction.0[0] - mu);
            p = (Matrix2::identity() - k * h) * p;
        }
        black_box((x, p));
        x[0]
    };
    let best = || {
        let mut filter = efficient::Config::<f32>::default().build().unwrap();
        for (slip, friction) in black_box(&slips).iter().zip(black_box(&frictions)) {
            efficient::update(&mut filter, *slip, friction.0[0], 0.0016);
        }
        black_box(filter).state().peak_friction
    };
    assert!((one() - lanes()).abs() < 1e-5 && (one() - by_nalgebra()).abs() < 1e-4);
    let reference = rate(1, || {
        by_nalgebra();
    });
    println!("| runs of 41 samples, `f32`, one core | runs a second | over nalgebra |");
    println!("| --- | --- | --- |");
    let row = |name: &str, rate: f64| {
        println!("| {name} | {:.2e} | {:.2} |", rate, rate / reference);
    };
    row("nalgebra, generic matrices", reference);
    row(
        "the lean update, one by one",
        rate(1, || {
            one();
        }),
    );
    row(
        "the lean update, 16 runs side by side",
        rate(LANES, || {
            lanes();
        }),
    );
    row(
        "the efficient estimator, one by one",
        rate(1, || {
            best();
        }),
    );
}
