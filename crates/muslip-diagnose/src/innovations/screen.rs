//! Scores of all candidates on the sums over any set of runs: one factorisation, one small solve a candidate.

use nalgebra::{DMatrix, DVector};

use super::candidates::Table;
use super::gram::Gram;

/// What a candidate adds to base and nuisances.
#[derive(Clone, Debug)]
pub struct Score {
    /// Position in the table.
    pub candidate: usize,
    /// Half the drop of the sum of squares, in nats.
    pub gain: f64,
    /// Coefficients of its columns.
    pub coefficients: DVector<f64>,
    /// Coefficients of base and nuisances beside it.
    pub fixed: DVector<f64>,
}

/// Prior precision of a column of the table (residual included).
#[must_use]
pub fn precision(table: &Table, column: usize) -> f64 {
    let first = 1 + table.base;
    if column >= first && column < first + table.nuisances.len() {
        table.nuisances[column - first].std.powi(-2)
    } else {
        0.0
    }
}

/// Scores every candidate; also the fit without any.
#[must_use]
pub fn scores(table: &Table, sum: &Gram) -> Option<(DVector<f64>, f64, Vec<Score>)> {
    let g = &sum.products;
    let fixed = table.base + table.nuisances.len();
    let n = g.nrows();
    let scale = DVector::from_fn(fixed, |i, _| {
        (g[(1 + i, 1 + i)] + precision(table, 1 + i))
            .sqrt()
            .max(1e-150)
    });
    let a = DMatrix::from_fn(fixed, fixed, |i, j| {
        let own = if i == j {
            precision(table, 1 + i) + 1e-9 * scale[i] * scale[i]
        } else {
            0.0
        };
        (g[(1 + i, 1 + j)] + own) / (scale[i] * scale[j])
    });
    let cholesky = a.cholesky()?;
    // Right sides: the residual and every candidate's columns.
    let first = 1 + fixed;
    let b = DMatrix::from_fn(fixed, 1 + n - first, |i, j| {
        let column = if j == 0 { 0 } else { first + j - 1 };
        g[(1 + i, column)] / scale[i]
    });
    let x = cholesky.solve(&b);
    let schur = |i: usize, j: usize| {
        let (ci, cj) = (
            if i == 0 { 0 } else { first + i - 1 },
            if j == 0 { 0 } else { first + j - 1 },
        );
        g[(ci, cj)] - b.column(i).dot(&x.column(j))
    };
    let rss = schur(0, 0);
    let without = DVector::from_fn(fixed, |i, _| -x[(i, 0)] / scale[i]);
    let mut out = Vec::with_capacity(table.candidates.len());
    for (index, candidate) in table.candidates.iter().enumerate() {
        let own: Vec<usize> = candidate.columns.clone().map(|c| c + 1).collect();
        let m = own.len();
        let size: Vec<f64> = own.iter().map(|&i| schur(i, i).max(0.0).sqrt()).collect();
        let whole: Vec<f64> = own
            .iter()
            .map(|&i| g[(first + i - 1, first + i - 1)].sqrt())
            .collect();
        // A column that base and nuisances span says nothing of its own.
        if size
            .iter()
            .zip(&whole)
            .all(|(s, w)| !(*s > 1e-3 * w) || !(*s > 1e-9))
        {
            continue;
        }
        let s = DMatrix::from_fn(m, m, |i, j| {
            schur(own[i], own[j]) / (size[i].max(1e-150) * size[j].max(1e-150))
                + if i == j { 1e-6 } else { 0.0 }
        });
        let r = DVector::from_fn(m, |i, _| -schur(own[i], 0) / size[i].max(1e-150));
        let Some(factor) = s.cholesky() else { continue };
        let c = factor.solve(&r);
        let gain = 0.5 * r.dot(&c);
        let coefficients = DVector::from_fn(m, |i, _| c[i] / size[i].max(1e-150));
        let mut fixed_with = without.clone();
        for (i, &column) in own.iter().enumerate() {
            for j in 0..fixed {
                fixed_with[j] -= x[(j, column)] / scale[j] * coefficients[i];
            }
        }
        out.push(Score {
            candidate: index,
            gain,
            coefficients,
            fixed: fixed_with,
        });
    }
    out.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    Some((without, rss, out))
}

/// Half the sum of squares of one run under these coefficients.
#[must_use]
pub fn loss_of(
    gram: &Gram,
    fixed: &DVector<f64>,
    candidate: Option<(usize, &DVector<f64>)>,
) -> f64 {
    let n = gram.products.nrows();
    let mut c = DVector::zeros(n);
    c[0] = 1.0;
    c.rows_mut(1, fixed.len()).copy_from(fixed);
    if let Some((first, own)) = candidate {
        c.rows_mut(1 + fixed.len() + first, own.len())
            .copy_from(own);
    }
    0.5 * c.dot(&(&gram.products * &c))
}
