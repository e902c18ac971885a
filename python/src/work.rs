//! The work itself: what the command does, with its JSON as text.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use host_sim::{RigLaw, RunError, Scenario};
use muslip::filter::mu_slip::Range;
use muslip_analysis::channels::listing;
use muslip_analysis::diagnose::predict::predict as predicted;
use muslip_analysis::diagnose::{json, wording::verdict_sentence};
use muslip_analysis::estimate::{
    EstimateOptions, EstimateResult, EstimatorKind, TraceRow, estimate as estimated, range_word,
};
use muslip_analysis::fit::fit_recordings;
use muslip_diagnose::outcome::Diagnosis;
use muslip_diagnose::repaired::Which;
use muslip_recordings::load::{self, Source};
use muslip_recordings::model_file;
use muslip_recordings::output::write_file;
use muslip_recordings::recording::{Channel, Recording, RecordingWriter, Required};
use muslip_report::diagnose::views::Views;
use muslip_report::diagnose::{files, page};
use muslip_report::fleet::Fleet;
use muslip_report::of_estimate;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::columns::{Columns, bytes, shown, source};
use crate::failure::Failure;
use crate::job;
use crate::rig::{Model, Rig, map_of};

fn text_of(value: &serde_json::Value) -> String {
    // As the command prints it.
    format!("{value:#}")
}

/// `muslip channels --json`.
#[pyfunction]
#[pyo3(signature = (path, map=None))]
pub(crate) fn channels(
    py: Python<'_>,
    path: PathBuf,
    map: Option<(bool, String)>,
) -> PyResult<String> {
    job::run(py, None, move |_| {
        let map = map_of(map.as_ref())?;
        Ok(text_of(
            &listing(&path, map.as_ref(), &mut |_| {})?.to_json(),
        ))
    })
}

pub(crate) fn range_of(word: Option<&str>) -> Result<Option<Range>, Failure> {
    match word {
        None => Ok(None),
        Some("aircraft") => Ok(Some(Range::Aircraft)),
        Some("automotive") => Ok(Some(Range::Automotive)),
        Some(other) => Err(Failure::Other(format!(
            "range {other:?}: must be 'aircraft' or 'automotive'"
        ))),
    }
}

pub(crate) fn estimator_of(word: Option<&str>) -> Result<Option<EstimatorKind>, Failure> {
    match word {
        None => Ok(None),
        Some("article") => Ok(Some(EstimatorKind::Article)),
        Some("efficient") => Ok(Some(EstimatorKind::Efficient)),
        Some(other) => Err(Failure::Other(format!(
            "estimator {other:?}: must be 'article' or 'efficient'"
        ))),
    }
}

/// Work on fewer bytes is over before anybody could interrupt it.
const SHORT_BYTES: u64 = 1 << 18;

/// Whether an estimate of a recording is over at once: of text or of what is in memory, for a few bytes of a compressed
/// file may be millions of samples, and a pipe has no end that is known.
fn is_short(source: &Source) -> bool {
    let is_plain = match source {
        Source::File(path) => path
            .extension()
            .is_some_and(|kind| kind.eq_ignore_ascii_case("csv")),
        Source::Memory(_) => true,
    };
    is_plain && (1..SHORT_BYTES).contains(&source.length_bytes())
}

/// What `muslip estimate` found.
#[pyclass(frozen, module = "muslip._native")]
pub(crate) struct Estimate {
    path: PathBuf,
    rig: String,
    result: EstimateResult,
    #[pyo3(get)]
    json: String,
    trace: Vec<TraceRow>,
}

