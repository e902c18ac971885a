//! The drag channel's scale is wrong.

use super::{Context, Describe, Evidence, Id, Law, Mechanism, Parameter, Reported, Stage, State};
use crate::number::Number;
use crate::prepare::Series;

/// The drag channel's scale is wrong.
pub struct ForceGain;

impl Describe for ForceGain {
    fn id(&self) -> Id {
        Id::ForceGain
    }
    fn stage(&self) -> Stage {
        Stage::Vehicle
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        vec![Parameter::new("gain_error", "1", -0.6, 1.5)]
    }
    fn starts(
        &self,
        _context: &Context,
        _series: &[Series],
        _evidence: &[Evidence],
    ) -> Vec<Vec<f64>> {
        vec![vec![0.0]]
    }
    fn equation(&self) -> &'static str {
        "reading = gain * drag"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the drag channel reads {:.3} times the true drag",
            reported[0].value
        )
    }
}

impl<T: Number> Mechanism<T> for ForceGain {
    fn apply(&self, p: &[T], _series: &Series, _context: &Context, state: &mut State<T>) {
        state.gain_change += p[0];
    }
    fn report(
        &self,
        p: &[T],
        _law: &Law<T>,
        _context: &Context,
        _series: &[Series],
    ) -> Vec<Reported<T>> {
        vec![Reported {
            name: "gain",
            unit: "1",
            value: p[0] + 1.0,
        }]
    }
}
