//! The command `muslip` behind [`main`], which ends a program that does nothing else:
//!
//! ```no_run
//! fn main() -> std::process::ExitCode {
//!     muslip_cli::main()
//! }
//! ```
//!
//! Whoever wants what the command does rather than its words takes `muslip_analysis` and `muslip_report`.
#![forbid(unsafe_code)]

mod cli;
mod demo;
mod rig_link;

pub use cli::main;
