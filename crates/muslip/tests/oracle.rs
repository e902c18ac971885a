//! The filter against a generic implementation with full matrices.
//!
//! The oracle below is written from the article's equations with `nalgebra`, for any number of states:
//! matrices, no symmetry assumed, textbook derivatives in s/sp. It shares nothing with the crate.
#![allow(clippy::unwrap_used, reason = "a failed step fails the test")]

use muslip::filter::mu_slip::{
    Config, Covariance, CovarianceForm, Estimate, Fusion, State, update_reporting,
};
use muslip::filter::{Estimator, FrictionMeasurement};
use muslip::real::Real;
use nalgebra::{Matrix2, RealField, RowVector2, SMatrix, SVector, Vector2};
use test_support::{Noise, Tolerance};

/// Predicted measurement, its Jacobian and its second derivatives.
struct Model<R, const N: usize> {
    predicted: R,
    jacobian: SMatrix<R, 1, N>,
    hessian: SMatrix<R, N, N>,
}

struct Updated<R, const N: usize> {
    x: SVector<R, N>,
    p: SMatrix<R, N, N>,
    gain: SVector<R, N>,
    noise: R,
    signal_before: R,
    signal_after: R,
}

/// One update of an extended Kalman filter with a scalar measurement; second-order pseudonoise from the
/// diagonal of P, Joseph's form or (I - K H) P.
fn ekf<R: RealField + Copy, const N: usize>(
    x: SVector<R, N>,
    p: SMatrix<R, N, N>,
    model: &Model<R, N>,
    measured: R,
    measurement_variance: R,
    joseph: bool,
) -> Updated<R, N> {
    let half = nalgebra::convert::<f64, R>(0.5);
    let mut noise = measurement_variance;
    for i in 0..N {
        noise += (half * model.hessian[(i, i)] * p[(i, i)]).powi(2);
        for j in 0..i {
            noise += model.hessian[(i, j)].powi(2) * p[(i, i)] * p[(j, j)];
        }
    }
    let h = model.jacobian;
    let signal_before = (h * p * h.transpose())[(0, 0)];
    let gain = p * h.transpose() / (signal_before + noise);
    let a = SMatrix::<R, N, N>::identity() - gain * h;
    let p = if joseph {
        a * p * a.transpose() + gain * gain.transpose() * noise
    } else {
        a * p
    };
    Updated {
        x: x + gain * (measured - model.predicted),
        p,
        gain,
        noise,
        signal_before,
        signal_after: (h * p * h.transpose())[(0, 0)],
    }
}

/// mu = 2 mup r/(1 + r²) with r = s/sp, differentiated by the quotient rule.
fn mu_slip<R: RealField + Copy>(x: Vector2<R>, s: R) -> Model<R, 2> {
    let number = nalgebra::convert::<f64, R>;
    let (mup, sp) = (x[0], x[1]);
    let r = s / sp;
    let q = number(1.0) + r * r;
    let by_both = -number(2.0) * r * (number(1.0) - r * r) / (q * q * sp);
    Model {
        predicted: number(2.0) * mup * r / q,
        jacobian: RowVector2::new(number(2.0) * r / q, mup * by_both),
        hessian: Matrix2::new(
            number(0.0),
            by_both,
            by_both,
            number(4.0) * mup * r * (number(1.0) - number(3.0) * r * r) / (q.powi(3) * sp * sp),
        ),
    }
}

/// One random case, exactly representable in `f32` so that both precisions get the same inputs.
#[derive(Debug, Clone, Copy)]
struct Case {
    state: [f64; 2],
    covariance: [f64; 3],
    slip: f64,
    friction: f64,
    variance: f64,
}

impl Case {
    fn random(noise: &mut Noise) -> Self {
        let single = |v: f64| f64::from(v as f32);
        let (mup, sp) = (noise.uniform(0.05, 1.2), noise.uniform(0.03, 0.4));
        Self {
            state: [mup, sp].map(single),
            covariance: noise.covariance().map(single),
            slip: single(noise.uniform(-0.05, 1.05)),
            friction: single(noise.uniform(-0.2, 1.4)),
            variance: single(noise.log_uniform(1e-3, 0.5).powi(2)),
        }
    }
}

