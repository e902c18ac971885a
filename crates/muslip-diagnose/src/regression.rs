//! Linear regression of what a model leaves on further columns, whitened, with the model's own parameters alongside.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::fit::{Problem, dot, weighted_normal};
use crate::model::Model;
use crate::noise::weight;
use crate::omnibus::Column;

/// Linear regression of a model's innovations on further columns, its own parameters free alongside.
pub struct Regression {
    innovations: Vec<Vec<f64>>,
    weights: Vec<Vec<f64>>,
    own: Vec<Vec<Vec<f64>>>,
    own_information: DMatrix<f64>,
    own_gradient: DVector<f64>,
    /// The same by run.
    by_run: Vec<(DMatrix<f64>, DVector<f64>)>,
}

/// What a regression found.
#[derive(Clone, Debug)]
pub struct Found {
    /// Drop of the loss in nats, beyond what the model's own parameters could gain.
    pub gain: f64,
    /// Steps of the model's own parameters that go with them.
    pub own: Vec<f64>,
    /// Coefficients of the columns.
    pub coefficients: Vec<f64>,
    /// Number of columns that were linearly independent of the rest.
    pub rank: usize,
    /// Gain in nats on each run when it is left out of the regression, summed; the in-sample gain where
    /// there are fewer than three runs.
    pub held_out: f64,
}

impl<'a> Regression {
    /// Linearises a model.
    #[must_use]
    pub fn new(problem: &'a Problem<'a>, model: &Model) -> Self {
        let parts: Vec<(Vec<f64>, Vec<Vec<f64>>)> = problem
            .runs
            .par_iter()
            .map(|&run| problem.jacobian(model, run))
            .collect();
        let mut innovations = Vec::new();
        let mut weights = Vec::new();
        let mut own = Vec::new();
        let count = model.vector().len();
        let mut own_information = DMatrix::zeros(count, count);
        let mut own_gradient = DVector::zeros(count);
        let mut by_run = Vec::new();
        for (e, columns) in parts {
            let w: Vec<f64> = e.iter().map(|e| weight(*e)).collect();
            let (information, gradient) = weighted_normal(&e, &w, &columns);
            own_information += &information;
            own_gradient += &gradient;
            by_run.push((information, gradient));
            innovations.push(e);
            weights.push(w);
            own.push(columns);
        }
        Self {
            innovations,
            weights,
            own,
            own_information,
            own_gradient,
            by_run,
        }
    }

    /// Innovations of the run at this place among the problem's runs.
    #[must_use]
    pub fn innovations(&self, place: usize) -> &[f64] {
        &self.innovations[place]
    }

    /// Regresses on columns given in the residual's unit (a column adds to the prediction).
    #[must_use]
    pub fn on(&self, problem: &Problem<'_>, columns: &[&Column]) -> Found {
        let own = self.own_gradient.len();
        let total = own + columns.len();
        let partial: Vec<(DMatrix<f64>, DVector<f64>)> = problem
            .runs
            .par_iter()
            .enumerate()
            .map(|(place, &run)| {
                let mut cross = DMatrix::zeros(columns.len(), total);
                let mut g = DVector::zeros(columns.len());
                let white: Vec<Vec<f64>> = columns
                    .iter()
                    .map(|c| problem.whiten(&c[run], run))
                    .collect();
                for (i, column) in white.iter().enumerate() {
                    // The residual is measured minus predicted: a column enters it with a minus.
                    let weighted: Vec<f64> = column
                        .iter()
                        .zip(&self.weights[place])
                        .map(|(c, w)| -c * w)
                        .collect();
                    g[i] = dot(&weighted, &self.innovations[place]);
                    for j in 0..own {
                        cross[(i, j)] = dot(&weighted, &self.own[place][j]);
                    }
                    for j in 0..=i {
                        cross[(i, own + j)] = -dot(&weighted, &white[j]);
                    }
                }
                (cross, g)
            })
            .collect();
        let assemble = |leave_out: Option<usize>| {
            let mut information = DMatrix::zeros(total, total);
            let mut gradient = DVector::zeros(total);
            for (place, (cross, g)) in partial.iter().enumerate() {
                if leave_out == Some(place) {
                    continue;
                }
                let (own_part, own_slope) = &self.by_run[place];
                add_part(
                    &mut information,
                    &mut gradient,
                    own_part,
                    own_slope,
                    cross,
                    g,
                );
            }
            (information, gradient)
        };
        let (information, gradient) = assemble(None);
        let (drop_all, step, rank_all) = decrease(&information, &gradient);
        let (drop_own, _, rank_own) = decrease(&self.own_information, &self.own_gradient);
        let mut held_out = 0.0;
        if partial.len() >= 3 {
            for (place, (cross, own_columns)) in partial.iter().enumerate() {
                let (rest, slope) = assemble(Some(place));
                let (_, full, _) = decrease(&rest, &slope);
                let (_, short, _) = decrease(
                    &rest.view((0, 0), (own, own)).into_owned(),
                    &slope.rows(0, own).into_owned(),
                );
                let mut here = DMatrix::zeros(total, total);
                let mut here_slope = DVector::zeros(total);
                let (own_part, own_slope) = &self.by_run[place];
                add_part(
                    &mut here,
                    &mut here_slope,
                    own_part,
                    own_slope,
                    cross,
                    own_columns,
                );
                let change = |x: &DVector<f64>| here_slope.dot(x) + 0.5 * x.dot(&(&here * x));
                let mut padded = DVector::zeros(total);
                padded.rows_mut(0, own).copy_from(&short);
                held_out += change(&padded) - change(&full);
            }
        } else {
            held_out = drop_all - drop_own;
        }
        Found {
            held_out,
            gain: drop_all - drop_own,
            own: step.rows(0, own).iter().copied().collect(),
            coefficients: step.rows(own, columns.len()).iter().copied().collect(),
            rank: rank_all - rank_own,
        }
    }
}

