//! The files of a rig, for every program that reads its recordings: CSV recordings, the rig file, the model file
//! of a diagnosis, and outputs that are whole or absent.
//!
//! [`recording`] reads recordings (CSV, and by `muslip-formats` what other programs write) and writes them, [`map_file`] the map of channels, [`rig_file`] and [`model_file`] the two TOML files, [`load`] hands
//! recordings to `muslip_diagnose`, [`output`] writes files. What is wrong with an input is an
//! [`input_error::InputError`]: one line that names file, line and column.
//!
//! ```
//! use muslip_recordings::output::write_file;
//! use muslip_recordings::recording::{Channel, Required, Run};
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("run.csv");
//! write_file(
//!     &path,
//!     b"time_s,wheel_speed_rad_s,vehicle_speed_m_s,drag_force_n,normal_force_n\n\
//!       0,60,20,3100,4000\n",
//! )?;
//! let run = Run::read(&path, Required::DragIncluded)?;
//! assert_eq!(run.channel(Channel::DragForce), Some(&[3100.0][..]));
//!
//! write_file(&path, b"time_s,drag_force_n\n0,3100\n")?;
//! let told = Run::read(&path, Required::DragIncluded).unwrap_err().to_string();
//! assert!(told.ends_with("run.csv:1:1: required column wheel_speed_rad_s is missing"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

pub mod input_error;
pub mod load;
pub mod map_file;
pub mod model_file;
mod optional;
pub mod output;
pub mod recording;
pub mod rig_file;
pub mod toml_file;
