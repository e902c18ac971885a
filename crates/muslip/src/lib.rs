//! `no_std` estimators and tyre laws of the mu-slip curve.
//!
//! A braked wheel slips; the friction it passes on rises with slip to a peak and falls again. From
//! samples of wheel speed, vehicle speed, drag and normal force this crate estimates, sample by sample,
//! the peak friction and the slip at which it lies, with their uncertainty. It allocates nothing, does
//! not panic and holds no `unsafe`; the same arithmetic runs in `f32` on a microcontroller and in
//! `f64` on a host.
//!
//! # The model on one screen
//!
//! ```text
//! sample      s  = (v - R ω)/v                z = Fx/Fz                      sample::slip_friction
//! law         mu = 2 mup s / (sp (1 + (s/sp)²))                              law::Rudd
//! state       x  = (mup, sp)     constant: no prediction, no process noise   filter::mu_slip::State
//! Jacobian    H  = (∂mu/∂mup, ∂mu/∂sp)        at the prior state
//! noise       R  = (n σ)² + (∂²mu/∂mup∂sp)² P11 P22 + (½ ∂²mu/∂sp² P22)²
//! gain        K  = P Hᵀ / (H P Hᵀ + R)
//! update      x += K (z - mu(s; x)),  P = (I - K H) P                        filter::mu_slip::update
//! start       x0 at the high end of the range, P0 = diag(x0²)                filter::mu_slip::Range
//! ```
//!
//! After R. Rudd, "Estimating the Mu Slip Curve via Extended Kalman Filtering", The Mathematica Journal
//! 11 (2011). It assumes that slip is known without error, that friction noise is white, and that the
//! tyre follows the law; n > 1 (3 by default) is the allowance for what it is not. It fails quietly
//! where the slips measured never come near the peak: then `sp` and `mup` are one unknown, and the
//! correlation says so.
//!
//! # Symbols
//!
//! | symbol | quantity | unit | here |
//! |---|---|---|---|
//! | v | vehicle or drum surface speed | m/s | [`sample::RigSample::vehicle_speed_m_s`] |
//! | ω | wheel speed | rad/s | [`sample::RigSample::wheel_speed_rad_s`] |
//! | R (radius) | effective radius | m | argument of [`sample::slip_friction`] |
//! | Fx, Fz | drag and normal force | N | [`sample::RigSample`] |
//! | s | slip ratio: 0 rolling freely, 1 locked | - | [`sample::SlipFriction::slip_ratio`] |
//! | z, mu | friction measured, predicted | - | [`sample::SlipFriction::friction`], [`law::TyreLaw::friction`] |
//! | mup, sp | peak friction, slip at the peak | - | [`filter::mu_slip::State`] |
//! | x, P | state, its 2×2 covariance | - | [`filter::mu_slip::State`], [`filter::mu_slip::Covariance`] |
//! | H | measurement Jacobian, 1×2 | - | [`law::TyreLaw::gradient`] |
//! | σ, n | friction's standard deviation, its inflation | - | [`filter::FrictionMeasurement::friction_std`], [`filter::mu_slip::Config::noise_inflation`] |
//! | R | noise variance | - | [`filter::mu_slip::Fusion::noise_variance`] |
//! | H P Hᵀ | signal: variance of the prediction | - | [`filter::mu_slip::Fusion::signal_before`] |
//! | K | Kalman gain, 2×1 | - | [`filter::mu_slip::Fusion::peak_friction_gain`] |
//!
//! # Features
//!
//! Off by default; neither changes a number.
//!
//! - `defmt`: `defmt::Format` for configuration, state, results and errors.
//! - `serde`: `Serialize` and `Deserialize` for the same; laws are validated on the way in.
//!
//! # Example
//!
//! ```
//! use muslip::filter::mu_slip::{Config, Range};
//! use muslip::filter::{Estimator, FrictionMeasurement};
//! use muslip::sample::{RigSample, SampleLimits, slip_friction};
//!
//! let limits = SampleLimits::for_median_normal_force(4000.0_f32);
//! let mut filter = Config::for_range(Range::Automotive).build()?;
//!
//! // Slip rises from free rolling to well past the peak; 0.31 m radius, 20 m/s, 4 kN.
//! for step in 0..40_u8 {
//!     let slip = f32::from(step) * 0.01;
//!     let friction = 2.0 * 0.8 * slip / (0.14 * (1.0 + (slip / 0.14) * (slip / 0.14)));
//!     let sample = RigSample {
//!         wheel_speed_rad_s: 20.0 * (1.0 - slip) / 0.31,
//!         vehicle_speed_m_s: 20.0,
//!         drag_force_n: friction * 4000.0,
//!         normal_force_n: 4000.0,
//!     };
//!     let point = slip_friction(&sample, 0.31, &limits)?;
//!     filter.update(&FrictionMeasurement {
//!         slip_ratio: point.slip_ratio,
//!         friction: point.friction,
//!         friction_std: 0.02,
//!     })?;
//! }
//!
//! let peak = filter.peak();
//! assert!((peak.peak_friction - 0.8).abs() < 0.02);
//! assert!((peak.critical_slip - 0.14).abs() < 0.01);
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::indexing_slicing,
        clippy::float_cmp,
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        clippy::cast_precision_loss,
        clippy::cast_sign_loss
    )
)]

pub mod filter;
pub mod law;
#[cfg(feature = "nalgebra")]
mod matrix;
pub mod real;
pub mod sample;
