//! A constant deceleration or acceleration that is not tyre drag.

use super::{Context, Describe, Evidence, Id, Law, Mechanism, Parameter, Reported, Stage, State};
use crate::number::Number;
use crate::prepare::Series;

/// A constant deceleration or acceleration that is not tyre drag.
pub struct GradeOrDrive;

impl Describe for GradeOrDrive {
    fn id(&self) -> Id {
        Id::GradeOrDrive
    }
    fn stage(&self) -> Stage {
        Stage::Vehicle
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let most = 9.81 * context.mass;
        vec![Parameter::new("force", "N", -most, most)]
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
        "m dv/dt = -drag - force"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "a constant force of {:.1} N {} the vehicle beside the tyre's drag",
            reported[0].value.abs(),
            if reported[0].value >= 0.0 {
                "slows"
            } else {
                "drives"
            }
        )
    }
}

impl<T: Number> Mechanism<T> for GradeOrDrive {
    fn apply(&self, p: &[T], _series: &Series, _context: &Context, state: &mut State<T>) {
        for f in &mut state.opposing {
            *f += p[0];
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
            name: "force",
            unit: "N",
            value: p[0],
        }]
    }
}
