//! The drag channel's scale is wrong.

use super::guide::runs;
use super::{
    Against, Alias, Balance, Compensation, Context, Describe, Example, Guide, Id, Kind, Law,
    Mechanism, Memory, Parameter, Reported, Residuals, Sign, Stage, State,
};
use crate::number::Number;
use crate::series::Series;

/// The drag channel's scale is wrong.
pub struct ForceGain;

impl Describe for ForceGain {
    fn id(&self) -> Id {
        Id::ForceGain
    }
    fn stage(&self) -> Stage {
        Stage::Vehicle
    }
    fn acts_also_at(&self) -> Option<Stage> {
        Some(Stage::Wheel)
    }
    fn drawn_over(&self) -> Against {
        Against::Drag
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        vec![Parameter::new("gain_error", "1", -0.6, 1.5)]
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
        "reading = gain * drag"
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
            example: Example {
                form: "",
                parameters: &[0.1],
            },
        }
    }
}

impl<T: Number> Mechanism<T> for ForceGain {
    fn apply(&self, p: &[T], _series: &Series, _context: &Context, state: &mut State<T>) {
        state.gain_change += p[0];
    }
    fn report(
        &self,
        p: &[T],
        _law: &Law<T>,
        _context: &Context,
        _series: &[Series],
    ) -> Vec<Reported<T>> {
        vec![Reported {
            name: "gain",
            unit: "1",
            value: p[0] + 1.0,
        }]
    }
}
