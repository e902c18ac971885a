//! The drag channel clips.

use super::prelude::*;

/// How the drag channel comes to its limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// At once.
    Hard,
    /// By and by: an amplifier that compresses before it clips.
    Soft,
}

/// All forms.
pub const FORMS: [Form; 2] = [Form::Hard, Form::Soft];

/// Sharpness of a soft limit: of two, the reading of a force as large as the limit is short by 29 %; of thirty it is
/// as good as hard.
const SHARPNESS: [f64; 2] = [2.0, 30.0];

/// The drag channel clips.
pub struct ForceSaturation {
    /// Which form.
    pub form: Form,
}

impl Describe for ForceSaturation {
    fn facts(&self) -> Facts {
        let (form, equation) = match self.form {
            Form::Hard => ("", "reading = min(drag, limit)"),
            Form::Soft => (
                "soft",
                "reading = drag / (1 + (drag / limit)^sharpness)^(1 / sharpness)",
            ),
        };
        Facts {
            form,
            amplitude: None,
            ..Facts::of(Id::ForceSaturation, Stage::Input, equation)
        }
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let limit = Parameter::new(
            "limit",
            "N",
            0.02 * context.max_drag,
            1.5 * context.max_drag,
        );
        let [low, high] = SHARPNESS;
        match self.form {
            Form::Hard => vec![limit],
            Form::Soft => vec![limit, Parameter::new("sharpness", "1", low, high)],
        }
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        let largest = search.context.max_drag - 1.5 * search.context.drag_sigma;
        match self.form {
            Form::Hard => [0.995, 0.97, 0.93, 0.88, 0.8, 0.7]
                .iter()
                .map(|m| vec![m * largest])
                .collect(),
            Form::Soft => [0.9, 1.05, 1.25]
                .iter()
                .map(|m| vec![m * largest, 8.0])
                .collect(),
        }
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!("the drag channel clips at {:.0} N", reported[0].value)
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "Above its range the amplifier or converter clips: the reading stays where it is however the force grows. Below, nothing is wrong.",
            kind: Kind::LoadCell,
            touches: &[Balance::Tyre, Balance::Wheel, Balance::Vehicle],
            memory: Memory::None,
            sign: Sign::Positive,
            aliases: &[],
            smallest: "a limit five percent below the largest drag",
            smallest_size: |c| 0.05 * c.max_drag,
            compensation: Compensation::NOT_IN_THE_FILTER,
            carried: "as it is",
            example: Example::of("", &[2600.0]),
        }
    }
}

impl<T: Number> Mechanism<T> for ForceSaturation {
    fn apply(&self, p: &[T], _series: &Series, _context: &Context, state: &mut State<T>) {
        for y in &mut state.force {
            *y = match self.form {
                Form::Hard if y.value() > p[0].value() => p[0],
                Form::Soft if y.value() > 0.0 => compressed(*y, p[0], p[1]),
                Form::Hard | Form::Soft => *y,
            };
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new("limit", "N", p[0])]
    }
}

/// Reading of a force above zero through a soft limit; the smaller of the two is raised to the power, so that nothing
/// overflows.
fn compressed<T: Number>(force: T, limit: T, sharpness: T) -> T {
    let ratio = (force / limit).ln();
    let (smaller, power) = if ratio.value() < 0.0 {
        (force, ratio * sharpness)
    } else {
        (limit, -(ratio * sharpness))
    };
    smaller * (-((power.exp() + 1.0).ln() / sharpness)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_soft_limit_follows_its_equation_and_is_passed_by_no_force() {
        for (force, limit, sharpness) in
            [(50.0, 100.0, 4.0), (100.0, 100.0, 2.0), (900.0, 100.0, 8.0)]
        {
            let found: f64 = compressed(force, limit, sharpness);
            let expected = force / (1.0 + (force / limit).powf(sharpness)).powf(1.0 / sharpness);
            assert!(
                (found - expected).abs() < 1e-9 * expected,
                "{found} {expected}"
            );
        }
        assert!(compressed(1e9, 100.0, 30.0) <= 100.0);
    }
}