#[pymethods]
impl Estimate {
    /// The columns of the trace as bytes, in the order of the contract.
    fn trace<'py>(&self, py: Python<'py>) -> PyResult<Vec<(&'static str, Bound<'py, PyBytes>)>> {
        type Column = (&'static str, fn(&TraceRow) -> f64);
        let columns: [Column; 13] = [
            ("time_s", |row| row.time_s),
            ("slip", |row| row.slip),
            ("friction", |row| row.friction),
            ("peak_friction", |row| row.peak_friction),
            ("critical_slip", |row| row.critical_slip),
            ("p11", |row| row.p11),
            ("p12", |row| row.p12),
            ("p22", |row| row.p22),
            ("innovation", |row| row.innovation),
            ("noise_variance", |row| row.noise_variance),
            ("signal_before", |row| row.signal_before),
            ("signal_after", |row| row.signal_after),
            ("nis", |row| row.nis),
        ];
        columns
            .into_iter()
            .map(|(name, of)| {
                let values: Vec<f64> = self.trace.iter().map(of).collect();
                Ok((name, bytes(py, &values)?))
            })
            .collect()
    }

    /// The page of `muslip estimate --report`.
    fn report_html(&self) -> PyResult<String> {
        let command = format!(
            "muslip estimate --rig {} --range {} --estimator {} {}",
            self.rig,
            range_word(self.result.range),
            self.result.estimator.word(),
            shown(&self.path)
        );
        Ok(job::guarded(|| {
            Ok(of_estimate(&self.path, &self.result, None, &command).to_html()?)
        })?)
    }
}

/// `muslip estimate`.
#[pyfunction]
#[pyo3(signature = (recording, rig, map=None, range=None, estimator=None, model=None, trace=true, progress=None))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub(crate) fn estimate(
    py: Python<'_>,
    recording: &Bound<'_, PyAny>,
    rig: &Rig,
    map: Option<(bool, String)>,
    range: Option<&str>,
    estimator: Option<&str>,
    model: Option<&Model>,
    trace: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Estimate> {
    let source = source(recording)?;
    let options = EstimateOptions {
        estimator: estimator_of(estimator)?,
        range: range_of(range)?,
    };
    let repaired = match model {
        Some(model) => {
            let file = rig.whole_file()?;
            model
                .file
                .check_rig(rig.path_or_name(), &file)
                .map_err(Failure::from)?;
            Some(model.file.repaired.clone())
        }
        None => None,
    };
    let (file, rig_map, rig) = (rig.file.clone(), rig.map.clone(), shown(rig.path_or_name()));
    let is_short = is_short(&source);
    job::run_short(py, progress.as_ref(), is_short, move |reporter| {
        let map = map_of(map.as_ref())?.or(rig_map);
        let mut recording = source.open(map.as_ref())?;
        let all = 2 * recording.length_bytes().max(1);
        let mut rows: Vec<TraceRow> = Vec::new();
        let result = estimated(
            &mut recording,
            &file,
            options,
            repaired.as_ref(),
            trace.then_some(&mut rows),
            &mut |bytes| reporter.tell(bytes as f64 / all as f64, "estimate"),
        )?;
        Ok(Estimate {
            path: recording.path().to_owned(),
            rig,
            json: text_of(&result.to_json_noting(recording.notes())),
            result,
            trace: rows,
        })
    })
}

/// `muslip fit --json`.
#[pyfunction]
#[pyo3(signature = (recordings, rig, map=None, max_iterations=100, progress=None))]
pub(crate) fn fit(
    py: Python<'_>,
    recordings: Vec<Bound<'_, PyAny>>,
    rig: &Rig,
    map: Option<(bool, String)>,
    max_iterations: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let sources: Vec<Source> = recordings.iter().map(source).collect::<PyResult<_>>()?;
    let (file, rig_map) = (rig.file.clone(), rig.map.clone());
    job::run(py, progress.as_ref(), move |reporter| {
        let map = map_of(map.as_ref())?.or(rig_map);
        let mut open = Vec::with_capacity(sources.len());
        for source in &sources {
            open.push(source.open(map.as_ref())?);
        }
        let all: u64 = 2 * open
            .iter()
            .map(|one| one.length_bytes())
            .sum::<u64>()
            .max(1);
        let result = fit_recordings(&mut open, &file, max_iterations, &mut |bytes| {
            reporter.tell(bytes as f64 / all as f64, "fit");
        })?;
        Ok(text_of(&result.to_json()))
    })
}

