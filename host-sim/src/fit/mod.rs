//! The batch fit: the two-parameter law through all points at once, by Levenberg and Marquardt.

mod curve;

pub use curve::{Curve, CurveFit, FitError, fit_curve, robust_start};
