//! A deceleration that grows with speed squared and is not tyre drag.

use super::{Context, Describe, Evidence, Id, Law, Mechanism, Parameter, Reported, Stage, State};
use crate::number::Number;
use crate::prepare::Series;

/// A deceleration that grows with speed squared and is not tyre drag.
pub struct AeroDrag;

impl Describe for AeroDrag {
    fn id(&self) -> Id {
        Id::AeroDrag
    }
    fn stage(&self) -> Stage {
        Stage::Vehicle
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        // Up to one g at the campaign's largest speed.
        let most = 9.81 * context.mass / context.max_speed.max(0.5).powi(2);
        vec![Parameter::new("coefficient", "kg/m", 0.0, most)]
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
        "m dv/dt = -drag - coefficient * v^2"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "a drag of {:.4} N per (m/s)^2 slows the vehicle beside the tyre",
            reported[0].value
        )
    }
}

impl<T: Number> Mechanism<T> for AeroDrag {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        for (f, v) in state.opposing.iter_mut().zip(&series.speed.smooth) {
            *f += p[0] * (v * v.abs());
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
            name: "coefficient",
            unit: "kg/m",
            value: p[0],
        }]
    }
}
