//! The drag channel passes a first-order low-pass filter.

use super::filters::first_order;
use super::late;
use super::prelude::*;
use crate::audit::Word;

/// The drag channel passes a first-order low-pass filter.
pub struct ForceLag;

impl Describe for ForceLag {
    fn facts(&self) -> Facts {
        let equation = "time_constant * d(reading)/dt + reading = drag";
        Facts {
            filters: true,
            finding: Some(Word::LowPassed),
            ..Facts::of(Id::ForceLag, Stage::Filter, equation)
        }
    }
    fn memory_s(&self, p: &[f64], _context: &Context) -> Option<f64> {
        p.first().copied()
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let most = late::longest(0.5, context);
        vec![Parameter::new("time_constant", "s", 1e-5, most)]
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        late::starts(&[0.6, 2.0, 6.0, 20.0, 60.0, 150.0], search.context)
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
                late::AT_ONE_SPEED,
                late::AT_ONE_RATE,
                Alias {
                    with: Id::StructuralResonance,
                    why: "Both filter; well damped they are nearly one.",
                    run: runs::TAP_STANDING,
                },
                late::AS_THE_WHEEL_SLOWS,
            ],
            smallest: "five milliseconds, less where slip moves fast",
            smallest_size: |_| 0.005,
            compensation: Compensation::By(
                "filters the slip and the load (or the friction) by the same time constant",
            ),
            carried: "as it is: settled at the run's first sample",
            example: Example::of("", &[0.03]),
        }
    }
}

impl<T: Number> Mechanism<T> for ForceLag {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        let rate = T::constant(1.0) / p[0];
        first_order(&mut state.force, |k| rate * series.dt[k]);
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new("time_constant", "s", p[0])]
    }
}
