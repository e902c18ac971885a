//! The wheel-speed channel reports late, relative to the other channels, by a fixed time.

use super::speed_delay::{parameters, report, shift, starts, statement};
use super::{Context, Describe, Evidence, Id, Law, Mechanism, Parameter, Reported, Stage, State};
use crate::number::Number;
use crate::prepare::Series;

/// The wheel-speed channel reports late, relative to the other channels, by a fixed time.
pub struct WheelSpeedDelay;

impl Describe for WheelSpeedDelay {
    fn id(&self) -> Id {
        Id::WheelSpeedDelay
    }
    fn stage(&self) -> Stage {
        Stage::Kinematics
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        parameters(context)
    }
    fn starts(
        &self,
        context: &Context,
        _series: &[Series],
        _evidence: &[Evidence],
    ) -> Vec<Vec<f64>> {
        starts(context)
    }
    fn equation(&self) -> &'static str {
        "measured omega(t) = omega(t - delay)"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        statement("wheel speed", reported[0].value)
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