/// What `muslip diagnose` found.
#[pyclass(frozen, module = "muslip._native")]
pub(crate) struct Diagnosed {
    diagnosis: Arc<Diagnosis>,
    views: Arc<Views>,
    command: String,
    #[pyo3(get)]
    json: String,
}

#[pymethods]
impl Diagnosed {
    /// The text of model.toml.
    fn model_text(&self) -> PyResult<String> {
        let about = verdict_sentence(&self.diagnosis);
        Ok(model_file::to_text(&self.diagnosis.repaired, &about)
            .map_err(|error| Failure::Other(error.to_string()))?)
    }

    #[getter]
    fn sentence(&self) -> String {
        verdict_sentence(&self.diagnosis)
    }

    fn report_html(&self) -> PyResult<String> {
        Ok(job::guarded(|| {
            Ok(page::report(&self.diagnosis, &self.views, &self.command).to_html()?)
        })?)
    }

    /// The three files of the command.
    fn write(&self, out: PathBuf) -> PyResult<()> {
        Ok(job::guarded(|| {
            files::write(&out, &self.diagnosis, &self.views, &self.command)
                .map(|_| ())
                .map_err(|error| match error {
                    files::WriteError::Output(error) => Failure::Output(error),
                    error => Failure::Other(error.to_string()),
                })
        })?)
    }
}

/// `muslip diagnose`.
#[pyfunction]
#[pyo3(signature = (recordings, rig, map=None, out=None, progress=None))]
pub(crate) fn diagnose(
    py: Python<'_>,
    recordings: Vec<Bound<'_, PyAny>>,
    rig: &Rig,
    map: Option<(bool, String)>,
    out: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Diagnosed> {
    let sources: Vec<Source> = recordings.iter().map(source).collect::<PyResult<_>>()?;
    let file = rig.whole_file()?;
    let rig_map = rig.map.clone();
    let names: Vec<String> = sources.iter().map(|one| shown(one.path())).collect();
    let command = format!(
        "muslip diagnose --rig {} {}",
        shown(rig.path_or_name()),
        names.join(" ")
    );
    /// Share of reading in the whole.
    const READING: f64 = 0.1;
    let diagnosed = job::run(py, progress.as_ref(), move |reporter| {
        let paths: Vec<PathBuf> = sources
            .iter()
            .filter_map(|one| match one {
                Source::File(path) => Some(path.clone()),
                Source::Memory(_) => None,
            })
            .collect();
        load::refuse_twice(&paths)?;
        let map = map_of(map.as_ref())?.or(rig_map);
        let campaign = load::campaign_of(&file, &sources, map.as_ref(), &|share| {
            reporter.tell(READING * share, "read");
        })?;
        if let Some(out) = &out {
            files::prepare_folder(out)?;
        }
        let (diagnosis, views) = files::diagnosed(campaign, &|share, step| {
            reporter.tell(READING + (1.0 - READING) * share, step);
        });
        let json = json::to_text(&diagnosis).map_err(|error| Failure::Other(error.to_string()))?;
        let diagnosed = Diagnosed {
            diagnosis: Arc::new(diagnosis),
            views: Arc::new(views),
            command,
            json,
        };
        Ok((diagnosed, out))
    })?;
    let (diagnosed, out) = diagnosed;
    if let Some(out) = out {
        diagnosed.write(out)?;
    }
    Ok(diagnosed)
}

/// The page of a fleet, of its summary as JSON.
#[pyfunction]
pub(crate) fn fleet_page(summary: &str, results: &str, command: &str) -> PyResult<String> {
    Ok(job::guarded(|| {
        let fleet: Fleet =
            serde_json::from_str(summary).map_err(|error| Failure::Other(error.to_string()))?;
        Ok(fleet.page(results, command).to_html()?)
    })?)
}

/// `muslip predict`: the columns of its file as bytes.
#[pyfunction]
#[pyo3(signature = (recording, rig, model, map=None, base=false))]
pub(crate) fn predict<'py>(
    py: Python<'py>,
    recording: &Bound<'_, PyAny>,
    rig: &Rig,
    model: &Model,
    map: Option<(bool, String)>,
    base: bool,
) -> PyResult<Vec<(&'static str, Bound<'py, PyBytes>)>> {
    let source = source(recording)?;
    let file = rig.whole_file()?;
    model
        .file
        .check_rig(rig.path_or_name(), &file)
        .map_err(Failure::from)?;
    let (model, rig_map) = (model.file.clone(), rig.map.clone());
    let prediction = job::run(py, None, move |_| {
        let map = map_of(map.as_ref())?.or(rig_map);
        let loaded = load::opened(source.open(map.as_ref())?, Required::DragOptional)?;
        let which = if base { Which::Base } else { Which::Repaired };
        predicted(&model, &loaded, which)
            .map_err(|error| Failure::Other(format!("{}: {error}", model.path().display())))
    })?;
    Ok(vec![
        ("time_s", bytes(py, &prediction.time_s)?),
        ("drag_force_n", bytes(py, &prediction.drag_force_n)?),
        (
            "drag_force_sigma_n",
            bytes(py, &prediction.drag_force_sigma_n)?,
        ),
        ("contact_force_n", bytes(py, &prediction.contact_force_n)?),
    ])
}

