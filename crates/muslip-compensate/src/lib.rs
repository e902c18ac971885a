//! Known distortions of a braked wheel's samples, compensated one by one before a filter of `muslip` sees them.
//!
//! A diagnosis has found that the wheel rolls on another radius, say, or that the load cell's amplifier
//! filters. Fed with such samples the filter's peak friction and critical slip are biased. A
//! [`Compensator`] stands between samples and filter: it carries the hidden states (delay line, felt
//! slip, tread temperature, low-pass filter) and says, for each sample, what the filter should compare
//! with what. The crate allocates nothing, does not panic and holds no `unsafe`; the same arithmetic runs in `f32` and in
//! `f64`.
//!
//! # Equations
//!
//! The chain from the wheel to the reading, with what is optional in brackets:
//!
//! ```text
//! slip         s  = (v - R [1 + e] ω)/v                    [e constant, with load, with speed squared]
//! felt slip    s' = s                                      [L ds'/dt = v (s - s')]
//! friction     f mu(s'/c; mup, sp)                         [f of load, speed, temperature; c of load]
//! contact      F  = Fz f mu                                [L dF/dt = v (Fz f mu - F)]
//! channel      G  = F + [share Fz] + [zero(t)]
//! reading      y(t) = G(t - [delay])                       [τ dy/dt + y = G, then the delay]
//! ```
//!
//! Read backwards it is the compensation:
//!
//! - *Delay.* The reading is late, so the other channels are made late by as much, in a ring of the last
//!   `N` samples with a straight line between them.
//! - *What is added* (crosstalk, zero drift) is subtracted.
//! - *Factors on friction*: friction read and its noise are divided by f. Power for the temperature is
//!   the measured drag times the sliding speed: no estimate feeds it.
//! - *Relaxation of slip* and *radius* change the slip at which the law is evaluated.
//! - *Low-pass filters* (lag of the channel, relaxation of the force) are not inverted, which would
//!   multiply noise. What the law predicts is put through the same filter, with its derivatives: with
//!   g(s; x) the law's force and H = ∂g/∂x, the intercept g - H x̂ and H are lagged, each with the estimate
//!   of its own time; lagged intercept + lagged H · x̂ is the reading expected now, and lagged H its
//!   Jacobian. The update compares like with like.
//!
//! First-order states are updated exactly for inputs that are straight lines between samples (powers:
//! held).
//!
//! # What remains
//!
//! White noise of the slip passes the law's curvature, as without compensation. The first delay after a
//! start or a gap gives no measurement; filters settle on their first input. Parameters are taken as
//! known: their uncertainty is not in the filter's covariance.
//!
//! # Features
//!
//! Off by default; neither changes a number. Both turn on the same feature of `muslip`.
//!
//! - `defmt`: `defmt::Format` for configuration, results and errors.
//! - `serde`: `Serialize` and `Deserialize` for the same.
//!
//! # Example
//!
//! `cargo run -p muslip-compensate --example load_cell` estimates behind a load cell whose zero has drifted.
//!
//! ```
//! use muslip_compensate::{Compensated, Compensation, EffectiveRadius, LoadCrosstalk};
//! use muslip::filter::Estimator;
//! use muslip::filter::mu_slip::{Config, Range};
//! use muslip::sample::{RigSample, SampleLimits};
//!
//! let mut compensator = Compensation {
//!     effective_radius: Some(EffectiveRadius::Constant { relative_error: 0.02_f32 }),
//!     load_crosstalk: Some(LoadCrosstalk { share: 0.03 }),
//!     ..Compensation::none()
//! }
//! .build::<0>(0.31, SampleLimits::for_median_normal_force(4000.0))?;
//! let mut filter = Config::for_range(Range::Automotive).build()?;
//!
//! for step in 0..200_u8 {
//!     // A wheel that truly rolls on 0.3162 m, a drag channel that reads 3 % of the load.
//!     let slip = f32::from(step) * 0.003;
//!     let friction = 2.0 * 0.8 * slip / (0.14 * (1.0 + (slip / 0.14) * (slip / 0.14)));
//!     let sample = RigSample {
//!         wheel_speed_rad_s: 20.0 * (1.0 - slip) / 0.3162,
//!         vehicle_speed_m_s: 20.0,
//!         drag_force_n: friction * 4000.0 + 0.03 * 4000.0,
//!         normal_force_n: 4000.0,
//!     };
//!     let drag_std_n = 80.0;
//!     match compensator.step(&sample, 0.002, &filter.state())? {
//!         Compensated::Measurement(m) => {
//!             let measurement = m.measurement(drag_std_n / m.normal_force_n);
//!             filter.update_expecting(&measurement, m.expected)?;
//!         }
//!         Compensated::Nothing(_) => {}
//!     }
//! }
//! assert!((filter.peak().peak_friction - 0.8).abs() < 0.01);
//! assert!((filter.peak().critical_slip - 0.14).abs() < 0.003);
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::as_conversions, clippy::float_cmp, clippy::indexing_slicing)
)]

/// The README's example, tested with the others.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod compensator;
mod config;
mod delay;
mod effect;
mod error;
mod first_order;

pub use compensator::{Compensated, CompensatedMeasurement, Compensator};
pub use config::Compensation;
pub use effect::{
    EffectiveRadius, ForceDelay, ForceLag, LoadCrosstalk, LoadSensitivity, Relaxation,
    SpeedSensitivity, ThermalFade, ZeroDrift,
};
pub use error::{CompensationError, NoMeasurement, Parameter, StepError};
