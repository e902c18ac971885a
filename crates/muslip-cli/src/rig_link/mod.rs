//! A rig's controller on a serial port or a socket: commands, telemetry, recordings as they happen.

mod parameters;
mod port;
mod recorder;
mod session;

pub use parameters::{parse_parameters, write_parameters};
pub use port::Port;
pub use recorder::Recorder;
pub use session::{RigError, Session};
