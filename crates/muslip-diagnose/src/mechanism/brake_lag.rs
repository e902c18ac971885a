//! Brake torque follows pressure with a lag.

use super::filters::first_order;
use super::{Context, Describe, Evidence, Id, Law, Mechanism, Parameter, Reported, Stage, State};
use crate::number::Number;
use crate::prepare::Series;

/// Brake torque follows pressure with a lag.
pub struct BrakeLag;

impl Describe for BrakeLag {
    fn id(&self) -> Id {
        Id::BrakeLag
    }
    fn stage(&self) -> Stage {
        Stage::Wheel
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        vec![Parameter::new(
            "time_constant",
            "s",
            1e-5,
            1.0_f64.min(0.25 * context.duration),
        )]
    }
    fn starts(
        &self,
        context: &Context,
        _series: &[Series],
        _evidence: &[Evidence],
    ) -> Vec<Vec<f64>> {
        [2.0, 6.0, 20.0, 60.0, 200.0]
            .iter()
            .map(|m| vec![m * 1e-3])
            .filter(|s| s[0] > 0.2 * context.dt)
            .collect()
    }
    fn equation(&self) -> &'static str {
        "time_constant * dT/dt + T = torque_per_pressure * pressure"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "brake torque follows the commanded torque with a time constant of {:.1} ms",
            1e3 * reported[0].value
        )
    }
}

impl<T: Number> Mechanism<T> for BrakeLag {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        let rate = T::constant(1.0) / p[0];
        first_order(&mut state.brake, |k| rate * series.dt[k]);
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
