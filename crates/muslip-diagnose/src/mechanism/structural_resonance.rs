//! The load cell and its mount ring: a lightly damped second-order response.

use super::filters::second_order;
use super::prelude::*;
use crate::constants::RINGING;

/// How much of the force passes through what rings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// All of it: one mode.
    Whole,
    /// A share: the mode is one of several, the others far above.
    Share,
}

/// All forms.
pub const FORMS: [Form; 2] = [Form::Whole, Form::Share];

/// The load cell and its mount ring: a lightly damped second-order response.
pub struct StructuralResonance {
    /// Which form.
    pub form: Form,
}

impl Describe for StructuralResonance {
    fn facts(&self) -> Facts {
        let (form, amplitude, equation) = match self.form {
            Form::Whole => (
                "",
                None,
                "reading'' + 2 zeta W reading' + W^2 reading = W^2 drag, W = 2 pi frequency",
            ),
            Form::Share => (
                "share",
                Some(2),
                "reading = drag + share (y - drag), y'' + 2 zeta W y' + W^2 y = W^2 drag, W = 2 pi frequency",
            ),
        };
        Facts {
            form,
            amplitude,
            filters: true,
            audited: (self.form == Form::Whole).then_some(Audited::Ring),
            ..Facts::of(Id::StructuralResonance, Stage::Structure, equation)
        }
    }
    fn memory_s(&self, p: &[f64], _context: &Context) -> Option<f64> {
        let omega = core::f64::consts::TAU * p.first()?;
        let damping = p.get(1).copied().unwrap_or(1.0);
        // What rings remembers as long as it rings.
        Some(1.0 / (omega * if self.rings(p) { damping } else { 1.0 }))
    }
    fn rings(&self, p: &[f64]) -> bool {
        p.get(1).is_some_and(|damping| *damping < RINGING)
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let mut all = vec![
            Parameter::new("frequency", "Hz", 2.0, 0.45 / context.dt),
            Parameter::new("damping_ratio", "1", 0.002, self.most_damping()),
        ];
        if self.form == Form::Share {
            all.push(Parameter::new("share", "1", 0.0, 1.5));
        }
        all
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        let top = 0.4 / search.context.dt;
        let mut starts = Vec::new();
        let mut frequency = 4.0;
        while frequency < top.min(150.0) {
            match self.form {
                Form::Whole => starts.extend([0.03, 0.15].map(|zeta| vec![frequency, zeta])),
                Form::Share => starts.extend([0.03, 0.12].map(|zeta| vec![frequency, zeta, 0.0])),
            }
            frequency *= 1.19;
        }
        starts
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the load cell and its mount ring at {:.1} Hz with a damping ratio of {:.3}",
            reported[0].value, reported[1].value
        )
    }
    fn owns(&self, parameters: &[f64], _context: &Context) -> bool {
        self.form == Form::Whole || below_limit(parameters[1], self.most_damping())
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "Load cell and mount are a mass on a spring: each change of the force makes them ring at their own frequency until damping has taken it. The mean is right, the oscillation is not the tyre's.",
            kind: Kind::LoadCell,
            touches: &[Balance::Tyre, Balance::Wheel, Balance::Vehicle],
            memory: Memory::Kernel,
            sign: Sign::Positive,
            aliases: &[
                Alias {
                    with: Id::RunOut,
                    why: "At one speed a revolution is a frequency.",
                    run: runs::TAP_STANDING,
                },
                Alias {
                    with: Id::InertialReaction,
                    why: "A wheel that oscillates is read as a force that does.",
                    run: runs::TAP_STANDING,
                },
            ],
            smallest: "a frequency that lies within the recording's band: below about 30 Hz it disturbs a ramp",
            smallest_size: |_| 30.0,
            compensation: Compensation::NOT_IN_THE_FILTER,
            carried: "as it is: settled at the run's first sample",
            example: Example::of("", &[18.0, 0.05]),
        }
    }
}

impl StructuralResonance {
    /// A share that hardly rings is any difference between two filters.
    fn most_damping(&self) -> f64 {
        match self.form {
            Form::Whole => 0.3,
            Form::Share => 0.25,
        }
    }
}

impl<T: Number> Mechanism<T> for StructuralResonance {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        match self.form {
            Form::Whole => second_order(&mut state.force, &series.dt, p[0], p[1]),
            Form::Share => {
                let mut ringing = state.force.clone();
                second_order(&mut ringing, &series.dt, p[0], p[1]);
                for (y, ringing) in state.force.iter_mut().zip(ringing) {
                    *y += p[2] * (ringing - *y);
                }
            }
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![
            Reported::new("frequency", "Hz", p[0]),
            Reported::new("damping_ratio", "1", p[1]),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_that_rings_as_little_as_it_may_is_a_filter_s() {
        let context = Context::default();
        let [whole, share] = [Form::Whole, Form::Share].map(|form| StructuralResonance { form });
        let rings = |p: &[f64]| share.owns(p, &context);
        assert!(rings(&[20.0, 0.11, 0.4]) && !rings(&[20.0, 0.25, 0.4]));
        assert!(whole.owns(&[20.0, 0.3], &context));
    }
}
