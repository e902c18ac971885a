//! Processor in the loop: the firmware's image in QEMU, in lock-step with the rig simulator.
//!
//! ```text
//! rig simulator -- RawSample --> target: image in QEMU and the same controller natively
//!       ^------- BrakeOutput -------|   <- commands / telemetry ->   host
//! ```
//!
//! Every sample of both targets is compared: outputs, telemetry, estimates, bit for bit.
#![forbid(unsafe_code)]

pub mod bench;
pub mod host;
pub mod log;
pub mod native;
pub mod qemu;
pub mod rig;
pub mod scenarios;
pub mod serve;
pub mod target;
