//! The wheel's inertia is not the rig file's.

use super::{
    Against, Balance, Compensation, Context, Describe, Example, Guide, Id, Kind, Law, Mechanism,
    Memory, Parameter, Reported, Residuals, Sign, Stage, State,
};
use crate::number::Number;
use crate::series::Series;

/// The wheel's inertia is not the rig file's.
pub struct WheelInertia;

impl Describe for WheelInertia {
    fn id(&self) -> Id {
        Id::WheelInertia
    }
    fn stage(&self) -> Stage {
        Stage::Wheel
    }
    fn drawn_over(&self) -> Against {
        Against::WheelAcceleration
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        vec![Parameter::new("inertia_error", "1", -0.8, 3.0)]
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
        "inertia * d(omega)/dt = R * drag - brake_torque"
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
            compensation: Compensation::Not("not of the tyre balance: it does not touch the curve"),
            carried: "as it is",
            example: Example {
                form: "",
                parameters: &[0.3],
            },
        }
    }
}

impl<T: Number> Mechanism<T> for WheelInertia {
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
            name: "inertia",
            unit: "kg m2",
            value: (p[0] + 1.0) * context.inertia,
        }]
    }
}