/// How far rounding may carry each result, in units of ε: the terms' magnitudes before they cancel.
struct Scales {
    state: [f64; 2],
    gain: [f64; 2],
    covariance: [f64; 3],
    signal: f64,
    signal_after: f64,
    noise: f64,
    innovation: f64,
}

impl Scales {
    fn of(case: &Case, exact: &Updated<f64, 2>) -> Self {
        let [mup, sp] = case.state;
        let [p00, p01, p11] = case.covariance;
        let w = 1.0 / (sp * sp + case.slip * case.slip);
        let h0 = 2.0 * case.slip.abs() * sp * w;
        // s² - sp² and sp² - 3 s² lose digits near their zeros: bounded by s² + sp² and three times that
        let h1 = 2.0 * mup * case.slip.abs() * w;
        let second = 3.0 * h0 * mup * w;
        let g = [p00 * h0 + p01.abs() * h1, p01.abs() * h0 + p11 * h1];
        let signal = h0 * g[0] + h1 * g[1];
        let noise = case.variance + (h1 / mup).powi(2) * p00 * p11 + (second * p11).powi(2);
        let variance = exact.signal_before + exact.noise;
        // relative error of the innovation's variance, which the gain inherits
        let lost = 1.0 + (signal + noise) / variance;
        let gain = g.map(|g| g / variance * lost);
        let innovation = case.friction.abs() + mup * h0;
        Self {
            state: [mup + gain[0] * innovation, sp + gain[1] * innovation],
            gain,
            covariance: [
                p00 + gain[0] * g[0],
                p01.abs() + gain[0] * g[1] + gain[1] * g[0],
                p11 + gain[1] * g[1],
            ],
            signal,
            // the oracle forms it by differences
            signal_after: signal * lost,
            noise,
            innovation,
        }
    }
}

fn compare<T: Real + Into<f64>>(what: &str, roundings: f64, scale: f64, got: T, expected: f64) {
    let epsilon: f64 = T::EPSILON.into();
    Tolerance::absolute(roundings * epsilon * scale).check(what, got.into(), expected);
}

/// Runs `cases` random updates in precision `T` against the oracle in `f64`; `roundings` of slack.
fn agrees<T: Real + Into<f64>>(seed: u64, cases: usize, roundings: f64, form: CovarianceForm) {
    let mut noise = Noise::seeded(seed);
    let mut refused = 0;
    for _ in 0..cases {
        let case = Case::random(&mut noise);
        let number = T::from_f64;
        let state = State {
            peak_friction: number(case.state[0]),
            critical_slip: number(case.state[1]),
        };
        let covariance = Covariance {
            p00: number(case.covariance[0]),
            p01: number(case.covariance[1]),
            p11: number(case.covariance[2]),
        };
        let (s, z, r) = (
            number(case.slip),
            number(case.friction),
            number(case.variance),
        );
        let (estimate, fusion) = match form {
            CovarianceForm::Short => {
                let Ok(done) = update_reporting(state, covariance, s, z, r) else {
                    refused += 1;
                    continue;
                };
                done
            }
            CovarianceForm::Joseph => joseph(state, covariance, s, z, r),
        };
        let [p00, p01, p11] = case.covariance;
        let exact = ekf(
            Vector2::from(case.state),
            Matrix2::new(p00, p01, p01, p11),
            &mu_slip(Vector2::from(case.state), case.slip),
            case.friction,
            case.variance,
            form == CovarianceForm::Joseph,
        );
        check(&case, &exact, roundings, estimate, &fusion);
    }
    assert_eq!(refused, 0, "of {cases}");
}

fn joseph<T: Real>(
    state: State<T>,
    covariance: Covariance<T>,
    s: T,
    z: T,
    variance: T,
) -> (Estimate<T>, Fusion<T>) {
    let mut config = Config {
        covariance_form: CovarianceForm::Joseph,
        initial_state: state,
        initial_covariance: covariance,
        ..Config::default()
    };
    config.noise_inflation = T::ONE;
    let mut filter = config.build().unwrap();
    let measurement = FrictionMeasurement {
        slip_ratio: s,
        friction: z,
        friction_std: variance.sqrt(),
    };
    let fusion = filter.update_reporting(&measurement).unwrap();
    (filter.estimate(), fusion)
}

