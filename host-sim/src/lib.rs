//! Rig simulator, recordings and reports behind the `muslip` command.
#![forbid(unsafe_code)]

pub mod fit;
pub mod input_error;
pub mod output;
pub mod recording;
pub mod rig_file;
pub mod simulate;
