//! A torque that opposes rotation, beside brake and tyre.

use super::prelude::*;

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
    fn facts(&self) -> Facts {
        let (form, drawn_over, equation) = match self.form {
            Form::Constant => (
                "constant",
                Against::WheelSpeed,
                "J d(omega)/dt = R drag - brake_torque - torque",
            ),
            Form::Speed => (
                "with_speed",
                Against::WheelSpeed,
                "J d(omega)/dt = R drag - brake_torque - torque - a (omega/mean - 1)",
            ),
            Form::Load => (
                "with_load",
                Against::NormalForce,
                "J d(omega)/dt = R drag - brake_torque - torque - a (normal_force/mean - 1)",
            ),
        };
        Facts {
            form,
            drawn_over,
            ..Facts::of(Id::BearingDrag, Stage::Wheel, equation)
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
            compensation: Compensation::NOT_OF_THE_TYRE,
            carried: "as it is, from the fresh run's own speed and load",
            example: Example::of("constant", &[40.0]),
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
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new("torque", "N m", p[0])]
    }
}
