//! What no mechanism explains of wheel and vehicle: by which variable it is located, and whether it holds on runs
//! left out.

use rayon::prelude::*;

use crate::choose::{Limits, required};
use crate::data::Data;
use crate::fit::{Joint, Problem};
use crate::mechanism::Balance;
use crate::model::Model;
use crate::noise::robust_sigma;
use crate::omnibus::{Column, Found, Regression, Variable, hat, knots};
use crate::validation::{EFFECT_SPAN_S, LEAST_EFFECT};

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
    let sigma = typical(part, model);
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
            let large = size(part, &effect) >= LEAST_EFFECT * sigma;
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
    if knots.len() < 2 {
        return None;
    }
    let columns = (0..knots.len())
        .map(|c| {
            values
                .iter()
                .enumerate()
                .map(|(run, u)| {
                    u.iter()
                        .enumerate()
                        .map(|(k, u)| {
                            let h = match hat(&knots, *u) {
                                Some((at, w)) if at == c => 1.0 - w,
                                Some((at, w)) if at + 1 == c => w,
                                _ => 0.0,
                            };
                            let x = h * lever(data, part.balance, acts, run, k);
                            if x.is_finite() { x } else { 0.0 }
                        })
                        .collect()
                })
                .collect()
        })
        .collect();
    Some(columns)
}

/// First two orders of the wheel's angle, with a phase of their own in each run.
fn once_a_revolution(part: &Problem<'_>, acts: Lever) -> Vec<Column> {
    let data = part.data;
    let mut columns = Vec::new();
    for own in part.runs {
        for order in [1.0, 2.0] {
            for quadrature in [false, true] {
                columns.push(
                    data.series
                        .iter()
                        .enumerate()
                        .map(|(run, s)| {
                            (0..s.len())
                                .map(|k| {
                                    if run != *own {
                                        return 0.0;
                                    }
                                    let (sin, cos) = (order * s.angle[k]).sin_cos();
                                    let x = lever(data, part.balance, acts, run, k)
                                        * if quadrature { sin } else { cos };
                                    if x.is_finite() { x } else { 0.0 }
                                })
                                .collect()
                        })
                        .collect(),
                );
            }
        }
    }
    columns
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

/// Means over [`EFFECT_SPAN_S`] of a column on the stretches of a problem.
fn means(part: &Problem<'_>, of: &dyn Fn(usize) -> Vec<f64>) -> Vec<f64> {
    let mut out = Vec::new();
    for &run in part.runs {
        let column = of(run);
        let length = ((EFFECT_SPAN_S / part.data.series[run].typical_dt) as usize).max(1);
        for segment in part.segments(run) {
            out.extend(
                column[segment.clone()]
                    .chunks_exact(length)
                    .map(|c| c.iter().sum::<f64>() / length as f64),
            );
        }
    }
    out
}

fn typical(part: &Problem<'_>, model: &Model) -> f64 {
    robust_sigma(&means(part, &|run| {
        part.residual(model, &model.vector(), run)
    }))
}

fn size(part: &Problem<'_>, effect: &Column) -> f64 {
    let all = means(part, &|run| effect[run].clone());
    (all.iter().map(|x| x * x).sum::<f64>() / all.len().max(1) as f64).sqrt()
}
