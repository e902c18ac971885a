//! The correction of state and covariance with one scalar measurement.

use muslip::filter::Decision;
use muslip::real::Real;

use super::error::{Input, StepError};
use super::state::{Covariance, Estimate, State};

/// One reading and what it is of.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Measurement<T> {
    /// Which channel.
    pub channel: Channel,
    /// The reading z, in the channel's unit.
    pub value: T,
    /// Variance of its noise, in that unit squared, > 0.
    pub variance: T,
}

/// A channel that the filter can be corrected with; h is its row of the measurement Jacobian in the
/// order ω, v, λ, μ, m.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Channel {
    /// Wheel speed in rad/s: z = ω, h = (1, 0, 0, 0, 0).
    WheelSpeed,
    /// Vehicle speed in m/s: z = v, h = (0, 1, 0, 0, 0).
    VehicleSpeed,
    /// Drag in N: z = μ m g, h = (0, 0, 0, m g, μ g).
    DragForce,
    /// Normal force in N: z = m g, h = (0, 0, 0, 0, g).
    NormalForce,
}

/// What one measurement did.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Fusion<T> {
    /// Measured minus predicted, in the channel's unit.
    pub innovation: T,
    /// Its variance h P hᵀ + r, in that unit squared.
    pub innovation_variance: T,
    /// Normalised innovation squared, dimensionless.
    pub nis: T,
    /// Whether the estimate was corrected.
    pub decision: Decision,
}

/// The corrected estimate beside what is told of it.
pub(super) struct Corrected<T> {
    pub(super) estimate: Estimate<T>,
    pub(super) fusion: Fusion<T>,
}

/// Corrects an estimate: K = P hᵀ/s, x + K y, P − K (P hᵀ)ᵀ with s = h P hᵀ + r.
#[inline]
pub(super) fn corrected<T: Real>(
    estimate: &Estimate<T>,
    measurement: &Measurement<T>,
    gravity_m_s2: T,
) -> Result<Corrected<T>, StepError> {
    let Measurement {
        channel,
        value,
        variance,
    } = *measurement;
    if !value.is_finite() {
        return Err(StepError::NonFinite(Input::Measurement));
    }
    if !variance.is_finite() {
        return Err(StepError::NonFinite(Input::Noise));
    }
    if variance <= T::ZERO {
        return Err(StepError::Negative(Input::Noise));
    }
    let State {
        wheel_speed_rad_s,
        vehicle_speed_m_s,
        friction,
        mass_kg,
        ..
    } = estimate.state;
    let rows = estimate.covariance.rows();
    let [row0, row1, _, row3, row4] = rows;
    let (predicted, p_h, signal) = match channel {
        Channel::WheelSpeed => (wheel_speed_rad_s, row0, row0[0]),
        Channel::VehicleSpeed => (vehicle_speed_m_s, row1, row1[1]),
        Channel::DragForce => {
            let by_friction = mass_kg * gravity_m_s2;
            let by_mass = friction * gravity_m_s2;
            let [a0, a1, a2, a3, a4] = row3;
            let [b0, b1, b2, b3, b4] = row4;
            let p_h = [
                by_friction * a0 + by_mass * b0,
                by_friction * a1 + by_mass * b1,
                by_friction * a2 + by_mass * b2,
                by_friction * a3 + by_mass * b3,
                by_friction * a4 + by_mass * b4,
            ];
            let signal = by_friction * p_h[3] + by_mass * p_h[4];
            (friction * by_friction, p_h, signal)
        }
        Channel::NormalForce => {
            let p_h = row4.map(|value| gravity_m_s2 * value);
            (mass_kg * gravity_m_s2, p_h, gravity_m_s2 * p_h[4])
        }
    };
    let innovation = value - predicted;
    let innovation_variance = signal + variance;
    let scaled = innovation / innovation_variance;
    let nis = innovation * scaled;
    let mut states = estimate.state.to_array();
    for (state, column) in states.iter_mut().zip(p_h) {
        *state += column * scaled;
    }
    let state = State::from_array(states);
    let mut after = rows;
    for (index, (row, p_row)) in after.iter_mut().zip(p_h).enumerate() {
        let gain = p_row / innovation_variance;
        for (column, (value, p_column)) in row.iter_mut().zip(p_h).enumerate() {
            let before = *value;
            *value = before - gain * p_column;
            if index == column && *value < T::ZERO && *value > -(before * rounding::<T>()) {
                // All that was left of the variance was rounding.
                *value = T::ZERO;
            }
        }
    }
    let covariance = Covariance::from_rows(after);
    if !(state.is_finite() && nis.is_finite() && covariance.is_valid()) {
        return Err(StepError::Overflow);
    }
    Ok(Corrected {
        estimate: Estimate { state, covariance },
        fusion: Fusion {
            innovation,
            innovation_variance,
            nis,
            decision: Decision::Accepted,
        },
    })
}

/// How far below zero, relative to the variance before, rounding alone may carry a variance.
fn rounding<T: Real>() -> T {
    T::from_f64(16.0) * T::EPSILON
}
