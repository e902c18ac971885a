//! The drag channel also reads a share of the wheel's angular acceleration.

use super::prelude::*;

/// The drag channel also reads a share of the wheel's angular acceleration.
pub struct InertialReaction;

impl Describe for InertialReaction {
    fn facts(&self) -> Facts {
        Facts {
            fed_by_chain: true,
            ..Facts::of(
                Id::InertialReaction,
                Stage::Reading,
                "reading = drag + share * d(omega)/dt",
            )
        }
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
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the drag channel also reads the wheel's angular acceleration, {:.3} N per rad/s2",
            reported[0].value
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "The load cell sits where the wheel's own inertia pulls on it too, so what accelerates the wheel is read as drag. It shows when the wheel locks or spins up, and not at a constant speed.",
            kind: Kind::LoadCell,
            touches: &[Balance::Tyre],
            memory: Memory::None,
            sign: Sign::Either,
            aliases: &[
                Alias {
                    with: Id::SlipHysteresis,
                    why: "The wheel slows while slip rises and speeds up while it falls.",
                    run: runs::STOP_LIFTED,
                },
                Alias {
                    with: Id::RelaxationLength,
                    why: "What is in proportion to the rate of slip looks like a lag.",
                    run: runs::STOP_LIFTED,
                },
            ],
            smallest: "a tenth of what the wheel's whole inertia would make at its radius",
            smallest_size: |c| 0.1 * c.inertia / c.radius.max(0.005),
            compensation: Compensation::NOT_IN_THE_FILTER,
            carried: "as it is, from the fresh run's own wheel speed",
            example: Example::of("", &[1.5]),
        }
    }
}

impl<T: Number> Mechanism<T> for InertialReaction {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        for (y, a) in state.force.iter_mut().zip(&series.wheel.rate) {
            *y += p[0] * *a;
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new("share", "kg m", p[0])]
    }
}
