//! The drag channel reads a share of the normal force, also at standstill.

use super::{Context, Describe, Evidence, Id, Law, Mechanism, Parameter, Reported, Stage, State};
use crate::number::Number;
use crate::prepare::Series;

/// The drag channel reads a share of the normal force, also at standstill.
pub struct LoadCrosstalk;

impl Describe for LoadCrosstalk {
    fn id(&self) -> Id {
        Id::LoadCrosstalk
    }
    fn stage(&self) -> Stage {
        Stage::Reading
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        vec![Parameter::new("share", "1", -0.3, 0.3)]
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
        "reading = drag + share * normal_force"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the drag channel reads {:.2} % of the normal force on top of the drag",
            100.0 * reported[0].value
        )
    }
}

impl<T: Number> Mechanism<T> for LoadCrosstalk {
    fn apply(&self, p: &[T], _series: &Series, _context: &Context, state: &mut State<T>) {
        for (y, n) in state.force.iter_mut().zip(&state.load) {
            *y += *n * p[0];
        }
    }
    fn report(
        &self,
        p: &[T],
        _law: &Law<T>,
        _context: &Context,
        _series: &[Series],
    ) -> Vec<Reported<T>> {
        vec![Reported {
            name: "share",
            unit: "1",
            value: p[0],
        }]
    }
}
