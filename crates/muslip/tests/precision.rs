//! How much of the filter's result single precision keeps, by either form of the covariance.
#![allow(clippy::unwrap_used, reason = "a failed step fails the test")]

use muslip::filter::mu_slip::{Config, Covariance, CovarianceForm, MuSlipFilter, State};
use muslip::filter::{Estimator, FrictionMeasurement};
use muslip::real::Real;
use test_support::Noise;
use test_support::scenario::article;

/// One measurement against one prior, in numbers that `f32` holds.
struct Case {
    state: [f32; 2],
    covariance: [f32; 3],
    slip: f32,
    friction: f32,
    std: f32,
}

impl Case {
    fn random(noise: &mut Noise, smallest_std: f64, largest_std: f64) -> Self {
        let single = |v: f64| v as f32;
        let covariance = noise.covariance().map(single);
        Self {
            state: [noise.uniform(0.05, 1.2), noise.uniform(0.03, 0.4)].map(single),
            covariance,
            slip: noise.uniform(0.0, 1.0) as f32,
            friction: noise.uniform(0.0, 1.2) as f32,
            std: noise.log_uniform(smallest_std, largest_std) as f32,
        }
    }

    fn posterior<T: Real + From<f32>>(&self, covariance_form: CovarianceForm) -> Covariance<T> {
        let [p00, p01, p11] = self.covariance.map(T::from);
        let config = Config {
            initial_state: State {
                peak_friction: self.state[0].into(),
                critical_slip: self.state[1].into(),
            },
            initial_covariance: Covariance { p00, p01, p11 },
            noise_inflation: T::ONE,
            covariance_form,
            ..Config::default()
        };
        let mut filter = config.build().unwrap();
        let measurement = FrictionMeasurement {
            slip_ratio: self.slip.into(),
            friction: self.friction.into(),
            friction_std: self.std.into(),
        };
        filter.update(&measurement).unwrap();
        filter.covariance()
    }

    /// Larger relative error of the two variances in single precision.
    fn error(&self, form: CovarianceForm) -> f64 {
        let exact = self.posterior::<f64>(CovarianceForm::Joseph);
        let got = self.posterior::<f32>(form);
        let relative = |got: f32, exact: f64| (f64::from(got) / exact - 1.0).abs();
        relative(got.p00, exact.p00).max(relative(got.p11, exact.p11))
    }
}

/// Median and largest relative error over 50,000 random cases with noise in this range.
fn errors(form: CovarianceForm, smallest_std: f64, largest_std: f64) -> (f64, f64) {
    let mut noise = Noise::seeded(5);
    let mut errors: Vec<f64> = (0..50_000)
        .map(|_| Case::random(&mut noise, smallest_std, largest_std).error(form))
        .collect();
    errors.sort_by(f64::total_cmp);
    let summary = (errors[errors.len() / 2], errors[errors.len() - 1]);
    println!("{form:?}, std {smallest_std}..{largest_std}: median, largest error {summary:?}");
    summary
}

#[test]
fn the_short_form_keeps_four_digits_while_noise_is_above_a_twentieth() {
    let (median, largest) = errors(CovarianceForm::Short, 0.05, 0.3);
    assert!(median < 1e-7 && largest < 1e-4);
    let (_, joseph) = errors(CovarianceForm::Joseph, 0.05, 0.3);
    assert!(joseph < 5e-6);
}

#[test]
fn josephs_form_keeps_five_digits_where_the_short_form_is_left_with_one() {
    let (_, short) = errors(CovarianceForm::Short, 1e-3, 1e-2);
    let (_, joseph) = errors(CovarianceForm::Joseph, 1e-3, 1e-2);
    assert!(joseph < 1e-5);
    assert!(short < 0.2);
    // what the option is for; if this fails, the option has lost its reason
    assert!(short > 100.0 * joseph);
}

#[test]
fn a_whole_run_in_single_precision_ends_within_a_ten_thousandth_of_a_sigma() {
    for std in [0.04, 0.01, 0.001] {
        for seed in 0..500 {
            let mut noise = Noise::seeded(seed);
            let mut single: MuSlipFilter<f32> = Config::default().build().unwrap();
            let mut double: MuSlipFilter<f64> = Config::default().build().unwrap();
            for slip_ratio in article::slips() {
                let friction = article::friction(slip_ratio) + noise.normal(std);
                let friction_std = std;
                let narrow = FrictionMeasurement {
                    slip_ratio: slip_ratio as f32,
                    friction: friction as f32,
                    friction_std: friction_std as f32,
                };
                let wide = FrictionMeasurement {
                    slip_ratio,
                    friction,
                    friction_std,
                };
                single.update(&narrow).unwrap();
                double.update(&wide).unwrap();
            }
            let (got, exact) = (single.peak(), double.peak());
            let off = |got: f32, exact: f64, std: f64| (f64::from(got) - exact).abs() / std;
            let (std0, std1) = (exact.peak_friction_std, exact.critical_slip_std);
            assert!(off(got.peak_friction, exact.peak_friction, std0) < 1e-4);
            assert!(off(got.critical_slip, exact.critical_slip, std1) < 1e-4);
            assert!(off(got.peak_friction_std, std0, std0) < 1e-5);
            assert!(off(got.critical_slip_std, std1, std1) < 1e-5);
        }
    }
}
