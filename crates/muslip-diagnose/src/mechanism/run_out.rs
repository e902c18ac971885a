//! Drag varies once (or a few times) a wheel revolution.

use super::once_a_turn::{Form, radius_reads_as_ripple};
use super::prelude::*;

/// Largest amplitude of an order, as a share of the drag.
const LIMIT: f64 = 0.5;
/// The same as a share of the radius.
const LIMIT_OF_RADIUS: f64 = 0.08;

/// What varies with the wheel's angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Of {
    /// The drag, in proportion to itself: a load that varies, a tyre unequally stiff.
    Drag,
    /// The rolling radius, hence the slip.
    Radius,
}

/// Drag varies once (or a few times) a wheel revolution.
pub struct RunOut {
    /// Orders and phases.
    pub form: Form,
    /// Of what.
    pub of: Of,
}

impl Describe for RunOut {
    fn facts(&self) -> Facts {
        let (form, stage, equation) = match self.of {
            Of::Drag => (
                self.form.as_str(),
                Stage::Contact,
                "drag = normal_force mu(slip) (1 + sum a_k cos(k angle) + b_k sin(k angle))",
            ),
            Of::Radius => (
                if self.form.phase_per_run {
                    "radius_phase_per_run"
                } else {
                    "radius"
                },
                Stage::Kinematics,
                "slip = 1 - radius (1 + a cos(angle) + b sin(angle)) omega / v",
            ),
        };
        Facts {
            form,
            rare: self.of == Of::Radius,
            fed_by_chain: true,
            ..Facts::of(Id::RunOut, stage, equation)
        }
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let limit = match self.of {
            Of::Drag => LIMIT,
            Of::Radius => LIMIT_OF_RADIUS,
        };
        self.form.parameters(context, limit)
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        // The ripple, which is common, is offered instead.
        if self.of == Of::Radius && radius_reads_as_ripple(search.series) {
            return Vec::new();
        }
        self.form.starts(search.context)
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        let percent = 100.0 * reported[0].value;
        match self.of {
            Of::Drag => format!("drag varies once a wheel revolution by {percent:.2} % of itself"),
            Of::Radius => format!(
                "the rolling radius varies once a wheel revolution; the drag at half the critical slip by {percent:.2} % of itself"
            ),
        }
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "A wheel or a drum that is out of round presses harder and less hard once a revolution, and a tyre is not equally stiff or equally large all around. The drag varies with the wheel's angle: in proportion to itself, or as the slip that a varying radius makes.",
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
            example: Example::of("first_order", &[0.06, 0.0]),
        }
    }
}

impl<T: Number> Mechanism<T> for RunOut {
    fn apply(&self, p: &[T], series: &Series, context: &Context, state: &mut State<T>) {
        if let Some(ripple) = self.form.ripple(p, series, &|_, _| 1.0) {
            match self.of {
                Of::Drag => {
                    for (force, r) in state.force.iter_mut().zip(ripple) {
                        *force = *force * (r + 1.0);
                    }
                }
                Of::Radius => {
                    let n = ripple.len();
                    let radius = state
                        .radius
                        .get_or_insert_with(|| vec![T::constant(context.radius); n]);
                    for (radius, r) in radius.iter_mut().zip(ripple) {
                        *radius = *radius * (r + 1.0);
                    }
                }
            }
        }
    }
    fn report(&self, p: &[T], fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        let factor = match self.of {
            Of::Drag => 1.0,
            // On the base curve d ln mu / d slip is 1.2 / critical slip at half of that.
            Of::Radius => 1.2 / fitted.law.critical.value(),
        };
        self.form.report(p, factor)
    }
}
