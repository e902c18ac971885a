//! Peak friction and critical slip of a braked tyre, sample by sample, with their uncertainty. `no_std`.
//!
//! A braked wheel slips; the friction it passes on rises with slip to a peak and falls again. From
//! samples of wheel speed, vehicle speed, drag and normal force this crate estimates where that peak lies. It is for a
//! test rig or a brake controller that measures these four. It allocates nothing, does not panic and holds no
//! `unsafe`; the same arithmetic runs in `f32` on a microcontroller and in `f64` on a host.
//!
//! # What is in it
//!
//! | module | |
//! |---|---|
//! | [`sample`] | from four channels to one point (slip, friction), or why it is none |
//! | [`filter::efficient`] | the estimator to begin with: batch maximum likelihood in fixed memory; learns the noise's level, leaves out outliers, can forget |
//! | [`filter::mu_slip`] | the article's two-state extended Kalman filter: a third of the cycles on average and a bounded worst case, 60 bytes in `f32`; can start from a given covariance |
//! | [`filter`] | what both offer: [`filter::Estimator`], [`filter::FrictionMeasurement`], [`filter::PeakEstimate`] |
//! | [`law`] | the two-parameter law [`law::Rudd`], and the trait of every law |
//! | [`real`] | the scalar: `f32`, `f64`, a dual number in tests |
//!
//! After an error ([`sample::SampleError`]: no measurement; [`filter::mu_slip::UpdateError`]: a refused input) the estimate is as before.
//!
//! How well the estimators do, and what they cost: docs/estimators.md. In crates of their own: `muslip-laws`
//! (Burckhardt, Magic Formula), `muslip-quarter-car` (filter and slip control of a braked quarter car),
//! `muslip-compensate` (known distortions of the samples), `muslip-innovations` (says during a run that the model is
//! wrong).
//!
//! # The model on one screen
//!
//! ```text
//! sample      s  = (v - R ω)/v                z = Fx/Fz                      sample::slip_friction
//! law         mu = 2 mup s / (sp (1 + (s/sp)²)) = mup sech(ln s - ln sp)     law::Rudd
//!
//! efficient   x  = ln s - ln s0, sp = s0 e^δ                                 filter::efficient
//!             mu = mup sech x (1 + δ tanh x) + O(δ²)      a straight line in (mup, mup δ)
//!             five sums hold its least squares; 24 bins of slip let s0 follow sp
//!             noise's level, prior and outliers from the same sums
//!
//! mu_slip     x  = (mup, sp)     constant: no prediction, no process noise   filter::mu_slip::State
//!             H  = (∂mu/∂mup, ∂mu/∂sp)        at the prior state             law::TyreLaw::gradient
//!             R  = (n σ)² + (∂²mu/∂mup∂sp)² P11 P22 + (½ ∂²mu/∂sp² P22)²
//!             K  = P Hᵀ / (H P Hᵀ + R)
//!             x += K (z - mu(s; x)),  P = (I - K H) P                        filter::Estimator::update
//!             x0 at the high end of the range, P0 = diag(x0²)                filter::mu_slip::Range
//! ```
//!
//! The law and the two-state filter are R. Rudd's, "Estimating the Mu Slip Curve via Extended Kalman Filtering", The
//! Mathematica Journal 11 (2011). Both estimators assume that slip is known without error, that friction noise is
//! white, and that the tyre follows the law; n > 1 (3 by default) is the two-state filter's allowance for what it is
//! not, the efficient one learns its own. Both fail quietly where the slips measured never come near the peak: then
//! `sp` and `mup` are one unknown, and the correlation says so.
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
//! | mup, sp | peak friction, slip at the peak | - | [`filter::PeakEstimate`] |
//! | σ, n | friction's standard deviation, its inflation | - | [`filter::FrictionMeasurement::friction_std`], [`filter::mu_slip::Config::noise_inflation`] |
//! | x, P | state, its 2×2 covariance | - | [`filter::mu_slip::State`], [`filter::mu_slip::Covariance`] |
//! | H | measurement Jacobian, 1×2 | - | [`law::TyreLaw::gradient`] |
//! | R | noise variance | - | [`filter::mu_slip::Fusion::noise_variance`] |
//! | H P Hᵀ | signal: variance of the prediction | - | [`filter::mu_slip::Fusion::signal_before`] |
//! | K | Kalman gain, 2×1 | - | [`filter::mu_slip::Fusion::peak_friction_gain`] |
//!
//! # Features
//!
//! Off by default; none changes a number.
//!
//! - `defmt`: `defmt::Format` for configuration, state, results and errors.
//! - `nalgebra`: `From` and `TryFrom` between [`filter::mu_slip::State`] or [`filter::mu_slip::Covariance`] and
//!   vectors and matrices of `nalgebra`.
//! - `serde`: `Serialize` and `Deserialize` for the same as `defmt`; laws are validated on the way in.
//!
//! # Example
//!
//! `cargo run -p muslip --example rig` is a rig's whole loop.
//!
//! ```
//! use muslip::filter::mu_slip::{self, Range};
//! use muslip::filter::{Estimator, FrictionMeasurement, efficient};
//! use muslip::sample::{RigSample, SampleLimits, slip_friction};
//!
//! let limits = SampleLimits::for_median_normal_force(4000.0_f32);
//! let mut filter = efficient::Config::for_range(Range::Automotive).build()?;
//! // The article's filter beside it; either is enough.
//! let mut article = mu_slip::Config::for_range(Range::Automotive).build()?;
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
//!     let measurement = FrictionMeasurement {
//!         slip_ratio: point.slip_ratio,
//!         friction: point.friction,
//!         friction_std: 0.02,
//!     };
//!     filter.update(&measurement)?;
//!     article.update(&measurement)?;
//! }
//!
//! for peak in [filter.peak(), article.peak()] {
//!     assert!((peak.peak_friction - 0.8).abs() < 0.02);
//!     assert!((peak.critical_slip - 0.14).abs() < 0.01);
//! }
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

/// The README's example, tested with the others.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub mod filter;
pub mod law;
#[cfg(feature = "nalgebra")]
mod matrix;
pub mod real;
pub mod sample;
