//! Locates and names what a simulation left out of a recording.
//!
//! A simulation of a braked wheel and recordings of it disagree. The engine says where (balance, channel, time,
//! operating region), what physics was left out (a mechanism of the [vocabulary](mechanism::Id), or the variable
//! that the rest depends on), repairs the model and proves it on data that no parameter and no choice saw.
//!
//! `diagnose::diagnose(&rig, runs, &|done, what| {})` takes a [`campaign::Rig`] and [`campaign::Run`]s (columns in s, rad/s, m/s,
//! N, N m or Pa) and gives an [`outcome::Diagnosis`]. It has no error: what cannot be judged is `undecided`, with its faults.
//!
//! The modules are the argument, in its order:
//!
//! | step | module |
//! | --- | --- |
//! | what is given | [`campaign`], `cleaning`, [`prepare`], `smooth`, [`series`], [`data`] |
//! | what is kept for the proof | `split` |
//! | the measuring chain | [`audit`], [`chain`] |
//! | the simulation and its balances | [`model`], [`mechanism`], [`number`] |
//! | residuals in level form, their covariance, innovations | `innovations`, `law_error` |
//! | candidates, finalists, what is named | `decide`, `looked`, `separating` |
//! | how large, and how sure | `figures`, [`diagnose`](mod@diagnose) |
//! | location | `locate`, `variable` |
//! | repair and proof | [`repaired`], [`correction`], `noise`, [`proof`] |
//! | result | [`diagnose`](mod@diagnose), [`outcome`], [`imbalance`] |
//!
//! It knows no file format and no terminal, and gives the same result whatever the number of threads.
#![forbid(unsafe_code)]
#![expect(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "`!(x > 0.0)` sends NaN the refusing way"
)]

pub mod audit;
mod balance;
pub mod campaign;
pub mod chain;
mod cleaning;
mod constants;
mod context;
pub mod correction;
pub mod data;
mod decide;
pub mod diagnose;
mod figures;
pub mod imbalance;
mod innovations;
mod law;
mod law_error;
mod locate;
mod looked;
pub mod mechanism;
pub mod model;
mod noise;
pub mod number;
pub mod outcome;
pub mod prepare;
pub mod progress;
pub mod proof;
pub mod repaired;
mod separating;
pub mod series;
mod slip;
mod smooth;
mod split;
mod turn;
mod variable;
