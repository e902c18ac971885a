//! The main job: a recording of a braked wheel goes in, the peak friction and the slip of the peak come
//! out, with their uncertainty and a verdict on whether to believe it.

mod consistency;
mod trace;

use std::io::{self, Write};

use muslip::filter::mu_slip::{Config, ConfigError, Estimate, Fusion, Range, UpdateError};
use muslip::filter::{Estimator, FrictionMeasurement, PeakEstimate};
use serde::Serialize;
use serde_json::json;

pub use consistency::{Consistency, ConsistencyTest, Verdict, mean_nis_band};
pub use trace::{TraceFormat, TraceRow, TraceWriter};

use crate::input_error::{InputError, InputProblem};
use crate::measure::{FrictionNoise, Skipped, Survey, for_each_measurement};
use crate::recording::Recording;
use crate::rig_file::RigFile;
use crate::thin::Thinned;

/// Measured points that are kept for a picture.
const PLOTTED_POINTS: usize = 2000;
/// Estimates that are kept for a picture: all of the first ones, where most happens, ...
const FIRST_STEPS: u64 = 60;
/// ... and an even selection of the later ones.
const PLOTTED_STEPS: usize = 500;

/// Which filter estimates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EstimatorKind {
    /// The two-state extended Kalman filter of Rudd's article: three times the measurement sigma, and
    /// pseudonoise.
    Article,
}

impl EstimatorKind {
    /// The estimator's word in the JSON.
    pub fn word(self) -> &'static str {
        match self {
            Self::Article => "article",
        }
    }
}

/// How to estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EstimateOptions {
    /// Which filter.
    pub estimator: EstimatorKind,
    /// Where it starts.
    pub range: Range,
}

/// One step of the estimate, kept for a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Number of used samples so far.
    pub sample: u64,
    /// The estimate after them.
    pub peak: PeakEstimate<f64>,
    /// Normalised innovation squared of the last of them.
    pub nis: f64,
}

/// What came out.
#[derive(Debug, Clone)]
pub struct EstimateResult {
    /// How it was estimated.
    pub options: EstimateOptions,
    /// The final estimate.
    pub peak: PeakEstimate<f64>,
    /// Samples that were used.
    pub used: u64,
    /// Samples that were not.
    pub skipped: Skipped,
    /// Where the measurement noise came from, and the smallest normal force.
    pub survey: Survey,
    /// Whether the filter was consistent.
    pub consistency: Consistency,
    /// An even selection of the measured points (slip, friction).
    pub points: Vec<(f64, f64)>,
    /// The first steps, an even selection of the later ones, and the last.
    pub steps: Vec<Step>,
}

