//! Drag varies once (or a few times) a wheel revolution.

use super::once_a_turn::Form;
use super::{Context, Describe, Evidence, Id, Law, Mechanism, Parameter, Reported, Stage, State};
use crate::number::Number;
use crate::prepare::Series;

/// Largest amplitude of an order, as a share of the drag.
const LIMIT: f64 = 0.5;

/// Drag varies once (or a few times) a wheel revolution.
pub struct RunOut {
    /// Which form.
    pub form: Form,
}

impl Describe for RunOut {
    fn id(&self) -> Id {
        Id::RunOut
    }
    fn form(&self) -> &'static str {
        self.form.as_str()
    }
    fn stage(&self) -> Stage {
        Stage::Contact
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        self.form.parameters(context, LIMIT)
    }
    fn starts(
        &self,
        context: &Context,
        _series: &[Series],
        _evidence: &[Evidence],
    ) -> Vec<Vec<f64>> {
        self.form.starts(context)
    }
    fn equation(&self) -> &'static str {
        "drag = normal_force mu(slip) (1 + sum a_k cos(k angle) + b_k sin(k angle))"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "drag varies once a wheel revolution by {:.2} % of itself",
            100.0 * reported[0].value
        )
    }
    fn predicts(&self) -> bool {
        !self.form.phase_per_run
    }
}

impl<T: Number> Mechanism<T> for RunOut {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        if let Some(ripple) = self.form.ripple(p, series) {
            for (force, r) in state.force.iter_mut().zip(ripple) {
                *force = *force * (r + 1.0);
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
        self.form.report(p, 1.0)
    }
}
