//! One update: the gate, the sums, and the estimate after them.

use super::estimate::{Estimate, PRIOR_PRECISION, Prepared, UNLEARNT_NOISE, half_log};
use super::sums::{Sums, Term};
use crate::filter::mu_slip::{Covariance, Decision};
use crate::real::Real;

/// Longest step of ln sp after one sample.
const LONGEST_STEP: f64 = 0.3;
/// Samples that the declared noise counts as when its level is learnt.
const DECLARED_NOISE_SAMPLES: f64 = 0.5;
/// The learnt variance is held within these factors of the declared one.
const NOISE_FACTORS: (f64, f64) = (0.15, 10.0);
/// The gate believes the noise to be at most this many times the declared variance (twice its deviation):
/// outliers that were let in must not open it to others.
const LARGEST_GATE_FACTOR: f64 = 4.0;
/// Suspicion begins at no more than this many times the declared variance.
const LARGEST_USUAL_FACTOR: f64 = 2.25;
/// Curvature of the likelihood in ln sp, over m² D (0.1 to 0.3 of a run through the peak), below which it
/// is not told from what rounding and the rows' end make of slips that say nothing of sp.
const LEAST_CURVATURE: f64 = 2e-3;
/// Innovation squared over the noise variance from which a sample is suspect.
const SUSPECT: f64 = 6.25;
/// Samples without a new suspect before the suspects are judged.
const PATIENCE: f64 = 3.0;
/// Prediction variance over noise variance below which the curve is known well enough to judge by.
const KNOWN: f64 = 0.5;
/// Residual of one suspect, in noise variances, beyond which it is taken out; 3 more for each other.
const CONVICTED: f64 = 10.0;
/// Most measurements in a row that the gate rejects.
const MOST_REJECTIONS: f64 = 3.0;
/// Curvature in ln sp over the noise from which sp at an end of its range is believed to lie beyond.
const BEYOND: f64 = 100.0;
/// Samples in a row after which the sums start anew about that end.
const BEYOND_SAMPLES: f64 = 16.0;
/// The likelihood is solved anew after this share of the samples that it holds, at the latest after
/// [`LONGEST_PAUSE`] samples.
const PAUSE: f64 = 0.25;
const LONGEST_PAUSE: f64 = 16.0;
/// Variance of ln sp above which every sample is solved for: over so wide a range (14 %) the curve bends, and a
/// Kalman step would take the bend for knowledge.
const WIDE: f64 = 0.02;
/// Samples at which all sums are halved.
const HALVED_AT: f64 = 65_536.0;

/// What the present curve expects of a measurement.
#[derive(Debug, Clone, Copy)]
pub(super) struct Expected<T> {
    pub(super) friction: T,
    /// ∂mu/∂mup and ∂mu/∂ln sp.
    pub(super) by_peak_friction: T,
    pub(super) by_log_slip: T,
    pub(super) innovation: T,
    /// Variance of the noise as learnt.
    pub(super) noise: T,
    /// H P Hᵀ
    pub(super) signal: T,
}