/// Why there is no estimate.
#[derive(Debug, thiserror::Error)]
pub enum EstimateError {
    /// The recording is malformed, or has no usable sample.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The filter's configuration is unsound.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The filter refuses its own earlier state, which no sound filter does.
    #[error(transparent)]
    Filter(#[from] UpdateError),
    /// The trace could not be written.
    #[error(transparent)]
    Trace(#[from] io::Error),
}

/// Estimates the curve of one recording, in two streaming passes.
///
/// `trace` takes the estimate after every used sample. `progress` is told the bytes gone through, of
/// twice the recording's length.
///
/// # Errors
/// [`EstimateError::Input`] for a malformed recording or one without a usable sample,
/// [`EstimateError::Trace`] with what the trace's sink answers.
pub fn estimate<W: Write>(
    recording: &mut Recording,
    rig: &RigFile,
    options: EstimateOptions,
    trace: Option<&mut TraceWriter<W>>,
    progress: &mut dyn FnMut(u64),
) -> Result<EstimateResult, EstimateError> {
    let survey = Survey::of(recording, rig, progress)?;
    let length = recording.length_bytes();
    let mut progress = |bytes| progress(length + bytes);
    match options.estimator {
        EstimatorKind::Article => {
            let filter = Config::for_range(options.range).build()?;
            run(
                filter,
                recording,
                rig,
                options,
                survey,
                trace,
                &mut progress,
            )
        }
    }
}

fn run<F, W: Write>(
    mut filter: F,
    recording: &mut Recording,
    rig: &RigFile,
    options: EstimateOptions,
    survey: Survey,
    mut trace: Option<&mut TraceWriter<W>>,
    progress: &mut dyn FnMut(u64),
) -> Result<EstimateResult, EstimateError>
where
    F: Estimator<
            f64,
            Measurement = FrictionMeasurement<f64>,
            Fusion = Fusion<f64>,
            Estimate = Estimate<f64>,
            Error = UpdateError,
        >,
{
    let mut test = ConsistencyTest::default();
    let mut points = Thinned::new(PLOTTED_POINTS);
    let mut steps = Vec::new();
    let mut later_steps = Thinned::new(PLOTTED_STEPS);
    let mut last_step = None;
    let mut used = 0;
    let mut refused = 0;
    let mut skipped = for_each_measurement(
        recording,
        rig.wheel.radius_m,
        &survey.limits,
        progress,
        |measured| -> Result<(), EstimateError> {
            let before = filter.estimate();
            let outcome = filter.update(&FrictionMeasurement {
                slip_ratio: measured.point.slip_ratio,
                friction: measured.point.friction,
                friction_std: survey.noise.friction_std(measured.normal_force_n),
            });
            // A refused update leaves the filter as it was; the sample is counted and passed over. So is
            // one whose squared innovation overflows (a reading of 1e308, say): no figure made with it
            // would be one.
            let fusion = match outcome {
                Ok(fusion) if fusion.nis.is_finite() => fusion,
                _ => {
                    refused += 1;
                    return Ok(filter.restore(before)?);
                }
            };
            used += 1;
            test.add(fusion.innovation / fusion.innovation_variance.sqrt());
            points.offer(|| (measured.point.slip_ratio, measured.point.friction));
            let step = || Step {
                sample: used,
                peak: filter.peak(),
                nis: fusion.nis,
            };
            if used <= FIRST_STEPS {
                steps.push(step());
            } else {
                later_steps.offer(step);
            }
            last_step = Some(step());
            match &mut trace {
                Some(trace) => {
                    Ok(trace.row(&trace_row(measured.time_s, &fusion, &filter.estimate()))?)
                }
                None => Ok(()),
            }
        },
    )?;
    skipped.refused = refused;
    let Some(consistency) = test.outcome() else {
        let problem = InputProblem::NoUsableSample(skipped.in_words());
        return Err(InputError::whole_file(recording.path(), problem).into());
    };
    steps.extend(later_steps.into_items());
    if let Some(last) = last_step
        && steps.last() != Some(&last)
    {
        steps.push(last);
    }
    Ok(EstimateResult {
        options,
        peak: filter.peak(),
        used,
        skipped,
        survey,
        consistency,
        points: points.into_items(),
        steps,
    })
}

fn trace_row(time_s: f64, fusion: &Fusion<f64>, estimate: &Estimate<f64>) -> TraceRow {
    TraceRow {
        time_s,
        slip: fusion.slip_ratio,
        friction: fusion.measured_friction,
        peak_friction: estimate.state.peak_friction,
        critical_slip: estimate.state.critical_slip,
        p11: estimate.covariance.p00,
        p12: estimate.covariance.p01,
        p22: estimate.covariance.p11,
        innovation: fusion.innovation,
        noise_variance: fusion.noise_variance,
        signal_before: fusion.signal_before,
        signal_after: fusion.signal_after,
        nis: fusion.nis,
    }
}

impl EstimateResult {
    /// The result as the contract's JSON object, `muslip.estimate/1`, with a few fields more.
    pub fn to_json(&self) -> serde_json::Value {
        #[derive(Serialize)]
        struct Quantity {
            value: f64,
            std: f64,
        }
        let peak = self.peak;
        let noise = match self.survey.noise {
            FrictionNoise::Declared { drag_std_n } => {
                json!({"source": "declared", "drag_force_n": drag_std_n})
            }
            FrictionNoise::Estimated { friction_std } => {
                json!({"source": "estimated", "friction": friction_std})
            }
        };
        let c = self.consistency;
        json!({
            "schema": "muslip.estimate/1",
            "estimator": self.options.estimator.word(),
            "range": range_word(self.options.range),
            "peak_friction": Quantity { value: peak.peak_friction, std: peak.peak_friction_std },
            "critical_slip": Quantity { value: peak.critical_slip, std: peak.critical_slip_std },
            "correlation": peak.correlation,
            "samples": {
                "used": self.used,
                "skipped": self.skipped.total(),
                "skipped_not_finite": self.skipped.not_finite,
                "skipped_low_speed": self.skipped.low_speed,
                "skipped_low_normal_force": self.skipped.low_normal_force,
                "skipped_slip_out_of_range": self.skipped.slip_out_of_range,
                "skipped_refused": self.skipped.refused,
            },
            "noise": noise,
            "consistency": {
                "mean_nis": c.mean_nis,
                "nis_low": c.nis_low,
                "nis_high": c.nis_high,
                "whiteness_p": c.whiteness_p,
                "verdict": c.verdict.word(),
            },
        })
    }
}

/// The word for a range, as on the command line.
pub fn range_word(range: Range) -> &'static str {
    match range {
        Range::Aircraft => "aircraft",
        Range::Automotive => "automotive",
    }
}
