//! The efficient estimator against batch maximum likelihood, written a second time here, and its edges.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failed step fails the test"
)]

use muslip::filter::efficient::{Config, ConfigError, ConfigParameter, EfficientFilter};
use muslip::filter::mu_slip::{Range, UpdateError};
use muslip::filter::{Decision, Estimator, FrictionMeasurement};
use test_support::noise::Noise;

const SIGMA: f64 = 0.04;

fn law(mup: f64, sp: f64, slip: f64) -> f64 {
    let r = slip / sp;
    2.0 * mup * r / (1.0 + r * r)
}

fn article_slips() -> Vec<f64> {
    (0..=40).map(|i| (f64::from(i) / 40.0).powi(2)).collect()
}

fn at(slip_ratio: f64, friction: f64, friction_std: f64) -> FrictionMeasurement<f32> {
    FrictionMeasurement {
        slip_ratio: slip_ratio as f32,
        friction: friction as f32,
        friction_std: friction_std as f32,
    }
}

/// Batch maximum likelihood by search: for each sp the best mup is a ratio of sums; sp by halving a grid.
fn maximum_likelihood(points: &[(f64, f64)]) -> (f64, f64) {
    let profile = |sp: f64| {
        let (mut c, mut d) = (0.0, 0.0);
        for &(slip, friction) in points {
            let shape = law(1.0, sp, slip);
            c += shape * friction;
            d += shape * shape;
        }
        (c / d, c * c / d)
    };
    let (mut low, mut high) = (0.03_f64.ln(), 0.8_f64.ln());
    let mut best = 0.0;
    for _ in 0..9 {
        let step = (high - low) / 40.0;
        best = (0..=40)
            .map(|i| low + step * f64::from(i))
            .max_by(|a, b| profile(a.exp()).1.total_cmp(&profile(b.exp()).1))
            .unwrap();
        (low, high) = (best - 2.0 * step, best + 2.0 * step);
    }
    (profile(best.exp()).0, best.exp())
}

fn run(filter: &mut EfficientFilter<f32>, points: &[(f64, f64)], declared: f64) {
    for &(slip, friction) in points {
        filter.update(&at(slip, friction, declared)).unwrap();
    }
}

fn points(mup: f64, sp: f64, slips: &[f64], seed: u64) -> Vec<(f64, f64)> {
    let mut noise = Noise::seeded(seed);
    slips
        .iter()
        .map(|&slip| (slip, law(mup, sp, slip) + noise.normal(SIGMA)))
        .collect()
}

#[test]
fn single_precision_over_41_samples_is_as_accurate_as_batch_maximum_likelihood() {
    let slips = article_slips();
    for (mup, sp, range) in [
        (0.1, 0.15, Range::Aircraft),
        (0.35, 0.1, Range::Aircraft),
        (0.6, 0.2, Range::Aircraft),
        (1.0, 0.125, Range::Automotive),
    ] {
        for declared in [0.5, 1.0, 1.5] {
            let mut squares = [[0.0; 2]; 2];
            for seed in 0..800 {
                let points = points(mup, sp, &slips, seed);
                let best = maximum_likelihood(&points);
                let mut filter = Config::for_range(range).build().unwrap();
                run(&mut filter, &points, declared * SIGMA);
                let state = filter.state();
                let found = (
                    f64::from(state.peak_friction),
                    f64::from(state.critical_slip),
                );
                for (square, (a, b)) in squares.iter_mut().zip([best, found]) {
                    square[0] += (a - mup).powi(2);
                    square[1] += (b - sp).powi(2);
                }
            }
            for (batch, efficient) in squares[0].iter().zip(squares[1]) {
                let ratio = (efficient / batch).sqrt();
                assert!(ratio < 1.05, "{mup} {sp} declared {declared}: {ratio}");
            }
        }
    }
}

#[test]
fn after_ten_thousand_samples_it_is_where_the_batch_fit_is() {
    let slips: Vec<f64> = (0..10_000)
        .map(|i| (f64::from(i % 1000) / 1000.0).powi(2))
        .collect();
    for seed in 0..4 {
        let points = points(0.8, 0.11, &slips, seed);
        let (mup, sp) = maximum_likelihood(&points);
        let mut filter = Config {
            nis_gate: None,
            ..Config::for_range(Range::Automotive)
        }
        .build()
        .unwrap();
        run(&mut filter, &points, SIGMA);
        let peak = filter.peak();
        let off = |found: f32, best: f64, std: f32| (f64::from(found) - best) / f64::from(std);
        assert!(off(peak.peak_friction, mup, peak.peak_friction_std).abs() < 0.1);
        assert!(off(peak.critical_slip, sp, peak.critical_slip_std).abs() < 0.1);
        assert!((f64::from(filter.noise_factor()) - 1.0).abs() < 0.06);
    }
}

