use super::config::Config;
use super::sums::{Sums, Term};
use crate::filter::mu_slip::{Covariance, Decision, Fusion, Input, State, UpdateError};
use crate::filter::{Estimator, FrictionMeasurement, PeakEstimate};
use crate::real::Real;

/// |β| beyond which sp is held: 0.38 to 2.64 times the centre slip.
pub(super) const LARGEST_BETA: f64 = 0.45;
/// Longest step of ln sp after one sample.
const LONGEST_STEP: f64 = 0.3;
/// Precision of the prior on ln sp: a standard deviation of 0.7.
const PRIOR_PRECISION: f64 = 2.0;
/// Samples that the declared noise counts as when its level is learnt.
const DECLARED_NOISE_SAMPLES: f64 = 0.5;
/// The learnt variance is held within these factors of the declared one.
const NOISE_FACTORS: (f64, f64) = (0.15, 10.0);
/// Weight of not having learnt the noise yet: the gate takes the noise variance as 1 + this over the
/// samples times what it seems.
const UNLEARNT_NOISE: f64 = 3.0;
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
/// Samples at which all sums are halved.
const HALVED_AT: f64 = 65_536.0;

/// All that the filter carries from one sample to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Estimate<T> {
    sums: Sums<T>,
    /// Those of `sums` that are of suspects.
    suspects: Sums<T>,
    /// Samples since the last suspect.
    since_suspect: T,
    /// Rejections in a row.
    rejections: T,
    /// s0, and its square.
    centre: T,
    centre_squared: T,
    /// Samples in a row at which sp was held at an end of its range.
    held: T,
    /// mup.
    peak_friction: T,
    /// β of sp.
    beta: T,
    /// Learnt over declared noise variance.
    noise_factor: T,
    /// The same for the gate: larger while it is being learnt.
    gate_factor: T,
    /// Covariance of (mup, ln sp).
    covariance: Covariance<T>,
}

impl<T: Real> Estimate<T> {
    pub(super) fn start(config: &Config<T>) -> Self {
        let start = config.initial_state;
        Self {
            sums: Sums::none(),
            suspects: Sums::none(),
            since_suspect: T::ZERO,
            rejections: T::ZERO,
            centre: config.centre_slip,
            centre_squared: config.centre_slip * config.centre_slip,
            held: T::ZERO,
            peak_friction: start.peak_friction,
            beta: beta_of(start.critical_slip, config.centre_slip),
            noise_factor: T::ONE,
            gate_factor: T::from_f64(1.0 + UNLEARNT_NOISE),
            covariance: Covariance {
                p00: start.peak_friction * start.peak_friction,
                p01: T::ZERO,
                p11: T::from_f64(1.0 / PRIOR_PRECISION),
            },
        }
    }

    /// Learnt over declared noise variance.
    pub fn noise_factor(&self) -> T {
        self.noise_factor
    }

    /// sp.
    fn critical_slip(&self) -> T {
        self.centre * (T::ONE + self.beta) / (T::ONE - self.beta)
    }

    fn is_sound(&self) -> bool {
        self.sums.is_finite()
            && self.suspects.is_finite()
            && self.centre > T::ZERO
            && (self.centre_squared
                + self.peak_friction
                + self.beta
                + self.noise_factor
                + self.gate_factor)
                .is_finite()
            && self.beta.abs() <= T::from_f64(LARGEST_BETA)
            && self.covariance.is_positive_definite()
    }
}

/// β of a slip about a centre slip.
fn beta_of<T: Real>(slip: T, centre: T) -> T {
    (slip - centre) / (slip + centre)
}

/// ln(sp/s0)/2 = atanh β, to 1e-2 at the ends of the range, where only a fading prior asks for it.
#[inline(always)]
fn half_log<T: Real>(beta: T) -> T {
    let square = beta * beta;
    beta * (T::ONE
        + square
            * (T::from_f64(1.0 / 3.0) + square * (T::from_f64(0.2) + square * T::from_f64(0.2))))
}

/// What the arithmetic needs of a configuration.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Prepared<T> {
    start_peak_friction: T,
    /// 1/start²
    peak_precision: T,
    start_half_log: T,
    gate: Option<T>,
    /// Factor on the sums a sample.
    keep: Option<T>,
}

