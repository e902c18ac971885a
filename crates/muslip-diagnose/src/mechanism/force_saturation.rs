//! The drag channel clips.

use super::{Context, Describe, Evidence, Id, Law, Mechanism, Parameter, Reported, Stage, State};
use crate::number::Number;
use crate::prepare::Series;

/// The drag channel clips.
pub struct ForceSaturation;

impl Describe for ForceSaturation {
    fn id(&self) -> Id {
        Id::ForceSaturation
    }
    fn stage(&self) -> Stage {
        Stage::Chain
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        vec![Parameter::new(
            "limit",
            "N",
            0.02 * context.max_drag,
            1.5 * context.max_drag,
        )]
    }
    fn starts(
        &self,
        context: &Context,
        _series: &[Series],
        _evidence: &[Evidence],
    ) -> Vec<Vec<f64>> {
        [0.995, 0.97, 0.93, 0.88, 0.8, 0.7]
            .iter()
            .map(|m| vec![m * (context.max_drag - 1.5 * context.drag_sigma)])
            .collect()
    }
    fn amplitude(&self) -> Option<usize> {
        None
    }
    fn equation(&self) -> &'static str {
        "reading = min(drag, limit)"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!("the drag channel clips at {:.0} N", reported[0].value)
    }
}

impl<T: Number> Mechanism<T> for ForceSaturation {
    fn apply(&self, p: &[T], _series: &Series, _context: &Context, state: &mut State<T>) {
        for y in &mut state.force {
            if y.value() > p[0].value() {
                *y = p[0];
            }
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
            name: "limit",
            unit: "N",
            value: p[0],
        }]
    }
}
