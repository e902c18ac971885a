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
    /// Length in standard deviations of what base and nuisances leave of each column.
    pub sizes: Vec<f64>,
}

/// Prior standard deviation of a free dependence at a knot, as a share of the friction, of the mean load or of the torque.
const FREE_STD: f64 = 0.5;

/// Prior precision of a column of the table (residual included).
#[must_use]
pub fn precision(table: &Table, column: usize) -> f64 {
    let first = 1 + table.base;
    if column >= first && column < first + table.nuisances.len() {
        table.nuisances[column - first].powi(-2)
    } else if column < first && column >= first - table.free {
        FREE_STD.powi(-2)
    } else {
        0.0
    }
}

/// Scores every candidate, best first.
#[must_use]
pub fn scores(table: &Table, sum: &Gram) -> Option<Vec<Score>> {
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
        out.push(Score {
            candidate: index,
            gain,
            coefficients,
            sizes: size,
        });
    }
    out.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    Some(out)
}
