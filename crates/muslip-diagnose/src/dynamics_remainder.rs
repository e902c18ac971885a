//! What no mechanism explains of wheel and vehicle: by which variable it is located, and whether it holds on runs
//! left out.

use rayon::prelude::*;

use crate::choose::{Limits, required};
use crate::data::Data;
use crate::fit::{Joint, Problem};
use crate::lines;
use crate::mechanism::Balance;
use crate::model::Model;
use crate::noise::robust_sigma;
use crate::omnibus::{Column, hats, knots};
use crate::regression::{Found, Regression};
use crate::size::{LEAST_EFFECT, means, root_mean_square};
use crate::variable::Variable;

/// A dependence of one balance on one variable.
#[derive(Clone, Debug)]
pub struct DynamicRemainder {
    /// Wheel or vehicle.
    pub balance: Balance,
    /// The contract's word for the variable.
    pub word: String,
    /// How it acts, for a reader.
    pub form: String,
    /// Whether the variable is a column that the contract does not name.
    pub recorded: bool,
    /// Gain in nats less the price of its columns and of having looked at so many.
    pub worth: f64,
    /// Gain in nats.
    pub gain: f64,
    /// What it adds to the balance, by run: N m on the wheel, N on the vehicle.
    pub effect: Column,
}

/// Knots of a variable.
const KNOTS: usize = 6;
/// Price in nats of having looked at so many variables.
const LOOKED: f64 = 10.0;

/// What a dependence multiplies.
#[derive(Clone, Copy, PartialEq)]
enum Lever {
    Constant,
    Brake,
}

/// All dependences that a model leaves over in its balances, strongest first; only those that hold on runs left out
/// and are large enough to matter.
#[must_use]
pub fn candidates(joint: &Joint<'_>, model: &Model, limits: &Limits) -> Vec<DynamicRemainder> {
    let mut found: Vec<DynamicRemainder> = joint
        .parts
        .iter()
        .flat_map(|part| of_balance(part, model, limits))
        .collect();
    found.sort_by(|a, b| b.worth.total_cmp(&a.worth));
    found
}

fn of_balance(part: &Problem<'_>, model: &Model, limits: &Limits) -> Vec<DynamicRemainder> {
    let data = part.data;
    let regression = Regression::new(part, model);
    let levers: &[Lever] = match part.balance {
        Balance::Wheel => &[Lever::Constant, Lever::Brake],
        _ => &[Lever::Constant],
    };
    let mut jobs: Vec<(Option<Variable>, Lever)> = Vec::new();
    for variable in Variable::all(data) {
        if matches!(
            variable,
            Variable::Column(_)
                | Variable::Time
                | Variable::Distance
                | Variable::VehicleSpeed
                | Variable::NormalForce
        ) {
            jobs.extend(levers.iter().map(|l| (Some(variable.clone()), *l)));
        }
    }
    if part.balance == Balance::Wheel {
        jobs.push((None, Lever::Brake));
    }
    let sigma = robust_sigma(&means(part, |run| {
        part.residual(model, &model.vector(), run)
    }));
    let count = part.count();
    jobs.par_iter()
        .filter_map(|(variable, lever)| {
            let columns = match variable {
                Some(variable) => spline(part, variable, *lever)?,
                None => once_a_revolution(part, *lever),
            };
            let references: Vec<&Column> = columns.iter().collect();
            let fit = regression.on(part, &references);
            let effect = summed(&columns, &fit);
            let price = 0.5 * fit.rank as f64 * (count.max(2) as f64).ln() + LOOKED;
            // The phase of a run left out is unknown: there the price stands for the proof.
            let held_out = if variable.is_some() {
                fit.held_out
            } else {
                fit.gain - price
            };
            let worth = (fit.gain - price).min(held_out);
            let size = root_mean_square(&means(part, |run| effect[run].clone()));
            let large = size >= LEAST_EFFECT * sigma;
            (worth.is_finite() && large && worth >= required(limits, count, 0.0)).then(|| {
                DynamicRemainder {
                    balance: part.balance,
                    word: variable
                        .as_ref()
                        .map_or_else(|| "wheel_angle_rad".to_owned(), |v| v.word(data)),
                    form: match lever {
                        Lever::Constant => String::new(),
                        Lever::Brake => "changes the brake torque by a factor".to_owned(),
                    },
                    recorded: matches!(variable, Some(Variable::Column(_))),
                    worth,
                    gain: fit.gain,
                    effect,
                }
            })
        })
        .collect()
}

fn lever(data: &Data, balance: Balance, lever: Lever, run: usize, k: usize) -> f64 {
    let context = &data.context;
    match (lever, &data.series[run].torque) {
        (Lever::Brake, Some(torque)) => torque.smooth[k],
        (Lever::Brake, None) => 0.0,
        (Lever::Constant, _) if balance == Balance::Wheel => context.mean_load * context.radius,
        (Lever::Constant, _) => context.mean_load,
    }
}

fn spline(part: &Problem<'_>, variable: &Variable, acts: Lever) -> Option<Vec<Column>> {
    let data = part.data;
    let values: Vec<Vec<f64>> = (0..data.series.len())
        .map(|run| variable.values(data, run))
        .collect();
    let knots = knots(part, &values, KNOTS);
    (knots.len() >= 2).then(|| {
        hats(&knots, &values, &|run, k| {
            lever(data, part.balance, acts, run, k)
        })
    })
}

/// First two orders of the wheel's angle, with a phase of their own in each run.
fn once_a_revolution(part: &Problem<'_>, acts: Lever) -> Vec<Column> {
    let data = part.data;
    let lever = |run: usize, k: usize| lever(data, part.balance, acts, run, k);
    [1.0, 2.0]
        .into_iter()
        .flat_map(|order| {
            lines::columns(part, order, &lever, &|run| {
                lines::phase_of(data, "wheel_angle_rad", run)
            })
        })
        .collect()
}

fn summed(columns: &[Column], fit: &Found) -> Column {
    let mut sum: Column = columns
        .first()
        .map(|c| c.iter().map(|run| vec![0.0; run.len()]).collect())
        .unwrap_or_default();
    for (column, coefficient) in columns.iter().zip(&fit.coefficients) {
        for (into, from) in sum.iter_mut().zip(column) {
            for (a, b) in into.iter_mut().zip(from) {
                *a += coefficient * b;
            }
        }
    }
    sum
}
