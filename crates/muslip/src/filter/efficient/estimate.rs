//! What the filter carries from one sample to the next.

use super::config::Config;
use super::sums::Sums;
use crate::filter::mu_slip::Covariance;
use crate::real::Real;

/// |β| beyond which sp is held: 0.38 to 2.64 times the centre slip.
pub(super) const LARGEST_BETA: f64 = 0.45;
/// Precision of the prior on ln sp: a standard deviation of 0.7.
pub(super) const PRIOR_PRECISION: f64 = 2.0;
/// Weight of not having learnt the noise yet: the gate takes the noise variance as 1 + this over the
/// samples times what it seems.
pub(super) const UNLEARNT_NOISE: f64 = 3.0;

/// All that the filter carries from one sample to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Estimate<T> {
    pub(super) sums: Sums<T>,
    /// Those of `sums` that are of suspects.
    pub(super) suspects: Sums<T>,
    /// Number of samples from which the likelihood is to be solved anew.
    pub(super) due: T,
    /// Samples since the last suspect.
    pub(super) since_suspect: T,
    /// Rejections in a row.
    pub(super) rejections: T,
    /// s0, and its square.
    pub(super) centre: T,
    pub(super) centre_squared: T,
    /// Samples in a row at which sp was held at an end of its range.
    pub(super) held: T,
    /// mup.
    pub(super) peak_friction: T,
    /// β of sp.
    pub(super) beta: T,
    /// Learnt over declared noise variance.
    pub(super) noise_factor: T,
    /// The same for the gate: larger while it is being learnt.
    pub(super) gate_factor: T,
    /// Covariance of (mup, ln sp).
    pub(super) covariance: Covariance<T>,
}

impl<T: Real> Estimate<T> {
    pub(super) fn start(config: &Config<T>) -> Self {
        let start = config.initial_state;
        Self {
            sums: Sums::none(),
            suspects: Sums::none(),
            due: T::ZERO,
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
    pub(super) fn critical_slip(&self) -> T {
        self.centre * (T::ONE + self.beta) / (T::ONE - self.beta)
    }

    /// Moves sp by a step of its logarithm; whether it would have left its range, at whose end it is then.
    #[inline(always)]
    pub(super) fn move_log_slip(&mut self, step: T) -> bool {
        let end = T::from_f64(LARGEST_BETA);
        let moved = self.beta + T::HALF * (T::ONE - self.beta * self.beta) * step;
        self.beta = moved.min(end).max(-end);
        moved.abs() > end
    }

    pub(super) fn is_sound(&self) -> bool {
        self.sums.is_finite()
            && self.suspects.is_finite()
            && self.centre > T::ZERO
            && (self.due
                + self.centre_squared
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
pub(super) fn half_log<T: Real>(beta: T) -> T {
    let square = beta * beta;
    beta * (T::ONE
        + square
            * (T::from_f64(1.0 / 3.0) + square * (T::from_f64(0.2) + square * T::from_f64(0.2))))
}

/// What the arithmetic needs of a configuration.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Prepared<T> {
    pub(super) start_peak_friction: T,
    /// 1/start²
    pub(super) peak_precision: T,
    pub(super) start_half_log: T,
    pub(super) gate: Option<T>,
    /// Factor on the sums a sample.
    pub(super) keep: Option<T>,
}

impl<T: Real> Prepared<T> {
    pub(super) fn of(config: &Config<T>) -> Self {
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