impl<T: Real> Prepared<T> {
    fn of(config: &Config<T>) -> Self {
        let start = config.initial_state;
        Self {
            start_peak_friction: start.peak_friction,
            peak_precision: T::ONE / (start.peak_friction * start.peak_friction),
            start_half_log: half_log(beta_of(start.critical_slip, config.centre_slip)),
            gate: config.nis_gate,
            keep: config.memory.map(|memory| T::ONE - T::ONE / memory),
        }
    }
}

/// What the present curve expects of a measurement.
#[derive(Debug, Clone, Copy)]
struct Expected<T> {
    friction: T,
    /// ∂mu/∂mup and ∂mu/∂ln sp.
    by_peak_friction: T,
    by_log_slip: T,
    innovation: T,
    /// Variance of the noise as learnt.
    noise: T,
    /// H P Hᵀ
    signal: T,
}

/// One update, in place; see [`EfficientFilter`]'s. Returns what was expected and whether the measurement
/// was taken.
#[inline(always)]
fn fuse<T: Real>(
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
        estimate.suspects.add(&term);
        estimate.since_suspect = T::ZERO;
    } else if estimate.suspects.count > T::ZERO {
        estimate.since_suspect += T::ONE;
        if estimate.since_suspect >= T::from_f64(PATIENCE) && signal < T::from_f64(KNOWN) * noise {
            judge(estimate);
        }
    }
    if estimate.sums.count >= T::from_f64(HALVED_AT) {
        estimate.sums.scale(T::HALF);
    }
    solve(prepared, estimate);
    (expected, Decision::Accepted)
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
}

/// The sums anew, about the present sp.
#[cold]
#[inline(never)]
fn start_anew<T: Real>(estimate: &mut Estimate<T>) {
    estimate.centre = estimate.critical_slip();
    estimate.centre_squared = estimate.centre * estimate.centre;
    estimate.beta = T::ZERO;
    estimate.held = T::ZERO;
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

/// One step of Gauss and Newton, the noise and the covariance.
#[inline(always)]
fn solve<T: Real>(prepared: &Prepared<T>, estimate: &mut Estimate<T>) {
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
    let end = T::from_f64(LARGEST_BETA);
    let moved = beta + T::HALF * (T::ONE - beta * beta) * step;

    estimate.noise_factor = factor;
    let believed = factor.min(T::from_f64(LARGEST_GATE_FACTOR));
    estimate.gate_factor = believed + believed * (T::from_f64(UNLEARNT_NOISE) * by_degrees);
    estimate.peak_friction =
        m + step * (at.friction_slope - (m + m) * at.law_half_slope) * by_information;
    estimate.beta = moved.min(end).max(-end);
    if moved.abs() > end && curvature > T::from_f64(BEYOND) * factor {
        estimate.held += T::ONE;
        if estimate.held > T::from_f64(BEYOND_SAMPLES) {
            start_anew(estimate);
        }
    } else {
        estimate.held = T::ZERO;
    }
    // P = factor [[D, m D'/2], [m D'/2, m² Σ w tanh² sech²]]⁻¹
    let p11 = factor * by_curvature;
    estimate.covariance = Covariance {
        p00: factor * by_information + slope * slope * p11,
        p01: -(slope * p11),
        p11,
    };
}

/// Corrects an estimate with one measured friction: the efficient estimator, lean.
///
/// `configuration` is of the filter that made the estimate. Inputs are not checked: for a slip, friction
/// or variance that is not finite, or a variance that is not positive, the estimate is spoilt;
/// [`EfficientFilter`] checks.
#[inline]
pub fn update<T: Real>(
    filter: &mut EfficientFilter<T>,
    slip_ratio: T,
    friction: T,
    measurement_variance: T,
) {
    fuse(
        &filter.prepared,
        &mut filter.estimate,
        slip_ratio,
        friction,
        measurement_variance,
    );
}

/// The filter: a validated configuration and the present estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EfficientFilter<T> {
    config: Config<T>,
    prepared: Prepared<T>,
    estimate: Estimate<T>,
}

impl<T: Real> EfficientFilter<T> {
    pub(super) fn new(config: Config<T>, estimate: Estimate<T>) -> Self {
        Self {
            config,
            prepared: Prepared::of(&config),
            estimate,
        }
    }

