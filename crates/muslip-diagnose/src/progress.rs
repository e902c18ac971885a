//! How far a diagnosis has come.

/// Called with the share of the work done (0..=1, which never falls) and what is being done.
pub type Progress<'a> = &'a (dyn Fn(f64, &str) + Sync);
