//! The state, and what it says.

use super::bins::Bins;
use super::config::Config;
use super::dissent::Dissent;
use super::sums::Sums;
use crate::filter::mu_slip::{Covariance, State};
use crate::real::Real;

/// Precision of the prior on ln sp: a standard deviation of 0.7.
const PRIOR_PRECISION: f64 = 2.0;
/// Samples that the declared noise counts as when its level is learnt.
pub(super) const DECLARED_NOISE_SAMPLES: f64 = 0.5;
/// The learnt variance is held within these factors of the declared one.
const NOISE_FACTORS: (f64, f64) = (0.15, 10.0);
/// Suspicion begins at no more than this many times the declared variance.
pub(super) const LARGEST_USUAL_FACTOR: f64 = 2.25;
/// Innovation squared over the noise variance from which a sample is suspect.
pub(super) const SUSPECT: f64 = 6.25;
/// Variance of ln sp by which sp may lie off the slip that the sums are about.
const FAR: f64 = 0.25;
/// Samples before noise, prior and thresholds are taken anew for the first time; then each time they have
/// doubled.
pub(super) const FIRST_RENEWAL: u16 = 6;
/// Curvature in ln sp over m² Σ w sech² tanh² below which it is rounding.
const ROUNDING: f64 = 16.0;
/// Curvature of the likelihood in ln sp over mup² Σ w sech² (0.1 to 0.3 of a run through the peak) below
/// which it is not believed.
const LEAST_CURVATURE: f64 = 2e-3;
/// Least share of it that is believed all the same: the prior is divided by this.
const LEAST_BELIEVED: f64 = 1e-3;
/// Sum of weights from which all are scaled down.
const LARGEST_SUM: f64 = 65_536.0;
/// Number of samples at which all sums are halved.
const HALVED_AT: f64 = 65_536.0;

/// All that the filter carries from one sample to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Estimate<T> {
    pub(super) bins: Bins<T>,
    pub(super) sums: Sums<T>,
    /// s0, the slip that the sums are about.
    pub(super) reference: T,
    /// ln(start/s0).
    pub(super) start_log_slip: T,
    /// mup.
    pub(super) peak_friction: T,
    /// ln(sp/s0).
    pub(super) shift: T,
    /// Noise variance that a weight of one stands for: that of the first sample.
    pub(super) unit: T,
    /// Learnt over declared noise variance.
    pub(super) noise_factor: T,
    pub(super) prior: Prior<T>,
    /// Innovation squared over the declared variance from which a sample is suspect.
    pub(super) suspect_level: T,
    /// Square of the shift from which the sums are taken anew.
    pub(super) far: T,
    /// Number of samples (with forgetting: of those that still count) at the last renewal.
    pub(super) count: T,
    /// Samples taken, up to where that no longer matters.
    pub(super) seen: u16,
    /// Samples until something is to be attended to, and from then until the next renewal.
    pub(super) quiet: u16,
    pub(super) rest: u16,
    /// Rejections in a row.
    pub(super) dissent: Dissent<T>,
    /// Judgements that are still due, and samples since the last suspect.
    pub(super) due: u8,
    pub(super) since_suspect: u8,
}

/// What is taken for known before the samples, in weights.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Prior<T> {
    /// Precision of mup.
    pub(super) weight: T,
    /// Share of the information on ln sp that is believed.
    pub(super) believed: T,
    /// Precision of ln sp over that.
    pub(super) slip_weight: T,
}

impl<T: Real> Prior<T> {
    const NONE: Self = Self {
        weight: T::ZERO,
        believed: T::ONE,
        slip_weight: T::ZERO,
    };

    fn scale(&mut self, factor: T) {
        self.weight *= factor;
        self.slip_weight *= factor;
    }
}

