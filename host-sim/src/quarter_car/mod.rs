//! The braked quarter car: plant, slip control loop, its comparison with the best stop there is.
//!
//! After P. Goddard's tutorial (docs/quarter-car.md). [`Scenario`] says what a stop starts from, a
//! [`Driver`] works the brake, [`stop`] runs it, [`optimum`] is what nobody can beat, and [`study`] puts all
//! drivers beside each other on all roads. The same options give the same figures on any number of threads.

mod car;
mod drivers;
mod observability;
mod optimum;
mod pages;
mod run;
mod scenario;
mod study;
mod tables;

pub use car::{Car, Truth};
pub use drivers::{
    Banked, Channels, Filtered, LockedWheel, NOMINAL, PerfectState, RigDriven, SETPOINT_SHARE,
    Setpoint, WHEEL_VARIANCE, controller, rolling_speed,
};
pub use observability::{Listener, Observability, WrongStart, listeners, table as observability};
pub use optimum::{Optimum, best_constant_slip, bound, optimum};
pub use pages::{NamedFigure, figures, markdown, report_page};
pub use run::{Belief, Driver, Readings, Sample, Stop, stop, traced};
pub use scenario::{
    Actuator, FaultKind, GRAVITY_M_S2, Road, SAMPLE_TIME_S, STEPS_A_SAMPLE, Scenario, SensorFault,
    SensorNoise,
};
pub use study::{
    BANK_MASS_STD_KG, LOCK_BAR_S, Ratios, Reference, Row, Study, StudyOptions, Who, draw, fault,
    study, work,
};

/// A filter, a controller or one of their steps that was refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SetupError {
    /// The filter's configuration.
    #[error(transparent)]
    Filter(#[from] muslip::filter::quarter_car::ConfigError),
    /// A step of the filter.
    #[error(transparent)]
    Step(#[from] muslip::filter::quarter_car::StepError),
    /// The setpoint's two-state filter.
    #[error(transparent)]
    Peak(#[from] muslip::filter::mu_slip::UpdateError),
    /// The seeker of the setpoint.
    #[error(transparent)]
    Seeker(#[from] muslip::control::peak_seeker::ConfigError),
    /// The controller.
    #[error(transparent)]
    Control(#[from] muslip::control::slip::ControlError),
}
