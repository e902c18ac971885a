//! Why a command ended early.

use std::io;

use muslip_analysis::estimate::EstimateError;
use muslip_analysis::fit::FitJobError;
use muslip_recordings::input_error::InputError;
use muslip_recordings::output::OutputError;
use muslip_report::{ExportError, ReportError};

/// Why a command ended early.
#[derive(Debug, thiserror::Error)]
pub(super) enum Failure {
    #[error(transparent)]
    Input(#[from] InputError),
    #[error(transparent)]
    Output(#[from] OutputError),
    #[error("error: {0}")]
    Usage(String),
    #[error("error: {0}")]
    Internal(String),
    /// Standard output cannot be written.
    #[error("error: standard output cannot be written: {0}")]
    Terminal(#[source] io::Error),
}

impl From<EstimateError> for Failure {
    fn from(error: EstimateError) -> Self {
        match error {
            EstimateError::Input(error) => Self::Input(error),
            error => Self::Internal(error.to_string()),
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

impl From<ReportError> for Failure {
    fn from(error: ReportError) -> Self {
        Self::Internal(error.to_string())
    }
}

impl From<ExportError> for Failure {
    fn from(error: ExportError) -> Self {
        match error {
            ExportError::Output(error) => Self::Output(error),
            ExportError::Report(error) => error.into(),
        }
    }
}
