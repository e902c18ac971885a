//! Rig simulator, recordings and reports behind the `muslip` command.
#![forbid(unsafe_code)]

pub mod campaign;
pub mod cli;
pub mod demo;
pub mod diagnose;
pub mod report;
pub mod rig_link;
pub mod simulate;
pub mod text;