/// Adds one run's share of the normal equations: the model's own block, and the columns' blocks.
fn add_part(
    information: &mut DMatrix<f64>,
    gradient: &mut DVector<f64>,
    own_part: &DMatrix<f64>,
    own_slope: &DVector<f64>,
    cross: &DMatrix<f64>,
    slope: &DVector<f64>,
) {
    let own = own_slope.len();
    for i in 0..own {
        gradient[i] += own_slope[i];
        for j in 0..own {
            information[(i, j)] += own_part[(i, j)];
        }
    }
    for i in 0..slope.len() {
        gradient[own + i] += slope[i];
        for j in 0..own {
            information[(own + i, j)] += cross[(i, j)];
            information[(j, own + i)] += cross[(i, j)];
        }
        for j in 0..=i {
            information[(own + i, own + j)] += cross[(i, own + j)];
            if i != j {
                information[(own + j, own + i)] += cross[(i, own + j)];
            }
        }
    }
}

/// Largest decrease of g·x + xᵀA x/2, where it is taken, and the numerical rank, by a pivoted Cholesky of
/// the scaled matrix: columns that depend on those before them are left out.
fn decrease(information: &DMatrix<f64>, gradient: &DVector<f64>) -> (f64, DVector<f64>, usize) {
    let n = gradient.len();
    let scale: Vec<f64> = (0..n)
        .map(|i| information[(i, i)].max(0.0).sqrt())
        .collect();
    let mut kept: Vec<usize> = Vec::new();
    let mut factor: Vec<Vec<f64>> = Vec::new();
    let mut forward: Vec<f64> = Vec::new();
    for i in 0..n {
        if scale[i] <= 0.0 {
            continue;
        }
        let mut row: Vec<f64> = Vec::with_capacity(kept.len() + 1);
        for (a, &j) in kept.iter().enumerate() {
            let mut value = information[(i, j)] / (scale[i] * scale[j]);
            for (x, y) in row.iter().zip(&factor[a]) {
                value -= x * y;
            }
            row.push(value / factor[a][a]);
        }
        let left = 1.0 - row.iter().map(|x| x * x).sum::<f64>();
        if left < 1e-5 {
            continue;
        }
        let pivot = left.sqrt();
        let mut y = -gradient[i] / scale[i];
        for (x, f) in row.iter().zip(&forward) {
            y -= x * f;
        }
        row.push(pivot);
        forward.push(y / pivot);
        factor.push(row);
        kept.push(i);
    }
    let drop = 0.5 * forward.iter().map(|y| y * y).sum::<f64>();
    let mut step = DVector::zeros(n);
    let mut solution = forward.clone();
    for a in (0..kept.len()).rev() {
        for b in a + 1..kept.len() {
            let upper = factor[b][a];
            solution[a] -= upper * solution[b];
        }
        solution[a] /= factor[a][a];
        step[kept[a]] = solution[a] / scale[kept[a]];
    }
    (drop, step, kept.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decrease_agrees_with_a_direct_solution_and_drops_dependent_columns() {
        let a = DMatrix::from_row_slice(3, 3, &[4.0, 1.0, 2.0, 1.0, 3.0, 0.5, 2.0, 0.5, 1.0]);
        // Third column is half the first: rank two in a consistent system.
        let g = DVector::from_column_slice(&[1.0, -2.0, 0.5]);
        let (drop, step, rank) = decrease(&a, &g);
        let two = a.view((0, 0), (2, 2)).into_owned();
        let solved = two
            .clone()
            .lu()
            .solve(&(-g.rows(0, 2).into_owned()))
            .unwrap();
        assert_eq!(rank, 2);
        assert!((step[0] - solved[0]).abs() < 1e-12 && (step[1] - solved[1]).abs() < 1e-12);
        assert!((drop - 0.5 * solved.dot(&(&two * &solved))).abs() < 1e-12);
    }
}
