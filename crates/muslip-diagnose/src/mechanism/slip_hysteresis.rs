//! Rising slip and falling slip follow different curves, whatever the rate.

use super::prelude::*;

/// Rising slip and falling slip follow different curves, whatever the rate.
pub struct SlipHysteresis;

impl Describe for SlipHysteresis {
    fn facts(&self) -> Facts {
        Facts::of(
            Id::SlipHysteresis,
            Stage::Friction,
            "friction = mu(slip) * (1 + loop_share * z), dz/d(slip) = (sign(d slip) - z)/width * sign(d slip)",
        )
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        vec![
            Parameter::new("loop_share", "1", -0.6, 0.6),
            Parameter::new("width", "1", 0.001, 0.15),
        ]
    }
    fn starts(&self, _search: &Search<'_>) -> Vec<Vec<f64>> {
        [0.003, 0.012, 0.04].iter().map(|w| vec![0.0, *w]).collect()
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "friction follows a loop: rising and falling slip differ by {:.1} % either side of their mean, whatever the rate",
            100.0 * reported[0].value
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "On the way into a skid the contact patch is stuck and on the way back it is already sliding, so rising and falling slip follow different curves. The loop does not depend on the rate: that is what a lag would do.",
            kind: Kind::Tyre,
            touches: &[Balance::Tyre],
            memory: Memory::Kernel,
            sign: Sign::Either,
            aliases: &[],
            smallest: "half a loop's height of three percent of friction",
            smallest_size: |_| 0.03,
            compensation: Compensation::NOT_IN_THE_FILTER,
            carried: "as it is: on the middle of the loop at the run's first sample",
            example: Example::of("", &[0.08, 0.02]),
        }
    }
}

impl<T: Number> Mechanism<T> for SlipHysteresis {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        let mut z = T::constant(0.0);
        for k in 1..state.slip.len() {
            if !series.rolling[k] || !series.rolling[k - 1] {
                continue;
            }
            let change = state.slip[k] - state.slip[k - 1];
            let direction = if change.value() >= 0.0 { 1.0 } else { -1.0 };
            let stay = (-(change.abs() / p[1])).exp();
            z = (z - direction) * stay + direction;
            state.friction[k] = state.friction[k] * (p[0] * z + 1.0);
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new("loop_share", "1", p[0].abs())]
    }
}
