//! How likely a model makes what it was not fitted to.

use super::columns::bounds;
use crate::constants::UNREAD_SHARE_OF_RANGE;
use crate::data::Data;
use crate::innovations::candidates::Table;
use crate::innovations::gram::{Gram, Solved, solve, total};
use crate::innovations::screen::precision;
use crate::model::Model;

/// How likely a model makes what it was not fitted to, in nats.
#[derive(Clone)]
pub struct Unseen {
    /// Negative log likelihood of each run under parameters from all others.
    pub runs: Vec<f64>,
    /// The same of each half run under parameters from all other halves.
    pub halves: Vec<f64>,
}

/// What a model says of every run and half run that it were not fitted to.
pub fn unseen(data: &Data, model: &Model, table: &Table, grams: &[[Gram; 2]]) -> Option<Unseen> {
    let sum = total(grams);
    let chosen: Vec<usize> = (1..sum.products.nrows()).collect();
    let bounds = bounds(data, model);
    let own = model.free_places();
    let wide = |i: usize| match own.get(i - 1) {
        Some(&p) => (UNREAD_SHARE_OF_RANGE * (bounds[p].1 - bounds[p].0)).powi(-2),
        None => precision(table, i),
    };
    let all = solve(&sum.products, &chosen, &wide)?;
    let of = |own: &Gram| outside(own, &sum, &all, &chosen, &wide);
    let runs = grams
        .iter()
        .map(|run| of(&total(core::slice::from_ref(run))));
    let halves = grams.iter().flatten().map(of);
    Some(Unseen {
        runs: runs.collect::<Option<_>>()?,
        halves: halves.collect::<Option<_>>()?,
    })
}

/// Negative log likelihood of a part of the readings, given all others: parameters that the others do not know are as
/// wide as these leave them.
fn outside(
    own: &Gram,
    sum: &Gram,
    all: &Solved,
    chosen: &[usize],
    prior: &dyn Fn(usize) -> f64,
) -> Option<f64> {
    let rest = solve(&(&sum.products - &own.products), chosen, prior)?;
    Some(0.5 * (own.log_variance + all.rss - rest.rss + all.log_det - rest.log_det))
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;

    /// Inner products of a residual and its columns, unit white noise.
    fn gram(residual: &DVector<f64>, columns: &DMatrix<f64>) -> Gram {
        let n = residual.len();
        let all = DMatrix::from_fn(1 + columns.ncols(), n, |i, k| match i {
            0 => residual[k],
            _ => columns[(k, i - 1)],
        });
        Gram {
            products: &all * all.transpose(),
            log_variance: 0.0,
            count: n,
        }
    }

    /// Minus the log density of a residual whose coefficients have this prior precision, without the constant.
    fn dense(residual: &DVector<f64>, columns: &DMatrix<f64>, precision: f64) -> f64 {
        let n = residual.len();
        let covariance = DMatrix::identity(n, n) + columns * columns.transpose() / precision;
        let factor = covariance.cholesky().unwrap();
        let log_det: f64 = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
        log_det + 0.5 * residual.dot(&factor.solve(residual))
    }

    #[test]
    fn what_others_leave_unknown_widens_the_prediction_of_a_run() {
        // The second column is hardly seen in the first run: dense conditioning says what the second costs.
        let wave = |k: usize, f: f64| (f * k as f64 + 0.3).sin();
        let x = DMatrix::from_fn(12, 2, |k, i| match (k < 6, i) {
            (_, 0) => wave(k, 0.7),
            (true, _) => 0.05 * wave(k, 1.3),
            (false, _) => 2.0 * wave(k, 1.3),
        });
        let e = DVector::from_fn(12, |k, _| {
            1.5 * wave(k, 0.7) - 2.0 * x[(k, 1)] + wave(k, 5.1)
        });
        let part = |from: usize| (e.rows(from, 6).into_owned(), x.rows(from, 6).into_owned());
        let ((e1, x1), (e2, x2)) = (part(0), part(6));
        let (first, second) = (gram(&e1, &x1), gram(&e2, &x2));
        let mut sum = first;
        sum.add(&second);
        let prior = |_: usize| 0.5;
        let all = solve(&sum.products, &[1, 2], &prior).unwrap();
        let found = outside(&second, &sum, &all, &[1, 2], &prior).unwrap();
        let expected = dense(&e, &x, 0.5) - dense(&e1, &x1, 0.5);
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        // With its parameters taken for certain it would cost far more.
        let certain = solve(&(&sum.products - &second.products), &[1, 2], &prior).unwrap();
        let left = &e2 + &x2 * &certain.coefficients;
        assert!(0.5 * left.norm_squared() > found);
    }
}
