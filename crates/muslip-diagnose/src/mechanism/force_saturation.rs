//! The drag channel clips.

use super::{
    Balance, Compensation, Context, Describe, Evidence, Example, Guide, Id, Kind, Law, Mechanism,
    Memory, Parameter, Reported, Sign, Stage, State,
};
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
    fn guide(&self) -> Guide {
        Guide {
            physics: "Above its range the amplifier or converter clips: the reading stays where it is however the force grows. Below, nothing is wrong.",
            kind: Kind::LoadCell,
            touches: &[Balance::Tyre, Balance::Wheel, Balance::Vehicle],
            memory: Memory::None,
            sign: Sign::Positive,
            aliases: &[],
            smallest: "a limit five percent below the largest drag",
            smallest_size: |c| 0.05 * c.max_drag,
            compensation: Compensation::Not("the filter has no compensation for it"),
            carried: "as it is",
            example: Example {
                form: "",
                parameters: &[2600.0],
            },
        }
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
