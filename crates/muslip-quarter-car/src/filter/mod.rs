//! The five-state filter of a braked quarter car: wheel speed, vehicle speed, slip, friction, mass.
//!
//! Source: P. Goddard, "Using an Extended Kalman Filter for Estimating Vehicle Dynamics and Mass",
//! goddardconsulting.ca; forward Euler with sample time Ts, the signs that its web text lost restored.
//! Equations (28)-(33) of docs/model.md.
//!
//! ```text
//! ω' = ω + Ts/J (R g μ m − sign(ω) Tb)          Tb: brake torque
//! v' = v − Ts g μ
//! λ' = (v − R ω)/v
//! μ' = c1 (1 − exp(−c2 λ)) − c3 λ                Burckhardt's law, or μ' = μ on an unknown road
//! m' = m
//! P' = F P Fᵀ + Q                                F: six entries beside units, written out
//! K  = P hᵀ/(h P hᵀ + r),  x + K y,  P − K (P hᵀ)ᵀ   for each scalar reading
//! ```
//!
//! # What it assumes and where it fails
//!
//! - Straight braking on a level road: all that slows the vehicle is friction.
//! - λ and μ lag by a sample each. Below some 5 m/s the tyre settles faster than that, and the model's
//!   slip near zero rings; held near the peak, where the curve is flat, it does not.
//! - Wheel speed tells vehicle speed only through the slope of the curve: at the peak it does not, and
//!   speed is integrated friction. On an unknown road it never does. It tells the product μ m always, and
//!   the mass only where friction is known by other means. `study-quarter-car` prints all that.
//! - Below [`Config::minimum_vehicle_speed_m_s`] slip has no meaning: [`Motion::Standstill`] says so, and
//!   [`Filter::slip_ratio`] is `None`. [`Motion::Locked`] is a wheel that the brake holds.
//!
//! ```
//! use muslip_quarter_car::filter::{Channel, Config, Measurement, Road, Vehicle};
//! use muslip_laws::burckhardt::DRY_ASPHALT;
//!
//! let vehicle = Vehicle { radius_m: 0.3_f32, inertia_kg_m2: 1.0, gravity_m_s2: 9.81 };
//! let mut filter = Config::tuned(vehicle, Road::Known(DRY_ASPHALT.law()), 30.0).build()?;
//! // Every 5 ms: the torque that acted, then what was read.
//! filter.predict(100.0)?;
//! filter.update(&Measurement { channel: Channel::WheelSpeed, value: 99.6, variance: 0.01 })?;
//! assert!(filter.slip_ratio().is_some_and(|slip| slip.abs() < 0.02));
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```

mod config;
mod error;
mod five_state;
mod model;
mod state;
mod update;

pub use config::{Config, law_of_bracketed_coefficients};
pub use error::{ConfigError, ConfigParameter, Input, StepError};
pub use five_state::Filter;
pub use model::{Motion, Road, Vehicle};
pub use state::{Covariance, Estimate, State, StateStd};
pub use update::{Channel, Fusion, Measurement};
