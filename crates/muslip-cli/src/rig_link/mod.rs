//! A rig's controller on a serial port or a socket: commands, telemetry, recordings as they happen.

mod model;
mod parameters;
mod port;
mod recorder;
mod session;

pub use model::Live;
pub use parameters::{compensated, parse_parameters, write_parameters};
pub use port::Port;
pub use recorder::Recorder;
pub use session::{RigError, Session};
