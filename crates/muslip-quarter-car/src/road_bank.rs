//! A bank of quarter-car filters, one road each, for a road that is one of a few but nobody knows which.
//!
//! The interacting-multiple-model estimator (H. A. P. Blom and Y. Bar-Shalom, IEEE Trans. Automatic Control
//! 33 (1988) 780-783). Before each sample every filter starts from the mixture of all that is probable
//! under its own road; after it the roads are weighed by the likelihood of the innovations:
//!
//! ```text
//! c_j  = Σ_i π_ij w_i                       π_ij: probability of a change from road i to j in a sample
//! x_j  ← Σ_i π_ij w_i/c_j x_i               and the covariance of that mixture
//! w_j  ∝ c_j exp(−NIS_j/2)/√s_j             after the filter's own prediction and correction
//! ```
//!
//! Equations (34)-(36) of docs/model.md. Wheel speed tells roads apart by the torque that they bear, so the
//! mass must be known: a light car on a dry road and a heavy one on a wet road lock at the same torque.

use muslip::filter::Decision;
use muslip::real::Real;
use muslip::sample::slip_ratio;

use crate::filter::{
    Channel, ConfigError, ConfigParameter, Covariance, Estimate, Filter, Measurement, Motion,
    State, StepError,
};

/// `N` filters with their weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoadBank<T, const N: usize> {
    filters: [Filter<T>; N],
    weights: [T; N],
    change_probability: T,
}

/// Largest normalised innovation squared that counts against a road: one wild reading must not decide.
const NIS_CEILING: f64 = 25.0;

/// Smallest weight, so that no road is ruled out for ever in single precision.
const WEIGHT_FLOOR: f64 = 1e-6;

impl<T: Real, const N: usize> RoadBank<T, N> {
    /// A bank of filters that differ in their road, equally probable at first.
    ///
    /// `change_probability` is that of another road at the next sample, within 0..1, ends excluded: the
    /// sample time over the mean time between changes.
    ///
    /// # Errors
    /// [`ConfigError`] unless there are at least two filters and the probability is in its range.
    pub fn new(filters: [Filter<T>; N], change_probability: T) -> Result<Self, ConfigError> {
        let valid = N >= 2 && change_probability > T::ZERO && change_probability < T::ONE;
        if !valid {
            return Err(ConfigError::OutOfRange(ConfigParameter::Bank));
        }
        let mut count = T::ZERO;
        for _ in 0..N {
            count += T::ONE;
        }
        Ok(Self {
            filters,
            weights: [T::ONE / count; N],
            change_probability,
        })
    }

    /// The probability of each road, in the order of the filters; they sum to 1.
    pub fn weights(&self) -> [T; N] {
        self.weights
    }

    /// The filters.
    pub fn filters(&self) -> &[Filter<T>; N] {
        &self.filters
    }

    /// The mixture of all estimates.
    pub fn estimate(&self) -> Estimate<T> {
        mixture(&self.filters, &self.weights)
    }

    /// How the quarter car moves under the most probable road.
    pub fn motion(&self) -> Motion {
        let mut best = (T::ZERO, Motion::Standstill);
        for (filter, weight) in self.filters.iter().zip(self.weights) {
            if weight > best.0 {
                best = (weight, filter.motion());
            }
        }
        best.1
    }

    /// Slip of the mixture's speeds; `None` where the most probable road's filter has none.
    pub fn slip_ratio(&self) -> Option<T> {
        match self.motion() {
            Motion::Standstill => None,
            Motion::Locked => Some(T::ONE),
            Motion::Rolling => {
                let State {
                    wheel_speed_rad_s,
                    vehicle_speed_m_s: v,
                    ..
                } = self.estimate().state;
                let config = self.filters.first()?.config();
                if v < config.minimum_vehicle_speed_m_s {
                    return None;
                }
                slip_ratio(wheel_speed_rad_s, v, config.vehicle.radius_m)
            }
        }
    }

    /// Torque of the tyre on the wheel, R g μ m in N m, of the mixture.
    pub fn tyre_torque_nm(&self) -> T {
        let mut sum = T::ZERO;
        for (filter, weight) in self.filters.iter().zip(self.weights) {
            sum += weight * filter.tyre_torque_nm();
        }
        sum
    }

    /// One sample: mixing, prediction under a brake torque in N m, and correction with the wheel speed
    /// (rad/s, variance in rad²/s²) where there is a reading.
    ///
    /// # Errors
    /// [`StepError`] of the first filter that refuses; the bank is as it was before.
    pub fn step(
        &mut self,
        brake_torque_nm: T,
        wheel_speed: Option<(T, T)>,
    ) -> Result<(), StepError> {
        let mut filters = self.filters;
        let mut weights = self.weights;
        let mut others = T::ZERO;
        for _ in 1..N {
            others += T::ONE;
        }
        let leaves = self.change_probability / others;
        let stays = T::ONE - self.change_probability;
        let mut logarithms = [T::ZERO; N];
        let mut highest = None;
        for (index, ((filter, weight), logarithm)) in filters
            .iter_mut()
            .zip(&mut weights)
            .zip(&mut logarithms)
            .enumerate()
        {
            let mut shares = self.weights;
            let mut total = T::ZERO;
            for (from, share) in shares.iter_mut().enumerate() {
                *share *= if from == index { stays } else { leaves };
                total += *share;
            }
            for share in &mut shares {
                *share /= total;
            }
            let mut mixed = filter.at(mixture(&self.filters, &shares));
            mixed.predict(brake_torque_nm)?;
            if let Some((value, variance)) = wheel_speed {
                let fusion = mixed.update(&Measurement {
                    channel: Channel::WheelSpeed,
                    value,
                    variance,
                })?;
                // A frozen reading says nothing of the road; a wild one not more than the ceiling.
                if fusion.decision == Decision::Accepted {
                    *logarithm = -(T::HALF * fusion.nis.min(T::from_f64(NIS_CEILING)))
                        - T::HALF * fusion.innovation_variance.ln();
                }
            }
            *filter = mixed;
            *weight = total;
            highest = Some(highest.map_or(*logarithm, |h: T| h.max(*logarithm)));
        }
        let highest = highest.unwrap_or(T::ZERO);
        let mut total = T::ZERO;
        for (weight, logarithm) in weights.iter_mut().zip(logarithms) {
            *weight = (*weight * (logarithm - highest).exp()).max(T::from_f64(WEIGHT_FLOOR));
            total += *weight;
        }
        for weight in &mut weights {
            *weight /= total;
        }
        if !(total.is_finite() && weights.iter().all(|weight| weight.is_finite())) {
            return Err(StepError::Overflow);
        }
        self.filters = filters;
        self.weights = weights;
        Ok(())
    }
}

/// Mean and covariance of a mixture of estimates with shares that sum to 1.
fn mixture<T: Real, const N: usize>(filters: &[Filter<T>; N], shares: &[T; N]) -> Estimate<T> {
    let mut mean = [T::ZERO; 5];
    for (filter, share) in filters.iter().zip(shares) {
        for (sum, value) in mean.iter_mut().zip(filter.estimate().state.to_array()) {
            *sum += *share * value;
        }
    }
    let mut covariance = Covariance::ZERO;
    for (filter, share) in filters.iter().zip(shares) {
        let estimate = filter.estimate();
        let mut difference = estimate.state.to_array();
        for (value, centre) in difference.iter_mut().zip(mean) {
            *value -= centre;
        }
        covariance = covariance.plus_spread(&estimate.covariance, difference, *share);
    }
    Estimate {
        state: State::from_array(mean),
        covariance,
    }
}
