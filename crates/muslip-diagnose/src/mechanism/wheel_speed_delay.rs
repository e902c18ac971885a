//! The wheel-speed channel reports late, relative to the other channels, by a fixed time.

use super::prelude::*;
use super::speed_delay;

/// The wheel-speed channel reports late, relative to the other channels, by a fixed time.
pub struct WheelSpeedDelay;

impl Describe for WheelSpeedDelay {
    fn facts(&self) -> Facts {
        Facts {
            through_force: false,
            late: Some(Speed::Wheel),
            ..Facts::of(
                Id::WheelSpeedDelay,
                Stage::Kinematics,
                "measured omega(t) = omega(t - delay)",
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
        speed_delay::statement("wheel speed", reported[0].value)
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "A tone ring's period is only known when the next tooth has passed, and the logger may average several: the wheel speed comes late. When the wheel locks quickly, slip lags behind the force that it made.",
            kind: Kind::Chain,
            touches: &[Balance::Tyre, Balance::Wheel],
            memory: Memory::Kernel,
            sign: Sign::Either,
            aliases: &[
                Alias {
                    with: Id::ForceDelay,
                    why: "Only relative timing shows: a wheel speed late against the force is the force early.",
                    run: runs::FREE_SPEEDS,
                },
                Alias {
                    with: Id::ForceLag,
                    why: "What lags behind and what comes early differ by a sign only.",
                    run: runs::FREE_SPEEDS,
                },
                Alias {
                    with: Id::RelaxationLength,
                    why: "A slip that comes late has the opposite sign of a force that builds up late, and hides it.",
                    run: runs::RAMP_SPEEDS,
                },
                Alias {
                    with: Id::BrakeLag,
                    why: "The wheel answers a torque that it seems to get earlier or later.",
                    run: runs::TAP_BRAKE,
                },
            ],
            smallest: "five milliseconds; one where the wheel locks in a tenth of a second",
            smallest_size: |_| 0.005,
            compensation: speed_delay::COMPENSATION,
            carried: "as it is, for the same instrument",
            example: Example::of("", &[0.02]),
        }
    }
}

impl<T: Number> Mechanism<T> for WheelSpeedDelay {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        speed_delay::shift(&mut state.omega, &series.wheel, series, p[0]);
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        speed_delay::report(p)
    }
}
