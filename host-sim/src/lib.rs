//! The rig simulator: from a rig file and a brake programme to a recording, for tests, studies and whoever wants to
//! know what an estimator makes of a truth that it does not share.
//!
//! [`Scenario`] is one run: [`Plant`] moves wheel and vehicle, [`Brake`] presses, [`Sensors`] read. [`replay()`] puts
//! recorded inputs under a repaired model; [`Scenario::run_model`] makes a fresh run of one.
//!
//! ```
//! use host_sim::{RigLaw, Scenario};
//! use muslip_recordings::rig_file::RigFile;
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("rig.toml");
//! std::fs::write(
//!     &path,
//!     "[wheel]\nradius_m = 0.31\ninertia_kg_m2 = 1.25\n[vehicle]\nmass_kg = 420.0\ncoasting = true\n\
//!      [tyre]\nlaw = \"rudd\"\npeak_friction = 0.85\ncritical_slip = 0.14\n",
//! )?;
//! let law: RigLaw = "magic-formula:8,1.95,0.92,0".parse()?;
//! let scenario = Scenario::usual(RigFile::read(&path)?, Some(law))?;
//! let mut rows = 0;
//! scenario.run(|row| {
//!     assert_eq!(row.len(), scenario.channels().len());
//!     rows += 1;
//!     Ok(())
//! })?;
//! assert_eq!(rows, scenario.rows());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod brake;
mod law;
mod model_noise;
mod plant;
mod repaired;
mod replay;
mod scenario;
mod sensors;

pub use brake::{Brake, BrakeProgramme};
pub use law::{LawTextError, RigLaw};
pub use plant::{Contact, Plant, PlantEffect, PlantParameters, PlantState, STANDSTILL_M_S};
pub use repaired::ModelRunError;
pub use replay::{Replay, ReplayError, replay};
pub use scenario::{RunError, STANDARD_GRAVITY_M_S2, Scenario, ScenarioError};
pub use sensors::Sensors;
