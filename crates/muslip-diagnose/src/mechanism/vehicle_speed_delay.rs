//! The vehicle-speed channel reports late, relative to the other channels, by a fixed time.

use super::speed_delay::{parameters, report, shift, starts, statement};
use super::{Context, Describe, Evidence, Id, Law, Mechanism, Parameter, Reported, Stage, State};
use crate::number::Number;
use crate::prepare::Series;

/// Slowest speed that a shifted reading may come to while the wheel rolls, in m/s: slip divides by it.
const SLOWEST_M_S: f64 = 0.5;

/// The vehicle-speed channel reports late, relative to the other channels, by a fixed time.
pub struct VehicleSpeedDelay;

impl Describe for VehicleSpeedDelay {
    fn id(&self) -> Id {
        Id::VehicleSpeedDelay
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
        "measured v(t) = v(t - delay)"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        statement("vehicle speed", reported[0].value)
    }
}

impl<T: Number> Mechanism<T> for VehicleSpeedDelay {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        shift(&mut state.speed, &series.speed, series, p[0]);
        for (v, rolling) in state.speed.iter_mut().zip(&series.rolling) {
            if *rolling && v.value() < SLOWEST_M_S {
                *v = T::constant(SLOWEST_M_S);
            }
        }
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