    /// The configuration it was built from.
    pub fn config(&self) -> &Config<T> {
        &self.config
    }

    /// The present state.
    pub fn state(&self) -> State<T> {
        State {
            peak_friction: self.estimate.peak_friction,
            critical_slip: self.estimate.critical_slip(),
        }
    }

    /// The present covariance of (mup, sp).
    pub fn covariance(&self) -> Covariance<T> {
        let slip = self.state().critical_slip;
        let Covariance { p00, p01, p11 } = self.estimate.covariance;
        Covariance {
            p00,
            p01: slip * p01,
            p11: slip * slip * p11,
        }
    }

    /// Learnt over declared noise variance, within 0.15 to 10.
    pub fn noise_factor(&self) -> T {
        self.estimate.noise_factor
    }

    /// Back to the start.
    pub fn reset(&mut self) {
        self.estimate = Estimate::start(&self.config);
    }
}

impl<T: Real> Estimator<T> for EfficientFilter<T> {
    type Measurement = FrictionMeasurement<T>;
    type Fusion = Fusion<T>;
    type Estimate = Estimate<T>;
    type Error = UpdateError;

    /// Corrects the estimate with one measured friction, or rejects it at the gate.
    ///
    /// The innovation's variance is made with the noise as learnt. Gains are P Hᵀ/S with P before the
    /// update; the estimate itself moves by the likelihood's own step.
    ///
    /// # Errors
    /// [`UpdateError`]; the estimate is exactly as it was before the call.
    fn update(&mut self, measurement: &FrictionMeasurement<T>) -> Result<Fusion<T>, UpdateError> {
        let FrictionMeasurement {
            slip_ratio,
            friction,
            friction_std,
        } = *measurement;
        for (value, input) in [
            (slip_ratio, Input::SlipRatio),
            (friction, Input::Friction),
            (friction_std, Input::Noise),
        ] {
            if !value.is_finite() {
                return Err(UpdateError::NonFinite(input));
            }
        }
        if friction_std <= T::ZERO {
            return Err(UpdateError::NonPositiveNoise);
        }
        let before = self.covariance();
        let slip = self.state().critical_slip;
        let mut after = self.estimate;
        let (expected, decision) = fuse(
            &self.prepared,
            &mut after,
            slip_ratio,
            friction,
            friction_std * friction_std,
        );
        let innovation_variance = expected.signal + expected.noise;
        let inverse = T::ONE / innovation_variance;
        let (h0, h1) = (expected.by_peak_friction, expected.by_log_slip / slip);
        let nis = expected.innovation * expected.innovation * inverse;
        if !(after.is_sound() && nis.is_finite()) {
            return Err(UpdateError::Overflow);
        }
        self.estimate = after;
        let Covariance { p00, p01, p11 } = self.covariance();
        Ok(Fusion {
            slip_ratio,
            measured_friction: friction,
            predicted_friction: expected.friction,
            innovation: expected.innovation,
            noise_variance: expected.noise,
            pseudonoise_variance: T::ZERO,
            signal_before: expected.signal,
            signal_after: h0 * (h0 * p00 + (h1 + h1) * p01) + h1 * h1 * p11,
            innovation_variance,
            peak_friction_gain: (before.p00 * h0 + before.p01 * h1) * inverse,
            critical_slip_gain: (before.p01 * h0 + before.p11 * h1) * inverse,
            nis,
            decision,
        })
    }

    fn estimate(&self) -> Estimate<T> {
        self.estimate
    }

    fn restore(&mut self, estimate: Estimate<T>) -> Result<(), UpdateError> {
        if !estimate.is_sound() {
            return Err(UpdateError::NonFinite(Input::State));
        }
        self.estimate = estimate;
        Ok(())
    }

    fn peak(&self) -> PeakEstimate<T> {
        let State {
            peak_friction,
            critical_slip,
        } = self.state();
        let covariance = self.covariance();
        let (peak_friction_std, critical_slip_std) = covariance.std();
        PeakEstimate {
            peak_friction,
            peak_friction_std,
            critical_slip,
            critical_slip_std,
            correlation: covariance.correlation(),
        }
    }
}
