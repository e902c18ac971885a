//! One curve through the usable samples of one or several recordings.

use std::path::PathBuf;

use muslip_recordings::input_error::{InputError, InputProblem};
use muslip_recordings::recording::Recording;
use muslip_recordings::rig_file::RigFile;
use serde_json::json;

use super::curve::{CurveFit, FitError, fit_curve, robust_start};
use crate::measure::{Skipped, Survey, for_each_measurement, median};

/// Iterations that are allowed unless the user says otherwise.
pub const DEFAULT_MAXIMUM_ITERATIONS: usize = 100;

/// Friction beyond which sums of squares could overflow: a reading of 1e308, not a tyre.
const LARGEST_FRICTION: f64 = 1e100;

/// Correlation of neighbouring residuals from which independence is not believed.
const NOTABLE_CORRELATION: f64 = 0.2;

/// What one recording contributed.
#[derive(Debug, Clone, PartialEq)]
pub struct RunFit {
    /// The file as the user named it.
    pub path: PathBuf,
    /// Samples that were used.
    pub used: u64,
    /// Samples that were not.
    pub skipped: Skipped,
    /// Root mean square of this recording's residuals about the common curve.
    pub rmse_friction: f64,
}

/// What came out.
#[derive(Debug, Clone, PartialEq)]
pub struct FitResult {
    /// The curve through all samples.
    pub fit: CurveFit,
    /// What each recording contributed.
    pub runs: Vec<RunFit>,
    /// Correlation of each residual with the next one in its recording.
    pub residual_correlation: f64,
    /// Slips of the samples used, in file order.
    pub slips: Vec<f64>,
    /// Frictions of the samples used.
    pub frictions: Vec<f64>,
    /// Smallest, median and largest normal force of the samples used, in N.
    pub normal_force_n: [f64; 3],
}

/// Why there is no fit.
#[derive(Debug, thiserror::Error)]
pub enum FitJobError {
    /// A recording is malformed, or all together do not hold a curve.
    #[error(transparent)]
    Input(#[from] InputError),
}

/// Fits one curve to several recordings together. `progress` receives the bytes read so far, of twice
/// the recordings' length.
///
/// # Errors
/// [`FitJobError::Input`] for a malformed recording, or for the first one where all together have too
/// few usable samples or do not determine the curve.
pub fn fit_recordings(
    recordings: &mut [Recording],
    rig: &RigFile,
    maximum_iterations: usize,
    progress: &mut dyn FnMut(u64),
) -> Result<FitResult, FitJobError> {
    let (mut slips, mut frictions, mut loads) = (Vec::new(), Vec::new(), Vec::new());
    let mut runs = Vec::new();
    let mut done = 0;
    for recording in recordings.iter_mut() {
        let survey = Survey::of(recording, rig, &mut |bytes| progress(done + bytes))?;
        done += recording.length_bytes();
        let first = slips.len();
        let mut refused = 0;
        let mut skipped = for_each_measurement(
            recording,
            rig.wheel.radius_m,
            &survey.limits,
            &mut |bytes| progress(done + bytes),
            |measured| -> Result<(), InputError> {
                if measured.point.friction.abs() > LARGEST_FRICTION {
                    refused += 1;
                    return Ok(());
                }
                slips.push(measured.point.slip_ratio);
                frictions.push(measured.point.friction);
                loads.push(measured.normal_force_n);
                Ok(())
            },
        )?;
        skipped.refused = refused;
        done += recording.length_bytes();
        runs.push(RunFit {
            path: recording.path().to_owned(),
            used: (slips.len() - first) as u64,
            skipped,
            rmse_friction: 0.0,
        });
    }
    let start = robust_start(&slips, &frictions);
    let fit = fit_curve(&slips, &frictions, start, maximum_iterations)
        .map_err(|error| no_fit(error, &runs))?;
    let residual_correlation = compare(&mut runs, &fit, &slips, &frictions);
    Ok(FitResult {
        fit,
        runs,
        residual_correlation,
        slips,
        frictions,
        normal_force_n: spread(&mut loads),
    })
}

/// Smallest, median and largest.
fn spread(values: &mut [f64]) -> [f64; 3] {
    let [low, high] = values
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &value| {
            [low.min(value), high.max(value)]
        });
    [low, median(values).unwrap_or(f64::NAN), high]
}

fn no_fit(error: FitError, runs: &[RunFit]) -> InputError {
    let mut skipped = Skipped::default();
    runs.iter().for_each(|run| skipped.add(&run.skipped));
    let reasons = skipped.in_words();
    let problem = if reasons.is_empty() {
        InputProblem::NoCurve(error.to_string())
    } else {
        InputProblem::NoCurve(format!("{error} (skipped: {reasons})"))
    };
    let path = runs
        .first()
        .map_or_else(PathBuf::new, |run| run.path.clone());
    InputError::whole_file(&path, problem)
}

/// Fills in each run's rmse and returns the correlation of neighbouring residuals within runs.
fn compare(runs: &mut [RunFit], fit: &CurveFit, slips: &[f64], frictions: &[f64]) -> f64 {
    let residuals: Vec<f64> = slips
        .iter()
        .zip(frictions)
        .map(|(&slip, &friction)| friction - fit.curve.friction(slip))
        .collect();
    let (mut power, mut product) = (0.0, 0.0);
    let mut rest = residuals.as_slice();
    for run in runs {
        let (of_run, later) = rest.split_at(rest.len().min(run.used as usize));
        rest = later;
        let sum: f64 = of_run.iter().map(|residual| residual * residual).sum();
        run.rmse_friction = (sum / of_run.len().max(1) as f64).sqrt();
        power += sum;
        product += of_run.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>();
    }
    if power > 0.0 {
        (product / power).clamp(-1.0, 1.0)
    } else {
        0.0
    }
}

impl FitResult {
    /// Samples used, of all recordings.
    pub fn used(&self) -> u64 {
        self.runs.iter().map(|run| run.used).sum()
    }

    /// Samples skipped, of all recordings.
    pub fn skipped(&self) -> Skipped {
        let mut skipped = Skipped::default();
        self.runs.iter().for_each(|run| skipped.add(&run.skipped));
        skipped
    }

    /// Factor by which the 1-sigma values are too small because neighbouring residuals are correlated, if that is
    /// worth a word: sqrt((1 + r)/(1 - r)), the effective number of samples of a first-order
    /// autoregression.
    pub fn understatement(&self) -> Option<f64> {
        let r = self.residual_correlation.min(0.9999);
        (r > NOTABLE_CORRELATION).then(|| ((1.0 + r) / (1.0 - r)).sqrt())
    }

    /// The result as the contract's JSON object, `muslip.fit/1`, with a few fields more.
    pub fn to_json(&self) -> serde_json::Value {
        let fit = &self.fit;
        let runs: Vec<_> = self
            .runs
            .iter()
            .map(|run| {
                json!({
                    "path": run.path.to_string_lossy(),
                    "used": run.used,
                    "skipped": run.skipped.total(),
                    "rmse_friction": run.rmse_friction,
                })
            })
            .collect();
        json!({
            "schema": "muslip.fit/1",
            "peak_friction": {"value": fit.curve.peak_friction, "std": fit.peak_friction_std()},
            "critical_slip": {"value": fit.curve.critical_slip, "std": fit.critical_slip_std()},
            "correlation": fit.correlation(),
            "iterations": fit.iterations,
            "converged": fit.converged,
            "rmse_friction": fit.rmse_friction,
            "residual_correlation": self.residual_correlation,
            "samples": {"used": self.used(), "skipped": self.skipped().total()},
            "recordings": runs,
        })
    }
}
