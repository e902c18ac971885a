//! The two-state extended Kalman filter of the mu-slip curve.
//!
//! Source: R. Rudd, "Estimating the Mu Slip Curve via Extended Kalman Filtering", The Mathematica
//! Journal 11 (2011). The state x = (mup, sp) is constant, so there is no prediction step and no
//! process noise; each measurement is a friction z at a known slip s.
//!
//! ```text
//! mu(s; x) = 2 mup s / (sp (1 + (s/sp)²))          the law, see law::Rudd
//! H  = (∂mu/∂mup, ∂mu/∂sp)                         at the prior state
//! R  = (n σ)² + (∂²mu/∂mup∂sp)² P11 P22 + (½ ∂²mu/∂sp² P22)²
//! K  = P Hᵀ / (H P Hᵀ + R)
//! x  ← x + K (z - mu(s; x))
//! P  ← (I - K H) P
//! ```
//!
//! n is the inflation of the measurement's standard deviation σ (3 by default). The other two terms of R
//! are the second-order pseudonoise: the squares of the second-order Taylor terms of mu, each taken with
//! the standard deviations of P's diagonal (and a correlation of 1 for the cross term; the mup-mup term
//! is zero). They keep the filter from trusting a linearisation that its own uncertainty exceeds.
//!
//! Five ways in: [`update_unchecked`] (leanest, one division), [`update`] (the same checked, two divisions), [`update_reporting`]
//! (the same with innovation, noise and gain), [`update_expecting`] (for a measurement that reads
//! something made of the law, as the crate `muslip-compensate` does), and [`MuSlipFilter`], which adds
//! configuration, an optional gate and the [`Estimator`](crate::filter::Estimator) trait.
//!
//! The filter does not hold the state to positive values, as the article's does not: one bad
//! measurement may carry it through zero and later ones bring it back. [`State::is_physical`] tells.

mod config;
mod error;
mod filter;
mod state;
mod update;

pub use config::{Config, CovarianceForm, Range};
pub use error::{ConfigError, ConfigParameter, Input, UpdateError};
pub use filter::MuSlipFilter;
pub use state::{Covariance, Estimate, NotSymmetric, State};
pub use update::{Fusion, update, update_expecting, update_reporting, update_unchecked};
