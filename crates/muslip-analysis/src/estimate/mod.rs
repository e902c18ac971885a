//! The main job: a recording of a braked wheel goes in, the peak friction and the slip of the peak come
//! out, with their uncertainty and a verdict on whether to believe it.

mod consistency;
mod model;
mod record;
mod trace;

use std::io;

use muslip::filter::efficient::{self, EfficientFilter};
use muslip::filter::mu_slip::{Config, ConfigError, Estimate, Fusion, MuSlipFilter, Range, State};
use muslip::filter::{Decision, Estimator, FrictionMeasurement, PeakEstimate};
use muslip::law::Expansion;
use muslip::sample::slip_friction;
use muslip_compensate::{Compensated, NoMeasurement};
use muslip_diagnose::repaired::Repaired;
use muslip_recordings::input_error::{InputError, InputProblem};
use muslip_recordings::recording::{Recording, Row};
use muslip_recordings::rig_file::RigFile;
use serde::Serialize;
use serde_json::json;

pub use consistency::{Consistency, ConsistencyTest, Verdict, mean_nis_band};
pub use model::{ModelUse, ModelledMechanism, Operation};
pub use record::{Frame, Record, Sample, Update};
pub use trace::{TraceFormat, TraceRow, TraceSink, TraceWriter};

use crate::measure::{FrictionNoise, Skipped, Survey, for_each_row};
use record::Recorder;

/// Which filter estimates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EstimatorKind {
    /// The two-state extended Kalman filter of Rudd's article: three times the measurement sigma, and
    /// pseudonoise.
    Article,
    /// The efficient one: as accurate as a batch fit by maximum likelihood, with the noise learnt.
    Efficient,
}

impl EstimatorKind {
    /// The estimator's word in the JSON.
    pub fn word(self) -> &'static str {
        match self {
            Self::Article => "article",
            Self::Efficient => "efficient",
        }
    }
}

/// How to estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EstimateOptions {
    /// Which filter; `None`: the efficient one, or the article's where a model is compensated that the
    /// efficient one cannot stand behind (a low-pass filter on the force).
    pub estimator: Option<EstimatorKind>,
    /// Range of tyres that it starts from; `None`: for the efficient estimator that of the recording
    /// ([`Survey::range`]), for the article's filter the article's.
    pub range: Option<Range>,
}

