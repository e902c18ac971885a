//! Live innovations of a braked wheel's balances: says during a run that its model is wrong. `no_std`.
//!
//! A rig believes in a tyre law (the two-parameter one, `muslip::law::Rudd`), a wheel inertia, a mass. Each makes a balance of what is read, and what a balance leaves
//! is noise with a memory. A Kalman filter whose states are the parts of that noise turns what is left into
//! innovations: independent and of variance 1 as long as the model is right. Their mean square and their dependence on
//! the one before then say, with a stated rate of false alarms, that it is not, and of which balance. The crate allocates
//! nothing, does not panic, lets no NaN out and holds no `unsafe`; the same arithmetic runs in `f32` on a
//! microcontroller and in `f64` on a host.
//!
//! # All of it on one screen
//!
//! ```text
//! reading   ω, v, F, N, T at an instant, each may be missing                      reading::Reading
//! tyre      e = F − N mu(s)               the law at the slip that speeds and drag agree on
//! wheel     z = J ω − ∫(R F − T) dt       in integrated form: nothing is differentiated
//! vehicle   z = m v + ∫F dt
//! noise     Σ parts: Ornstein-Uhlenbeck times a gain, constants of a run, a walk,
//!           both integrated into the walk                                        whitener::Kind
//! filter    y = z − h x,  s = h P hᵀ + r,  ν = y/√s;  P = U D Uᵀ                  whitener::Whitener
//! evidence  Σ ν²/n against χ², Σ ν ν₋₁/n against its quantile, window by window   detection
//!           fast: each ν, 256 a window; slow: sums over 32, 64 a window
//! verdict   NotFormed, Consistent, Inconsistent { balance, band }                monitor::Verdict
//! settings  rig, law, noise of the sensors, what the right model may leave out    settings::Settings
//! ```
//!
//! Equations: docs/model.md (74) to (77); why it is so: docs/design/0011-live-innovations.md. [`whitener`] can be used
//! alone, for any residual whose noise is such a sum.
//!
//! # Which parts
//!
//! Those of the diagnosis of recordings (`muslip-diagnose`), because all of them fit into the controller's time and
//! each that is left out becomes a false alarm. Four things differ, for the sake of a run without an end:
//!
//! | there | here | why |
//! |---|---|---|
//! | a run's scale and zero of a rate enter the level by integrals that grow | enter the rate, and are integrated with it | `f32` would lose its digits to the integrals; the innovations are the same |
//! | the level is z | the level is counted from its last reading | likewise: only a step's integral and the difference of two readings are added |
//! | smoothed speeds: their noise in the slip remembers | speeds as read: white, and a part that remembers | there is no time to smooth |
//! | sizes of the noise are fitted | are given, the largest plausible ones where not known | a size fitted to a wrong model hides it |
//!
//! | balance | white | states |
//! |---|---|---|
//! | tyre, 8 | drag, load, speeds by the law's slope | friction quick and slow; wheel speed, vehicle speed, drag coloured; of the run friction, zero, slip |
//! | wheel, 8 | wheel speed | walk; wheel speed coloured; drag coloured, torque quick, slow, drifting, the brake's scale and the zero of the run, all integrated |
//! | vehicle, 8 | vehicle speed | walk; vehicle speed coloured; drag coloured, force quick, slow, drifting, the drag's scale and the zero of the run, all integrated |
//!
//! # When a balance is formed
//!
//! | case | what happens |
//! |---|---|
//! | a reading is `None` | time passes; balances that need it are not formed at this sample |
//! | drag or torque is `None`, or a step longer than a gap | what is integrated over it is unknown: the next reading of the level only says where it is |
//! | a speed is `None` | the integral goes on; the next reading is held against it |
//! | the wheel is slower than its minimum (locked) | no tyre, no wheel; the wheel's level is found anew |
//! | the vehicle is slower than its minimum | none |
//! | an innovation beyond the gate | told, not fused, counted as evidence by the gate; ten in a row: the level is found anew |
//! | a reading that is not finite, a step that is not forward | an error; all is what it was |
//!
//! # How often it is wrong
//!
//! A window is inconsistent with [`Detection::false_alarm_probability`](detection::Detection::false_alarm_probability)
//! at most, under the right model with noise of the stated sizes; 1e-6 unless said otherwise, or one false alarm in 21
//! hours or more of all balances formed at 1 kHz. Over simulated stops, with the probability raised so that there is something to
//! count, alarms are as many as stated (`cargo test -p muslip-innovations --test verdicts -- --nocapture` prints them).
//! There a mass off by a tenth is told within two slow windows (4.1 s), a grade of 5 % within a second, friction or
//! brake torque off by a tenth within two fast ones (0.52 s), each of the right balance in all of 20 runs. What the
//! stated noise allows for is not told: with the usual sizes friction lower by 4 % and a mass off by 7 % are still told in
//! all of 20 runs, 2 % and 3 % in none.
//!
//! # Cost
//!
//! One sample of all three balances takes a tenth of the 168,000 cycles that a Cortex-M4F has between samples at 1 kHz, at its
//! worst: `cargo xtask cycles`, docs/estimators.md. `cargo xtask test` fails above 12 % (`.ci/budgets.toml`). 2 kB of
//! state in `f32`, as much stack for the copy that a refused step is rolled back to. The image has no double precision
//! and no call that could panic.
//!
//! # Example
//!
//! `cargo run -p muslip-innovations --example live` runs a whole stop in which the road turns wet.
//!
//! ```
//! use muslip::law::Rudd;
//! use muslip::sample::RigSample;
//! use muslip_innovations::monitor::Verdict;
//! use muslip_innovations::reading::Reading;
//! use muslip_innovations::settings::{Rig, Sensors, Settings};
//!
//! let rig = Rig {
//!     effective_radius_m: 0.31_f32,
//!     wheel_inertia_kg_m2: 1.2,
//!     vehicle_mass_kg: Some(400.0),
//! };
//! // Peak friction at critical slip; noise of wheel speed, vehicle speed, drag, load, torque; the largest drag.
//! let law = Rudd::new(0.9, 0.12)?;
//! let sensors = Sensors::white(0.05, 0.02, 20.0, 15.0, 5.0);
//! let mut monitor = Settings::usual(rig, law, sensors, 3600.0).build()?;
//!
//! // Rolling freely, every millisecond; no brake torque is measured.
//! let sample = RigSample {
//!     wheel_speed_rad_s: 20.0 / 0.31,
//!     vehicle_speed_m_s: 20.0,
//!     drag_force_n: 0.0,
//!     normal_force_n: 4000.0,
//! };
//! for _ in 0..255 {
//!     let told = monitor.step(0.001, &Reading::new(&sample, None))?;
//!     assert!(told.tyre.is_some() && told.wheel.is_none());
//! }
//! assert_eq!(monitor.verdict(), Verdict::NotFormed);
//! monitor.step(0.001, &Reading::new(&sample, None))?;
//! assert_eq!(monitor.verdict(), Verdict::Consistent);
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::as_conversions, clippy::float_cmp, clippy::indexing_slicing)
)]

pub mod detection;
mod level;
pub mod monitor;
pub mod reading;
pub mod settings;
mod tyre;
pub mod whitener;
