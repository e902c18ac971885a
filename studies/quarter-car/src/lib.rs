//! The braked quarter car: plant, slip control loop, its comparison with the best stop there is.
//!
//! After P. Goddard's tutorial (docs/quarter-car.md). [`Scenario`] says what a stop starts from, a
//! [`Driver`] works the brake, [`stop`] runs it, [`optimum()`] is what nobody can beat, and [`study()`] puts all
//! drivers beside each other on all roads. The same options give the same figures on any number of threads.
//! `cargo run -p study-quarter-car --release` writes them all.
//!
//! ```
//! use study_quarter_car::{Filtered, Road, Scenario, optimum, stop};
//!
//! let scenario = Scenario::usual(Road::dry(), 31);
//! let mut driver = Filtered::tuned(&scenario)?;
//! let ratio = stop(&scenario, &mut driver).distance_m / optimum(&scenario).distance_m;
//! assert!((1.0..1.05).contains(&ratio));
//! # Ok::<(), study_quarter_car::SetupError>(())
//! ```
#![forbid(unsafe_code)]

mod banked;
mod car;
mod drivers;
mod error;
mod faults;
mod figures;
mod filtered;
mod observability;
mod optimum;
mod options;
mod pages;
mod rig_driven;
mod rows;
mod run;
mod scenario;
mod search;
mod study;
mod surface;
mod tables;
mod who;

pub use banked::Banked;
pub use car::{Car, Truth};
pub use drivers::{
    Channels, LockedWheel, NOMINAL, PerfectState, SETPOINT_SHARE, WHEEL_VARIANCE, controller,
    rolling_speed,
};
pub use error::SetupError;
pub use faults::fault;
pub use figures::{NamedFigure, figures};
pub use filtered::Filtered;
pub use observability::{Listener, Observability, WrongStart, listeners, table as observability};
pub use optimum::{Optimum, best_constant_slip, bound, optimum};
pub use options::StudyOptions;
pub use pages::{markdown, report_page};
pub use rig_driven::{RigDriven, Setpoint};
pub use rows::{LOCK_BAR_S, Ratios, Row};
pub use run::{Belief, Driver, Readings, Sample, Stop, stop, traced};
pub use scenario::{
    Actuator, FOREIGN_RELAXATION_M, FaultKind, GRAVITY_M_S2, Road, SAMPLE_TIME_S, STEPS_A_SAMPLE,
    Scenario, SensorFault, SensorNoise,
};
pub use study::{Reference, Study, draw, study, work};
pub use surface::Surface;
pub use who::{BANK_MASS_STD_KG, Who};
