//! The measuring chain: what is known of it is taken off the recordings before any physics is asked for.

pub mod coast;
pub mod correct;
pub mod held;
pub mod recorded;
pub mod timing;
pub mod untold;
