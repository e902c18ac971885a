//! The translating mass is not the rig file's.

use super::prelude::*;

/// The translating mass is not the rig file's.
pub struct VehicleInertia;

impl Describe for VehicleInertia {
    fn facts(&self) -> Facts {
        Facts {
            drawn_over: Against::VehicleAcceleration,
            ..Facts::of(Id::VehicleInertia, Stage::Vehicle, "mass * dv/dt = -drag")
        }
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        vec![Parameter::new("mass_error", "1", -0.7, 2.0)]
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!("the translating mass is {:.4} kg", reported[0].value)
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "The mass that the tyre's drag slows is not the rig file's: fuel, passengers, a drum's own inertia. Deceleration under a known force tells it.",
            kind: Kind::Vehicle,
            touches: &[Balance::Vehicle],
            memory: Memory::None,
            sign: Sign::Either,
            aliases: &[],
            smallest: "three percent of the mass",
            smallest_size: |c| 0.03 * c.mass,
            compensation: Compensation::NOT_OF_THE_TYRE,
            carried: "as it is",
            example: Example::of("", &[0.15]),
        }
    }
}

impl<T: Number> Mechanism<T> for VehicleInertia {
    fn apply(&self, p: &[T], _series: &Series, _context: &Context, state: &mut State<T>) {
        state.inertia_change += p[0];
    }
    fn report(&self, p: &[T], fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new(
            "mass",
            "kg",
            (p[0] + 1.0) * fitted.context.mass,
        )]
    }
}