/// What the present curve expects of a measurement.
#[derive(Debug, Clone, Copy)]
pub(super) struct Expected<T> {
    pub friction: T,
    /// ∂mu/∂mup and ∂mu/∂ln sp.
    pub by_peak_friction: T,
    pub by_log_slip: T,
    /// H P Hᵀ
    pub signal: T,
    /// Variance of the noise as learnt.
    pub noise: T,
}

/// s0 e^shift by the fraction that is right to 3e-6 for a longest step.
#[inline]
pub(super) fn moved<T: Real>(slip: T, shift: T) -> T {
    let half = T::HALF * shift;
    let even = T::ONE + half * half * T::from_f64(1.0 / 3.0);
    slip * ((even + half) / (even - half))
}

impl<T: Real> Estimate<T> {
    pub(super) fn start(config: &Config<T>) -> Self {
        let State {
            peak_friction,
            critical_slip,
        } = config.initial_state;
        let mut estimate = Self {
            bins: Bins::NONE,
            sums: Sums::NONE,
            reference: critical_slip,
            start_log_slip: T::ZERO,
            peak_friction,
            shift: T::ZERO,
            unit: T::ONE,
            noise_factor: T::ONE,
            prior: Prior::NONE,
            suspect_level: T::ZERO,
            far: T::ZERO,
            count: T::ZERO,
            seen: FIRST_RENEWAL,
            quiet: FIRST_RENEWAL,
            rest: 0,
            dissent: Dissent::NONE,
            due: 0,
            since_suspect: 0,
        };
        estimate.renew(config);
        // The first sample is looked at closely: it brings the unit.
        estimate.suspect_level = -T::ONE;
        estimate
    }

    /// Learnt over declared noise variance.
    pub fn noise_factor(&self) -> T {
        self.noise_factor
    }

    pub(super) fn state(&self) -> State<T> {
        State {
            peak_friction: self.peak_friction,
            critical_slip: moved(self.reference, self.shift),
        }
    }

    /// The sums before any sample: what is known of mup all the same.
    pub(super) fn prior_sums(&self, config: &Config<T>) -> Sums<T> {
        Sums {
            law: self.prior.weight,
            friction: self.prior.weight * config.initial_state.peak_friction,
            ..Sums::NONE
        }
    }

    /// Covariance of (mup, ln sp).
    pub(super) fn covariance(&self) -> Covariance<T> {
        let Sums {
            law,
            law_slope,
            law_curvature,
            ..
        } = self.sums;
        let m = self.peak_friction;
        let noise = self.noise_factor * self.unit;
        let by_law = T::ONE / law;
        let ratio = law_slope * by_law;
        let curvature = (m * m * (law_curvature - law_slope * ratio)).max(T::ZERO);
        // P = noise [[D, m D'/2], [m D'/2, m² Σ w sech² tanh²]]⁻¹
        let slope = m * ratio;
        let p11 = noise / (self.prior.believed * (curvature + self.prior.slip_weight));
        Covariance {
            p00: noise * by_law + slope * slope * p11,
            p01: -(slope * p11),
            p11,
        }
    }

    /// What the present curve expects at a slip, with noise of this variance.
    pub(super) fn expected(&self, slip: T, variance: T) -> Expected<T> {
        let State {
            peak_friction: m,
            critical_slip: sp,
        } = self.state();
        let (square, about) = (slip * slip, sp * sp);
        let inverse = T::ONE / (square + about);
        let sech = slip * (sp + sp) * inverse;
        let slope = m * sech * ((square - about) * inverse);
        let Covariance { p00, p01, p11 } = self.covariance();
        Expected {
            friction: m * sech,
            by_peak_friction: sech,
            by_log_slip: slope,
            signal: sech * (sech * p00 + (slope + slope) * p01) + slope * slope * p11,
            noise: self.noise_factor * variance,
        }
    }

