//! One pass of the article's filter over a stream.

use muslip::filter::mu_slip::{
    Config, ConfigError, Covariance, Estimate, Fusion, Range, UpdateError,
};
use muslip::filter::{Estimator, FrictionMeasurement};

use super::stream::{FRICTION_STD, POINTS, slips};

/// A pass that ended before the last point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PassError {
    /// The start is not one that the filter takes, such as a first pass that ended at a negative slip.
    #[error("the pass cannot start: {0}")]
    Start(#[from] ConfigError),
    /// An update was refused.
    #[error("an update was refused: {0}")]
    Update(#[from] UpdateError),
    /// The stream has no point.
    #[error("the stream has no point")]
    Empty,
}

/// What the filter holds after a point, and what that point did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// State and covariance after the update.
    pub estimate: Estimate<f64>,
    /// Innovation, noise, signal and gain of the update.
    pub fusion: Fusion<f64>,
}

/// Where a first pass starts.
pub fn first_start(range: Range) -> Estimate<f64> {
    Estimate {
        state: range.initial_state(),
        covariance: range.initial_covariance(),
    }
}

/// Where a second pass starts: at the state that the first ended with, by the rule of the first start,
/// each standard deviation as large as the state.
pub fn second_start(first: Estimate<f64>) -> Estimate<f64> {
    let state = first.state;
    Estimate {
        state,
        covariance: Covariance::from_std(state.peak_friction, state.critical_slip),
    }
}

/// Runs the article's filter over all points; `observe` sees every step.
///
/// # Errors
/// [`PassError`].
pub(super) fn run(
    start: Estimate<f64>,
    frictions: &[f64; POINTS],
    mut observe: impl FnMut(&Step),
) -> Result<Estimate<f64>, PassError> {
    let mut filter = Config {
        initial_state: start.state,
        initial_covariance: start.covariance,
        ..Config::default()
    }
    .build()?;
    for (slip_ratio, &friction) in slips().into_iter().zip(frictions) {
        let fusion = filter.update_reporting(&FrictionMeasurement {
            slip_ratio,
            friction,
            friction_std: FRICTION_STD,
        })?;
        let estimate = filter.estimate();
        observe(&Step { estimate, fusion });
    }
    Ok(filter.estimate())
}

/// Every step of a pass.
///
/// # Errors
/// [`PassError`].
pub fn traced(start: Estimate<f64>, frictions: &[f64; POINTS]) -> Result<Vec<Step>, PassError> {
    let mut steps = Vec::with_capacity(POINTS);
    run(start, frictions, |step| steps.push(*step))?;
    Ok(steps)
}

/// The state and covariance after a pass, without its steps.
///
/// # Errors
/// [`PassError`].
pub(super) fn finished(
    start: Estimate<f64>,
    frictions: &[f64; POINTS],
) -> Result<Estimate<f64>, PassError> {
    run(start, frictions, |_| {})
}
