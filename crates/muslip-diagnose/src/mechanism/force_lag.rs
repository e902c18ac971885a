//! The drag channel passes a first-order low-pass filter.

use super::filters::first_order;
use super::guide::runs;
use super::{
    Alias, Balance, Compensation, Context, Describe, Example, Guide, Id, Kind, Law, Mechanism,
    Memory, Parameter, Reported, Residuals, Sign, Stage, State,
};
use crate::number::Number;
use crate::series::Series;

/// The drag channel passes a first-order low-pass filter.
pub struct ForceLag;

impl Describe for ForceLag {
    fn id(&self) -> Id {
        Id::ForceLag
    }
    fn stage(&self) -> Stage {
        Stage::Filter
    }
    fn memory_s(&self, p: &[f64], _context: &Context) -> Option<f64> {
        p.first().copied()
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        vec![Parameter::new(
            "time_constant",
            "s",
            1e-5,
            0.5_f64.min(0.25 * context.duration),
        )]
    }
    fn starts(
        &self,
        context: &Context,
        _series: &[Series],
        _evidence: &[Residuals],
    ) -> Vec<Vec<f64>> {
        [0.6, 2.0, 6.0, 20.0, 60.0, 150.0]
            .iter()
            .map(|m| vec![m * 1e-3])
            .filter(|s| s[0] > 0.2 * context.dt)
            .collect()
    }
    fn equation(&self) -> &'static str {
        "time_constant * d(reading)/dt + reading = drag"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the drag channel is low-pass filtered with a time constant of {:.1} ms",
            1e3 * reported[0].value
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "An anti-aliasing filter or the averaging of an amplifier follows the force with a time constant: slow features come late by it, fast ones are rounded and weakened. It does not depend on the speed.",
            kind: Kind::Chain,
            touches: &[Balance::Tyre, Balance::Wheel, Balance::Vehicle],
            memory: Memory::Kernel,
            sign: Sign::Positive,
            aliases: &[
                Alias {
                    with: Id::RelaxationLength,
                    why: "At one speed a distance is a time.",
                    run: runs::RAMP_SPEEDS,
                },
                Alias {
                    with: Id::SlipHysteresis,
                    why: "At one rate of slip what comes late opens the same loop.",
                    run: runs::RAMP_SPEEDS,
                },
                Alias {
                    with: Id::StructuralResonance,
                    why: "Both filter; well damped they are nearly one.",
                    run: runs::TAP_STANDING,
                },
                Alias {
                    with: Id::InertialReaction,
                    why: "When the wheel slows before the force falls, its acceleration looks like the force's past.",
                    run: runs::STOP_LIFTED,
                },
            ],
            smallest: "five milliseconds, less where slip moves fast",
            smallest_size: |_| 0.005,
            compensation: Compensation::By(
                "filters the slip and the load (or the friction) by the same time constant",
            ),
            carried: "as it is: settled at the run's first sample",
            example: Example {
                form: "",
                parameters: &[0.03],
            },
        }
    }
}

impl<T: Number> Mechanism<T> for ForceLag {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        let rate = T::constant(1.0) / p[0];
        first_order(&mut state.force, |k| rate * series.dt[k]);
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