    pub(super) fn is_sound(&self) -> bool {
        self.bins.is_finite()
            && self.sums.is_finite()
            && self.dissent.is_finite()
            && self.reference > T::ZERO
            && (self.reference
                + self.start_log_slip
                + self.peak_friction
                + self.shift
                + self.noise_factor)
                .is_finite()
            && self.covariance().is_positive_definite()
    }

    /// Noise, prior and thresholds anew.
    pub(super) fn renew(&mut self, config: &Config<T>) {
        let State {
            peak_friction: start,
            ..
        } = config.initial_state;
        let (square, count) = self.bins.totals();
        self.count = count;
        let Prior { weight, .. } = self.prior;
        let sums = &mut self.sums;
        let m = self.peak_friction;
        // What is left of Σ w z² after the straight line of `solve`.
        let slope = m * self.shift;
        let (law, friction) = (sums.law - weight, sums.friction - weight * start);
        let residual = square
            - m * (friction + friction - m * law)
            - slope
                * (sums.friction_slope + sums.friction_slope
                    - (m + m) * sums.law_slope
                    - slope * sums.law_curvature);
        let declared = T::from_f64(DECLARED_NOISE_SAMPLES);
        let degrees = declared + (count - T::TWO).max(T::ZERO);
        let factor = (declared * self.unit + residual.max(T::ZERO)) / (self.unit * degrees);
        let (least, most) = NOISE_FACTORS;
        let factor = factor.max(T::from_f64(least)).min(T::from_f64(most));
        self.noise_factor = factor;
        let noise = factor * self.unit;

        let weight = noise / (start * start);
        sums.law = law + weight;
        sums.friction = friction + weight * start;
        let spread = m * m * sums.law_curvature;
        let mut curvature = spread - m * m * (sums.law_slope * sums.law_slope / sums.law);
        if curvature <= T::from_f64(ROUNDING) * T::EPSILON * spread {
            curvature = T::ZERO;
        }
        // Slips that all lie before the peak say little of it, and what they say is far from normal.
        let least = T::from_f64(LEAST_CURVATURE) * m * m * sums.law;
        let square = curvature * curvature;
        let believed = (square / (square + least * least)).max(T::from_f64(LEAST_BELIEVED));
        // Without information the prior holds ln sp; it fades as samples speak.
        let share = noise / (noise + believed * curvature);
        let slip_weight = T::from_f64(PRIOR_PRECISION) * noise * (share * share) / believed;
        self.prior = Prior {
            weight,
            believed,
            slip_weight,
        };
        self.far = T::from_f64(FAR) * noise / (believed * (curvature + slip_weight));
        self.watch(config);
    }

    /// From where on a sample is looked at closely.
    pub(super) fn watch(&mut self, config: &Config<T>) {
        self.suspect_level = match (config.nis_gate, config.memory) {
            (None, None) => T::ONE / T::MIN_POSITIVE,
            // With forgetting each sample is looked at closely: there the forgetting is done.
            (_, Some(_)) => -T::ONE,
            // And so is each that may end a run of rejections.
            _ if !self.dissent.is_none() => -T::ONE,
            _ => T::from_f64(SUSPECT) * self.noise_factor.min(T::from_f64(LARGEST_USUAL_FACTOR)),
        };
    }

    /// Halves what grows with time, and scales weights down whose powers would not be numbers.
    pub(super) fn keep_in_range(&mut self) {
        if self.count >= T::from_f64(HALVED_AT) {
            self.scale(T::HALF);
        }
        if self.sums.law > T::from_f64(LARGEST_SUM) {
            let factor = T::from_f64(1.0 / LARGEST_SUM);
            self.sums.scale(factor);
            self.prior.scale(factor);
            self.bins.scale(factor, T::ONE);
            self.unit *= factor;
        }
    }

    /// All samples count so many times what they did.
    pub(super) fn scale(&mut self, factor: T) {
        self.sums.scale(factor);
        self.prior.scale(factor);
        self.bins.scale(factor, factor);
        self.count *= factor;
    }
}
