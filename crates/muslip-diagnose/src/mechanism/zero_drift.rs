//! The drag channel's zero moves with time.

use super::prelude::*;

/// How the zero moves, and on which clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Linear from the start of each run.
    Linear,
    /// Linear in each run, with an offset.
    LinearOffset,
    /// Linear through all runs.
    LinearCumulative,
    /// A warm-up in each run.
    WarmUp,
    /// A warm-up through all runs.
    WarmUpCumulative,
}

impl Form {
    fn cumulative(self) -> bool {
        matches!(self, Self::LinearCumulative | Self::WarmUpCumulative)
    }
}

/// All forms.
pub const FORMS: [Form; 5] = [
    Form::Linear,
    Form::LinearOffset,
    Form::LinearCumulative,
    Form::WarmUp,
    Form::WarmUpCumulative,
];

/// Share of its offset within which a zero, and by less than a reading's noise, does not move: a share of a load that stays
/// the same is read like that.
const LEAST_MOVED: f64 = 0.2;
/// Shortest time constant of a warm-up, as a share of a run: what is warm at once is an offset.
const SHORTEST_WARM_UP: f64 = 0.02;

/// The drag channel's zero moves with time.
pub struct ZeroDrift {
    /// Which form.
    pub form: Form,
}

impl Describe for ZeroDrift {
    fn facts(&self) -> Facts {
        let linear = "reading = drag + slope * t";
        let warm_up = "reading = drag + rise * (1 - exp(-t/time_constant))";
        let (form, equation) = match self.form {
            Form::Linear => ("linear_in_run", linear),
            Form::LinearOffset => ("linear_with_offset", "reading = drag + offset + slope * t"),
            Form::LinearCumulative => ("linear_through_runs", linear),
            Form::WarmUp => ("warm_up_in_run", warm_up),
            Form::WarmUpCumulative => ("warm_up_through_runs", warm_up),
        };
        Facts {
            form,
            ..Facts::of(Id::ZeroDrift, Stage::Reading, equation)
        }
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let force = context.max_drag.max(10.0 * context.drag_sigma);
        let time = if self.form.cumulative() {
            context.total_time
        } else {
            context.duration
        }
        .max(1e-3);
        let slope = Parameter::new("slope", "N/s", -2.0 * force / time, 2.0 * force / time);
        let offset = Parameter::new("offset", "N", -force, force);
        match self.form {
            Form::Linear | Form::LinearCumulative => vec![slope],
            Form::LinearOffset => vec![slope, offset],
            Form::WarmUp | Form::WarmUpCumulative => vec![
                Parameter::new("rise", "N", -2.0 * force, 2.0 * force),
                Parameter::new(
                    "time_constant",
                    "s",
                    SHORTEST_WARM_UP * context.duration,
                    5.0 * time,
                ),
            ],
        }
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        let time = if self.form.cumulative() {
            search.context.total_time
        } else {
            search.context.duration
        };
        match self.form {
            Form::Linear => vec![vec![0.0]],
            Form::LinearCumulative if search.context.runs > 1 => vec![vec![0.0]],
            Form::LinearOffset => vec![vec![0.0, 0.0]],
            Form::WarmUp => [0.06, 0.2, 0.7]
                .iter()
                .map(|share| vec![0.0, share * time])
                .collect(),
            Form::WarmUpCumulative if search.context.runs > 1 => [0.1, 0.4]
                .iter()
                .map(|share| vec![0.0, share * time])
                .collect(),
            _ => Vec::new(),
        }
    }
    fn owns(&self, parameters: &[f64], context: &Context) -> bool {
        match self.form {
            Form::Linear | Form::LinearOffset | Form::LinearCumulative => true,
            Form::WarmUp | Form::WarmUpCumulative => {
                above_limit(parameters[1], SHORTEST_WARM_UP * context.duration)
            }
        }
    }
    fn says_as_well(&self, parameters: &[f64], context: &Context) -> Option<Id> {
        let moved = (parameters[0] * context.duration).abs();
        let unmoved =
            |offset: f64| moved < LEAST_MOVED * offset.abs() && moved < context.drag_sigma;
        (self.form == Form::LinearOffset && unmoved(parameters[1])).then_some(Id::LoadCrosstalk)
    }
    fn by_order(&self, context: &Context) -> bool {
        self.form.cumulative() && !context.clock_continues
    }
    fn statement(&self, reported: &[Reported<f64>], p: &[f64]) -> String {
        if reported[0].name == "slope" {
            format!(
                "the drag channel's zero moves by {:.3} N/s",
                reported[0].value
            )
        } else {
            format!(
                "the drag channel's zero warms up by {:.1} N with a time constant of {:.2} s",
                p[0], reported[0].value
            )
        }
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "Strain gauges and amplifiers warm up, and what they read of no force moves: steadily or towards an end. It has nothing to do with what the wheel does.",
            kind: Kind::LoadCell,
            touches: &[Balance::Tyre, Balance::Wheel, Balance::Vehicle],
            memory: Memory::Campaign,
            sign: Sign::Either,
            aliases: &[],
            smallest: "a reading's noise, over the whole run",
            smallest_size: |c| c.drag_sigma,
            compensation: Compensation::By("takes the zero at the sample's time off the drag"),
            carried: "by the clock: of each run, or of the whole campaign where it goes on through all runs; there a run without the campaign's clock is predicted without it",
            example: Example::of("linear_in_run", &[60.0]),
        }
    }
}

impl<T: Number> Mechanism<T> for ZeroDrift {
    fn apply(&self, p: &[T], series: &Series, context: &Context, state: &mut State<T>) {
        let before = if self.form.cumulative() && !context.clock_continues {
            context.before(series.index).time - series.time.first().copied().unwrap_or(0.0)
        } else if self.form.cumulative() {
            -context.first_time
        } else {
            -series.time.first().copied().unwrap_or(0.0)
        };
        for (y, t) in state.force.iter_mut().zip(&series.time) {
            let since = t + before;
            *y += match self.form {
                Form::Linear | Form::LinearCumulative => p[0] * since,
                Form::LinearOffset => p[0] * since + p[1],
                Form::WarmUp | Form::WarmUpCumulative => {
                    p[0] * (-((-(T::constant(since) / p[1])).exp()) + 1.0)
                }
            };
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        match self.form {
            Form::WarmUp | Form::WarmUpCumulative => vec![
                Reported::new("time_constant", "s", p[1]),
                Reported::new("rise", "N", p[0]),
            ],
            _ => vec![Reported::new("slope", "N/s", p[0])],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zero_that_does_not_move_is_a_share_of_the_load_as_well() {
        let context = Context {
            duration: 10.0,
            drag_sigma: 3.0,
            ..Context::default()
        };
        let zero = |form: Form| ZeroDrift { form };
        let said = |slope: f64, offset: f64| {
            zero(Form::LinearOffset).says_as_well(&[slope, offset], &context)
        };
        // In a run by 1 N beside an offset of 20 N; by a quarter of it; by more than the noise.
        assert_eq!(said(-0.1, 20.0), Some(Id::LoadCrosstalk));
        assert_eq!(said(0.2, 8.0), None);
        assert_eq!(said(0.5, 200.0), None);
        assert_eq!(zero(Form::Linear).says_as_well(&[1e-6], &context), None);
    }

    #[test]
    fn what_is_warm_at_once_does_not_warm_up() {
        let context = Context {
            duration: 10.0,
            ..Context::default()
        };
        let form = Form::WarmUp;
        let warms = |time_constant: f64| ZeroDrift { form }.owns(&[20.0, time_constant], &context);
        assert!(warms(1.0) && !warms(0.2));
    }
}
