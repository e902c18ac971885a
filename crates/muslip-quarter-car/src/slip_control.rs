//! Discrete PI controller of slip.
//!
//! It knows no filter: slip may come from [`Filter`](crate::filter::Filter), from measured speeds or, in a simulation,
//! from the truth.
//!
//! ```text
//! e = λ* − λ                                          slip that is wanted and not there
//! u = T_ff + B (J v/R) e + I                          T_ff: the tyre's torque as estimated
//! T = u held within range and rate
//! I ← I + (B/Ti) (J v/R) e Ts                         anti-windup: not where that leads further past a limit
//! ```
//!
//! Slip moves as dλ/dt = R/(J v) (T − R F) while speed hardly changes, F being the tyre's force; with the
//! tyre's torque R F fed forward the loop is dλ/dt = B e at every speed and on both sides of the peak,
//! B (rad/s) its bandwidth. Equations (37)-(39) of docs/model.md.

use core::fmt;

use muslip::real::Real;

/// Configuration of the controller.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Config<T> {
    /// Slip to hold, dimensionless, within 0..1, ends excluded.
    pub setpoint_slip: T,
    /// Bandwidth B of the loop in rad/s, > 0. A third of what one sample of delay, actuator and sensor
    /// lag leave is safe: 40 rad/s at 5 ms.
    pub bandwidth_rad_s: T,
    /// Integral time Ti in s, > 0.
    pub integral_time_s: T,
    /// Sample time Ts in s, > 0.
    pub sample_time_s: T,
    /// Radius R of the wheel in m, > 0.
    pub radius_m: T,
    /// Inertia J of the wheel in kg m², > 0.
    pub inertia_kg_m2: T,
    /// Largest torque of the brake in N m, > 0; the smallest is 0.
    pub maximum_torque_nm: T,
    /// Largest rate of the torque either way in N m/s, > 0.
    pub maximum_torque_rate_nm_s: T,
    /// Vehicle speed in m/s below which the gain falls no further, > 0.
    pub minimum_vehicle_speed_m_s: T,
}

/// What the controller is told at a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Input<T> {
    /// Slip, dimensionless; `None` where it has no meaning (standstill): torque is then held.
    pub slip_ratio: Option<T>,
    /// Vehicle speed in m/s.
    pub vehicle_speed_m_s: T,
    /// Torque of the tyre on the wheel in N m, as estimated, or 0 for a pure PI controller.
    pub tyre_torque_nm: T,
}

/// What the controller answers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Output<T> {
    /// Brake torque to demand in N m, within range and rate.
    pub brake_torque_nm: T,
    /// Which limit held the torque.
    pub limit: Limit,
}

/// A limit that held the torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Limit {
    /// None.
    Free,
    /// Zero or the largest torque.
    Range,
    /// The rate.
    Rate,
    /// Slip has no meaning: the torque is held.
    Held,
}

/// A field of [`Config`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ConfigParameter {
    /// `setpoint_slip`.
    SetpointSlip,
    /// `bandwidth_rad_s`.
    Bandwidth,
    /// `integral_time_s`.
    IntegralTime,
    /// `sample_time_s`.
    SampleTime,
    /// `radius_m`.
    Radius,
    /// `inertia_kg_m2`.
    Inertia,
    /// `maximum_torque_nm`.
    MaximumTorque,
    /// `maximum_torque_rate_nm_s`.
    MaximumTorqueRate,
    /// `minimum_vehicle_speed_m_s`.
    MinimumVehicleSpeed,
}

/// Why the controller or one of its steps was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ControlError {
    /// The field is outside the range that [`Config`] states.
    OutOfRange(ConfigParameter),
    /// An input of a step, or a result, is infinite or NaN; the controller is as it was before.
    NonFinite,
}

impl fmt::Display for ControlError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::OutOfRange(parameter) => match parameter {
                ConfigParameter::SetpointSlip => "setpoint slip is not within 0 to 1",
                ConfigParameter::Bandwidth => "bandwidth is not finite and positive",
                ConfigParameter::IntegralTime => "integral time is not finite and positive",
                ConfigParameter::SampleTime => "sample time is not finite and positive",
                ConfigParameter::Radius => "wheel radius is not finite and positive",
                ConfigParameter::Inertia => "wheel inertia is not finite and positive",
                ConfigParameter::MaximumTorque => "largest torque is not finite and positive",
                ConfigParameter::MaximumTorqueRate => {
                    "largest torque rate is not finite and positive"
                }
                ConfigParameter::MinimumVehicleSpeed => {
                    "minimum vehicle speed is not finite and positive"
                }
            },
            Self::NonFinite => "input of the slip controller is not finite",
        })
    }
}

impl core::error::Error for ControlError {}

/// The controller: configuration, integral and the last torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlipController<T> {
    config: Config<T>,
    integral_nm: T,
    brake_torque_nm: T,
}

