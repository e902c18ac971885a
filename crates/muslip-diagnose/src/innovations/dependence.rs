//! A free dependence on one variable: what is said where no mechanism of the vocabulary accounts for a mismatch, and
//! what every mechanism has to compete with.

use super::candidates::Triple;
use crate::data::Data;
use crate::mechanism::Balance;
use crate::model::Model;
use crate::omnibus::{Action, Levers, finite_or_zero, hat};
use crate::repaired::Correction;
use crate::variable::Variable;

/// Hat functions of a dependence.
const KNOTS: usize = 7;

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
    /// Columns by run.
    pub columns: Vec<Vec<Triple>>,
}

/// Knots between the variable's extremes, half by quantile, half evenly: what is rare still matters.
fn knots(data: &Data, values: &[Vec<f64>], balance: Balance) -> Vec<f64> {
    let mut all: Vec<f64> = Vec::new();
    for (s, u) in data.series.iter().zip(values) {
        let segments = match balance {
            Balance::Tyre => &s.tyre,
            Balance::Wheel => &s.wheel_balance,
            Balance::Vehicle => &s.vehicle_balance,
        };
        all.extend(
            segments
                .iter()
                .flat_map(|g| u[g.clone()].iter().step_by(3))
                .filter(|v| v.is_finite()),
        );
    }
    if all.len() < 30 {
        return Vec::new();
    }
    all.sort_by(f64::total_cmp);
    let quantile = |q: f64| all[((all.len() - 1) as f64 * q) as usize];
    let (low, high) = (quantile(0.005), quantile(0.995));
    if !(high > low) {
        return Vec::new();
    }
    let least = (high - low) / (6.0 * KNOTS as f64);
    let mut out: Vec<f64> = Vec::new();
    for i in 0..KNOTS {
        let share = i as f64 / (KNOTS - 1) as f64;
        let knot = 0.5 * quantile(0.005 + 0.99 * share) + 0.5 * (low + share * (high - low));
        if out.last().is_none_or(|k| knot - k > least) {
            out.push(knot);
        }
    }
    if out.len() < 3 { Vec::new() } else { out }
}

/// All dependences that a campaign can show, about a model.
#[must_use]
pub fn all(data: &Data, model: &Model) -> Vec<Dependence> {
    let levers = Levers::new(data, model);
    let mut out = Vec::new();
    let balances = [
        (
            Balance::Tyre,
            data.series.iter().any(|s| !s.tyre.is_empty()),
        ),
        (
            Balance::Wheel,
            data.series
                .iter()
                .any(|s| !s.wheel_balance.is_empty() && s.torque.is_some()),
        ),
        (
            Balance::Vehicle,
            data.series.iter().any(|s| !s.vehicle_balance.is_empty()),
        ),
    ];
    for variable in Variable::all(data) {
        let values: Vec<Vec<f64>> = (0..data.series.len())
            .map(|run| variable.values(data, run))
            .collect();
        for (balance, there) in balances {
            if !there {
                continue;
            }
            let knots = knots(data, &values, balance);
            if knots.is_empty() {
                continue;
            }
            let actions: &[Action] = if balance == Balance::Tyre {
                &[Action::Friction, Action::Force]
            } else {
                &[Action::Force]
            };
            for &action in actions {
                let columns = (0..data.series.len())
                    .map(|run| columns(data, &levers, balance, action, &knots, &values[run], run))
                    .collect();
                out.push(Dependence {
                    balance,
                    variable: variable.clone(),
                    action,
                    knots: knots.clone(),
                    columns,
                });
            }
        }
    }
    out
}

/// Columns of one run: minus the lever times each hat in the tyre's row, integrated in the others.
fn columns(
    data: &Data,
    levers: &Levers,
    balance: Balance,
    action: Action,
    knots: &[f64],
    u: &[f64],
    run: usize,
) -> Vec<Triple> {
    let s = &data.series[run];
    let n = s.len();
    let height = |c: usize, k: usize| match hat(knots, u[k]) {
        Some((at, w)) if at == c => 1.0 - w,
        Some((at, w)) if at + 1 == c => w,
        _ => 0.0,
    };
    (0..knots.len())
        .map(|c| {
            let mut triple: Triple = [Vec::new(), Vec::new(), Vec::new()];
            let zeros = || vec![0.0; n];
            if !s.tyre.is_empty() {
                triple[0] = zeros();
            }
            if !s.wheel_balance.is_empty() && s.torque.is_some() {
                triple[1] = zeros();
            }
            if !s.vehicle_balance.is_empty() {
                triple[2] = zeros();
            }
            let into = &mut triple[balance as usize];
            let mut sum = 0.0;
            for (k, into) in into.iter_mut().enumerate() {
                *into = match balance {
                    Balance::Tyre => {
                        finite_or_zero(-height(c, k) * levers.of(data, action, run, k))
                    }
                    Balance::Wheel | Balance::Vehicle => {
                        let lever = if balance == Balance::Wheel {
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
            }
            triple
        })
        .collect()
}

impl Dependence {
    /// The correction of a repaired model, from the columns' coefficients.
    #[must_use]
    pub fn correction(&self, data: &Data, coefficients: &[f64]) -> Correction {
        Correction {
            variable: self.variable.key(data),
            acts_on: self.action.as_str().to_owned(),
            form: String::new(),
            knots: self.knots.clone(),
            values: coefficients.to_vec(),
            harmonics: Vec::new(),
        }
    }
}