/// `muslip simulate` with a tyre law: the recording that its file would hold.
#[pyfunction]
#[pyo3(signature = (rig, law=None, seed=1, speed_m_s=None, normal_force_n=None, applications=3, duration_s=4.0, rate_hz=None, noise=true))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub(crate) fn simulate(
    py: Python<'_>,
    rig: &Rig,
    law: Option<&str>,
    seed: u64,
    speed_m_s: Option<f64>,
    normal_force_n: Option<f64>,
    applications: u32,
    duration_s: f64,
    rate_hz: Option<f64>,
    noise: bool,
) -> PyResult<Columns> {
    let other = |error: &dyn std::error::Error| Failure::Other(error.to_string());
    let law: Option<RigLaw> = law
        .map(str::parse)
        .transpose()
        .map_err(|error: <RigLaw as std::str::FromStr>::Err| other(&error))?;
    let mut file = rig.whole_file()?;
    if !noise {
        file.noise.clear();
    }
    let mut scenario = Scenario::usual(file, law).map_err(|error| other(&error))?;
    scenario.seed = seed;
    scenario.applications = applications;
    scenario.duration_s = duration_s;
    if let Some(rate_hz) = rate_hz {
        scenario.rate_hz = rate_hz;
    }
    if let Some(normal_force_n) = normal_force_n {
        scenario.normal_force_n = normal_force_n;
    }
    scenario.speed_m_s = speed_m_s.unwrap_or_else(|| scenario.lasting_speed_m_s());
    scenario.check().map_err(|error| other(&error))?;
    let memory = job::run(py, None, move |reporter| {
        let io = |error: std::io::Error| Failure::Other(format!("a temporary file: {error}"));
        // Through the very writer and reader of files: the numbers are those of the command's.
        let folder = tempfile::tempdir().map_err(io)?;
        let path = folder.path().join("run.csv");
        let names: Vec<&str> = scenario
            .channels()
            .iter()
            .map(|&one| Channel::name(one))
            .collect();
        let mut writer =
            RecordingWriter::new(Vec::new(), &scenario.origin(), &names).map_err(io)?;
        let all = scenario.rows().max(1);
        let mut rows = 0_u64;
        scenario
            .run(|row| {
                rows += 1;
                reporter.tell(rows as f64 / all as f64, "simulate");
                writer.row(row)
            })
            .map_err(|error| match error {
                RunError::Write(error) => io(error),
                RunError::Scenario(error) => Failure::Other(error.to_string()),
            })?;
        write_file(&path, &writer.into_inner())?;
        Ok(Recording::read_whole(&path, None)?.named(Path::new("simulated")))
    })?;
    Ok(Columns { memory })
}
