//! Brake torque follows pressure with a lag.

use super::filters::first_order;
use super::guide::runs;
use super::{
    Alias, Balance, Compensation, Context, Describe, Example, Guide, Id, Kind, Law, Mechanism,
    Memory, Parameter, Reported, Residuals, Sign, Stage, State,
};
use crate::number::Number;
use crate::series::Series;

/// Brake torque follows pressure with a lag.
pub struct BrakeLag;

impl Describe for BrakeLag {
    fn id(&self) -> Id {
        Id::BrakeLag
    }
    fn stage(&self) -> Stage {
        Stage::Wheel
    }
    fn memory_s(&self, p: &[f64], _context: &Context) -> Option<f64> {
        p.first().copied()
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        vec![Parameter::new(
            "time_constant",
            "s",
            1e-5,
            1.0_f64.min(0.25 * context.duration),
        )]
    }
    fn starts(
        &self,
        context: &Context,
        _series: &[Series],
        _evidence: &[Residuals],
    ) -> Vec<Vec<f64>> {
        [2.0, 6.0, 20.0, 60.0, 200.0]
            .iter()
            .map(|m| vec![m * 1e-3])
            .filter(|s| s[0] > 0.2 * context.dt)
            .collect()
    }
    fn equation(&self) -> &'static str {
        "time_constant * dT/dt + T = torque_per_pressure * pressure"
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
            compensation: Compensation::Not("not of the tyre balance: it does not touch the curve"),
            carried: "as it is: settled at the run's first sample",
            example: Example {
                form: "",
                parameters: &[0.03],
            },
        }
    }
}

impl<T: Number> Mechanism<T> for BrakeLag {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        let rate = T::constant(1.0) / p[0];
        first_order(&mut state.brake, |k| rate * series.dt[k]);
    }
    fn report(
        &self,
        p: &[T],
        _law: &Law<T>,
        _context: &Context,
        _series: &[Series],
    ) -> Vec<Reported<T>> {
        vec![Reported {
            name: "time_constant",
            unit: "s",
            value: p[0],
        }]
    }
}
