//! Sealed trials of `muslip diagnose`.
//!
//! `generate` writes campaigns of recordings in which effects are concealed, made by physics of its
//! own; `score` runs the tool on them as a user would, then opens the sealed truth and judges. The
//! crate depends on no other member of the workspace: it knows the tool by its files alone.
#![forbid(unsafe_code)]

mod bars;
mod baseline;
mod campaign;
mod cause;
mod chain;
#[cfg(test)]
mod checks;
mod contract;
mod draw;
mod effect;
mod estimate;
mod figures;
mod files;
mod form;
mod judge;
mod measure;
mod measured;
mod noise;
mod oracle;
mod pace;
mod pages;
mod plan;
mod process;
mod rig;
mod rivals;
mod score;
mod share;
mod sim;
mod strata;
mod table;
mod tally;
mod tool;
mod trial;
mod tyre;

pub use estimate::{Compensation, compensation};
pub use files::generate;
pub use score::{Report, ScoreRequest, score};
pub use strata::Request;
pub use tool::Tool;
pub use trial::{Trial, only_measured, trial};
