//! Filter runs a second on one core: 41 samples each, one by one, in lanes, and by nalgebra.
//!
//! `cargo run --release -p muslip --example throughput -- [RUNS]`, a million runs each if nothing else is said;
//! `docs/scripts/peers.py rate` adds a row for filterpy.
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
/// Different streams, in turn.
const STREAMS: usize = 256;
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

/// Seconds that this thread has been on a processor: what else the machine does is not counted. Where Linux does not tell,
/// seconds on the wall.
fn processor_seconds(start: Instant) -> f64 {
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok())
        .map_or_else(
            || start.elapsed().as_secs_f64(),
            |nanoseconds| 1e-9 * nanoseconds,
        )
}

/// Runs a second of a body that is called with the number of a stream and makes `each` runs a call; until there
/// were so many runs.
fn rate(runs: usize, each: usize, mut body: impl FnMut(usize)) -> f64 {
    (0..STREAMS).for_each(&mut body);
    let start = Instant::now();
    let before = processor_seconds(start);
    for call in 0..runs.div_ceil(each) {
        body(call % STREAMS);
    }
    (runs.div_ceil(each) * each) as f64 / (processor_seconds(start) - before)
}

/// The article's filter in matrices, as one would write it.
fn by_nalgebra(slips: &[f32], frictions: impl Iterator<Item = f32>) -> f32 {
    let mut x = Vector2::new(0.6_f32, 0.2);
    let mut p = Matrix2::new(0.36_f32, 0.0, 0.0, 0.04);
    for (&s, friction) in slips.iter().zip(frictions) {
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
        x += k * (friction - mu);
        p = (Matrix2::identity() - k * h) * p;
    }
    black_box((x, p));
    x[0]
}

fn main() {
    let runs = std::env::args()
        .nth(1)
        .map_or(1_000_000, |text| text.parse().unwrap());
    let mut noise = Noise::seeded(1);
    let slips: [f32; POINTS] = std::array::from_fn(|i| (i as f32 / 40.0).powi(2));
    // Lane by lane a stream of its own, so that no branch is foretold by the run before.
    let streams: Vec<[Lanes; POINTS]> = (0..STREAMS)
        .map(|_| {
            std::array::from_fn(|i| {
                let r = slips[i] / 0.15;
                Lanes(std::array::from_fn(|_| {
                    0.7 * r / (1.0 + r * r) + noise.normal(0.04) as f32
                }))
            })
        })
        .collect();
    // One by one: a lane of each, side by side in memory.
    let single: Vec<[f32; POINTS]> = streams
        .iter()
        .enumerate()
        .map(|(stream, frictions)| frictions.map(|friction| friction.0[stream % LANES]))
        .collect();
    let first = |stream: usize| black_box(&single)[stream].iter().copied();
    let one = |stream: usize| {
        let mut x = Range::Aircraft.initial_state::<f32>();
        let mut p = Range::Aircraft.initial_covariance::<f32>();
        for (slip, friction) in black_box(&slips).iter().zip(first(stream)) {
            (x, p) = update_unchecked(x, p, *slip, friction, VARIANCE);
        }
        black_box((x, p));
        x.peak_friction
    };
    let lanes = |stream: usize| {
        let mut x = Range::Aircraft.initial_state::<Lanes>();
        let mut p = Range::Aircraft.initial_covariance::<Lanes>();
        let variance = Lanes([VARIANCE; LANES]);
        for (slip, friction) in black_box(&slips).iter().zip(&black_box(&streams)[stream]) {
            (x, p) = update_unchecked(x, p, Lanes([*slip; LANES]), *friction, variance);
        }
        black_box((x, p));
        x.peak_friction
    };
    let matrices = |stream: usize| by_nalgebra(black_box(&slips), first(stream));
    let best = |stream: usize| {
        let mut filter = efficient::Config::<f32>::default().build().unwrap();
        for (slip, friction) in black_box(&slips).iter().zip(first(stream)) {
            efficient::update_unchecked(&mut filter, *slip, friction, 0.0016);
        }
        black_box(filter).state().peak_friction
    };
    for stream in 0..STREAMS {
        let one = one(stream);
        assert!((one - lanes(stream).0[stream % LANES]).abs() < 1e-5);
        assert!((one - matrices(stream)).abs() < 1e-4);
        assert!((best(stream) - 0.35).abs() < 0.2);
    }
    let reference = rate(runs, 1, |stream| {
        matrices(stream);
    });
    println!("| runs of 41 samples, `f32`, one core | runs | runs a second | over nalgebra |");
    println!("| --- | --- | --- | --- |");
    let row = |name: &str, rate: f64| {
        println!("| {name} | {runs} | {rate:.2e} | {:.2} |", rate / reference);
    };
    row("nalgebra, generic matrices", reference);
    let lean = rate(runs, 1, |stream| {
        one(stream);
    });
    row("the lean update, one by one", lean);
    let side_by_side = rate(runs, LANES, |stream| {
        lanes(stream);
    });
    row("the lean update, 16 runs side by side", side_by_side);
    row(
        "the efficient estimator, one by one",
        rate(runs, 1, |stream| {
            best(stream);
        }),
    );
    println!();
    println!(
        "Bar: side by side at least 4 times the one-by-one loop: {:.1}, {}.",
        side_by_side / lean,
        if side_by_side >= 4.0 * lean {
            "met"
        } else {
            "missed"
        }
    );
}
