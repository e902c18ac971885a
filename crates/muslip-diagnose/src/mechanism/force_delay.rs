//! The drag channel reports late by a fixed time.

use super::late;
use super::prelude::*;

/// The drag channel reports late by a fixed time.
pub struct ForceDelay;

impl Describe for ForceDelay {
    fn facts(&self) -> Facts {
        let equation = "reading(t) = drag(t - delay)";
        Facts {
            filters: true,
            ..Facts::of(Id::ForceDelay, Stage::Line, equation)
        }
    }
    fn memory_s(&self, p: &[f64], _context: &Context) -> Option<f64> {
        p.first().copied()
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let most = late::longest(0.15, context);
        vec![Parameter::new("delay", "s", 0.0, most)]
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        late::starts(&[0.5, 1.5, 4.0, 10.0, 25.0, 60.0], search.context)
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the drag channel reports {:.1} ms late",
            1e3 * reported[0].value
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "A converter, a bus or a logger hands the drag on a fixed time after it acted. Every feature comes later, and none is rounded.",
            kind: Kind::Chain,
            touches: &[Balance::Tyre, Balance::Wheel, Balance::Vehicle],
            memory: Memory::Kernel,
            sign: Sign::Positive,
            aliases: &[
                late::AT_ONE_SPEED,
                late::AT_ONE_RATE,
                Alias {
                    with: Id::ForceLag,
                    why: "A short filter delays slow features by its time constant.",
                    run: runs::TAP_IMPULSE,
                },
                Alias {
                    with: Id::StructuralResonance,
                    why: "Far below its frequency a resonance is a delay of 2 zeta/W.",
                    run: runs::TAP_IMPULSE,
                },
                late::AS_THE_WHEEL_SLOWS,
            ],
            smallest: "five milliseconds, less where slip moves fast",
            smallest_size: |_| 0.005,
            compensation: Compensation::By(
                "delays the slip and the load by the same time in a delay line, so that they meet the force that belongs to them",
            ),
            carried: "as it is",
            example: Example::of("", &[0.02]),
        }
    }
}

impl<T: Number> Mechanism<T> for ForceDelay {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        let delay = p[0].value();
        if delay <= 0.0 && p[0] == T::constant(0.0) {
            return;
        }
        let input = state.force.clone();
        let n = input.len();
        let mut at = 0;
        for k in 0..n {
            let wanted = series.time[k] - delay;
            while at + 1 < n && series.time[at + 1] <= wanted {
                at += 1;
            }
            if wanted <= series.time[0] || n < 4 {
                state.force[k] = input[0];
                continue;
            }
            // Cubic Lagrange over the four samples around the wanted time.
            let from = at.saturating_sub(1).min(n - 4);
            let mut y = T::constant(0.0);
            for (i, value) in input.iter().enumerate().skip(from).take(4) {
                let mut weight = T::constant(1.0);
                for j in from..from + 4 {
                    if i != j {
                        let gap = series.time[i] - series.time[j];
                        weight = weight * ((-p[0] + (series.time[k] - series.time[j])) / gap);
                    }
                }
                y += *value * weight;
            }
            state.force[k] = y;
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new("delay", "s", p[0])]
    }
}