/// One update, in place; see the filter's. Returns what was expected and whether the measurement
/// was taken.
#[inline(always)]
pub(super) fn fuse<T: Real>(
    prepared: &Prepared<T>,
    estimate: &mut Estimate<T>,
    slip: T,
    friction: T,
    variance: T,
) -> (Expected<T>, Decision) {
    let beta = estimate.beta;
    let (down, up) = (T::ONE - beta, T::ONE + beta);
    let square = slip * slip;
    let centre = estimate.centre_squared;
    let about_centre = square + centre;
    let (far, near) = (square * (down * down), centre * (up * up));
    let about_peak = far + near;
    // Three reciprocals by one division.
    let product = about_centre * about_peak;
    let inverse = T::ONE / (product * variance);
    let weight = inverse * product;
    let scaled = inverse * variance;
    let by_centre = scaled * about_peak;
    let by_peak = scaled * about_centre;
    let numerator = slip * (estimate.centre + estimate.centre);

    let q = numerator * by_centre;
    let p = (square - centre) * by_centre;
    let sech = numerator * by_peak * (down * up);
    let tanh = (far - near) * by_peak;
    let m = estimate.peak_friction;
    let slope = m * sech * tanh;
    let expected_friction = m * sech;
    let innovation = friction - expected_friction;
    let Covariance { p00, p01, p11 } = estimate.covariance;
    let signal = sech * (sech * p00 + (slope + slope) * p01) + slope * slope * p11;
    let noise = estimate.noise_factor * variance;
    let expected = Expected {
        friction: expected_friction,
        by_peak_friction: sech,
        by_log_slip: slope,
        innovation,
        noise,
        signal,
    };

    let squared_innovation = innovation * innovation;
    let mut suspect = false;
    if let Some(gate) = prepared.gate {
        let gate_noise = estimate.gate_factor * variance;
        let usual = estimate.noise_factor.min(T::from_f64(LARGEST_USUAL_FACTOR)) * variance;
        suspect = squared_innovation > T::from_f64(SUSPECT) * usual;
        if suspect && squared_innovation > gate * (signal + gate_noise) {
            if estimate.rejections < T::from_f64(MOST_REJECTIONS) {
                estimate.rejections += T::ONE;
                return (expected, Decision::Rejected);
            }
            if prepared.keep.is_some() {
                // The curve has changed: what is known of the old one misleads.
                estimate.sums = Sums::none();
                estimate.suspects = Sums::none();
                suspect = false;
            }
        } else {
            estimate.rejections = T::ZERO;
        }
    }
    if let Some(keep) = prepared.keep {
        estimate.sums.scale(keep);
        estimate.suspects.scale(keep);
    }
    let term = Term {
        weighted_friction: weight * friction,
        weight,
        friction,
        p,
        q,
    };
    estimate.sums.add(&term);
    if suspect {
        suspects_too(estimate, &term);
    } else if estimate.suspects.count > T::ZERO {
        estimate.since_suspect += T::ONE;
        if estimate.since_suspect >= T::from_f64(PATIENCE) && signal < T::from_f64(KNOWN) * noise {
            judge(estimate);
        }
    }
    if estimate.sums.count < estimate.due {
        advance(estimate, &expected);
    } else {
        solve(prepared, estimate);
    }
    (expected, Decision::Accepted)
}

/// The estimate between two solutions: one step of the extended Kalman filter from the last one.
#[inline(always)]
fn advance<T: Real>(estimate: &mut Estimate<T>, expected: &Expected<T>) {
    let Covariance { p00, p01, p11 } = estimate.covariance;
    let (h0, h1) = (expected.by_peak_friction, expected.by_log_slip);
    let inverse = T::ONE / (expected.signal + expected.noise);
    let (g0, g1) = (p00 * h0 + p01 * h1, p01 * h0 + p11 * h1);
    let (k0, k1) = (g0 * inverse, g1 * inverse);
    estimate.peak_friction += k0 * expected.innovation;
    estimate.move_log_slip(k1 * expected.innovation);
    estimate.covariance = Covariance {
        p00: p00 - k0 * g0,
        p01: p01 - k0 * g1,
        p11: p11 - k1 * g1,
    };
}

/// Sums a surprising sample a second time.
#[cold]
#[inline(never)]
fn suspects_too<T: Real>(estimate: &mut Estimate<T>, term: &Term<T>) {
    estimate.suspects.add(term);
    estimate.since_suspect = T::ZERO;
    estimate.due = T::ZERO;
}

/// Takes the suspects out if they do not fit the curve, and clears their names.
#[cold]
#[inline(never)]
fn judge<T: Real>(estimate: &mut Estimate<T>) {
    let suspects = &estimate.suspects;
    let residual = suspects.residual(estimate.peak_friction, estimate.beta);
    let allowed = T::from_f64(CONVICTED) + T::from_f64(3.0) * (suspects.count - T::ONE);
    let factor = estimate.noise_factor.min(T::from_f64(LARGEST_GATE_FACTOR));
    if residual > factor * allowed {
        estimate.sums.subtract(&estimate.suspects);
    }
    estimate.suspects = Sums::none();
    estimate.due = T::ZERO;
}

