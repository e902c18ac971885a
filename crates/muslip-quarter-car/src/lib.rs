//! A braked quarter car: what it does, on which road, and how hard to brake it.
//!
//! For a controller that knows the brake torque and reads the wheel's speed, and perhaps more. A filter estimates wheel
//! speed, vehicle speed, slip, friction and mass; a bank of such filters tells which of a few roads it is; a PI
//! controller holds slip at a setpoint, which a seeker moves to the peak of the road; a guard opens the brake where
//! a locked wheel may be taken for standstill. Each part can be used without the others. The crate allocates nothing,
//! does not panic and holds no `unsafe`; the same arithmetic runs in `f32` on a microcontroller and in `f64` on a host.
//!
//! From wheel speed alone the road must be one of the bank's and the mass known: the worst simulated stops on dry asphalt
//! (mass off by up to 30 %) and on snow (already by up to 5 %) did not stop within 60 s (docs/quarter-car.md, Monte Carlo).
//! With the mass unknown, measure the vehicle's speed as well.
//!
//! # The model on one screen
//!
//! ```text
//! wheel      ω' = ω + Ts/J (R g μ m − sign(ω) Tb)                         filter
//! vehicle    v' = v − Ts g μ
//! slip       λ' = (v − R ω)/v
//! friction   μ' = c1 (1 − exp(−c2 λ)) − c3 λ, or μ' = μ                   filter::Road: known or unknown
//! mass       m' = m
//! predict    P' = F P Fᵀ + Q                                              filter::Filter::predict
//! update     K = P hᵀ/(h P hᵀ + r),  x + K y,  P − K (P hᵀ)ᵀ              filter::Filter::update
//! roads      w_j ∝ c_j exp(−NIS_j/2)/√s_j, c_j = Σ_i π_ij w_i             road_bank::RoadBank::step
//! torque     T = T_ff + B (J v/R) (λ* − λ) + I, within range and rate     slip_control::SlipController::step
//! setpoint   λ* = a share of the critical slip as estimated               peak_seeker::PeakSeeker::step
//! guard      a wheel that stands: open the brake, see whether it turns    lock_guard::LockGuard::step
//! ```
//!
//! Equations (28)-(39) of docs/model.md; how well it does: docs/quarter-car.md. Straight braking on a level road:
//! all that slows the vehicle is friction. At the peak of the curve wheel speed says nothing of vehicle speed, and on an
//! unknown road it never does; see [`filter`].
//!
//! # Symbols
//!
//! | symbol | quantity | unit | here |
//! |---|---|---|---|
//! | ω | wheel speed | rad/s | [`filter::State::wheel_speed_rad_s`] |
//! | v | vehicle speed | m/s | [`filter::State::vehicle_speed_m_s`] |
//! | λ | slip, a sample old; of now: [`filter::Filter::slip_ratio`] | - | [`filter::State::slip_ratio`] |
//! | μ | friction | - | [`filter::State::friction`] |
//! | m | quarter of the vehicle's mass | kg | [`filter::State::mass_kg`] |
//! | P, Q | covariance, process noise of a sample | products of units | [`filter::Covariance`], [`filter::Config::process_std`] |
//! | h, r | row of the measurement Jacobian, noise variance | of the channel | [`filter::Channel`], [`filter::Measurement::variance`] |
//! | R, J, g | radius, wheel inertia, gravity | m, kg m², m/s² | [`filter::Vehicle`] |
//! | Ts | sample time | s | [`filter::Config::sample_time_s`] |
//! | Tb, T | brake torque | N m | argument of [`filter::Filter::predict`], [`slip_control::Output::brake_torque_nm`] |
//! | T_ff | torque of the tyre as estimated | N m | [`filter::Filter::tyre_torque_nm`] |
//! | B, λ* | bandwidth, setpoint | rad/s, - | [`slip_control::Config`] |
//!
//! # Features
//!
//! Off by default; neither changes a number. Both turn on the same feature of `muslip` and `muslip-laws`.
//!
//! - `defmt`: `defmt::Format` for configuration, state, results and errors.
//! - `serde`: `Serialize` and `Deserialize` for the same.
//!
//! # Example
//!
//! `cargo run -p muslip-quarter-car --example slip_control` holds the slip of a simulated quarter car.
//!
//! ```
//! use muslip_laws::burckhardt::DRY_ASPHALT;
//! use muslip_quarter_car::filter::{Channel, Config, Measurement, Road, Vehicle};
//! use muslip_quarter_car::slip_control;
//!
//! let vehicle = Vehicle { radius_m: 0.3_f32, inertia_kg_m2: 1.0, gravity_m_s2: 9.81 };
//! let mut filter = Config::tuned(vehicle, Road::Known(DRY_ASPHALT.law()), 30.0).build()?;
//! let mut controller = slip_control::Config {
//!     setpoint_slip: 0.1,
//!     bandwidth_rad_s: 40.0,
//!     integral_time_s: 0.5,
//!     sample_time_s: 0.005,
//!     radius_m: 0.3,
//!     inertia_kg_m2: 1.0,
//!     maximum_torque_nm: 3000.0,
//!     maximum_torque_rate_nm_s: 30_000.0,
//!     minimum_vehicle_speed_m_s: 2.0,
//! }
//! .build()?;
//!
//! // Every 5 ms: the torque that acted, what was read, the torque to demand.
//! filter.predict(controller.brake_torque_nm())?;
//! filter.update(&Measurement { channel: Channel::WheelSpeed, value: 99.9, variance: 0.01 })?;
//! let output = controller.step(&slip_control::Input {
//!     slip_ratio: filter.slip_ratio(),
//!     vehicle_speed_m_s: filter.estimate().state.vehicle_speed_m_s,
//!     tyre_torque_nm: filter.tyre_torque_nm(),
//! })?;
//! assert!(output.brake_torque_nm > 0.0);
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

pub mod filter;
pub mod lock_guard;
pub mod peak_seeker;
pub mod road_bank;
pub mod slip_control;
