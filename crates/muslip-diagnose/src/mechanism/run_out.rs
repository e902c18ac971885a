//! Drag varies once (or a few times) a wheel revolution.

use super::once_a_turn::Form;
use super::{
    Alias, Balance, Compensation, Context, Describe, Evidence, Example, Guide, Id, Kind, Law,
    Mechanism, Memory, Parameter, Reported, Sign, Stage, State,
};
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
    fn guide(&self) -> Guide {
        Guide {
            physics: "A wheel or a drum that is out of round presses harder and less hard once a revolution, and a tyre is not equally stiff all around. The drag varies with the wheel's angle, in proportion to itself.",
            kind: Kind::Wheel,
            touches: &[Balance::Tyre],
            memory: Memory::None,
            sign: Sign::Either,
            aliases: &[Alias {
                with: Id::EncoderRipple,
                why: "Both repeat with the wheel's angle; a rippling speed is a rippling slip, hence force.",
                run: "Turn the encoder's ring on the hub by a quarter and repeat: a ripple of the encoder moves with it, a run-out of the tyre does not.",
            }],
            smallest: "three percent of the drag",
            smallest_size: |_| 0.03,
            compensation: Compensation::Not("needs the wheel's angle, which a sample lacks"),
            carried: "its size as it is; its phase only where the wheel's angle is known from run to run",
            example: Example {
                form: "first_order",
                parameters: &[0.06, 0.0],
            },
        }
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
