//! Against dense algebra and differences.

use nalgebra::{DMatrix, DVector};
use rand::RngExt as _;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::part::APART;
use super::*;

const WHITE: f64 = 0.7;

/// Irregular times with a gap, and a gain that varies.
fn times(draw: &mut ChaCha8Rng) -> (Vec<f64>, Vec<f64>) {
    let mut t = 0.0;
    let time = (0..80)
        .map(|k| {
            t += if k == 45 {
                0.6
            } else {
                draw.random_range(0.004..0.03)
            };
            t
        })
        .collect();
    (
        time,
        (0..80).map(|_| draw.random_range(-2.0..2.0)).collect(),
    )
}

/// Covariance of the readings, built impulse by impulse: every independent cause of noise drives the recursion
/// alone.
fn dense(
    time: &[f64],
    segments: &[core::ops::Range<usize>],
    stride: usize,
    parts: &[Part<'_>],
) -> DMatrix<f64> {
    let used = segments.iter().flat_map(|s| s.clone().step_by(stride));
    let used: Vec<usize> = used.collect();
    let n = used.len();
    let mut covariance = DMatrix::identity(n, n) * (WHITE * WHITE);
    let starts: Vec<usize> = segments.iter().map(|s| s.start).collect();
    for part in parts {
        if let Kind::Filtered(tau) = part.kind {
            // The covariance of white noise behind two poles, in closed form.
            let (a, b) = (1.0 / (APART * tau), APART / tau);
            let at = |lag: f64| {
                (-a * lag).exp() * (0.5 / a - 1.0 / (a + b))
                    + (-b * lag).exp() * (0.5 / b - 1.0 / (a + b))
            };
            covariance += DMatrix::from_fn(n, n, |i, j| {
                let gain = |i: usize| part.gain.get(used[i]).copied().unwrap_or(1.0);
                let lag = (time[used[i]] - time[used[j]]).abs();
                part.std * part.std * gain(i) * gain(j) * at(lag) / at(0.0)
            });
        }
    }
    let mut add = |effect: &DVector<f64>| covariance += effect * effect.transpose();
    for part in parts.iter().filter(|part| part.kind == Kind::Walk) {
        // A walk of which each reading is the mean over the time that it was taken for: that is a half of how far it went in
        // it, and what is independent of that.
        for (i, &k) in used.iter().enumerate() {
            let start = starts.contains(&k);
            let meant = if start {
                time[k + 1] - time[k]
            } else {
                time[k] - time[k - 1]
            };
            let before = if start {
                0.0
            } else {
                time[k - 1] - time[used[i - 1]]
            };
            let behind = |j: usize| !starts.iter().any(|s| *s > k && *s <= used[j]);
            let going = |own: f64, seconds: f64| {
                DVector::from_fn(n, |j, _| match j {
                    j if j == i => own * part.std * seconds.sqrt(),
                    j if j > i && behind(j) => part.std * seconds.sqrt(),
                    _ => 0.0,
                })
            };
            add(&going(1.0, before));
            add(&going(0.5, meant));
            let mut beside = DVector::zeros(n);
            beside[i] = part.std * (meant / 12.0).sqrt();
            add(&beside);
        }
    }
    for part in parts {
        for cause in 0..n {
            let mut effect = DVector::zeros(n);
            let (mut x, mut level) = (0.0, 0.0);
            for (i, &k) in used.iter().enumerate() {
                let dt = if i == 0 {
                    0.0
                } else {
                    time[k] - time[used[i - 1]]
                };
                let here = if i == cause { 1.0 } else { 0.0 };
                let first = i == 0;
                let kept = |tau: f64| (-dt / tau).exp();
                let driven = |tau: f64| {
                    let fresh = if first {
                        1.0
                    } else {
                        (1.0 - kept(tau).powi(2)).sqrt()
                    };
                    fresh * part.std
                };
                match part.kind {
                    Kind::Forgetting(tau) => {
                        x = kept(tau) * x + here * driven(tau);
                    }
                    Kind::Constant => x += if first { here * part.std } else { 0.0 },
                    Kind::Walk => {
                        if starts.contains(&k) {
                            x = here * (WHITE * WHITE * DIFFUSE).sqrt();
                        }
                    }
                    Kind::Integrated(tau) => {
                        level += dt * x;
                        if starts.contains(&k) {
                            level = 0.0;
                        }
                        x = kept(tau) * x + here * driven(tau);
                    }
                    Kind::Filtered(_) => {}
                }
                let gain = part.gain.get(k).copied().unwrap_or(1.0);
                effect[i] = if matches!(part.kind, Kind::Integrated(_)) {
                    level
                } else {
                    gain * x
                };
            }
            add(&effect);
        }
    }
    covariance
}

/// Sizes of these parts beside the readings' own noise.
fn sizes_of(parts: &[Part<'_>], diffuse: f64) -> Sizes {
    Sizes {
        white: WHITE,
        diffuse,
        parts: core::array::from_fn(|i| parts.get(i).map_or(0.0, |part| part.std)),
    }
}

/// The filter on one run, and columns through it.
struct Filter {
    own: Whitener,
}

impl Filter {
    fn new(
        time: &[f64],
        segments: &[core::ops::Range<usize>],
        stride: usize,
        white: f64,
        diffuse: f64,
        parts: &[Part<'_>],
    ) -> Self {
        let course = Arc::new(Course::new(time, segments, stride, parts));
        let sizes = Sizes {
            white,
            ..sizes_of(parts, diffuse)
        };
        // A shorter run beside it, which ends before.
        let shorter = Arc::new(Course::new(time, &segments[..2], stride, parts));
        let mut all = whiteners(&[Some(shorter), None, Some(course)], &sizes);
        Self {
            own: all.pop().flatten().unwrap(),
        }
    }

    fn apply(&self, columns: &[&[f64]]) -> Lanes {
        self.own.apply(&Lanes::of(columns, self.own.samples()))
    }
}

fn worst_difference(parts: &[Part<'_>], time: &[f64], stride: usize, draw: &mut ChaCha8Rng) -> f64 {
    let segments = [2..30, 34..45, 45..80];
    let whitener = Filter::new(
        time,
        &segments,
        stride,
        WHITE,
        WHITE * WHITE * DIFFUSE,
        parts,
    );
    let covariance = dense(time, &segments, stride, parts);
    let factor = covariance.clone().cholesky().unwrap();
    let columns: Vec<Vec<f64>> = (0..11)
        .map(|_| (0..80).map(|_| draw.random_range(-1.0..1.0)).collect())
        .collect();
    let refs: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let white = whitener.apply(&refs);
    let mut worst = 0.0f64;
    let samples = whitener.own.samples();
    let products = white.products(0, samples.len());
    for (i, a) in columns.iter().enumerate() {
        for (j, b) in columns.iter().enumerate() {
            let pick =
                |x: &[f64]| DVector::from_iterator(samples.len(), samples.iter().map(|k| x[*k]));
            let expected = pick(a).dot(&factor.solve(&pick(b)));
            let found = products[(i, j)];
            worst = worst.max((found - expected).abs() / expected.abs().max(1.0));
        }
    }
    let log_det = 2.0 * factor.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    worst.max((whitener.own.log_variances().iter().sum::<f64>() - log_det).abs() / log_det.abs())
}

fn part(kind: Kind, std: f64, gain: &[f64]) -> Part<'_> {
    Part { kind, std, gain }
}

#[test]
fn the_filter_equals_dense_algebra_with_gaps_and_stretches_left_out() {
    let mut draw = ChaCha8Rng::seed_from_u64(7);
    for _ in 0..5 {
        let (time, gain) = times(&mut draw);
        let parts = [
            part(Kind::Forgetting(0.05), 0.8, &gain),
            part(Kind::Constant, 1.3, &gain),
            part(Kind::Forgetting(0.4), 0.5, &[]),
            part(Kind::Filtered(0.06), 0.9, &gain),
        ];
        assert!(worst_difference(&parts, &time, 1, &mut draw) < 1e-9);
    }
}

#[test]
fn the_filter_equals_dense_algebra_where_levels_are_unknown() {
    let mut draw = ChaCha8Rng::seed_from_u64(8);
    for _ in 0..5 {
        let (time, gain) = times(&mut draw);
        let parts = [
            part(Kind::Walk, 0.6, &[]),
            part(Kind::Forgetting(0.05), 0.8, &gain),
            part(Kind::Integrated(0.1), 2.0, &[]),
        ];
        // A variance of 1e8 leaves dense algebra itself six digits.
        for stride in [1, 2] {
            let worst = worst_difference(&parts, &time, stride, &mut draw);
            assert!(worst < 1e-5, "{stride}: {worst}");
        }
    }
}

#[test]
fn slopes_of_the_likelihood_are_its_differences() {
    let mut draw = ChaCha8Rng::seed_from_u64(9);
    let (time, gain) = times(&mut draw);
    let columns: Vec<Vec<f64>> = (0..11)
        .map(|_| (0..80).map(|_| draw.random_range(-3.0..3.0)).collect())
        .collect();
    let refs: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let segments = [2..30, 34..45, 45..80];
    let parts = |variances: &[f64]| {
        let kinds = [
            Kind::Walk,
            Kind::Forgetting(0.05),
            Kind::Integrated(0.1),
            Kind::Constant,
            Kind::Integrated(0.7),
            Kind::Filtered(0.06),
        ];
        let gained = [false, true, false, true, false, true];
        kinds
            .into_iter()
            .zip(gained)
            .zip(variances)
            .map(|((kind, gained), variance)| Part {
                kind,
                std: variance.sqrt(),
                gain: if gained { &gain } else { &[] },
            })
            .collect::<Vec<_>>()
    };
    let filter = |variances: &[f64; 7]| {
        Filter::new(
            &time,
            &segments,
            1,
            variances[6].sqrt(),
            1e6,
            &parts(&variances[..6]),
        )
    };
    let value = |variances: &[f64; 7]| {
        let whitener = filter(variances);
        let products = whitener
            .apply(&refs)
            .products(0, whitener.own.samples().len());
        let squares = products.trace();
        whitener.own.log_variances().iter().sum::<f64>() + squares
    };
    let here = [0.4, 0.6, 2.0, 1.2, 0.8, 0.7, 0.5];
    let whitener = filter(&here);
    let traces = traces(&[&whitener.own])[0];
    // Sums of columns that a rotation makes explain together what the columns do.
    let rotation = DMatrix::from_fn(11, 11, |_, _| draw.random_range(-1.0..1.0))
        .qr()
        .q();
    let [some, last] = whitener.own.explained(&whitener.apply(&refs), &rotation);
    let squares = ByVariance {
        parts: core::array::from_fn(|i| some.parts[i] + last.parts[i]),
        white: some.white + last.white,
    };
    for i in 0..7 {
        let own = if i == 6 {
            traces.white - squares.white
        } else {
            traces.parts[i] - squares.parts[i]
        };
        let by = |h: f64| {
            let mut there = here;
            there[i] += h;
            value(&there)
        };
        // The level's variance of 1e6 leaves the value ten digits: smaller steps measure its rounding.
        let h = 5e-4 * here[i];
        let difference = (by(h) - by(-h)) / (2.0 * h);
        assert!(
            (own - difference).abs() < 1e-4 * difference.abs().max(1.0),
            "{i}: {own} {difference}"
        );
    }
}

#[test]
fn what_each_part_is_expected_to_have_been_equals_dense_algebra() {
    let mut draw = ChaCha8Rng::seed_from_u64(10);
    let (time, gain) = times(&mut draw);
    let segments = [2..30, 34..45, 45..80];
    let parts = [
        part(Kind::Forgetting(0.05), 0.8, &gain),
        part(Kind::Constant, 1.3, &gain),
        part(Kind::Forgetting(0.4), 0.5, &[]),
        part(Kind::Filtered(0.06), 0.9, &gain),
    ];
    let filter = Filter::new(&time, &segments, 1, WHITE, 1.0, &parts);
    let column: Vec<f64> = (0..80).map(|_| draw.random_range(-1.0..1.0)).collect();
    let sizes = sizes_of(&parts, 1.0);
    let white = filter.apply(&[&column, &gain]);
    let expected = filter.own.expected(&white, &[1.0, 0.0], &sizes);
    let samples = filter.own.samples();
    let own = DVector::from_iterator(samples.len(), samples.iter().map(|k| column[*k]));
    let factor = dense(&time, &segments, 1, &parts).cholesky().unwrap();
    let weighed = factor.solve(&own);
    let white_part = DMatrix::identity(samples.len(), samples.len()) * (WHITE * WHITE);
    for (i, part) in parts.iter().enumerate() {
        let covariance = dense(&time, &segments, 1, core::slice::from_ref(part)) - &white_part;
        let difference = DVector::from_vec(expected.column(i)) - covariance * &weighed;
        assert!(difference.amax() < 1e-9, "{i}: {}", difference.amax());
    }
    let difference = DVector::from_vec(expected.column(MOST)) - &white_part * &weighed;
    assert!(difference.amax() < 1e-9);
}

#[test]
fn what_each_part_is_expected_to_have_been_is_what_it_explains() {
    let mut draw = ChaCha8Rng::seed_from_u64(11);
    let (time, gain) = times(&mut draw);
    let parts = [
        part(Kind::Walk, 0.6, &[]),
        part(Kind::Forgetting(0.05), 0.8, &gain),
        part(Kind::Integrated(0.1), 2.0, &[]),
        part(Kind::Filtered(0.06), 0.9, &gain),
    ];
    let filter = Filter::new(&time, &[2..30, 34..45, 45..80], 1, WHITE, 1e6, &parts);
    let column: Vec<f64> = (0..80).map(|_| draw.random_range(-1.0..1.0)).collect();
    let sizes = sizes_of(&parts, 1e6);
    let white = filter.apply(&[&column]);
    let expected = filter.own.expected(&white, &[1.0], &sizes);
    let along = filter.own.apply(&expected).products_with(&white);
    let [_, explained] = filter.own.explained(&white, &DMatrix::identity(1, 1));
    for i in 0..parts.len() {
        let square = sizes.variance(i) * explained.parts[i];
        assert!((along[(i, 0)] - square).abs() < 1e-6 * square, "{i}");
    }
    let square = WHITE * WHITE * explained.white;
    assert!((along[(MOST, 0)] - square).abs() < 1e-6 * square);
}
