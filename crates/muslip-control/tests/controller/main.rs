//! The controller from its samples to its valves: runs, interlocks, link and parameters.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failed step fails the test"
)]

mod bench;
mod guards;
mod interlocks;
mod link;
mod parameters;
mod rates;
mod runs;
