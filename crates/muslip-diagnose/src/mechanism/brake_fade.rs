//! Torque per pressure falls with brake temperature.

use super::prelude::*;

/// Brake temperature in units of the mean brake power times a second, from cold at the start of a run.
fn heat<T: Number>(time_constant: T, series: &Series, context: &Context) -> Vec<T> {
    let Some(torque) = &series.torque else {
        return Vec::new();
    };
    let rate = T::constant(1.0) / time_constant;
    let mut theta = T::constant(0.0);
    let scale = context.mean_brake_power.max(1e-9);
    (0..series.len())
        .map(|k| {
            let power = (torque.smooth[k] * series.wheel.smooth[k] / scale).max(0.0);
            let power = if power.is_finite() { power } else { 0.0 };
            // Exact for constant power over the step.
            let stay = (-(rate * series.dt[k])).exp();
            let settled = time_constant * power;
            theta = (theta - settled) * stay + settled;
            theta
        })
        .collect()
}

/// Shortest time constant in s: what cools faster is no brake, and follows the torque as a lag does.
const SHORTEST_S: f64 = 0.3;

/// Torque per pressure falls with brake temperature.
pub struct BrakeFade;

impl Describe for BrakeFade {
    fn facts(&self) -> Facts {
        Facts::of(
            Id::BrakeFade,
            Stage::Wheel,
            "T = torque_per_pressure * pressure * exp(-sensitivity * theta), d(theta)/dt = power/mean_power - theta/time_constant",
        )
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        vec![
            Parameter::new("sensitivity", "1/s", -2.0, 5.0),
            Parameter::new(
                "time_constant",
                "s",
                SHORTEST_S,
                (20.0 * context.duration).max(10.0),
            ),
        ]
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        [0.5, 2.0, 8.0, 40.0]
            .iter()
            .filter(|t| **t < 20.0 * search.context.duration)
            .map(|t| vec![0.0, *t])
            .collect()
    }
    fn owns(&self, parameters: &[f64], _context: &Context) -> bool {
        above_limit(parameters[1], SHORTEST_S)
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "brake torque per pressure falls by up to {:.1} % as the brake heats",
            100.0 * reported[0].value
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "Pads lose friction as the brake heats, so the same pressure gives less torque late in an application. It recovers as the brake cools.",
            kind: Kind::Wheel,
            touches: &[Balance::Wheel],
            memory: Memory::Run,
            sign: Sign::Positive,
            aliases: &[
                Alias {
                    with: Id::BrakeLag,
                    why: "Both take torque from a rising pressure.",
                    run: runs::BRAKE_LIFTED,
                },
                Alias {
                    with: Id::WheelInertia,
                    why: "Torque that is missing and inertia that is too small slow the wheel alike.",
                    run: runs::BRAKE_LIFTED,
                },
                Alias {
                    with: Id::BearingDrag,
                    why: "Torque that fades is a torque of the other sign beside the brake.",
                    run: runs::BRAKE_LIFTED,
                },
                Alias {
                    with: Id::ForceGain,
                    why: "The wheel's balance weighs torque against drag: either scale may be wrong.",
                    run: runs::BRAKE_LIFTED,
                },
            ],
            smallest: "five percent of the torque",
            smallest_size: |_| 0.05,
            compensation: Compensation::NOT_OF_THE_TYRE,
            carried: "starts cold in every run; heated by the fresh run's own brake power",
            example: Example::of("", &[0.1, 3.0]),
        }
    }
}

impl<T: Number> Mechanism<T> for BrakeFade {
    fn apply(&self, p: &[T], series: &Series, context: &Context, state: &mut State<T>) {
        for (torque, theta) in state.brake.iter_mut().zip(heat(p[1], series, context)) {
            *torque = *torque * (-(p[0] * theta)).exp();
        }
    }
    fn report(&self, p: &[T], fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        let mut largest = T::constant(0.0);
        for run in fitted.series {
            for theta in heat(p[1], run, fitted.context) {
                if theta.value() > largest.value() {
                    largest = theta;
                }
            }
        }
        let loss = -((-(p[0] * largest)).exp()) + 1.0;
        vec![
            Reported::new("torque_loss", "1", loss),
            Reported::new("time_constant", "s", p[1]),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cools_as_fast_as_it_may_is_no_brake() {
        let own = |time_constant: f64| BrakeFade.owns(&[0.1, time_constant], &Context::default());
        assert!(own(3.0) && !own(SHORTEST_S));
    }
}
