//! A constant deceleration or acceleration that is not tyre drag.

use super::prelude::*;

/// A constant deceleration or acceleration that is not tyre drag.
pub struct GradeOrDrive;

impl Describe for GradeOrDrive {
    fn facts(&self) -> Facts {
        Facts {
            drawn_over: Against::VehicleSpeed,
            ..Facts::of(Id::GradeOrDrive, Stage::Vehicle, "m dv/dt = -drag - force")
        }
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let most = 9.81 * context.mass;
        vec![Parameter::new("force", "N", -most, most)]
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
            compensation: Compensation::NOT_OF_THE_TYRE,
            carried: "as it is, on the same track in the same direction",
            example: Example::of("", &[-300.0]),
        }
    }
}

impl<T: Number> Mechanism<T> for GradeOrDrive {
    fn apply(&self, p: &[T], _series: &Series, _context: &Context, state: &mut State<T>) {
        for f in &mut state.opposing {
            *f += p[0];
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new("force", "N", p[0])]
    }
}
