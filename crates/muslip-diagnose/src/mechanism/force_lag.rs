//! The drag channel passes a first-order low-pass filter.

use super::filters::first_order;
use super::{Context, Describe, Evidence, Id, Law, Mechanism, Parameter, Reported, Stage, State};
use crate::number::Number;
use crate::prepare::Series;

/// The drag channel passes a first-order low-pass filter.
pub struct ForceLag;

impl Describe for ForceLag {
    fn id(&self) -> Id {
        Id::ForceLag
    }
    fn stage(&self) -> Stage {
        Stage::Chain
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        vec![Parameter::new(
            "time_constant",
            "s",
            1e-5,
            0.5_f64.min(0.25 * context.duration),
        )]
    }
    fn starts(
        &self,
        context: &Context,
        _series: &[Series],
        _evidence: &[Evidence],
    ) -> Vec<Vec<f64>> {
        [0.6, 2.0, 6.0, 20.0, 60.0, 150.0]
            .iter()
            .map(|m| vec![m * 1e-3])
            .filter(|s| s[0] > 0.2 * context.dt)
            .collect()
    }
    fn equation(&self) -> &'static str {
        "time_constant * d(reading)/dt + reading = drag"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the drag channel is low-pass filtered with a time constant of {:.1} ms",
            1e3 * reported[0].value
        )
    }
}

impl<T: Number> Mechanism<T> for ForceLag {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        let rate = T::constant(1.0) / p[0];
        first_order(&mut state.force, |k| rate * series.dt[k]);
    }
    fn report(
        &self,
        p: &[T],
        _law: &Law<T>,
        _context: &Context,
        _series: &[Series],
    ) -> Vec<Reported<T>> {
        vec![Reported {
            name: "time_constant",
            unit: "s",
            value: p[0],
        }]
    }
}