impl<T: Real> Config<T> {
    /// The controller, with the brake open.
    ///
    /// # Errors
    /// [`ControlError::OutOfRange`] naming the first field that is outside its range.
    pub fn build(self) -> Result<SlipController<T>, ControlError> {
        let positive = |value: T| value.is_finite() && value > T::ZERO;
        let checks = [
            (
                is_setpoint(self.setpoint_slip),
                ConfigParameter::SetpointSlip,
            ),
            (positive(self.bandwidth_rad_s), ConfigParameter::Bandwidth),
            (
                positive(self.integral_time_s),
                ConfigParameter::IntegralTime,
            ),
            (positive(self.sample_time_s), ConfigParameter::SampleTime),
            (positive(self.radius_m), ConfigParameter::Radius),
            (positive(self.inertia_kg_m2), ConfigParameter::Inertia),
            (
                positive(self.maximum_torque_nm),
                ConfigParameter::MaximumTorque,
            ),
            (
                positive(self.maximum_torque_rate_nm_s),
                ConfigParameter::MaximumTorqueRate,
            ),
            (
                positive(self.minimum_vehicle_speed_m_s),
                ConfigParameter::MinimumVehicleSpeed,
            ),
        ];
        match checks.into_iter().find(|(holds, _)| !holds) {
            Some((_, parameter)) => Err(ControlError::OutOfRange(parameter)),
            None => Ok(SlipController {
                config: self,
                integral_nm: T::ZERO,
                brake_torque_nm: T::ZERO,
            }),
        }
    }
}

fn is_setpoint<T: Real>(slip_ratio: T) -> bool {
    slip_ratio > T::ZERO && slip_ratio < T::ONE
}

impl<T: Real> SlipController<T> {
    /// The configuration.
    pub fn config(&self) -> &Config<T> {
        &self.config
    }

    /// The torque demanded last, in N m.
    pub fn brake_torque_nm(&self) -> T {
        self.brake_torque_nm
    }

    /// Replaces the slip to hold.
    ///
    /// # Errors
    /// [`ControlError::OutOfRange`] unless within 0..1, ends excluded; nothing changes.
    pub fn set_setpoint_slip(&mut self, slip_ratio: T) -> Result<(), ControlError> {
        if !is_setpoint(slip_ratio) {
            return Err(ControlError::OutOfRange(ConfigParameter::SetpointSlip));
        }
        self.config.setpoint_slip = slip_ratio;
        Ok(())
    }

    /// Takes over without a bump from a brake that holds a torque in N m: the next step answers that
    /// torque (held within the range) give or take one sample of the integral, whatever slip is told.
    ///
    /// # Errors
    /// [`ControlError::NonFinite`]; nothing changes.
    pub fn start(&mut self, brake_torque_nm: T, first: &Input<T>) -> Result<(), ControlError> {
        let proportional = self.checked(first)?.map_or(T::ZERO, |p| p.torque_nm);
        let torque = self.within_range(brake_torque_nm);
        let integral = torque - proportional - first.tyre_torque_nm;
        if !(brake_torque_nm.is_finite() && integral.is_finite()) {
            return Err(ControlError::NonFinite);
        }
        self.brake_torque_nm = torque;
        self.integral_nm = integral;
        Ok(())
    }

    /// One sample: the torque to demand until the next.
    ///
    /// # Errors
    /// [`ControlError::NonFinite`]; the controller is as it was before, and so should be the demand.
    pub fn step(&mut self, input: &Input<T>) -> Result<Output<T>, ControlError> {
        let Some(proportional) = self.checked(input)? else {
            return Ok(Output {
                brake_torque_nm: self.brake_torque_nm,
                limit: Limit::Held,
            });
        };
        let wanted = input.tyre_torque_nm + proportional.torque_nm + self.integral_nm;
        let in_range = self.within_range(wanted);
        let reach = self.config.maximum_torque_rate_nm_s * self.config.sample_time_s;
        let torque = in_range
            .min(self.brake_torque_nm + reach)
            .max(self.brake_torque_nm - reach);
        let increment =
            proportional.torque_nm * self.config.sample_time_s / self.config.integral_time_s;
        // A limit that holds the torque back from where the error pulls it would only wind the integral up.
        let winds_up =
            (torque < wanted && increment > T::ZERO) || (torque > wanted && increment < T::ZERO);
        let integral = if winds_up {
            self.integral_nm
        } else {
            self.integral_nm + increment
        };
        if !(torque.is_finite() && integral.is_finite()) {
            return Err(ControlError::NonFinite);
        }
        let limit = if torque != in_range {
            Limit::Rate
        } else if in_range != wanted {
            Limit::Range
        } else {
            Limit::Free
        };
        self.brake_torque_nm = torque;
        self.integral_nm = integral;
        Ok(Output {
            brake_torque_nm: torque,
            limit,
        })
    }

    /// Lowers the torque as fast as the rate allows for one sample and empties the integral: for a guard
    /// that overrules slip. Called instead of [`SlipController::step`].
    pub fn release(&mut self) {
        let reach = self.config.maximum_torque_rate_nm_s * self.config.sample_time_s;
        self.brake_torque_nm = (self.brake_torque_nm - reach).max(T::ZERO);
        self.integral_nm = T::ZERO;
    }

    fn within_range(&self, torque_nm: T) -> T {
        torque_nm.min(self.config.maximum_torque_nm).max(T::ZERO)
    }

    /// The proportional part, `None` where slip has no meaning.
    fn checked(&self, input: &Input<T>) -> Result<Option<Proportional<T>>, ControlError> {
        let told = input.slip_ratio.unwrap_or(T::ZERO);
        if !(told.is_finite()
            && input.vehicle_speed_m_s.is_finite()
            && input.tyre_torque_nm.is_finite())
        {
            return Err(ControlError::NonFinite);
        }
        Ok(input.slip_ratio.map(|slip_ratio| {
            let speed = input
                .vehicle_speed_m_s
                .max(self.config.minimum_vehicle_speed_m_s);
            let gain = self.config.bandwidth_rad_s * self.config.inertia_kg_m2 * speed
                / self.config.radius_m;
            Proportional {
                torque_nm: gain * (self.config.setpoint_slip - slip_ratio),
            }
        }))
    }
}

/// The proportional part of the torque.
struct Proportional<T> {
    torque_nm: T,
}
