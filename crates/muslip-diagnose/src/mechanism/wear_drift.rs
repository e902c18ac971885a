//! Friction shifts with accumulated sliding energy or from run to run, and does not recover.

use super::prelude::*;

/// What friction shifts with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Accumulated sliding energy.
    Energy,
    /// Accumulated sliding energy, most of it at first: running in.
    RunningIn,
    /// The number of the run.
    Run,
}

/// All forms.
pub const FORMS: [Form; 3] = [Form::Energy, Form::RunningIn, Form::Run];

/// Sliding energy since the campaign began over its total, on the nominal curve: it must not depend on
/// the parameters that are being fitted.
fn work(series: &Series, context: &Context) -> Vec<f64> {
    let scale = 1.0 / context.total_work.max(1e-9);
    let mut done = context.before(series.index).work;
    (0..series.len())
        .map(|k| {
            done += series.nominal_power(k, context) * series.dt[k];
            done * scale
        })
        .collect()
}

/// Friction shifts with accumulated sliding energy or from run to run, and does not recover.
pub struct WearDrift {
    /// Which form.
    pub form: Form,
}

impl Describe for WearDrift {
    fn facts(&self) -> Facts {
        let (form, equation) = match self.form {
            Form::Energy => (
                "energy",
                "friction = mu(slip) exp(-loss * sliding energy / total sliding energy)",
            ),
            Form::RunningIn => (
                "running_in",
                "friction = mu(slip) exp(-loss * (1 - exp(-sliding energy / (share * total sliding energy))))",
            ),
            Form::Run => ("run", "friction = mu(slip) exp(-loss * run / last run)"),
        };
        Facts {
            form,
            ..Facts::of(Id::WearDrift, Stage::Friction, equation)
        }
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        let mut all = vec![Parameter::new("loss", "1", -1.5, 2.5)];
        if self.form == Form::RunningIn {
            all.push(Parameter::new("log_share", "1", 0.02f64.ln(), 0.6f64.ln()));
        }
        all
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        match self.form {
            Form::Run if search.context.runs < 2 => Vec::new(),
            Form::Run | Form::Energy => vec![vec![0.0]],
            Form::RunningIn => [0.08f64, 0.25]
                .iter()
                .map(|share| vec![0.01, share.ln()])
                .collect(),
        }
    }
    fn by_order(&self, _context: &Context) -> bool {
        true
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "friction has fallen by {:.1} % from the first run to the last and does not recover",
            100.0 * reported[0].value
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "Sliding removes rubber, polishes the road or runs a fresh tread in: friction shifts with the energy that was spent and does not come back after a rest. Within one run it is little, from the first run to the last it adds up.",
            kind: Kind::Tyre,
            touches: &[Balance::Tyre],
            memory: Memory::Campaign,
            sign: Sign::Either,
            aliases: &[
                Alias {
                    with: Id::ZeroDrift,
                    why: "Both shift from run to run; one is a factor, the other a force.",
                    run: runs::FIRST_RUN_AGAIN,
                },
                Alias {
                    with: Id::SurfacePatch,
                    why: "Where each run starts further on, a place is a run.",
                    run: runs::FIRST_RUN_AGAIN,
                },
                Alias {
                    with: Id::LoadSensitivity,
                    why: "Where the load changes from run to run, it goes with use.",
                    run: runs::FIRST_RUN_AGAIN,
                },
            ],
            smallest: "three percent of friction from the first run to the last",
            smallest_size: |_| 0.03,
            compensation: Compensation::NOT_IN_THE_FILTER,
            carried: "not to a run whose place in the campaign is not known: that is predicted by the law that fits all runs best without it",
            example: Example::of("energy", &[0.15]),
        }
    }
}

impl WearDrift {
    /// Logarithm of what is left of friction at this share of the campaign's sliding energy.
    fn left<T: Number>(&self, p: &[T], work: f64) -> T {
        match self.form {
            Form::Energy | Form::Run => -(p[0] * work),
            Form::RunningIn => p[0] * ((-((-p[1]).exp() * work)).exp() + -1.0),
        }
    }
}

impl<T: Number> Mechanism<T> for WearDrift {
    fn apply(&self, p: &[T], series: &Series, context: &Context, state: &mut State<T>) {
        match self.form {
            Form::Run => {
                let last = (context.runs.max(2) - 1) as f64;
                // Beyond what was recorded nothing is known: as after the last run.
                let factor = self.left(p, (series.index as f64 / last).min(1.0)).exp();
                for f in &mut state.friction {
                    *f = *f * factor;
                }
            }
            Form::Energy | Form::RunningIn => {
                for (f, work) in state.friction.iter_mut().zip(work(series, context)) {
                    *f = *f * self.left(p, work).exp();
                }
            }
        }
    }
    fn report(&self, p: &[T], fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        let mean_work = |run: &Series| {
            let all = work(run, fitted.context);
            all.iter().sum::<f64>() / all.len().max(1) as f64
        };
        let (first, last) = match (self.form, fitted.series) {
            (Form::Energy | Form::RunningIn, [first, .., last]) => {
                (mean_work(first), mean_work(last))
            }
            _ => (0.0, 1.0),
        };
        let change = self.left(p, last) - self.left(p, first);
        vec![Reported::new("friction_loss", "1", -change.exp() + 1.0)]
    }
}
