//! What `muslip diagnose` and `muslip predict` ask of recordings.

pub mod job;
pub mod json;
pub mod predict;
pub mod wording;