/// What came out.
#[derive(Debug, Clone)]
pub struct EstimateResult {
    /// How it was to be estimated.
    pub options: EstimateOptions,
    /// Which filter estimated.
    pub estimator: EstimatorKind,
    /// Range of tyres that it started from.
    pub range: Range,
    /// The final estimate.
    pub peak: PeakEstimate<f64>,
    /// Samples that were used.
    pub used: u64,
    /// Samples that were not.
    pub skipped: Skipped,
    /// What of a model was compensated, where one was given.
    pub model: Option<ModelUse>,
    /// Where the measurement noise came from, and the smallest normal force.
    pub survey: Survey,
    /// Whether the filter was consistent.
    pub consistency: Consistency,
    /// What is kept of the run for pictures.
    pub record: Record,
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
    /// The same of the efficient estimator.
    #[error(transparent)]
    EfficientConfig(#[from] efficient::ConfigError),
    /// The model's parameters cannot be compensated.
    #[error("the model cannot be compensated: {0}")]
    Model(String),
    /// The trace could not be written.
    #[error(transparent)]
    Trace(#[from] io::Error),
}

/// Estimates the curve of one recording, in two streaming passes.
///
/// `model` is what a diagnosis found: of its mechanisms those are compensated that can be, sample by
/// sample, and where the rig file declares no drag noise the model's counts. `trace` takes the estimate
/// after every used sample. `progress` receives the bytes read so far, of twice the recording's length.
///
/// # Errors
/// [`EstimateError::Input`] for a malformed recording or one without a usable sample,
/// [`EstimateError::Model`] for a model that cannot be compensated, [`EstimateError::Trace`] with what the
/// trace's sink answers.
pub fn estimate<S: TraceSink>(
    recording: &mut Recording,
    rig: &RigFile,
    options: EstimateOptions,
    model: Option<&Repaired>,
    trace: Option<&mut S>,
    progress: &mut dyn FnMut(u64),
) -> Result<EstimateResult, EstimateError> {
    let mut survey = Survey::of(recording, rig, progress)?;
    let length = recording.length_bytes();
    let mut progress = |bytes| progress(length + bytes);
    let radius_m = rig.wheel.radius_m;
    let model =
        model.map(|model| ModelUse::of(model, &recording.path().to_string_lossy(), &survey));
    let mut front = Front {
        radius_m,
        compensator: None,
        last_time_s: f64::NAN,
        skipped: Skipped::default(),
    };
    if let Some(used) = &model {
        let (drag_std_n, share_of_drag) = used.noise;
        if matches!(survey.noise, FrictionNoise::Estimated { .. }) && drag_std_n > 0.0 {
            survey.noise = FrictionNoise::Modelled {
                drag_std_n,
                share_of_drag,
            };
        }
        let compensator = model::compensator(used, radius_m, &survey);
        front.compensator = Some(compensator.map_err(EstimateError::Model)?);
    }
    let filtered = model.as_ref().is_some_and(ModelUse::filters_force);
    let kind = match options.estimator {
        Some(EstimatorKind::Efficient) if filtered => {
            return Err(EstimateError::Model(
                "the efficient estimator does not stand behind a low-pass filter on the force; use --estimator article".to_owned(),
            ));
        }
        Some(kind) => kind,
        None if filtered => EstimatorKind::Article,
        None => EstimatorKind::Efficient,
    };
    // The article's filter starts where the article does unless it is told otherwise.
    let found = match kind {
        EstimatorKind::Article => Range::default(),
        EstimatorKind::Efficient => survey.range,
    };
    let range = options.range.unwrap_or(found);
    let filter = match kind {
        EstimatorKind::Article => Filter::Article(Config::for_range(range).build()?),
        EstimatorKind::Efficient => Filter::Efficient(efficient::Config::for_range(range).build()?),
    };
    let run = run(filter, front, recording, &survey, trace, &mut progress)?;
    Ok(EstimateResult {
        options,
        estimator: kind,
        range,
        peak: run.peak,
        used: run.used,
        skipped: run.skipped,
        model,
        survey,
        consistency: run.consistency,
        record: run.record,
    })
}

/// One of the filters.
#[derive(Debug, Clone, Copy)]
#[expect(clippy::large_enum_variant, reason = "one of it in a run")]
enum Filter {
    Article(MuSlipFilter<f64>),
    Efficient(EfficientFilter<f64>),
}

impl Filter {
    /// Corrects with one measurement; `None` if the filter refuses or rejects it.
    fn update(&mut self, measured: &Measured) -> Option<Fusion<f64>> {
        let before = *self;
        let fusion = match (&mut *self, measured.expected) {
            (Self::Article(filter), Some(expected)) => {
                filter.update_expecting(&measured.measurement, expected)
            }
            (Self::Article(filter), None) => filter.update_reporting(&measured.measurement),
            // Without a low-pass filter on the force a compensated reading is the law at its slip.
            (Self::Efficient(filter), _) => filter.update_reporting(&measured.measurement),
        };
        // A squared innovation that overflows (a reading of 1e308, say) makes no figure that is one.
        match fusion {
            Ok(fusion) if !fusion.nis.is_finite() => {
                *self = before;
                None
            }
            Ok(fusion) => (fusion.decision == Decision::Accepted).then_some(fusion),
            Err(_) => None,
        }
    }

    fn estimate(&self) -> Estimate<f64> {
        match self {
            Self::Article(filter) => filter.estimate(),
            Self::Efficient(filter) => Estimate {
                state: filter.state(),
                covariance: filter.covariance(),
            },
        }
    }

    fn peak(&self) -> PeakEstimate<f64> {
        match self {
            Self::Article(filter) => filter.peak(),
            Self::Efficient(filter) => filter.peak(),
        }
    }
}

/// One row as the filter takes it.
struct Measured {
    time_s: f64,
    measurement: FrictionMeasurement<f64>,
    /// What the reading is expected to be; `None` where it reads the law at its slip.
    expected: Option<Expansion<f64>>,
}

/// What stands between rows and filter: slip and friction, and the compensation of a model.
struct Front {
    radius_m: f64,
    compensator: Option<Box<dyn model::Compensating>>,
    /// Time of the last row that the compensator took, in s.
    last_time_s: f64,
    skipped: Skipped,
}

impl Front {
    /// The row as a measurement at the filter's present state; `None`, counted, if it is none.
    fn measured(&mut self, row: &Row<'_>, survey: &Survey, state: &State<f64>) -> Option<Measured> {
        let time_s = row.time_s();
        if !time_s.is_finite() {
            self.skipped.not_finite += 1;
            return None;
        }
        let sample = row.rig_sample();
        let Some(compensator) = &mut self.compensator else {
            return match slip_friction(&sample, self.radius_m, &survey.limits) {
                Ok(point) => Some(Measured {
                    time_s,
                    measurement: FrictionMeasurement {
                        slip_ratio: point.slip_ratio,
                        friction: point.friction,
                        friction_std: survey
                            .noise
                            .friction_std(sample.normal_force_n, point.friction),
                    },
                    expected: None,
                }),
                Err(error) => {
                    self.skipped.count(error);
                    None
                }
            };
        };
        // The first step's time is not used.
        let dt_s = (time_s - self.last_time_s).max(0.0);
        match compensator.step(&sample, dt_s, state) {
            Ok(outcome) => {
                self.last_time_s = time_s;
                match outcome {
                    Compensated::Measurement(compensated) => {
                        let noise = survey.noise.friction_std(
                            compensated.normal_force_n,
                            compensated.expected.friction,
                        );
                        return Some(Measured {
                            time_s,
                            measurement: compensated.measurement(noise),
                            expected: Some(compensated.expected),
                        });
                    }
                    Compensated::Nothing(NoMeasurement::Sample(error)) => self.skipped.count(error),
                    Compensated::Nothing(_) => self.skipped.delay_line_filling += 1,
                }
            }
            // The compensator is what it was: the row's time belongs to the next one.
            Err(muslip_compensate::StepError::NonFinite { .. }) => self.skipped.not_finite += 1,
            Err(_) => self.skipped.refused += 1,
        }
        None
    }
}

/// What a filter made of a recording.
struct Run {
    peak: PeakEstimate<f64>,
    used: u64,
    skipped: Skipped,
    consistency: Consistency,
    record: Record,
}

fn run<S: TraceSink>(
    mut filter: Filter,
    mut front: Front,
    recording: &mut Recording,
    survey: &Survey,
    mut trace: Option<&mut S>,
    progress: &mut dyn FnMut(u64),
) -> Result<Run, EstimateError> {
    let mut test = ConsistencyTest::default();
    let mut recorder = Recorder::new(filter.peak());
    let mut used = 0;
    let mut refused = 0;
    let mut outcome = Ok(());
    let mut take = |row: &Row<'_>| -> Result<(), EstimateError> {
        let Some(measured) = front.measured(row, survey, &filter.estimate().state) else {
            return Ok(());
        };
        recorder.offered(&measured.measurement);
        let Some(fusion) = filter.update(&measured) else {
            refused += 1;
            return Ok(());
        };
        used += 1;
        test.add(fusion.innovation / fusion.innovation_variance.sqrt());
        recorder.used(measured.time_s, &fusion, || filter.peak());
        match &mut trace {
            Some(trace) => {
                Ok(trace.row(&trace_row(measured.time_s, &fusion, &filter.estimate()))?)
            }
            None => Ok(()),
        }
    };
    for_each_row(recording, progress, |row| {
        if outcome.is_ok() {
            outcome = take(row);
        }
    })?;
    outcome?;
    let mut skipped = front.skipped;
    skipped.refused += refused;
    let Some(consistency) = test.outcome() else {
        let problem = InputProblem::NoUsableSample(skipped.in_words());
        return Err(InputError::whole_file(recording.path(), problem).into());
    };
    Ok(Run {
        peak: filter.peak(),
        used,
        skipped,
        consistency,
        record: recorder.finish(),
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

/// Where the range of tyres came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RangeSource {
    /// It was given.
    Option,
    /// Friction and slip of the recording, beside the rig file's tyre.
    Recording,
    /// The article's filter starts where the article does.
    Default,
}

impl RangeSource {
    /// As in JSON.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Option => "option",
            Self::Recording => "recording",
            Self::Default => "default",
        }
    }
}

impl EstimateResult {
    /// Where its range came from.
    #[must_use]
    pub fn range_source(&self) -> RangeSource {
        match (self.options.range, self.estimator) {
            (Some(_), _) => RangeSource::Option,
            (None, EstimatorKind::Efficient) => RangeSource::Recording,
            (None, EstimatorKind::Article) => RangeSource::Default,
        }
    }

    /// As [`EstimateResult::to_json`], with what was done to read a file of another format, where anything was.
    pub fn to_json_noting(&self, notes: &[String]) -> serde_json::Value {
        let mut json = self.to_json();
        if let (false, Some(object)) = (notes.is_empty(), json.as_object_mut()) {
            object.insert("read".to_owned(), notes.into());
        }
        json
    }

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
            FrictionNoise::Modelled {
                drag_std_n,
                share_of_drag,
            } => {
                json!({"source": "model", "drag_force_n": drag_std_n, "share_of_drag": share_of_drag})
            }
        };
        let c = self.consistency;
        let mut object = json!({
            "schema": "muslip.estimate/1",
            "estimator": self.estimator.word(),
            "range": range_word(self.range),
            "range_source": self.range_source().word(),
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
                "skipped_delay_line_filling": self.skipped.delay_line_filling,
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
        });
        if let (Some(model), Some(object)) = (&self.model, object.as_object_mut()) {
            object.insert("model".to_owned(), model.to_json());
        }
        object
    }
}

/// The word for a range, as on the command line.
pub fn range_word(range: Range) -> &'static str {
    match range {
        Range::Aircraft => "aircraft",
        Range::Automotive => "automotive",
    }
}
