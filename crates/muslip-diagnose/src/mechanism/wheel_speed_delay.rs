//! The wheel-speed channel reports late, relative to the other channels, by a fixed time.

use super::guide::runs;
use super::speed_delay::{parameters, report, shift, starts, statement};
use super::{
    Alias, Balance, Compensation, Context, Describe, Example, Guide, Id, Kind, Law, Mechanism,
    Memory, Parameter, Reported, Residuals, Sign, Speed, Stage, State,
};
use crate::number::Number;
use crate::series::Series;

/// The wheel-speed channel reports late, relative to the other channels, by a fixed time.
pub struct WheelSpeedDelay;

impl Describe for WheelSpeedDelay {
    fn id(&self) -> Id {
        Id::WheelSpeedDelay
    }
    fn stage(&self) -> Stage {
        Stage::Kinematics
    }
    fn through_force(&self) -> bool {
        false
    }
    fn late(&self) -> Option<Speed> {
        Some(Speed::Wheel)
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        parameters(context)
    }
    fn starts(
        &self,
        context: &Context,
        _series: &[Series],
        _evidence: &[Residuals],
    ) -> Vec<Vec<f64>> {
        starts(context)
    }
    fn equation(&self) -> &'static str {
        "measured omega(t) = omega(t - delay)"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        statement("wheel speed", reported[0].value)
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
            compensation: Compensation::Not(
                "all other channels would have to wait for the late one, and the filter keeps no line of them",
            ),
            carried: "as it is, for the same instrument",
            example: Example {
                form: "",
                parameters: &[0.02],
            },
        }
    }
}

impl<T: Number> Mechanism<T> for WheelSpeedDelay {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        shift(&mut state.omega, &series.wheel, series, p[0]);
    }
    fn report(
        &self,
        p: &[T],
        _law: &Law<T>,
        _context: &Context,
        _series: &[Series],
    ) -> Vec<Reported<T>> {
        report(p)
    }
}
