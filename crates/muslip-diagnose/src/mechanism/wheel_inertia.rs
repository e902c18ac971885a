//! The wheel's inertia is not the rig file's.

use super::prelude::*;

/// The wheel's inertia is not the rig file's.
pub struct WheelInertia;

impl Describe for WheelInertia {
    fn facts(&self) -> Facts {
        Facts {
            drawn_over: Against::WheelAcceleration,
            scales_level: true,
            ..Facts::of(
                Id::WheelInertia,
                Stage::Wheel,
                "inertia * d(omega)/dt = R * drag - brake_torque",
            )
        }
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        vec![Parameter::new("inertia_error", "1", -0.8, 3.0)]
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!("the wheel's inertia is {:.5} kg m2", reported[0].value)
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "Disc, hub and drive turn with the wheel and add to its inertia, or the rig file has another wheel's. Torque over angular acceleration tells it.",
            kind: Kind::Wheel,
            touches: &[Balance::Wheel],
            memory: Memory::None,
            sign: Sign::Either,
            aliases: &[],
            smallest: "a tenth of the inertia",
            smallest_size: |c| 0.1 * c.inertia,
            compensation: Compensation::NOT_OF_THE_TYRE,
            carried: "as it is",
            example: Example::of("", &[0.3]),
        }
    }
}

impl<T: Number> Mechanism<T> for WheelInertia {
    fn apply(&self, p: &[T], _series: &Series, _context: &Context, state: &mut State<T>) {
        state.inertia_change += p[0];
    }
    fn report(&self, p: &[T], fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new(
            "inertia",
            "kg m2",
            (p[0] + 1.0) * fitted.context.inertia,
        )]
    }
}
