//! Friction shifts with accumulated sliding energy or from run to run, and does not recover.

use super::{Context, Describe, Evidence, Id, Law, Mechanism, Parameter, Reported, Stage, State};
use crate::number::Number;
use crate::prepare::Series;

/// What friction shifts with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Accumulated sliding energy.
    Energy,
    /// The number of the run.
    Run,
}

/// All forms.
pub const FORMS: [Form; 2] = [Form::Energy, Form::Run];

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
    fn id(&self) -> Id {
        Id::WearDrift
    }
    fn form(&self) -> &'static str {
        match self.form {
            Form::Energy => "energy",
            Form::Run => "run",
        }
    }
    fn stage(&self) -> Stage {
        Stage::Friction
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        vec![Parameter::new("loss", "1", -1.5, 2.5)]
    }
    fn starts(
        &self,
        context: &Context,
        _series: &[Series],
        _evidence: &[Evidence],
    ) -> Vec<Vec<f64>> {
        if self.form == Form::Run && context.runs < 2 {
            Vec::new()
        } else {
            vec![vec![0.0]]
        }
    }
    fn equation(&self) -> &'static str {
        match self.form {
            Form::Energy => {
                "friction = mu(slip) exp(-loss * sliding energy / total sliding energy)"
            }
            Form::Run => "friction = mu(slip) exp(-loss * run / last run)",
        }
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "friction has fallen by {:.1} % from the first run to the last and does not recover",
            100.0 * reported[0].value
        )
    }
}

impl<T: Number> Mechanism<T> for WearDrift {
    fn apply(&self, p: &[T], series: &Series, context: &Context, state: &mut State<T>) {
        match self.form {
            Form::Run => {
                let position = series.index as f64 / (context.runs.max(2) - 1) as f64;
                let factor = (-(p[0] * position)).exp();
                for f in &mut state.friction {
                    *f = *f * factor;
                }
            }
            Form::Energy => {
                for (f, work) in state.friction.iter_mut().zip(work(series, context)) {
                    *f = *f * (-(p[0] * work)).exp();
                }
            }
        }
    }
    fn report(
        &self,
        p: &[T],
        _law: &Law<T>,
        context: &Context,
        series: &[Series],
    ) -> Vec<Reported<T>> {
        let mean_work = |run: &Series| {
            let all = work(run, context);
            all.iter().sum::<f64>() / all.len().max(1) as f64
        };
        let span = match (self.form, series.first(), series.last()) {
            (Form::Run, _, _) => 1.0,
            (Form::Energy, Some(first), Some(last)) if series.len() > 1 => {
                mean_work(last) - mean_work(first)
            }
            _ => 1.0,
        };
        vec![Reported {
            name: "friction_loss",
            unit: "1",
            value: -((-(p[0] * span)).exp()) + 1.0,
        }]
    }
}
