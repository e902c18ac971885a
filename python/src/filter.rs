//! The estimators sample by sample.

use muslip::filter::efficient::{self, EfficientFilter};
use muslip::filter::mu_slip::{Config, MuSlipFilter, Range};
use muslip::filter::{Decision, Estimator as _, FrictionMeasurement, PeakEstimate};
use muslip_analysis::estimate::EstimatorKind;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::columns::shared;
use crate::failure::Failure;
use crate::work::{estimator_of, range_of};

#[derive(Clone, Copy)]
#[expect(clippy::large_enum_variant, reason = "one of it a Python object")]
enum Filter {
    Article(MuSlipFilter<f64>),
    Efficient(EfficientFilter<f64>),
}

impl Filter {
    fn update(
        &mut self,
        slip_ratio: f64,
        friction: f64,
        friction_std: f64,
    ) -> Result<bool, Failure> {
        let measurement = FrictionMeasurement {
            slip_ratio,
            friction,
            friction_std,
        };
        let refused = |error: &dyn std::error::Error| Failure::Other(error.to_string());
        let decision = match self {
            Self::Article(filter) => filter
                .update(&measurement)
                .map_err(|error| refused(&error))?,
            Self::Efficient(filter) => filter
                .update(&measurement)
                .map_err(|error| refused(&error))?,
        };
        Ok(decision == Decision::Accepted)
    }
}

/// A filter with its state.
#[pyclass(frozen, module = "muslip._native")]
pub(crate) struct Estimator {
    filter: Mutex<Filter>,
}

impl Estimator {
    fn filter(&self) -> MutexGuard<'_, Filter> {
        self.filter.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Estimator {
    #[new]
    #[pyo3(signature = (range=None, estimator=None))]
    fn new(range: Option<&str>, estimator: Option<&str>) -> PyResult<Self> {
        let range = range_of(range)?.unwrap_or(Range::Aircraft);
        let other = |error: &dyn std::error::Error| Failure::Other(error.to_string());
        let filter = match estimator_of(estimator)?.unwrap_or(EstimatorKind::Efficient) {
            EstimatorKind::Article => {
                Filter::Article(Config::for_range(range).build().map_err(|e| other(&e))?)
            }
            EstimatorKind::Efficient => Filter::Efficient(
                efficient::Config::for_range(range)
                    .build()
                    .map_err(|e| other(&e))?,
            ),
        };
        Ok(Self {
            filter: Mutex::new(filter),
        })
    }

    /// Corrects the estimate; whether the measurement was taken.
    fn update(&self, slip: f64, friction: f64, std: f64) -> PyResult<bool> {
        Ok(self.filter().update(slip, friction, std)?)
    }

    /// Corrects it with one measurement after the other; a byte each, 1 where it was taken. On an error nothing has changed.
    fn update_many<'py>(
        &self,
        py: Python<'py>,
        slips: &Bound<'py, PyAny>,
        frictions: &Bound<'py, PyAny>,
        stds: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let (slips, frictions, stds) = (shared(slips)?, shared(frictions)?, shared(stds)?);
        let taken = py.detach(|| {
            let [slips, frictions, stds] =
                [&slips, &frictions, &stds].map(|column| column.as_ref().as_ref());
            if slips.len() != frictions.len() || slips.len() != stds.len() {
                return Err(Failure::Other(format!(
                    "{} slips, {} frictions and {} stds: must be as many",
                    slips.len(),
                    frictions.len(),
                    stds.len()
                )));
            }
            let mut filter = self.filter();
            let mut next = *filter;
            let mut taken = Vec::with_capacity(slips.len());
            for (row, ((&slip, &friction), &std)) in
                slips.iter().zip(frictions).zip(stds).enumerate()
            {
                let accepted = next
                    .update(slip, friction, std)
                    .map_err(|error| match error {
                        Failure::Other(what) => {
                            Failure::Other(format!("measurement {row}: {what}"))
                        }
                        error => error,
                    })?;
                taken.push(u8::from(accepted));
            }
            *filter = next;
            Ok(taken)
        })?;
        Ok(PyBytes::new(py, &taken))
    }

    /// Peak friction, its std, critical slip, its std, correlation.
    fn peak(&self) -> (f64, f64, f64, f64, f64) {
        let PeakEstimate {
            peak_friction,
            peak_friction_std,
            critical_slip,
            critical_slip_std,
            correlation,
        } = match &*self.filter() {
            Filter::Article(filter) => filter.peak(),
            Filter::Efficient(filter) => filter.peak(),
        };
        (
            peak_friction,
            peak_friction_std,
            critical_slip,
            critical_slip_std,
            correlation,
        )
    }
}
