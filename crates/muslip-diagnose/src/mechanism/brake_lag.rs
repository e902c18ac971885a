//! Brake torque follows pressure with a lag.

use super::filters::first_order;
use super::late;
use super::prelude::*;

/// Brake torque follows pressure with a lag.
pub struct BrakeLag;

impl Describe for BrakeLag {
    fn facts(&self) -> Facts {
        Facts {
            audited: Some(Audited::EarlyBrake),
            ..Facts::of(
                Id::BrakeLag,
                Stage::Wheel,
                "time_constant * dT/dt + T = torque_per_pressure * pressure",
            )
        }
    }
    fn memory_s(&self, p: &[f64], _context: &Context) -> Option<f64> {
        p.first().copied()
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let most = late::longest(1.0, context);
        vec![Parameter::new("time_constant", "s", 1e-5, most)]
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        late::starts(&[2.0, 6.0, 20.0, 60.0, 200.0], search.context)
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "brake torque follows the commanded torque with a time constant of {:.1} ms",
            1e3 * reported[0].value
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "Fluid, hoses and calliper must move before the pads press, so torque follows the pressure with a lag. It shows where the pressure steps.",
            kind: Kind::Wheel,
            touches: &[Balance::Wheel],
            memory: Memory::Kernel,
            sign: Sign::Positive,
            aliases: &[
                Alias {
                    with: Id::WheelInertia,
                    why: "Both delay how the wheel answers a step.",
                    run: runs::BRAKE_LIFTED,
                },
                Alias {
                    with: Id::BearingDrag,
                    why: "On ramps a lag is a constant torque that is missing.",
                    run: runs::BRAKE_LIFTED,
                },
            ],
            smallest: "five milliseconds; one to two are within the bias of ideal sensors",
            smallest_size: |_| 0.005,
            compensation: Compensation::NOT_OF_THE_TYRE,
            carried: "as it is: settled at the run's first sample",
            example: Example::of("", &[0.03]),
        }
    }
}

impl<T: Number> Mechanism<T> for BrakeLag {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        let rate = T::constant(1.0) / p[0];
        first_order(&mut state.brake, |k| rate * series.dt[k]);
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new("time_constant", "s", p[0])]
    }
}
