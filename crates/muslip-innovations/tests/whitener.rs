//! The filter against the dense algebra that it stands for, in both precisions.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failed step fails the test"
)]

mod dense;

use dense::{Kind as Dense, Problem};
use muslip::real::Real;
use muslip_innovations::whitener::{Kind, Part, PartError, Whitener};
use test_support::noise::Noise;

const PARTS: usize = 6;

fn kind<T: Real>(kind: Dense) -> Kind<T> {
    let time_constant_s = T::from_f64;
    match kind {
        Dense::Forgetting(tau) => Kind::Forgetting {
            time_constant_s: time_constant_s(tau),
        },
        Dense::Integrated(tau) => Kind::Integrated {
            time_constant_s: time_constant_s(tau),
        },
        Dense::Constant => Kind::Constant,
        Dense::Walk => Kind::Walk,
        Dense::IntegratedConstant => Kind::IntegratedConstant,
    }
}

/// A random problem with missing readings, gaps and, of a level, stretches; and its readings.
fn random(seed: u64, walk: bool, n: usize) -> (Problem, Vec<f64>) {
    let mut draw = Noise::seeded(seed);
    let tau = |draw: &mut Noise| draw.log_uniform(0.002, 2.0);
    let mut parts = Vec::new();
    for i in 0..PARTS {
        let forgets = Dense::Forgetting(tau(&mut draw));
        let kind = match (walk, i) {
            (true, 0) => Dense::Walk,
            (true, 2) => Dense::Integrated(tau(&mut draw)),
            (true, 3) => Dense::IntegratedConstant,
            (true, 4) => Dense::Integrated(tau(&mut draw)),
            (_, 5) => Dense::Constant,
            _ => forgets,
        };
        let large = matches!(
            kind,
            Dense::Walk | Dense::Integrated(_) | Dense::IntegratedConstant
        );
        let std = draw.log_uniform(0.1, 3.0) * if large { 100.0 } else { 1.0 };
        parts.push((
            kind,
            if i == 1 && seed.is_multiple_of(4) {
                0.0
            } else {
                std
            },
        ));
    }
    let mut problem = Problem {
        parts,
        time: vec![],
        rows: vec![],
        rates: vec![],
        white: vec![],
        stretch: vec![],
        read: vec![],
    };
    let (mut now, mut stretch) = (0.0, 0);
    for k in 0..n {
        let lost = k > 0 && draw.uniform(0.0, 1.0) < 0.05;
        let long = k > 0 && draw.uniform(0.0, 1.0) < 0.03;
        now += match (k, long) {
            (0, _) => 0.0,
            // Longer than any part remembers, too.
            (_, true) => draw.log_uniform(0.05, 500.0),
            _ => [0.001, draw.uniform(0.0005, 0.002)][k % 2],
        };
        stretch += usize::from(long && walk);
        problem.time.push(now);
        problem.white.push(draw.log_uniform(0.2, 1.0).powi(2));
        problem.stretch.push(stretch);
        problem.read.push(!lost);
        let gain = |draw: &mut Noise| draw.uniform(-1.5, 1.5);
        let row = problem.parts.iter().map(|(kind, _)| match kind {
            Dense::Walk => 1.0,
            Dense::Integrated(_) | Dense::IntegratedConstant => 0.0,
            _ => gain(&mut draw),
        });
        problem.rows.push(row.collect());
        let rates = (0..PARTS).map(|_| gain(&mut draw));
        problem.rates.push(rates.collect());
    }
    let readings = (0..n).map(|_| draw.normal(2.0)).collect();
    (problem, readings)
}

fn filtered<T: Real>(problem: &Problem, readings: &[f64], value: fn(T) -> f64) -> Vec<Option<f64>> {
    let parts = core::array::from_fn(|i| Part {
        kind: kind(problem.parts[i].0),
        std: T::from_f64(problem.parts[i].1),
    });
    let mut filter = Whitener::<T, PARTS>::new(parts).unwrap();
    let mut last_stretch = 0;
    let array = |from: &[f64]| core::array::from_fn(|i| T::from_f64(from[i]));
    (0..readings.len())
        .map(|k| {
            let dt = if k == 0 {
                0.0
            } else {
                problem.time[k] - problem.time[k - 1]
            };
            filter.predict(T::from_f64(dt), &array(&problem.rates[k]));
            if problem.stretch[k] != last_stretch {
                filter.forget_level();
                last_stretch = problem.stretch[k];
            }
            if !problem.read[k] {
                return None;
            }
            let (reading, white) = (T::from_f64(readings[k]), T::from_f64(problem.white[k]));
            let innovation =
                filter.update(reading, &array(&problem.rows[k]), white, T::from_f64(1e6))?;
            assert!(innovation.fused && filter.is_finite());
            Some(value(innovation.normalised()))
        })
        .collect()
}