#[test]
fn a_hundred_thousand_samples_are_counted_without_an_overflow_and_estimated() {
    // A hundred seconds at 1 kHz: more than sixteen bits count.
    let slips: Vec<f64> = (0..100_000)
        .map(|k| 0.3 * f64::from(k % 500) / 500.0)
        .collect();
    let points = points(0.9, 0.12, &slips, 5);
    let mut filter = Config::for_range(Range::Automotive).build().unwrap();
    run(&mut filter, &points, SIGMA);
    let (mup, sp) = maximum_likelihood(&points);
    let peak = filter.peak();
    let (off_mup, off_sp) = (
        (f64::from(peak.peak_friction) - mup) / f64::from(peak.peak_friction_std),
        (f64::from(peak.critical_slip) - sp) / f64::from(peak.critical_slip_std),
    );
    assert!(
        off_mup.abs() < 0.5 && off_sp.abs() < 0.5,
        "{off_mup} {off_sp}"
    );
}

#[test]
fn its_memory_is_fixed_and_small() {
    assert!(
        size_of::<EfficientFilter<f32>>() <= 512,
        "{}",
        size_of::<EfficientFilter<f32>>()
    );
}

#[test]
fn outliers_are_rejected_or_taken_out_again() {
    let slips = article_slips();
    let (mut clean, mut dirty) = (0.0, 0.0);
    for seed in 0..300 {
        let mut points = points(0.35, 0.15, &slips, seed);
        let errors = |points: &[(f64, f64)]| {
            let mut filter = Config::default().build().unwrap();
            run(&mut filter, points, SIGMA);
            (f64::from(filter.state().peak_friction) - 0.35).powi(2)
        };
        clean += errors(&points);
        let mut pick = Noise::seeded(1000 + seed);
        for point in &mut points {
            if pick.uniform(0.0, 1.0) < 0.05 {
                point.1 += 10.0 * SIGMA * pick.uniform(-1.0, 1.0).signum();
            }
        }
        dirty += errors(&points);
    }
    let ratio = (dirty / clean).sqrt();
    assert!(ratio < 1.15, "{ratio}");
}

#[test]
fn a_step_of_friction_is_followed_within_twenty_samples() {
    for seed in 0..20 {
        let mut noise = Noise::seeded(seed);
        let mut filter = Config::<f32> {
            memory: Some(20.0),
            ..Config::for_range(Range::Automotive)
        }
        .build()
        .unwrap();
        for i in 0..120 {
            let slip = 0.21 - 0.19 * (0.75 * f64::from(i)).cos();
            let mup = if i < 100 { 0.8 } else { 0.3 };
            filter
                .update(&at(slip, law(mup, 0.15, slip) + noise.normal(0.02), 0.02))
                .unwrap();
            if i == 99 {
                assert!((filter.state().peak_friction - 0.8).abs() < 0.08);
            }
        }
        let mup = filter.state().peak_friction;
        assert!((mup - 0.3).abs() < 0.03, "{seed}: {mup}");
    }
}

#[test]
fn slips_that_say_nothing_of_the_peak_leave_the_start_and_its_uncertainty() {
    for slips in [[0.0; 3], [0.1; 3], [0.0, 0.01, 0.02]] {
        let mut noise = Noise::seeded(3);
        let mut filter = Config::<f32>::default().build().unwrap();
        for i in 0..600 {
            let slip = slips[i % 3];
            filter
                .update(&at(slip, law(0.6, 0.15, slip) + noise.normal(SIGMA), SIGMA))
                .unwrap();
        }
        let peak = filter.peak();
        assert!(
            peak.critical_slip_std > 0.4 * peak.critical_slip,
            "{slips:?}: {peak:?}"
        );
        assert!((peak.critical_slip - 0.15).abs() < 2.0 * peak.critical_slip_std);
        assert!((peak.peak_friction - 0.6).abs() < 2.0 * peak.peak_friction_std);
    }
}

