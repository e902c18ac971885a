//! Inner products of whitened columns, run by run: all that a linear decision needs to know of the samples.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::whiten::{Lanes, Whitener};

/// Columns of one run in one balance: the residual first.
pub type Columns = Vec<Vec<f64>>;

/// Inner products of one run.
#[derive(Clone, Debug)]
pub struct Gram {
    /// Products of all columns with each other; the residual is the first.
    pub products: DMatrix<f64>,
    /// Sum of the logarithms of the innovations' variances.
    pub log_variance: f64,
    /// Innovations.
    pub count: usize,
}

impl Gram {
    /// Nothing of so many columns.
    #[must_use]
    pub fn empty(columns: usize) -> Self {
        Self {
            products: DMatrix::zeros(columns, columns),
            log_variance: 0.0,
            count: 0,
        }
    }

    /// Adds another's.
    pub fn add(&mut self, other: &Self) {
        self.products += &other.products;
        self.log_variance += other.log_variance;
        self.count += other.count;
    }
}

/// Sum over all runs and halves.
#[must_use]
pub fn total(grams: &[[Gram; 2]]) -> Gram {
    let mut sum = Gram::empty(grams.first().map_or(1, |g| g[0].products.nrows()));
    for half in grams.iter().flatten() {
        sum.add(half);
    }
    sum
}

/// Filters of every run of one balance under its noise; nothing where a run does not form it.
pub type Filters = Vec<Option<Whitener>>;

/// Inner products of every run's columns in one balance through its filters, first and second half apart.
#[must_use]
pub fn grams(filters: &Filters, columns: &[Columns]) -> Vec<[Gram; 2]> {
    let runs = filters.par_iter().zip(columns);
    runs.map(|(filter, columns)| gram(filter.as_ref(), columns))
        .collect()
}

fn gram(whitener: Option<&Whitener>, columns: &[Vec<f64>]) -> [Gram; 2] {
    let q = columns.len();
    let Some(whitener) = whitener.filter(|_| q > 0 && !columns[0].is_empty()) else {
        return [Gram::empty(q), Gram::empty(q)];
    };
    let packed = Packed::new(columns, whitener.samples());
    let white = whitener.apply(&packed.lanes);
    let n = whitener.samples().len();
    let middle = n / 2;
    [(0, middle), (middle, n)].map(|(from, to)| Gram {
        products: packed.products(q, &white, from, to),
        log_variance: whitener.log_variances()[from..to].iter().sum(),
        count: to - from,
    })
}

/// The columns of one run that are not nothing, at the samples in use.
pub struct Packed {
    /// Which they are.
    pub which: Vec<usize>,
    /// They.
    pub lanes: Lanes,
}

impl Packed {
    /// Of all columns.
    #[must_use]
    pub fn new(columns: &[Vec<f64>], samples: &[usize]) -> Self {
        let which: Vec<usize> = (0..columns.len())
            .filter(|i| columns[*i].iter().any(|x| *x != 0.0))
            .collect();
        let own: Vec<&[f64]> = which.iter().map(|i| columns[*i].as_slice()).collect();
        Self {
            lanes: Lanes::of(&own, samples),
            which,
        }
    }

    /// Inner products over some of their innovations, among all `q` columns.
    #[must_use]
    pub fn products(&self, q: usize, white: &Lanes, from: usize, to: usize) -> DMatrix<f64> {
        let own = white.products(from, to);
        let mut all = DMatrix::zeros(q, q);
        for (i, &a) in self.which.iter().enumerate() {
            for (j, &b) in self.which.iter().enumerate() {
                all[(a, b)] = own[(i, j)];
            }
        }
        all
    }
}

/// Least squares on inner products with a Gaussian prior on the coefficients.
#[derive(Clone)]
pub struct Solved {
    /// Coefficients of the chosen columns.
    pub coefficients: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// A root of it: directions in which the coefficients are not known, one a column.
    pub unknown: DMatrix<f64>,
    /// Sum of squares that is left, prior included.
    pub rss: f64,
    /// Logarithm of the normal matrix's determinant.
    pub log_det: f64,
}

/// Fits the residual (column 0) by the chosen columns; `precision` is the prior's, by column.
#[must_use]
pub fn solve(
    products: &DMatrix<f64>,
    chosen: &[usize],
    precision: &dyn Fn(usize) -> f64,
) -> Option<Solved> {
    let n = chosen.len();
    let scale: Vec<f64> = chosen
        .iter()
        .map(|&i| (products[(i, i)] + precision(i)).sqrt().max(1e-150))
        .collect();
    let a = DMatrix::from_fn(n, n, |i, j| {
        let prior = if i == j {
            precision(chosen[i]) + 1e-9 * scale[i] * scale[i]
        } else {
            0.0
        };
        (products[(chosen[i], chosen[j])] + prior) / (scale[i] * scale[j])
    });
    let b = DVector::from_fn(n, |i, _| -products[(chosen[i], 0)] / scale[i]);
    let cholesky = a.cholesky()?;
    let x = cholesky.solve(&b);
    let rss = products[(0, 0)] - b.dot(&x);
    let lower = cholesky.l();
    let mut unknown = lower
        .solve_lower_triangular(&DMatrix::identity(n, n))?
        .transpose();
    for (i, mut row) in unknown.row_iter_mut().enumerate() {
        row /= scale[i];
    }
    let log_det = 2.0
        * (0..n)
            .map(|i| cholesky.l_dirty()[(i, i)].ln() + scale[i].ln())
            .sum::<f64>();
    Some(Solved {
        coefficients: DVector::from_fn(n, |i, _| x[i] / scale[i]),
        covariance: &unknown * unknown.transpose(),
        unknown,
        rss,
        log_det,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_squares_on_products_is_least_squares_on_columns() {
        // y = 3 a − 2 b + e: the residual of the model is −y, whose fit are the coefficients that cancel it.
        let a = [1.0, 2.0, -1.0, 0.5, 3.0];
        let b = [0.0, 1.0, 1.0, -2.0, 0.3];
        let e = [0.01, -0.02, 0.005, 0.01, -0.01];
        let columns = DMatrix::from_fn(3, 5, |i, k| match i {
            0 => -(3.0 * a[k] - 2.0 * b[k] + e[k]),
            1 => a[k],
            _ => b[k],
        });
        let solved = solve(&(&columns * columns.transpose()), &[1, 2], &|_| 0.0).unwrap();
        let x = DMatrix::from_fn(5, 2, |k, i| columns[(i + 1, k)]);
        let y = -columns.row(0).transpose();
        let expected = x.clone().svd(true, true).solve(&y, 1e-12).unwrap();
        assert!((&solved.coefficients - &expected).norm() < 1e-7);
        assert!((solved.rss - (y - x * expected).norm_squared()).abs() < 1e-6);
    }

    #[test]
    fn a_tight_prior_keeps_a_coefficient_at_nothing() {
        let products = DMatrix::from_row_slice(2, 2, &[4.0, -2.0, -2.0, 1.0]);
        let free = solve(&products, &[1], &|_| 0.0).unwrap();
        let tight = solve(&products, &[1], &|_| 1e6).unwrap();
        assert!((free.coefficients[0] - 2.0).abs() < 1e-6);
        assert!(tight.coefficients[0].abs() < 1e-5);
    }
}
