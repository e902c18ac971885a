//! A free dependence on one variable: what is said where no mechanism of the vocabulary accounts for a mismatch, and
//! what every mechanism has to compete with.

use std::sync::Arc;

use rayon::prelude::*;

use super::rows::Triple;
use crate::correction::{Action, Levers, hat, knots_among};
use crate::data::Data;
use crate::mechanism::Balance;
use crate::number::finite_or_zero;
use crate::repaired::Correction;
use crate::variable::Variable;

/// Hat functions of a dependence.
const KNOTS: usize = 7;
/// Fewest of them: two are a straight line, which is no shape.
const LEAST_KNOTS: usize = 3;
/// Fewest values that knots are set among.
const LEAST_SAMPLES: usize = 30;

/// A dependence of one balance on one variable, as columns.
#[derive(Clone)]
pub struct Dependence {
    /// The balance that it is in.
    pub balance: Balance,
    /// What it depends on.
    pub variable: Variable,
    /// How it acts (in the tyre balance).
    pub action: Action,
    /// Knots of the hat functions.
    pub knots: Vec<f64>,
    /// The knot at which a dependence of friction is one: the law's own peak friction holds there. The fullest one.
    reference: Option<usize>,
    /// The variable by run and sample.
    values: Arc<Vec<Vec<f64>>>,
}

/// Columns of these dependences together.
#[must_use]
pub fn width(all: &[Dependence]) -> usize {
    all.iter().map(Dependence::width).sum()
}

/// Knots between the variable's extremes, half by quantile, half evenly: what is rare still matters.
fn knots(data: &Data, values: &[Vec<f64>], balance: Balance, count: usize) -> Vec<f64> {
    let mut all: Vec<f64> = Vec::new();
    for (s, u) in data.series.iter().zip(values) {
        let used = s.segments(balance).iter();
        all.extend(
            used.flat_map(|g| u[g.clone()].iter().step_by(3))
                .filter(|v| v.is_finite()),
        );
    }
    if all.len() < LEAST_SAMPLES {
        return Vec::new();
    }
    let knots = knots_among(all, count);
    if knots.len() < LEAST_KNOTS.min(count) {
        Vec::new()
    } else {
        knots
    }
}

/// The knot that most samples are about: beside one that nothing is known of, the law could be anything.
fn fullest(data: &Data, values: &[Vec<f64>], balance: Balance, knots: &[f64]) -> usize {
    let mut about = vec![0.0; knots.len()];
    for (s, u) in data.series.iter().zip(values) {
        for k in s.segments(balance).iter().flat_map(Clone::clone) {
            if let Some((at, w)) = hat(knots, u[k]) {
                about[at] += 1.0 - w;
                if let Some(next) = about.get_mut(at + 1) {
                    *next += w;
                }
            }
        }
    }
    let fullest = (0..knots.len()).max_by(|a, b| about[*a].total_cmp(&about[*b]));
    fullest.unwrap_or(0)
}

/// All dependences that a campaign can show.
#[must_use]
pub fn all(data: &Data) -> Vec<Dependence> {
    Variable::all(data)
        .into_par_iter()
        .flat_map_iter(|variable| on(data, &variable))
        .collect()
}

/// All dependences on one variable.
fn on(data: &Data, variable: &Variable) -> Vec<Dependence> {
    let mut out = Vec::new();
    let runs = 0..data.series.len();
    let values: Vec<Vec<f64>> = runs.map(|run| variable.values(data, run)).collect();
    let values = Arc::new(values);
    for balance in [Balance::Tyre, Balance::Wheel, Balance::Vehicle] {
        if !data.forms(balance) || holds_own_noise(variable, balance) {
            continue;
        }
        // What was recorded beside the rig's channels may well act in proportion, and differ by run alone.
        let recorded = matches!(variable, Variable::Column(_));
        let counts: &[usize] = if recorded { &[KNOTS, 2] } else { &[KNOTS] };
        let shapes: Vec<Vec<f64>> = counts
            .iter()
            .map(|&count| knots(data, &values, balance, count))
            .filter(|knots| !knots.is_empty())
            .collect();
        let actions: &[Action] = if balance == Balance::Tyre {
            &[Action::Friction, Action::Force]
        } else {
            &[Action::Force]
        };
        for (&action, knots) in actions
            .iter()
            .flat_map(|a| shapes.iter().map(move |k| (a, k)))
        {
            let reference =
                (action == Action::Friction).then(|| fullest(data, &values, balance, knots));
            out.push(Dependence {
                balance,
                variable: variable.clone(),
                action,
                knots: knots.clone(),
                reference,
                values: Arc::clone(&values),
            });
        }
    }
    out
}

/// Whether a variable holds the noise of a balance's own level: a rate of the level's speed, integrated again, is
/// that speed, noise and all, and a dependence on it would buy it away.
fn holds_own_noise(variable: &Variable, balance: Balance) -> bool {
    match variable {
        Variable::SlipRate => balance != Balance::Tyre,
        Variable::VehicleSpeedRate => balance == Balance::Vehicle,
        _ => false,
    }
}

impl Dependence {
    /// Its columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.knots.len() - usize::from(self.reference.is_some())
    }

    /// Columns on one run beside the model that the levers are of: minus the lever times each hat in the tyre's row,
    /// integrated in the others.
    #[must_use]
    pub fn columns(&self, data: &Data, levers: &Levers, run: usize) -> Vec<Triple> {
        let (s, u) = (&data.series[run], &self.values[run]);
        let hats: Vec<Option<(usize, f64)>> = u.iter().map(|u| hat(&self.knots, *u)).collect();
        let height = |c: usize, k: usize| match hats[k] {
            Some((at, w)) if at == c => 1.0 - w,
            Some((at, w)) if at + 1 == c => w,
            _ => 0.0,
        };
        let formed = !s.segments(self.balance).is_empty();
        let samples = if formed { s.len() } else { 0 };
        (0..self.knots.len())
            .filter(|c| self.reference != Some(*c))
            .map(|c| {
                let mut sum = 0.0;
                let entry = |k: usize| match self.balance {
                    Balance::Tyre => {
                        finite_or_zero(-height(c, k) * levers.of(data, self.action, run, k))
                    }
                    Balance::Wheel | Balance::Vehicle => {
                        let lever = if self.balance == Balance::Wheel {
                            data.context.radius
                        } else {
                            1.0
                        };
                        sum += finite_or_zero(
                            height(c, k) * lever * data.context.mean_load * s.dt[k].min(0.1),
                        );
                        sum
                    }
                };
                let mut triple = Triple::default();
                triple[self.balance as usize] = (0..samples).map(entry).collect();
                triple
            })
            .collect()
    }

    /// The correction of a repaired model, from the columns' coefficients.
    #[must_use]
    pub fn correction(&self, data: &Data, coefficients: &[f64]) -> Correction {
        let mut values = coefficients.to_vec();
        if let Some(reference) = self.reference {
            values.insert(reference, 0.0);
        }
        Correction {
            variable: self.variable.key(data),
            acts_on: self.action.as_str().to_owned(),
            form: String::new(),
            knots: self.knots.clone(),
            values,
            harmonics: Vec::new(),
        }
    }
}
