//! The batch fit: the two-parameter law through all points at once, by Levenberg and Marquardt.

mod curve;
mod job;

pub use curve::{Curve, CurveFit, FitError, fit_curve, robust_start};
pub use job::{DEFAULT_MAXIMUM_ITERATIONS, FitJobError, FitResult, RunFit, fit_recordings};
