//! `muslip diagnose` and `muslip predict`: files in, engine, files out.

pub mod effects;
pub mod files;
pub mod guide;
pub mod page;
pub mod plots;
mod proof;
pub mod summary;
pub mod views;
