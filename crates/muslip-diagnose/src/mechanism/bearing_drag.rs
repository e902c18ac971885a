//! A torque that opposes rotation, beside brake and tyre.

use super::guide::runs;
use super::{
    Against, Alias, Balance, Compensation, Context, Describe, Example, Guide, Id, Kind, Law,
    Mechanism, Memory, Parameter, Reported, Residuals, Sign, Stage, State,
};
use crate::number::Number;
use crate::series::Series;

/// What the torque depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Nothing.
    Constant,
    /// Wheel speed.
    Speed,
    /// Normal force.
    Load,
}

/// All forms.
pub const FORMS: [Form; 3] = [Form::Constant, Form::Speed, Form::Load];

/// A torque that opposes rotation, beside brake and tyre.
pub struct BearingDrag {
    /// Which form.
    pub form: Form,
}

impl Describe for BearingDrag {
    fn id(&self) -> Id {
        Id::BearingDrag
    }
    fn form(&self) -> &'static str {
        match self.form {
            Form::Constant => "constant",
            Form::Speed => "with_speed",
            Form::Load => "with_load",
        }
    }
    fn stage(&self) -> Stage {
        Stage::Wheel
    }
    fn drawn_over(&self) -> Against {
        if self.form() == "with_load" {
            Against::NormalForce
        } else {
            Against::WheelSpeed
        }
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let scale = (context.mean_load * context.radius).max(1e-9);
        let mut all = vec![Parameter::new("torque", "N m", 0.0, 0.5 * scale)];
        match self.form {
            Form::Constant => {}
            Form::Speed => all.push(Parameter::new(
                "torque_with_speed",
                "N m",
                -0.5 * scale,
                0.5 * scale,
            )),
            Form::Load => all.push(Parameter::new(
                "torque_with_load",
                "N m",
                -0.5 * scale,
                0.5 * scale,
            )),
        }
        all
    }
    fn starts(
        &self,
        _context: &Context,
        _series: &[Series],
        _evidence: &[Residuals],
    ) -> Vec<Vec<f64>> {
        vec![vec![0.0; if self.form == Form::Constant { 1 } else { 2 }]]
    }
    fn equation(&self) -> &'static str {
        match self.form {
            Form::Constant => "J d(omega)/dt = R drag - brake_torque - torque",
            Form::Speed => "J d(omega)/dt = R drag - brake_torque - torque - a (omega/mean - 1)",
            Form::Load => {
                "J d(omega)/dt = R drag - brake_torque - torque - a (normal_force/mean - 1)"
            }
        }
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "a torque of {:.2} N m opposes the wheel's rotation beside brake and tyre",
            reported[0].value
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "Bearings, seals and a gear drag on the wheel beside brake and tyre, with a torque that may grow with speed or load. The wheel slows with the brake released.",
            kind: Kind::Wheel,
            touches: &[Balance::Wheel],
            memory: Memory::None,
            sign: Sign::Positive,
            aliases: &[Alias {
                with: Id::WheelInertia,
                why: "Where the wheel always slows at one rate, an inertia is a torque.",
                run: runs::BRAKE_LIFTED,
            }],
            smallest: "three percent of the largest drag at the radius",
            smallest_size: |c| 0.03 * c.max_drag.max(c.drag_sigma) * c.radius,
            compensation: Compensation::Not("not of the tyre balance: it does not touch the curve"),
            carried: "as it is, from the fresh run's own speed and load",
            example: Example {
                form: "constant",
                parameters: &[40.0],
            },
        }
    }
}

impl<T: Number> Mechanism<T> for BearingDrag {
    fn apply(&self, p: &[T], series: &Series, context: &Context, state: &mut State<T>) {
        for k in 0..state.opposing.len() {
            let omega = series.wheel.smooth[k];
            let mut torque = p[0];
            match self.form {
                Form::Constant => {}
                Form::Speed => {
                    torque += p[1] * (omega.abs() / context.mean_wheel_speed.max(1e-9) - 1.0)
                }
                Form::Load => torque += p[1] * (series.load.smooth[k] / context.mean_load - 1.0),
            }
            if omega < 0.0 {
                torque = -torque;
            }
            state.opposing[k] += torque;
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
            name: "torque",
            unit: "N m",
            value: p[0],
        }]
    }
}
