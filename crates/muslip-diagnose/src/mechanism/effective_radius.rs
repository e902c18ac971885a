//! The rolling radius is not the rig file's (constant, or changing with load or speed), so slip is biased.

use super::prelude::*;

/// What the radius depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Nothing: it is just another.
    Constant,
    /// Normal force.
    Load,
    /// Speed squared.
    Speed,
}

/// All forms.
pub const FORMS: [Form; 3] = [Form::Constant, Form::Load, Form::Speed];

/// The rolling radius is not the rig file's (constant, or changing with load or speed), so slip is biased.
pub struct EffectiveRadius {
    /// Which form.
    pub form: Form,
}

impl Describe for EffectiveRadius {
    fn facts(&self) -> Facts {
        let (form, equation) = match self.form {
            Form::Constant => ("constant", "slip = (v - radius * omega)/v"),
            Form::Load => (
                "with_load",
                "slip = (v - radius * (1 + a (normal_force/mean - 1)) * omega)/v",
            ),
            Form::Speed => (
                "with_speed",
                "slip = (v - radius * (1 + a ((v/mean v)^2 - 1)) * omega)/v",
            ),
        };
        Facts {
            form,
            like_noise_of_run: true,
            ..Facts::of(Id::EffectiveRadius, Stage::Kinematics, equation)
        }
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        let mut all = vec![Parameter::new("radius_error", "1", -0.1, 0.1)];
        match self.form {
            Form::Constant => {}
            Form::Load => all.push(Parameter::new("per_relative_load", "1", -0.15, 0.15)),
            Form::Speed => all.push(Parameter::new("per_relative_speed_squared", "1", -0.1, 0.1)),
        }
        all
    }
    fn by_no_figure(&self) -> &'static [usize] {
        match self.form {
            Form::Constant => &[],
            Form::Load | Form::Speed => &[1],
        }
    }
    fn statement(&self, reported: &[Reported<f64>], p: &[f64]) -> String {
        format!(
            "the wheel rolls on a radius of {:.5} m{}",
            reported[0].value,
            match self.form {
                Form::Constant => String::new(),
                Form::Load => format!(", changing by {:.2} % when the load doubles", 100.0 * p[1]),
                Form::Speed => format!(
                    ", growing by {:.2} % from rest to the mean speed",
                    100.0 * p[1]
                ),
            }
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "Slip is the small difference of two large speeds, so an error of the rolling radius (pressure, wear, load, centrifugal growth) is an offset of slip of the same size. The force at a slip of nearly zero shows it, for the tyre is stiff there.",
            kind: Kind::Wheel,
            touches: &[Balance::Tyre],
            memory: Memory::None,
            sign: Sign::Either,
            aliases: &[],
            smallest: "one percent of the radius is gross; a tenth of it shows",
            smallest_size: |_| 0.01,
            compensation: Compensation::By(
                "forms slip with the radius found, which may depend on the sample's load or speed",
            ),
            carried: "as it is, from the fresh run's own load and speed",
            example: Example::of("constant", &[0.01]),
        }
    }
}

impl<T: Number> Mechanism<T> for EffectiveRadius {
    fn apply(&self, p: &[T], series: &Series, context: &Context, state: &mut State<T>) {
        let n = state.omega.len();
        let mut radius = Vec::with_capacity(n);
        for k in 0..n {
            let mut change = p[0] + 1.0;
            match self.form {
                Form::Constant => {}
                Form::Load => change += p[1] * (series.load.smooth[k] / context.mean_load - 1.0),
                Form::Speed => {
                    let relative = series.speed.smooth[k] / context.mean_speed;
                    change += p[1] * (relative * relative - 1.0);
                }
            }
            radius.push(change * context.radius);
        }
        state.radius = Some(radius);
    }
    fn report(&self, p: &[T], fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new(
            "radius",
            "m",
            (p[0] + 1.0) * fitted.context.radius,
        )]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_radius_varies_by_is_told_by_no_figure() {
        let of = |form| EffectiveRadius { form };
        let context = Context::default();
        for form in FORMS {
            let all = of(form).parameters(&context);
            let told = of(form).by_no_figure();
            assert_eq!(told.len() + 1, all.len(), "the first is the figure");
            assert!(
                told.iter()
                    .all(|own| all[*own].low < 0.0 && all[*own].high > 0.0)
            );
        }
    }
}
