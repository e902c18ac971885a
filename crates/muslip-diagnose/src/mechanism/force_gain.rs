//! The drag channel's scale is wrong.

use super::prelude::*;

/// The drag channel's scale is wrong.
pub struct ForceGain;

impl Describe for ForceGain {
    fn facts(&self) -> Facts {
        Facts {
            acts_also_at: Some(Stage::Wheel),
            drawn_over: Against::Drag,
            ..Facts::of(Id::ForceGain, Stage::Vehicle, "reading = gain * drag")
        }
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        vec![Parameter::new("gain_error", "1", -0.6, 1.5)]
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the drag channel reads {:.3} times the true drag",
            reported[0].value
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "The drag channel's calibration is wrong by a factor. The tyre balance cannot see it, for peak friction takes it up; mass times deceleration, and the brake's torque, do.",
            kind: Kind::LoadCell,
            touches: &[Balance::Wheel, Balance::Vehicle],
            memory: Memory::None,
            sign: Sign::Either,
            aliases: &[
                Alias {
                    with: Id::VehicleInertia,
                    why: "Force over mass is all that a deceleration shows.",
                    run: runs::KNOWN_WEIGHT,
                },
                Alias {
                    with: Id::WheelInertia,
                    why: "Torque over inertia is all that the wheel's acceleration shows.",
                    run: runs::KNOWN_WEIGHT,
                },
                Alias {
                    with: Id::BearingDrag,
                    why: "Under a steady drag a share of it is a constant torque.",
                    run: runs::KNOWN_WEIGHT,
                },
                Alias {
                    with: Id::GradeOrDrive,
                    why: "Under a steady drag a share of it is a constant force.",
                    run: runs::KNOWN_WEIGHT,
                },
            ],
            smallest: "three percent of the scale",
            smallest_size: |_| 0.03,
            compensation: Compensation::Not(
                "the scale of the drag channel: peak friction is wrong by the same factor",
            ),
            carried: "as it is; the load cell of a fresh run reads as wrongly",
            example: Example::of("", &[0.1]),
        }
    }
}

impl<T: Number> Mechanism<T> for ForceGain {
    fn apply(&self, p: &[T], _series: &Series, _context: &Context, state: &mut State<T>) {
        state.gain_change += p[0];
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new("gain", "1", p[0] + 1.0)]
    }
}
