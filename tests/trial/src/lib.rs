//! Sealed trials of `muslip diagnose`.
//!
//! `generate` writes campaigns of recordings in which effects are concealed, made by physics of its
//! own; `score` runs the tool on them as a user would, then opens the sealed truth and judges. The
//! crate depends on no other member of the workspace: it knows the tool by its files alone.
#![forbid(unsafe_code)]

mod baseline;
mod contract;
mod draw;
mod estimate;
mod generate;
mod judge;
mod process;
mod real;
mod report;
mod setup;
mod share;
mod table;
mod tool;

pub use estimate::{Compensation, compensation};
pub use generate::files::generate;
pub use generate::strata::Request;
pub use judge::score::{Report, ScoreRequest, score};
pub use real::Study;
pub use report::pace::pace;
pub use report::trial::{only_measured, trial};
pub use setup::Trial;
pub use tool::Tool;
