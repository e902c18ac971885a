//! The vehicle-speed channel reports late, relative to the other channels, by a fixed time.

use super::prelude::*;
use super::speed_delay;

/// Slowest speed that a shifted reading may come to while the wheel rolls, in m/s: slip divides by it.
const SLOWEST_M_S: f64 = 0.5;

/// The vehicle-speed channel reports late, relative to the other channels, by a fixed time.
pub struct VehicleSpeedDelay;

impl Describe for VehicleSpeedDelay {
    fn facts(&self) -> Facts {
        Facts {
            through_force: false,
            late: Some(Speed::Vehicle),
            ..Facts::of(
                Id::VehicleSpeedDelay,
                Stage::Kinematics,
                "measured v(t) = v(t - delay)",
            )
        }
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        speed_delay::parameters(context)
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        speed_delay::starts(search.context)
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        speed_delay::statement("vehicle speed", reported[0].value)
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "A satellite receiver, an optical sensor or a bus hands the vehicle speed on after a fixed time, while force and wheel are read at once. While the vehicle slows down the speed is then too high, and slip with it.",
            kind: Kind::Chain,
            touches: &[Balance::Tyre, Balance::Vehicle],
            memory: Memory::Kernel,
            sign: Sign::Either,
            aliases: &[
                Alias {
                    with: Id::WheelSpeedDelay,
                    why: "Slip is formed of both: one late is the other early.",
                    run: runs::TAP_BRAKE,
                },
                Alias {
                    with: Id::ForceDelay,
                    why: "Only relative timing shows: a speed late against the force is the force early.",
                    run: runs::FREE_SPEEDS,
                },
                Alias {
                    with: Id::EffectiveRadius,
                    why: "Under a constant deceleration a late speed is too high by a constant, as slip is with a wrong radius.",
                    run: "Slow down in a freely rolling wheel, then hold the speed: a delay of a speed shows only while it changes, a wrong radius always.",
                },
            ],
            smallest: "five milliseconds: the slip is off by delay times deceleration over speed",
            smallest_size: |_| 0.005,
            compensation: speed_delay::COMPENSATION,
            carried: "as it is, for the same instrument",
            example: Example::of("", &[0.06]),
        }
    }
}

impl<T: Number> Mechanism<T> for VehicleSpeedDelay {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        speed_delay::shift(&mut state.speed, &series.speed, series, p[0]);
        for (v, rolling) in state.speed.iter_mut().zip(&series.rolling) {
            if *rolling && v.value() < SLOWEST_M_S {
                *v = T::constant(SLOWEST_M_S);
            }
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        speed_delay::report(p)
    }
}
