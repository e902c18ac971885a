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
//! # Ways to update
//!
//! | method of [`MuSlipFilter`] | takes | tells |
//! |---|---|---|
//! | [`update`](crate::filter::Estimator::update) | a friction at a slip | accepted or rejected |
//! | [`update_reporting`](crate::filter::Estimator::update_reporting) | the same | [`Fusion`]: innovation, noise, gain |
//! | [`update_expecting`](MuSlipFilter::update_expecting) | a reading of something made of the law, as the crate `muslip-compensate` predicts it | [`Fusion`] |
//!
//! All refuse the same with the same [`UpdateError`] and leave the estimate as it was; the first equals the second but
//! for rounding. What they cost on a Cortex-M4F, modelled cycles at opt-level 3 by `cargo xtask cycles`
//! (docs/estimators.md):
//!
//! | | cycles |
//! |---|---|
//! | the arithmetic alone | 91 |
//! | `update`: all checks | 117 |
//! | `update_reporting`: all checks and the report | 249 |
//!
//! | of which, check of `update` | how | instructions |
//! |---|---|---|
//! | noise is a positive number, and the configuration is the article's | inflated standard deviation above one limit | 7, the inflation and its square among them |
//! | inputs, state and innovation's variance are finite | their sum less itself is no NaN | 4 |
//! | innovation's variance and P11' are positive | their product above the smallest | 5 |
//! | P' is positive definite, with its margin for rounding | P12'² against P11' P22' | 8 |
//!
//! The prior is not checked at an update: [`Config::build`], [`restore`](crate::filter::Estimator::restore) and the
//! update before have.
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
pub use update::{Fusion, update_reporting, update_unchecked};
