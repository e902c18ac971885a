//! Drag on a rolling, unbraked wheel, proportional to load, absent at standstill.

use super::{Context, Describe, Evidence, Id, Law, Mechanism, Parameter, Reported, Stage, State};
use crate::number::Number;
use crate::prepare::Series;

/// Drag on a rolling, unbraked wheel, proportional to load, absent at standstill.
pub struct RollingResistance {
    /// Whether it grows with speed squared.
    pub growing: bool,
}

impl Describe for RollingResistance {
    fn id(&self) -> Id {
        Id::RollingResistance
    }
    fn form(&self) -> &'static str {
        if self.growing {
            "growing_with_speed"
        } else {
            "constant"
        }
    }
    fn stage(&self) -> Stage {
        Stage::Contact
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        let mut all = vec![Parameter::new("coefficient", "1", -0.02, 0.15)];
        if self.growing {
            all.push(Parameter::new("growth", "1", -1.0, 5.0));
        }
        all
    }
    fn starts(
        &self,
        _context: &Context,
        _series: &[Series],
        _evidence: &[Evidence],
    ) -> Vec<Vec<f64>> {
        vec![if self.growing {
            vec![0.01, 0.0]
        } else {
            vec![0.0]
        }]
    }
    fn equation(&self) -> &'static str {
        "drag = normal_force * (mu(slip) + coefficient)"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the rolling wheel drags with {:.4} of the normal force without any braking",
            reported[0].value
        )
    }
}

impl<T: Number> Mechanism<T> for RollingResistance {
    fn apply(&self, p: &[T], series: &Series, context: &Context, state: &mut State<T>) {
        let mut moment = vec![T::constant(0.0); state.force.len()];
        for k in 0..state.force.len() {
            // Gone at standstill and when the wheel no longer rolls.
            let surface = series.wheel.smooth[k] * context.radius;
            if !series.rolling[k] || !(surface > 0.0) {
                continue;
            }
            let mut coefficient = p[0] * (surface / 0.3).tanh();
            if self.growing {
                let relative = series.speed.smooth[k] / context.mean_speed;
                coefficient = coefficient * (p[1] * (relative * relative - 1.0) + 1.0);
            }
            state.force[k] += coefficient * state.load[k];
            moment[k] = coefficient * state.load[k] * context.radius;
        }
        if self.growing {
            state.rolling_moment = Some(moment);
        }
    }
    fn report(
        &self,
        p: &[T],
        _law: &Law<T>,
        _context: &Context,
        _series: &[Series],
    ) -> Vec<Reported<T>> {
        vec![Reported {
            name: "coefficient",
            unit: "1",
            value: p[0],
        }]
    }
}