/// The largest difference of two lists of innovations, which are there at the same instants.
fn apart(a: &[Option<f64>], b: &[Option<f64>]) -> f64 {
    assert_eq!(a.len(), b.len());
    let each = a.iter().zip(b).enumerate().map(|(k, pair)| match pair {
        (Some(a), Some(b)) => (a - b).abs(),
        (None, None) => 0.0,
        other => panic!("at {k}: {other:?}"),
    });
    each.fold(0.0, f64::max)
}

#[test]
fn innovations_are_those_of_the_dense_covariance_with_gaps() {
    for seed in 0..60 {
        for walk in [false, true] {
            let (problem, readings) = random(seed, walk, 120);
            let dense = problem.innovations(&readings);
            let worst = apart(&filtered::<f64>(&problem, &readings, |x| x), &dense);
            assert!(worst < 1e-8, "seed {seed}, walk {walk}: {worst:e}");
        }
    }
}

#[test]
fn innovations_in_single_precision_are_within_a_thousandth_of_the_dense_ones() {
    for seed in 100..160 {
        for walk in [false, true] {
            let (problem, readings) = random(seed, walk, 120);
            let dense = problem.innovations(&readings);
            let single = filtered::<f32>(&problem, &readings, f64::from);
            let worst = apart(&single, &dense);
            assert!(worst < 1e-3, "seed {seed}, walk {walk}: {worst:e}");
        }
    }
}

#[test]
fn a_level_counted_from_its_last_reading_gives_the_same_innovations() {
    let parts = |kinds: [Kind<f64>; 3]| kinds.map(|kind| Part { kind, std: 0.5 });
    let tau = 0.05;
    let parts = parts([
        Kind::Walk,
        Kind::Forgetting {
            time_constant_s: tau,
        },
        Kind::Integrated {
            time_constant_s: tau,
        },
    ]);
    let (mut absolute, mut relative) =
        (Whitener::new(parts).unwrap(), Whitener::new(parts).unwrap());
    let mut draw = Noise::seeded(9);
    let (mut input, mut last) = (0.0, 0.0);
    for _ in 0..500 {
        let (by, level) = (draw.normal(1.0), draw.normal(3.0));
        input += by;
        for filter in [&mut absolute, &mut relative] {
            filter.predict(0.001, &[0.0, 0.0, 1.0]);
        }
        relative.shift_level(by - (level - last));
        last = level;
        let row = [1.0, 1.0, 0.0];
        let a = absolute.update(level - input, &row, 0.1, 1e6);
        let b = relative.update(0.0, &row, 0.1, 1e6);
        let value =
            |x: Option<muslip_innovations::whitener::Innovation<f64>>| x.map(|x| x.normalised());
        assert!((value(a).unwrap_or(0.0) - value(b).unwrap_or(0.0)).abs() < 1e-9);
    }
}

#[test]
fn a_reading_beyond_the_gate_is_told_and_changes_nothing() {
    let constant = Part {
        kind: Kind::Constant,
        std: 1.0,
    };
    let mut filter = Whitener::new([constant]).unwrap();
    let before = filter;
    let refused = filter.update(100.0, &[1.0], 1.0, 6.0).unwrap();
    assert!(!refused.fused && refused.normalised() > 6.0);
    assert_eq!(filter, before);
    assert!(filter.update(3.0, &[1.0], 1.0, 6.0).unwrap().fused);
    assert!((filter.state()[0] - 1.5).abs() < 1e-12);
}

#[test]
fn parts_that_make_no_filter_are_refused_by_name() {
    let part = |kind, std| Part { kind, std };
    let forgetting = |time_constant_s| Kind::Forgetting { time_constant_s };
    let of = |parts: [Part<f32>; 2]| Whitener::new(parts).map(|_| ());
    let good = part(Kind::Constant, 1.0);
    assert_eq!(of([good, part(forgetting(1.0), 1.0)]), Ok(()));
    for std in [-1.0, f32::NAN, f32::INFINITY, 1e30] {
        assert_eq!(of([good, part(Kind::Constant, std)]), Err(PartError::Std));
    }
    for tau in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(
            of([good, part(forgetting(tau), 1.0)]),
            Err(PartError::TimeConstant)
        );
    }
    assert_eq!(of([good, part(Kind::Walk, 1.0)]), Err(PartError::Walk));
    assert_eq!(
        of([good, part(Kind::IntegratedConstant, 1.0)]),
        Err(PartError::Walk)
    );
}
