//! `muslip diagnose` and `muslip predict`: files in, engine, files out.

pub mod effects;
pub mod guide;
pub mod job;
pub mod json;
pub mod page;
pub mod plots;
pub mod predict;
mod proof;
pub mod summary;
pub mod views;
pub mod wording;
