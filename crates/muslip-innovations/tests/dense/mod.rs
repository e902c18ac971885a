//! Innovations by the Cholesky factor of a covariance that is written out: every part by its formula, no recursion.

#![allow(
    clippy::unwrap_used,
    reason = "a covariance without a factor fails the test"
)]

use nalgebra::{DMatrix, DVector};

/// How a part goes in time.
#[derive(Debug, Clone, Copy)]
pub enum Kind {
    Forgetting(f64),
    Constant,
    Walk,
    Integrated(f64),
    IntegratedConstant,
}

/// Readings of a sum of parts; one entry an instant.
pub struct Problem {
    pub parts: Vec<(Kind, f64)>,
    pub time: Vec<f64>,
    /// By instant: the gain of each part in the reading.
    pub rows: Vec<Vec<f64>>,
    /// By instant: the gain of each part in the rate, over the step that ends there.
    pub rates: Vec<Vec<f64>>,
    /// Variance of the reading's own noise.
    pub white: Vec<f64>,
    /// The stretch of known level that an instant belongs to.
    pub stretch: Vec<usize>,
    /// Whether there is a reading.
    pub read: Vec<bool>,
}

impl Problem {
    fn step(&self, k: usize) -> f64 {
        if k == 0 {
            0.0
        } else {
            self.time[k] - self.time[k - 1]
        }
    }

    fn walks(&self) -> bool {
        matches!(self.parts[0].0, Kind::Walk)
    }

    /// Of all readings, as if the level were known to be zero before the first of each stretch.
    fn covariance(&self) -> DMatrix<f64> {
        let n = self.time.len();
        let mut sum = DMatrix::from_fn(n, n, |p, q| if p == q { self.white[p] } else { 0.0 });
        for (i, (kind, std)) in self.parts.iter().enumerate() {
            // Σ = A C Aᵀ: C by the part's own law, A by how it enters.
            let age = |p: usize, q: usize| (self.time[p] - self.time[q]).abs();
            let of_part = DMatrix::from_fn(n, n, |p, q| match kind {
                Kind::Forgetting(tau) | Kind::Integrated(tau) => (-age(p, q) / tau).exp(),
                Kind::Constant | Kind::IntegratedConstant => 1.0,
                Kind::Walk => f64::from(u8::from(p == q)),
            });
            // What happens between an instant and the next of the same stretch.
            let along = |p: usize, q: usize| q < p && self.stretch[p] == self.stretch[q];
            let enters = DMatrix::from_fn(n, n, |p, q| match kind {
                Kind::Forgetting(_) | Kind::Constant if p == q => self.rows[p][i],
                Kind::Walk if along(p, q) => self.step(q + 1),
                // The part as it is before a step acts over that step.
                Kind::Integrated(_) | Kind::IntegratedConstant if along(p, q) => {
                    self.rates[q + 1][i] * self.step(q + 1)
                }
                _ => 0.0,
            });
            sum += &enters * of_part * enters.transpose() * (std * std);
        }
        sum
    }

    /// Normalised innovations; none for what is no reading and for the first of each stretch of an unknown level.
    pub fn innovations(&self, readings: &[f64]) -> Vec<Option<f64>> {
        let n = self.time.len();
        let mut rows: Vec<DVector<f64>> = Vec::new();
        let mut of_instant = vec![None; n];
        let mut first_of = std::collections::BTreeMap::new();
        for k in 0..n {
            if !self.read[k] {
                continue;
            }
            let mut row = DVector::zeros(n);
            row[k] = 1.0;
            if self.walks() {
                // Nothing known of the level: only differences to the stretch's first reading say anything.
                let first = *first_of.entry(self.stretch[k]).or_insert(k);
                if first == k {
                    continue;
                }
                row[first] = -1.0;
            }
            of_instant[k] = Some(rows.len());
            rows.push(row);
        }
        let seen = DMatrix::from_fn(rows.len(), n, |p, q| rows[p][q]);
        let covariance = &seen * self.covariance() * seen.transpose();
        let factor = covariance.cholesky().unwrap().l();
        let white = factor
            .solve_lower_triangular(&(seen * DVector::from_column_slice(readings)))
            .unwrap();
        of_instant.iter().map(|at| at.map(|at| white[at])).collect()
    }
}