/// The sums anew, about the present sp.
#[cold]
#[inline(never)]
fn start_anew<T: Real>(estimate: &mut Estimate<T>) {
    estimate.centre = estimate.critical_slip();
    estimate.centre_squared = estimate.centre * estimate.centre;
    estimate.beta = T::ZERO;
    estimate.held = T::ZERO;
    estimate.due = T::ZERO;
    estimate.sums = Sums::none();
    estimate.suspects = Sums::none();
    estimate.noise_factor = T::ONE;
    estimate.gate_factor = T::from_f64(1.0 + UNLEARNT_NOISE);
    let m = estimate.peak_friction;
    estimate.covariance = Covariance {
        p00: m * m,
        p01: T::ZERO,
        p11: T::from_f64(1.0 / PRIOR_PRECISION),
    };
}

/// One step of Gauss and Newton on the whole likelihood, the noise and the covariance.
#[inline(never)]
fn solve<T: Real>(prepared: &Prepared<T>, estimate: &mut Estimate<T>) {
    if estimate.sums.count >= T::from_f64(HALVED_AT) {
        estimate.sums.scale(T::HALF);
    }
    let count = estimate.sums.count;
    estimate.due = if prepared.keep.is_some() {
        T::ZERO
    } else {
        count + (T::from_f64(PAUSE) * count).min(T::from_f64(LONGEST_PAUSE))
    };
    let sums = &estimate.sums;
    let beta = estimate.beta;
    let at = sums.at(beta);
    let prior = prepared.peak_precision * estimate.noise_factor;
    let information = at.law + prior;
    // Two reciprocals by one division.
    let declared = T::from_f64(DECLARED_NOISE_SAMPLES);
    let degrees = declared + (sums.count - T::TWO).max(T::ZERO);
    let inverse = T::ONE / (information * degrees);
    let by_information = inverse * degrees;
    let m = (at.friction + prior * prepared.start_peak_friction) * by_information;

    let residual = sums.square - m * (at.friction + at.friction - m * at.law);
    let by_degrees = inverse * information;
    let factor = (declared + residual.max(T::ZERO)) * by_degrees;
    let (least, most) = NOISE_FACTORS;
    let factor = factor.max(T::from_f64(least)).min(T::from_f64(most));

    // mup profiled out: dmup/d ln sp = -m D'/2 / D at the expected information
    let slope = m * at.law_half_slope * by_information;
    let mut curvature = (m * (m * at.slip_information - slope * at.law_half_slope)).max(T::ZERO);
    let mut gradient = m * (at.friction_slope - m * at.law_half_slope);
    let scale = m * m * at.law;
    if curvature < T::from_f64(0.05) * scale {
        let least = T::from_f64(LEAST_CURVATURE) * scale;
        let square = curvature * curvature;
        let believed = square / (square + least * least);
        gradient *= believed;
        curvature *= believed;
    }
    if curvature < T::from_f64(100.0) * factor {
        // Without information the prior holds ln sp; it fades as samples speak.
        let share = factor / (factor + curvature);
        let precision = T::from_f64(PRIOR_PRECISION) * factor * (share * share);
        let away = half_log(beta) - prepared.start_half_log;
        gradient -= precision * (away + away);
        curvature += precision;
    }
    let by_curvature = T::ONE / curvature;
    let longest = T::from_f64(LONGEST_STEP);
    let step = (gradient * by_curvature).min(longest).max(-longest);

    estimate.noise_factor = factor;
    let believed = factor.min(T::from_f64(LARGEST_GATE_FACTOR));
    estimate.gate_factor = believed + believed * (T::from_f64(UNLEARNT_NOISE) * by_degrees);
    estimate.peak_friction =
        m + step * (at.friction_slope - (m + m) * at.law_half_slope) * by_information;
    let beyond = estimate.move_log_slip(step);
    if beyond && curvature > T::from_f64(BEYOND) * factor {
        estimate.held += T::ONE;
        if estimate.held > T::from_f64(BEYOND_SAMPLES) {
            start_anew(estimate);
        }
    } else {
        estimate.held = T::ZERO;
    }
    // P = factor [[D, m D'/2], [m D'/2, m² Σ w tanh² sech²]]⁻¹
    let p11 = factor * by_curvature;
    if p11 > T::from_f64(WIDE) {
        estimate.due = T::ZERO;
    }
    estimate.covariance = Covariance {
        p00: factor * by_information + slope * slope * p11,
        p01: -(slope * p11),
        p11,
    };
}
