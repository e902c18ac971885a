//! The drag channel reads a share of the normal force, also at standstill.

use super::prelude::*;

/// The drag channel reads a share of the normal force, also at standstill.
pub struct LoadCrosstalk;

impl Describe for LoadCrosstalk {
    fn facts(&self) -> Facts {
        Facts::of(
            Id::LoadCrosstalk,
            Stage::Reading,
            "reading = drag + share * normal_force",
        )
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        vec![Parameter::new("share", "1", -0.3, 0.3)]
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the drag channel reads {:.2} % of the normal force on top of the drag",
            100.0 * reported[0].value
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "A load cell that is not mounted square, or whose axes are not decoupled, reads a share of the normal force as drag. It does so at standstill too.",
            kind: Kind::LoadCell,
            touches: &[Balance::Tyre, Balance::Wheel, Balance::Vehicle],
            memory: Memory::None,
            sign: Sign::Either,
            aliases: &[
                Alias {
                    with: Id::RollingResistance,
                    why: "While the wheel rolls both are a share of the load.",
                    run: runs::LOAD_STEPS,
                },
                Alias {
                    with: Id::ZeroDrift,
                    why: "Under a constant load a share of it is a constant.",
                    run: runs::LOAD_STEPS,
                },
                Alias {
                    with: Id::LoadSensitivity,
                    why: "Both are read off how the drag goes with the load.",
                    run: runs::LOAD_STEPS,
                },
            ],
            smallest: "one percent of the load",
            smallest_size: |_| 0.01,
            compensation: Compensation::By("takes the share of the sample's load off the drag"),
            carried: "as it is, from the fresh run's own load",
            example: Example::of("", &[0.03]),
        }
    }
}

impl<T: Number> Mechanism<T> for LoadCrosstalk {
    fn apply(&self, p: &[T], _series: &Series, _context: &Context, state: &mut State<T>) {
        for (y, n) in state.force.iter_mut().zip(&state.load) {
            *y += *n * p[0];
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new("share", "1", p[0])]
    }
}
