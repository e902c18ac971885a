//! The translating mass is not the rig file's.

use super::{
    Against, Balance, Compensation, Context, Describe, Example, Guide, Id, Kind, Law, Mechanism,
    Memory, Parameter, Reported, Residuals, Sign, Stage, State,
};
use crate::number::Number;
use crate::series::Series;

/// The translating mass is not the rig file's.
pub struct VehicleInertia;

impl Describe for VehicleInertia {
    fn id(&self) -> Id {
        Id::VehicleInertia
    }
    fn stage(&self) -> Stage {
        Stage::Vehicle
    }
    fn drawn_over(&self) -> Against {
        Against::VehicleAcceleration
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        vec![Parameter::new("mass_error", "1", -0.7, 2.0)]
    }
    fn starts(
        &self,
        _context: &Context,
        _series: &[Series],
        _evidence: &[Residuals],
    ) -> Vec<Vec<f64>> {
        vec![vec![0.0]]
    }
    fn equation(&self) -> &'static str {
        "mass * dv/dt = -drag"
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
            compensation: Compensation::Not("not of the tyre balance: it does not touch the curve"),
            carried: "as it is",
            example: Example {
                form: "",
                parameters: &[0.15],
            },
        }
    }
}

impl<T: Number> Mechanism<T> for VehicleInertia {
    fn apply(&self, p: &[T], _series: &Series, _context: &Context, state: &mut State<T>) {
        state.inertia_change += p[0];
    }
    fn report(
        &self,
        p: &[T],
        _law: &Law<T>,
        context: &Context,
        _series: &[Series],
    ) -> Vec<Reported<T>> {
        vec![Reported {
            name: "mass",
            unit: "kg",
            value: (p[0] + 1.0) * context.mass,
        }]
    }
}
