//! Tyre laws beside the one that the filters of `muslip` believe in: Burckhardt's and the Magic Formula.
//!
//! For whoever has coefficients of such a law: to draw its curve, to find its peak, to simulate a tyre, or to give a
//! filter of `muslip-quarter-car` its road. Each is a [`TyreLaw`]: friction, its slope,
//! its first and second derivatives by the parameters, and its peak. The crate allocates nothing, does not panic and
//! holds no `unsafe`; the same arithmetic runs in `f32` and in `f64`.
//!
//! # The laws on one screen
//!
//! ```text
//! Burckhardt      mu = c1 (1 - exp(-c2 s)) - c3 s                     peak at s = ln(c1 c2/c3)/c2
//! Magic Formula   mu = D sin(C atan(B s - E (B s - atan(B s))))       peak D, where C atan(...) = π/2
//! ```
//!
//! Both are odd in slip. The Magic Formula has no shifts; D is friction, not force, and slip a ratio, not percent. B > 0,
//! 0 < C ≤ 2, D > 0, E ≤ 1, and of Burckhardt's c1, c2 > 0, c3 ≥ 0, c1 c2 > c3: else a `LawError`. A law that exists is a
//! usable one.
//!
//! # Symbols
//!
//! | symbol | quantity | unit | here |
//! |---|---|---|---|
//! | s | slip ratio: 0 rolling freely, 1 locked | - | argument of [`TyreLaw::friction`] |
//! | mu | friction | - | [`TyreLaw::friction`] |
//! | c1, c2, c3 | coefficients of M. Burckhardt, 1993 | - | [`Burckhardt::new`], published sets in [`burckhardt`] |
//! | B, C, D, E | factors of H. B. Pacejka, 2012 | - | [`MagicFormula::new`] |
//!
//! # Features
//!
//! Off by default; neither changes a number. Both turn on the same feature of `muslip`.
//!
//! - `defmt`: `defmt::Format` for laws.
//! - `serde`: `Serialize` and `Deserialize` for the same; laws are validated on the way in.
//!
//! # Example
//!
//! ```
//! use muslip::law::TyreLaw;
//! use muslip_laws::burckhardt::WET_ASPHALT;
//! use muslip_laws::{Burckhardt, MagicFormula};
//!
//! let wet: Burckhardt<f32> = WET_ASPHALT.law();
//! let peak = wet.peak();
//! assert!((peak.friction - 0.80).abs() < 0.01 && (peak.slip_ratio - 0.13).abs() < 0.01);
//!
//! let tyre = MagicFormula::new(10.0_f32, 1.9, 1.0, 0.97)?;
//! assert!(tyre.friction(0.05) < tyre.peak().friction);
//! assert!(MagicFormula::new(10.0_f32, 2.1, 1.0, 0.97).is_err());
//! # Ok::<(), muslip::law::LawError>(())
//! ```
//!
//! [`TyreLaw`]: muslip::law::TyreLaw
//! [`TyreLaw::friction`]: muslip::law::TyreLaw::friction
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::as_conversions, clippy::float_cmp, clippy::indexing_slicing)
)]

pub mod burckhardt;
mod magic_formula;

pub use burckhardt::Burckhardt;
pub use magic_formula::MagicFormula;