fn check<T: Real + Into<f64>>(
    case: &Case,
    exact: &Updated<f64, 2>,
    roundings: f64,
    Estimate { state, covariance }: Estimate<T>,
    fusion: &Fusion<T>,
) {
    let scales = Scales::of(case, exact);
    let near = |what, scale, got: T, expected| compare(what, roundings, scale, got, expected);
    near("mup", scales.state[0], state.peak_friction, exact.x[0]);
    near("sp", scales.state[1], state.critical_slip, exact.x[1]);
    near("P11", scales.covariance[0], covariance.p00, exact.p[(0, 0)]);
    near("P12", scales.covariance[1], covariance.p01, exact.p[(0, 1)]);
    near("P21", scales.covariance[1], covariance.p01, exact.p[(1, 0)]);
    near("P22", scales.covariance[2], covariance.p11, exact.p[(1, 1)]);
    near(
        "K1",
        scales.gain[0],
        fusion.peak_friction_gain,
        exact.gain[0],
    );
    near(
        "K2",
        scales.gain[1],
        fusion.critical_slip_gain,
        exact.gain[1],
    );
    near("R", scales.noise, fusion.noise_variance, exact.noise);
    near(
        "H P H'",
        scales.signal,
        fusion.signal_before,
        exact.signal_before,
    );
    near(
        "H P+ H'",
        scales.signal_after,
        fusion.signal_after,
        exact.signal_after,
    );
    let innovation = case.friction - mu_slip(Vector2::from(case.state), case.slip).predicted;
    near(
        "innovation",
        scales.innovation,
        fusion.innovation,
        innovation,
    );
    let variance = exact.signal_before + exact.noise;
    let lost = (scales.signal + scales.noise) / variance;
    let nis_scale =
        (scales.innovation * innovation.abs() + innovation * innovation * lost) / variance;
    near(
        "NIS",
        nis_scale,
        fusion.nis,
        innovation * innovation / variance,
    );
}

const CASES: usize = 100_000;

#[test]
fn single_precision_agrees_with_full_matrices_within_eight_roundings() {
    agrees::<f32>(11, CASES, 8.0, CovarianceForm::Short);
}

#[test]
fn double_precision_agrees_with_full_matrices_within_sixteen_roundings() {
    // twice as many: here the oracle rounds as much as the filter
    agrees::<f64>(12, CASES, 16.0, CovarianceForm::Short);
}

#[test]
fn josephs_form_agrees_with_full_matrices() {
    // more terms, and the variance passes through a root and a square
    agrees::<f32>(13, CASES, 32.0, CovarianceForm::Joseph);
    agrees::<f64>(14, CASES, 32.0, CovarianceForm::Joseph);
}

#[test]
fn a_whole_run_agrees_with_full_matrices() {
    for seed in 0..200 {
        let mut filter = Config::<f64>::default().build().unwrap();
        let mut reporting = filter;
        let start = filter.estimate();
        let mut x = Vector2::from(start.state.to_array());
        let mut p = Matrix2::from(start.covariance.rows());
        for (slip_ratio, friction) in test_support::scenario::article::measurements(seed) {
            let friction_std = test_support::scenario::article::FRICTION_STD;
            let measurement = FrictionMeasurement {
                slip_ratio,
                friction,
                friction_std,
            };
            filter.update(&measurement).unwrap();
            reporting.update_reporting(&measurement).unwrap();
            let variance = (3.0 * friction_std).powi(2);
            let exact = ekf(x, p, &mu_slip(x, slip_ratio), friction, variance, false);
            (x, p) = (exact.x, exact.p);
        }
        for filter in [filter, reporting] {
            let near = Tolerance::relative(1e-11);
            near.check("mup", filter.state().peak_friction, x[0]);
            near.check("sp", filter.state().critical_slip, x[1]);
            near.check("P11", filter.covariance().p00, p[(0, 0)]);
            near.check("P12", filter.covariance().p01, p[(0, 1)]);
            near.check("P22", filter.covariance().p11, p[(1, 1)]);
        }
    }
}
