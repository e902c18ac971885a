//! The drag channel also reads a share of the wheel's angular acceleration.

use super::{Context, Describe, Evidence, Id, Law, Mechanism, Parameter, Reported, Stage, State};
use crate::number::Number;
use crate::prepare::Series;

/// The drag channel also reads a share of the wheel's angular acceleration.
pub struct InertialReaction;

impl Describe for InertialReaction {
    fn id(&self) -> Id {
        Id::InertialReaction
    }
    fn stage(&self) -> Stage {
        Stage::Reading
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        // A wheel inertia in the wrong place would give inertia/radius.
        let natural = context.inertia / context.radius;
        vec![Parameter::new(
            "share",
            "kg m",
            -5.0 * natural,
            5.0 * natural,
        )]
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
        "reading = drag + share * d(omega)/dt"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the drag channel also reads the wheel's angular acceleration, {:.3} N per rad/s2",
            reported[0].value
        )
    }
}

impl<T: Number> Mechanism<T> for InertialReaction {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        for (y, a) in state.force.iter_mut().zip(&series.wheel.rate) {
            *y += p[0] * *a;
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
            unit: "kg m",
            value: p[0],
        }]
    }
}
