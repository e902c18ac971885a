//! A deceleration that grows with speed squared and is not tyre drag.

use super::prelude::*;

/// A deceleration that grows with speed squared and is not tyre drag.
pub struct AeroDrag;

impl Describe for AeroDrag {
    fn facts(&self) -> Facts {
        Facts {
            drawn_over: Against::VehicleSpeed,
            ..Facts::of(
                Id::AeroDrag,
                Stage::Vehicle,
                "m dv/dt = -drag - coefficient * v^2",
            )
        }
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        // Up to one g at the campaign's largest speed.
        let most = 9.81 * context.mass / context.max_speed.max(0.5).powi(2);
        vec![Parameter::new("coefficient", "kg/m", 0.0, most)]
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "a drag of {:.4} N per (m/s)^2 slows the vehicle beside the tyre",
            reported[0].value
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "The air slows the vehicle by a force that grows with the square of its speed, beside the tyre. It shows at high speed with the brake released.",
            kind: Kind::Vehicle,
            touches: &[Balance::Vehicle],
            memory: Memory::None,
            sign: Sign::Positive,
            aliases: &[
                Alias {
                    with: Id::GradeOrDrive,
                    why: "In a narrow range of speed its square is a constant.",
                    run: runs::COAST_DOWN,
                },
                Alias {
                    with: Id::VehicleInertia,
                    why: "Where all stops begin at one speed, deceleration goes with it.",
                    run: runs::COAST_DOWN,
                },
                Alias {
                    with: Id::ForceGain,
                    why: "Where all stops begin at one speed, drag goes with it.",
                    run: runs::COAST_DOWN,
                },
            ],
            smallest: "three percent of the largest drag at the largest speed",
            smallest_size: |c| 0.03 * c.max_drag.max(c.drag_sigma) / c.max_speed.max(0.1).powi(2),
            compensation: Compensation::NOT_OF_THE_TYRE,
            carried: "as it is, from the fresh run's own speed",
            example: Example::of("", &[0.8]),
        }
    }
}

impl<T: Number> Mechanism<T> for AeroDrag {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        for (f, v) in state.opposing.iter_mut().zip(&series.speed.smooth) {
            *f += p[0] * (v * v.abs());
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new("coefficient", "kg/m", p[0])]
    }
}
