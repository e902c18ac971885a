//! Errors as Python sees them: `muslip.MuslipError`, the line of the command with its parts.

use muslip_analysis::estimate::EstimateError;
use muslip_analysis::fit::FitJobError;
use muslip_recordings::input_error::{InputError, InputProblem};
use muslip_recordings::output::OutputError;
use muslip_report::ReportError;
use pyo3::PyErr;

pyo3::import_exception!(muslip._errors, MuslipError);

/// Why a call ended early.
#[derive(Debug)]
pub(crate) enum Failure {
    Input(InputError),
    Output(OutputError),
    /// The words of the command's line, after `error: `.
    Other(String),
    /// A panic of the engine: a bug, and not the end of the interpreter.
    Panic(String),
}

impl From<InputError> for Failure {
    fn from(error: InputError) -> Self {
        Self::Input(error)
    }
}

impl From<OutputError> for Failure {
    fn from(error: OutputError) -> Self {
        Self::Output(error)
    }
}

impl From<ReportError> for Failure {
    fn from(error: ReportError) -> Self {
        Self::Other(error.to_string())
    }
}

impl From<EstimateError> for Failure {
    fn from(error: EstimateError) -> Self {
        match error {
            EstimateError::Input(error) => Self::Input(error),
            error => Self::Other(error.to_string()),
        }
    }
}

impl From<FitJobError> for Failure {
    fn from(error: FitJobError) -> Self {
        match error {
            FitJobError::Input(error) => Self::Input(error),
        }
    }
}

/// The channel that a problem is about.
fn channel(problem: &InputProblem) -> Option<String> {
    match problem {
        InputProblem::MissingColumn(name) => Some((*name).to_owned()),
        InputProblem::NotANumber { column, .. } | InputProblem::ColumnLength { column, .. } => {
            Some(column.clone())
        }
        InputProblem::ColumnTwice(quoted) => Some(quoted.trim_matches('"').to_owned()),
        InputProblem::TimeRepeats(_) | InputProblem::TimeGoesBack { .. } => {
            Some("time_s".to_owned())
        }
        _ => None,
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        let whole = |path: &std::path::Path| path.display().to_string();
        match failure {
            Failure::Input(error) => MuslipError::new_err((
                error.to_string(),
                whole(&error.path),
                error.line,
                error.column,
                channel(&error.problem),
            )),
            Failure::Output(error) => {
                MuslipError::new_err((error.to_string(), whole(&error.path), 1_u64, 1_u64))
            }
            Failure::Other(what) => MuslipError::new_err((format!("error: {what}"),)),
            Failure::Panic(what) => {
                MuslipError::new_err((format!("error: internal, please report it: {what}"),))
            }
        }
    }
}
