//! A constant deceleration or acceleration that is not tyre drag.

use super::guide::runs;
use super::{
    Against, Alias, Balance, Compensation, Context, Describe, Example, Guide, Id, Kind, Law,
    Mechanism, Memory, Parameter, Reported, Residuals, Sign, Stage, State,
};
use crate::number::Number;
use crate::series::Series;

/// A constant deceleration or acceleration that is not tyre drag.
pub struct GradeOrDrive;

impl Describe for GradeOrDrive {
    fn id(&self) -> Id {
        Id::GradeOrDrive
    }
    fn stage(&self) -> Stage {
        Stage::Vehicle
    }
    fn drawn_over(&self) -> Against {
        Against::VehicleSpeed
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let most = 9.81 * context.mass;
        vec![Parameter::new("force", "N", -most, most)]
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
        "m dv/dt = -drag - force"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "a constant force of {:.1} N {} the vehicle beside the tyre's drag",
            reported[0].value.abs(),
            if reported[0].value >= 0.0 {
                "slows"
            } else {
                "drives"
            }
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "A slope of the track, a dragging second brake or a drive that is not quite off acts on the vehicle with a constant force. It does so whether the wheel is braked or not.",
            kind: Kind::Vehicle,
            touches: &[Balance::Vehicle],
            memory: Memory::None,
            sign: Sign::Either,
            aliases: &[Alias {
                with: Id::VehicleInertia,
                why: "Under a steady drag a share of the deceleration is a constant.",
                run: runs::COAST_DOWN,
            }],
            smallest: "three percent of the largest drag",
            smallest_size: |c| 0.03 * c.max_drag.max(c.drag_sigma),
            compensation: Compensation::Not("not of the tyre balance: it does not touch the curve"),
            carried: "as it is, on the same track in the same direction",
            example: Example {
                form: "",
                parameters: &[-300.0],
            },
        }
    }
}

impl<T: Number> Mechanism<T> for GradeOrDrive {
    fn apply(&self, p: &[T], _series: &Series, _context: &Context, state: &mut State<T>) {
        for f in &mut state.opposing {
            *f += p[0];
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
            name: "force",
            unit: "N",
            value: p[0],
        }]
    }
}
