use muslip::law::{LawError, TyreLaw};
use muslip::real::Real;
use muslip_laws::Burckhardt;

use super::error::{ConfigError, ConfigParameter};
use super::model::{Road, Vehicle};
use super::state::StateStd;

/// Configuration of the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Config<T> {
    /// Wheel and gravity.
    pub vehicle: Vehicle<T>,
    /// What is known of the road.
    pub road: Road<T>,
    /// Sample time Ts in s, > 0.
    pub sample_time_s: T,
    /// Vehicle speed v0 at the start in m/s, >= 0; the wheel rolls freely there, without slip.
    pub initial_vehicle_speed_m_s: T,
    /// Quarter mass m0 at the start in kg, > 0.
    pub initial_mass_kg: T,
    /// Standard deviations of the start, the roots of P0's diagonal.
    pub initial_std: StateStd<T>,
    /// Standard deviations of the process noise of one sample, the roots of Q's diagonal.
    pub process_std: StateStd<T>,
    /// Vehicle speed in m/s below which slip has no meaning, > 0; see
    /// [`Motion::Standstill`](super::Motion::Standstill).
    pub minimum_vehicle_speed_m_s: T,
    /// Normalised innovation squared above which a reading is rejected; none accepts all.
    pub nis_gate: Option<T>,
    /// Whether a wheel speed that repeats the last reading exactly is taken as a frozen sensor's and left
    /// out. For a sensor that resolves its own noise; one that does not repeats itself in health.
    pub refuses_repeats: bool,
    /// Whether the vehicle is held to be at least as fast as the wheel's circumference, as it is while
    /// only the brake acts on the wheel. Where integrated friction has carried the estimate below, vehicle
    /// speed starts again from the wheel's, its error added to its variance.
    pub keeps_slip_positive: bool,
}

impl<T: Real> Config<T> {
    /// The tutorial's filter: Ts = 5 ms, P0 = 0, Q = diag(0.01², 0.01², 1, 1, 0.001²), m0 = 450 kg, no
    /// gate. Its measurement variance is [`Config::tutorial_variance`].
    pub fn tutorial(vehicle: Vehicle<T>, law: Burckhardt<T>, initial_vehicle_speed_m_s: T) -> Self {
        Self {
            vehicle,
            road: Road::Known(law),
            sample_time_s: T::from_f64(0.005),
            initial_vehicle_speed_m_s,
            initial_mass_kg: T::from_f64(450.0),
            initial_std: StateStd::ZERO,
            process_std: StateStd {
                wheel_speed_rad_s: T::from_f64(0.01),
                vehicle_speed_m_s: T::from_f64(0.01),
                slip_ratio: T::ONE,
                friction: T::ONE,
                mass_kg: T::from_f64(0.001),
            },
            minimum_vehicle_speed_m_s: T::HALF,
            nis_gate: None,
            refuses_repeats: false,
            keeps_slip_positive: false,
        }
    }

    /// The tutorial's variance of the wheel speed, 0.005/Ts = 1 rad²/s².
    pub fn tutorial_variance() -> T {
        T::ONE
    }

    /// The tuned filter; docs/quarter-car.md says what it was tuned on.
    ///
    /// The start is honest: vehicle speed is known as well as a freely rolling wheel tells it, mass give
    /// or take a sixth. Slip is an identity of the two speeds and gets the noise of a sample's lag, not
    /// of ignorance; friction gets 2 % of its peak for what the road's law is off by.
    pub fn tuned(vehicle: Vehicle<T>, road: Road<T>, initial_vehicle_speed_m_s: T) -> Self {
        let friction = match road {
            Road::Known(law) => T::from_f64(0.02) * law.peak().friction,
            Road::Unknown => T::from_f64(0.05),
        };
        Self {
            vehicle,
            road,
            sample_time_s: T::from_f64(0.005),
            initial_vehicle_speed_m_s,
            initial_mass_kg: T::from_f64(450.0),
            initial_std: StateStd {
                wheel_speed_rad_s: T::from_f64(0.1),
                vehicle_speed_m_s: T::from_f64(0.1),
                slip_ratio: T::from_f64(0.005),
                friction: T::from_f64(0.05),
                mass_kg: T::from_f64(75.0),
            },
            process_std: StateStd {
                wheel_speed_rad_s: T::from_f64(0.05),
                vehicle_speed_m_s: T::from_f64(0.005),
                slip_ratio: T::from_f64(0.01),
                friction,
                mass_kg: T::from_f64(0.1),
            },
            minimum_vehicle_speed_m_s: T::HALF,
            nis_gate: Some(T::from_f64(100.0)),
            refuses_repeats: true,
            keeps_slip_positive: true,
        }
    }

    /// Whether every field is within its range.
    ///
    /// # Errors
    /// [`ConfigError`] naming the first that is not.
    pub fn check(&self) -> Result<(), ConfigError> {
        let positive = |value: T| value.is_finite() && value > T::ZERO;
        let checks = [
            (positive(self.vehicle.radius_m), ConfigParameter::Radius),
            (
                positive(self.vehicle.inertia_kg_m2),
                ConfigParameter::Inertia,
            ),
            (
                positive(self.vehicle.gravity_m_s2),
                ConfigParameter::Gravity,
            ),
            (positive(self.sample_time_s), ConfigParameter::SampleTime),
            (
                self.initial_vehicle_speed_m_s.is_finite()
                    && self.initial_vehicle_speed_m_s >= T::ZERO,
                ConfigParameter::InitialVehicleSpeed,
            ),
            (positive(self.initial_mass_kg), ConfigParameter::InitialMass),
            (self.initial_std.is_valid(), ConfigParameter::InitialStd),
            (self.process_std.is_valid(), ConfigParameter::ProcessStd),
            (
                positive(self.minimum_vehicle_speed_m_s),
                ConfigParameter::MinimumVehicleSpeed,
            ),
            (
                self.nis_gate.is_none_or(|gate| gate > T::ZERO),
                ConfigParameter::NisGate,
            ),
        ];
        match checks.into_iter().find(|(holds, _)| !holds) {
            Some((_, parameter)) => Err(ConfigError::OutOfRange(parameter)),
            None => Ok(()),
        }
    }
}

/// Burckhardt's law from the coefficients of the tutorial's form μ = c1 (1 − exp(−c2 λ) − c3 λ).
///
/// The bracket makes the linear term c1 c3 λ; in the published form μ = c1 (1 − exp(−c2 λ)) − c3 λ, which
/// is [`Burckhardt`]'s, its coefficient is c3. The published c3 is therefore c1 times the bracket's:
/// dry asphalt's 0.52 is 0.4062 in the bracket, and 0.52 put into the bracket makes a road that falls
/// 28 % faster past the peak.
///
/// # Errors
/// [`LawError`] where the published form refuses the coefficients.
pub fn law_of_bracketed_coefficients<T: Real>(
    c1: T,
    c2: T,
    c3: T,
) -> Result<Burckhardt<T>, LawError> {
    Burckhardt::new(c1, c2, c1 * c3)
}
