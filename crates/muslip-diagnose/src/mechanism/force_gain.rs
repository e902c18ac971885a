//! The drag channel's scale is wrong.

use super::prelude::*;

/// Largest bend over the largest reading.
const BEND: f64 = 0.2;
/// The same as a share of the scale's error: what bends by more is no scale's error, and a lag of the brake looks like it.
const MOST_BENT: f64 = 0.5;

/// Whether the scale's error is the same at every force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// One factor.
    Constant,
    /// It grows or falls a little with the force: no load cell is straight.
    Bent,
}

/// All forms.
pub const FORMS: [Form; 2] = [Form::Constant, Form::Bent];

/// The drag channel's scale is wrong.
pub struct ForceGain {
    /// Which form.
    pub form: Form,
}

impl Describe for ForceGain {
    fn facts(&self) -> Facts {
        let (form, equation) = match self.form {
            Form::Constant => ("", "reading = gain * drag"),
            Form::Bent => (
                "bent",
                "reading = drag (gain + bend (|reading| / largest reading - 1/2))",
            ),
        };
        Facts {
            form,
            acts_also_at: Some(Stage::Wheel),
            drawn_over: Against::Drag,
            ..Facts::of(Id::ForceGain, Stage::Vehicle, equation)
        }
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        let gain = Parameter::new("gain_error", "1", -0.6, 1.5);
        match self.form {
            Form::Constant => vec![gain],
            Form::Bent => vec![gain, Parameter::new("bend", "1", -BEND, BEND)],
        }
    }
    fn owns(&self, p: &[f64], _context: &Context) -> bool {
        let own = |bend: f64| below_limit(bend, BEND) && bend < MOST_BENT * p[0].abs();
        self.form == Form::Constant || own(p[1].abs())
    }
    fn statement(&self, reported: &[Reported<f64>], p: &[f64]) -> String {
        let by = reported[0].value;
        match self.form {
            Form::Constant => format!("the drag channel reads {by:.3} times the true drag"),
            Form::Bent => format!(
                "the drag channel reads {by:.3} times the true drag at half of its largest reading, {:.3} times at that",
                by + 0.5 * p[1]
            ),
        }
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "The drag channel's calibration is wrong by a factor, which may change a little with the force. The tyre balance hardly sees it, for peak friction takes it up; mass times deceleration, and the brake's torque, do.",
            kind: Kind::LoadCell,
            touches: &[Balance::Wheel, Balance::Vehicle],
            memory: Memory::None,
            sign: Sign::Either,
            aliases: &[
                Alias {
                    with: Id::VehicleInertia,
                    why: "Force over mass is all that a deceleration shows.",
                    run: runs::KNOWN_WEIGHT,
                },
                Alias {
                    with: Id::WheelInertia,
                    why: "Torque over inertia is all that the wheel's acceleration shows.",
                    run: runs::KNOWN_WEIGHT,
                },
                Alias {
                    with: Id::BearingDrag,
                    why: "Under a steady drag a share of it is a constant torque.",
                    run: runs::KNOWN_WEIGHT,
                },
                Alias {
                    with: Id::GradeOrDrive,
                    why: "Under a steady drag a share of it is a constant force.",
                    run: runs::KNOWN_WEIGHT,
                },
            ],
            smallest: "three percent of the scale",
            smallest_size: |_| 0.03,
            compensation: Compensation::Not(
                "the scale of the drag channel: peak friction is wrong by the same factor",
            ),
            carried: "as it is; the load cell of a fresh run reads as wrongly",
            example: Example::of("", &[0.1]),
        }
    }
}

impl<T: Number> Mechanism<T> for ForceGain {
    fn apply(&self, p: &[T], _series: &Series, context: &Context, state: &mut State<T>) {
        state.gain_change += p[0];
        if self.form == Form::Bent {
            state.gain_change += p[1] * -0.5;
            state.gain_bend += p[1] * context.max_drag.max(1e-9).recip();
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new("gain", "1", p[0] + 1.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BENT: ForceGain = ForceGain { form: Form::Bent };

    #[test]
    fn a_bent_scale_is_the_gain_at_half_of_the_largest_reading_and_differs_by_the_bend_from_none_to_the_largest()
     {
        let context = Context {
            max_drag: 4000.0,
            ..Context::default()
        };
        let mut state = State::<f64>::empty();
        BENT.apply(&[0.2, 0.04], &Series::default(), &context, &mut state);
        let gain = |reading: f64| 1.0 / state.true_share(reading);
        let near = |reading: f64, expected: f64| (gain(reading) - expected).abs() < 1e-12;
        assert!(near(2000.0, 1.2) && near(0.0, 1.18) && near(4000.0, 1.22));
    }

    #[test]
    fn what_bends_by_more_than_half_of_what_it_errs_by_is_no_error_of_a_scale() {
        let owns = |p: &[f64]| BENT.owns(p, &Context::default());
        assert!(owns(&[0.1, 0.04]) && owns(&[-0.1, 0.04]));
        assert!(!owns(&[-0.03, 0.087]) && !owns(&[0.1, 0.06]) && !owns(&[0.6, BEND]));
    }
}