#[test]
fn a_slip_of_the_peak_far_from_the_usual_is_found_all_the_same() {
    let slips: Vec<f64> = (0..3000).map(|i| f64::from(i % 300) / 300.0).collect();
    for sp in [0.04, 0.5] {
        let points = points(0.8, sp, &slips, 1);
        let mut filter = Config::<f32>::for_range(Range::Automotive).build().unwrap();
        run(&mut filter, &points, SIGMA);
        let found = f64::from(filter.state().critical_slip);
        assert!((found / sp - 1.0).abs() < 0.05, "{sp}: {:?}", filter.peak());
    }
}

#[test]
fn an_error_leaves_everything_as_it_was() {
    let mut filter = Config::<f32>::default().build().unwrap();
    run(&mut filter, &[(0.05, 0.3), (0.1, 0.5)], SIGMA);
    let before = filter;
    for (measurement, refused) in [
        (at(f64::NAN, 0.1, 0.1), true),
        (at(0.1, f64::INFINITY, 0.1), true),
        (at(0.1, 0.1, 0.0), true),
        (at(0.1, 0.1, -1.0), true),
        (at(1e30, 1e30, 1e-30), true),
        (at(0.1, 0.5, 0.04), false),
    ] {
        let outcome = filter.update(&measurement);
        assert_eq!(outcome.is_err(), refused, "{measurement:?}: {outcome:?}");
        if refused {
            assert_eq!(filter, before);
        }
    }
    assert_eq!(
        filter.update(&at(0.1, 0.1, 0.0)).unwrap_err(),
        UpdateError::NonPositiveNoise
    );
    let mut restored = Config::<f32>::default().build().unwrap();
    restored.restore(filter.estimate()).unwrap();
    assert_eq!(restored, filter);
}

#[test]
fn an_update_without_a_report_decides_refuses_and_ends_as_one_with_it() {
    let mut noise = Noise::seeded(11);
    let (mut accepted, mut rejected, mut refused) = (0, 0, 0);
    for run in 0..60 {
        let mut lean = Config::<f32>::default().build().unwrap();
        let mut reporting = lean;
        for step in 0..400 {
            let slip = (noise.normal(1.0).abs() * 0.2).min(1.0);
            let off = match (step * 7 + run) % 53 {
                0 => 2.0,
                1 => 1e15,
                2 => 1e25,
                _ => noise.normal(SIGMA),
            };
            let sigma = if step % 97 == 3 { 1e-25 } else { SIGMA };
            let measurement = at(slip, law(0.8, 0.14, slip) + off, sigma);
            let in_full = reporting.update_reporting(&measurement);
            let outcome = lean.update(&measurement);
            match &outcome {
                Ok(Decision::Accepted) => accepted += 1,
                Ok(Decision::Rejected) => rejected += 1,
                Err(_) => refused += 1,
            }
            assert_eq!(outcome, in_full.map(|fusion| fusion.decision));
            assert_eq!(lean, reporting);
        }
    }
    assert!(
        accepted > 20_000 && rejected > 300 && refused > 300,
        "{accepted} {rejected} {refused}"
    );
}

#[test]
fn an_outlier_is_reported_as_rejected_and_changes_nothing_but_its_count() {
    let slips = article_slips();
    let mut filter = Config::<f32>::default().build().unwrap();
    run(&mut filter, &points(0.35, 0.15, &slips, 5), SIGMA);
    let before = filter.peak();
    let fusion = filter.update_reporting(&at(0.15, 1.5, SIGMA)).unwrap();
    assert_eq!(fusion.decision, Decision::Rejected);
    assert!(fusion.nis > 16.0);
    assert_eq!(filter.peak(), before);
}

#[test]
fn a_field_outside_its_range_is_named() {
    let refused = |change: fn(&mut Config<f32>)| {
        let mut config = Config::default();
        change(&mut config);
        match config.build() {
            Err(ConfigError::OutOfRange(parameter)) => parameter,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(
        refused(|c| c.initial_state.critical_slip = 3.0),
        ConfigParameter::InitialState
    );
    assert_eq!(
        refused(|c| c.nis_gate = Some(f32::NAN)),
        ConfigParameter::NisGate
    );
    assert_eq!(refused(|c| c.memory = Some(3.0)), ConfigParameter::Memory);
}
