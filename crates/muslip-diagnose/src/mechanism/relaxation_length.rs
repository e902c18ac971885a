//! Force builds up over a rolling distance (lag time = length / speed).

use super::filters::first_order;
use super::prelude::*;

/// What is delayed by rolling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// The slip that the tyre feels.
    Slip,
    /// The force.
    Force,
}

/// All forms.
pub const FORMS: [Form; 2] = [Form::Slip, Form::Force];

/// Force builds up over a rolling distance (lag time = length / speed).
pub struct RelaxationLength {
    /// Which form.
    pub form: Form,
}

impl Describe for RelaxationLength {
    fn facts(&self) -> Facts {
        let (form, stage, equation) = match self.form {
            Form::Slip => (
                "slip",
                Stage::Slip,
                "drag = normal_force * mu(slip'), length * d(slip')/dt = v * (slip - slip')",
            ),
            Form::Force => (
                "force",
                Stage::Contact,
                "length * d(drag)/dt = v * (normal_force * mu(slip) - drag)",
            ),
        };
        Facts {
            form,
            filters: true,
            ..Facts::of(Id::RelaxationLength, stage, equation)
        }
    }
    fn memory_s(&self, p: &[f64], context: &Context) -> Option<f64> {
        Some(p.first()? / context.mean_speed)
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        vec![Parameter::new(
            "length",
            "m",
            1e-5,
            (8.0 * context.radius).max(0.05),
        )]
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        [0.08, 0.25, 0.7, 1.5, 3.0]
            .iter()
            .map(|m| vec![m * search.context.radius])
            .collect()
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!("force builds up over {:.3} m of rolling", reported[0].value)
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "The carcass must deflect before the contact patch feels a new slip, and it deflects as the wheel rolls: the force follows slip over a rolling distance and not over a time. The lag is long at low speed and short at high speed.",
            kind: Kind::Tyre,
            touches: &[Balance::Tyre],
            memory: Memory::Kernel,
            sign: Sign::Positive,
            aliases: &[],
            smallest: "three tenths of the wheel's radius",
            smallest_size: |c| 0.3 * c.radius,
            compensation: Compensation::By(
                "filters the slip (or the friction) that the update is given by the same distance",
            ),
            carried: "as it is: settled at the run's first sample",
            example: Example::of("slip", &[0.6]),
        }
    }
}

impl<T: Number> Mechanism<T> for RelaxationLength {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        let speed: Vec<f64> = series
            .speed
            .smooth
            .iter()
            .map(|v| v.abs().max(0.05))
            .collect();
        let rate = T::constant(1.0) / p[0];
        let step = |k: usize| rate * (series.dt[k] * 0.5 * (speed[k] + speed[k - 1]));
        match self.form {
            Form::Slip => first_order(&mut state.slip, step),
            Form::Force => first_order(&mut state.force, step),
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new("length", "m", p[0])]
    }
}
