//! What is asked of the recordings of a braked wheel, for a command, a notebook or a program of one's own.
//!
//! [`estimate`] follows the mu-slip curve through one recording, [`campaign`] holds the estimates of many beside each other,
//! [`measure`] says which rows count and how they err, [`channels`] lists what a file holds, [`fit`] puts the law through all
//! points at once, [`property_file`] writes it for simulations, [`records`] makes tables of results, [`diagnose`] finds what a
//! simulation left out and predicts the drag. Results are plain structures with their JSON and, in [`wording`], their
//! sentences; pages and plots of them are `muslip_report`'s. Feature `formats` (off): the files of other programs.
//!
//! ```
//! use std::fmt::Write as _;
//!
//! use muslip_analysis::estimate::{EstimateOptions, TraceWriter, estimate};
//! use muslip_analysis::fit::Curve;
//! use muslip_recordings::recording::Recording;
//! use muslip_recordings::rig_file::RigFile;
//!
//! let folder = tempfile::tempdir()?;
//! let rig = folder.path().join("rig.toml");
//! std::fs::write(
//!     &rig,
//!     "[wheel]\nradius_m = 0.31\ninertia_kg_m2 = 1.25\n[vehicle]\nmass_kg = 420.0\ncoasting = true\n\
//!      [tyre]\nlaw = \"rudd\"\npeak_friction = 0.85\ncritical_slip = 0.14\n",
//! )?;
//!
//! // A wheel at 20 m/s under 4000 N, braked past the peak of a known curve.
//! let truth = Curve { peak_friction: 0.9, critical_slip: 0.12 };
//! let mut rows = String::from("time_s,wheel_speed_rad_s,vehicle_speed_m_s,drag_force_n,normal_force_n\n");
//! for sample in 0..200 {
//!     let time_s = f64::from(sample) * 0.005;
//!     let slip = 0.3 * time_s;
//!     let wheel_speed_rad_s = (1.0 - slip) * 20.0 / 0.31;
//!     writeln!(rows, "{time_s},{wheel_speed_rad_s},20,{},4000", 4000.0 * truth.friction(slip))?;
//! }
//! let run = folder.path().join("run.csv");
//! std::fs::write(&run, rows)?;
//!
//! let options = EstimateOptions { estimator: None, range: None };
//! let no_trace = None::<&mut TraceWriter<Vec<u8>>>;
//! let mut recording = Recording::open(&run)?;
//! let result = estimate(&mut recording, &RigFile::read(&rig)?, options, None, no_trace, &mut |_| ())?;
//! assert!((result.peak.peak_friction - 0.9).abs() < 0.01);
//! assert!((result.peak.critical_slip - 0.12).abs() < 0.01);
//! assert_eq!(result.to_json()["schema"], "muslip.estimate/1");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

pub mod campaign;
pub mod channels;
pub mod diagnose;
pub mod estimate;
pub mod fit;
pub mod measure;
pub mod property_file;
pub mod records;
pub mod thin;
pub mod wording;
