//! Whitening by a Kalman filter: residuals become innovations, of unit variance and independent, under a covariance
//! that is a sum of simple parts.
//!
//! Every part is a state of the filter: an Ornstein-Uhlenbeck process times a known gain, a constant of the run, a
//! walk (white noise integrated), or a process that is integrated into the walk. So a pass costs O(n), gaps and
//! locked stretches are steps of time without a reading, and one pass of gains serves any number of columns.

#![expect(
    clippy::needless_range_loop,
    reason = "rows and columns of one matrix are told apart by their indices"
)]

mod course;
mod lanes;
mod part;
mod passes;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use nalgebra::DMatrix;
use pulp::Arch;
use rayon::prelude::*;

use lanes::LANES;
use passes::{Apply, Covariance, Expected, Found, RUNS, Squares, Traces};

pub use course::{Course, Sizes};
pub use lanes::Lanes;
pub use part::{Kind, MOST, Part};

/// Variance of a level of which nothing is known, over that of the other parts.
pub const DIFFUSE: f64 = 1e8;

/// The filter's gains on one run: what whitens any column.
pub struct Whitener {
    course: Arc<Course>,
    found: Found,
}

/// One number for each part's variance and for that of the readings' own noise.
#[derive(Clone, Copy, Debug, Default)]
pub struct ByVariance {
    /// By part, in their order.
    pub parts: [f64; MOST],
    /// Of the readings' own noise.
    pub white: f64,
}

/// Runs the filter's covariance over every course under noise of these sizes; nothing where there is no course. All are
/// of one balance.
#[must_use]
pub fn whiteners(courses: &[Option<Arc<Course>>], sizes: &Sizes) -> Vec<Option<Whitener>> {
    let present: Vec<&Arc<Course>> = courses.iter().flatten().collect();
    let mut found = present.chunks(RUNS).flat_map(|group| {
        if group.len() > RUNS / 2 {
            covariance::<RUNS>(group, sizes)
        } else {
            covariance::<{ RUNS / 2 }>(group, sizes)
        }
    });
    let mut own = |course: &Arc<Course>| {
        Some(Whitener {
            course: Arc::clone(course),
            found: found.next()?,
        })
    };
    courses.iter().map(|course| own(course.as_ref()?)).collect()
}

fn covariance<const R: usize>(group: &[&Arc<Course>], sizes: &Sizes) -> Vec<Found> {
    let course = |r: usize| group.get(r).map_or(Course::none(), |course| &***course);
    let found = Arch::new().dispatch(Covariance::<R> {
        courses: core::array::from_fn(course),
        sizes,
    });
    found.into_iter().take(group.len()).collect()
}

/// Tr V⁻¹ K of every run, K being what a unit of a variance adds to V: the slope of log|V|, by one pass back through the
/// filter (Koopman and Shephard 1992, Biometrika 79: exact score of a model in state space).
#[must_use]
pub fn traces(whiteners: &[&Whitener]) -> Vec<ByVariance> {
    let pairs = whiteners.par_chunks(2);
    pairs
        .flat_map_iter(|group| match group {
            [one, other] => {
                let whiteners = [*one, *other];
                Arch::new().dispatch(Traces { whiteners }).to_vec()
            }
            _ => {
                let alone = |one: &&Whitener| Arch::new().dispatch(Traces { whiteners: [*one] });
                group.iter().flat_map(alone).collect()
            }
        })
        .collect()
}

impl Whitener {
    /// Samples in use, in order.
    #[must_use]
    pub fn samples(&self) -> &[usize] {
        &self.course.samples
    }

    /// Logarithms of the innovations' variances.
    #[must_use]
    pub fn log_variances(&self) -> &[f64] {
        &self.found.log_variances
    }

    /// Σ yᵀ V⁻¹ K V⁻¹ y, K being what a unit of a variance adds to V, over sums y of columns whose innovations (each over
    /// its standard deviation) are given: minus the slope of Σ yᵀ V⁻¹ y, by the same pass back. `weights` holds how much
    /// of each column (row) a sum (column) has. Of all sums but the last together, and of the last.
    #[must_use]
    pub fn explained(&self, innovations: &Lanes, weights: &DMatrix<f64>) -> [ByVariance; 2] {
        let told_apart = weights.ncols().saturating_sub(1);
        // The last sum goes into the last lane.
        let lanes = (told_apart + 1).next_multiple_of(LANES);
        let mut placed = weights.columns(0, told_apart).into_owned();
        placed = placed.resize_horizontally(lanes, 0.0);
        if let Some(last) = weights.column_iter().next_back() {
            placed.set_column(lanes - 1, &last);
        }
        let sums = innovations.sums(&placed);
        let groups = sums.groups();
        let mut out = [ByVariance::default(); 2];
        for group in 0..groups {
            let (whitener, sums, out) = (self, sums.values(), &mut out);
            if group + 1 == groups {
                Arch::new().dispatch(Squares::<true> {
                    whitener,
                    sums,
                    groups,
                    group,
                    out,
                });
            } else {
                Arch::new().dispatch(Squares::<false> {
                    whitener,
                    sums,
                    groups,
                    group,
                    out,
                });
            }
        }
        out.map(|own| self.course.with_twin(own))
    }

    /// What each part, then the readings' own noise, is expected to have been in a sum of columns whose innovations (each
    /// over its standard deviation) are given: V_i V⁻¹ y, V_i being what the part adds to V. `weights` holds how much of
    /// each column the sum has. They add up to the sum itself, but for a level of which nothing is known.
    #[must_use]
    pub fn expected(&self, innovations: &Lanes, weights: &[f64], sizes: &Sizes) -> Lanes {
        let mut placed = DMatrix::zeros(weights.len(), LANES);
        placed.column_mut(0).copy_from_slice(weights);
        let own = innovations.sums(&placed).column(0);
        let rows = Arch::new().dispatch(Expected {
            whitener: self,
            sizes,
            innovations: &own,
        });
        Lanes::of_readings(&rows)
    }

    /// Innovations of several columns, each over its own standard deviation.
    #[must_use]
    pub fn apply(&self, columns: &Lanes) -> Lanes {
        let mut out = Lanes::room(columns.count, self.samples().len());
        let groups = columns.groups();
        for first in (0..groups).step_by(2) {
            let (whitener, columns, out) = (self, columns.values(), out.values_mut());
            if first + 1 < groups {
                Arch::new().dispatch(Apply::<2> {
                    whitener,
                    columns,
                    out,
                    groups,
                    first,
                });
            } else {
                Arch::new().dispatch(Apply::<1> {
                    whitener,
                    columns,
                    out,
                    groups,
                    first,
                });
            }
        }
        out
    }
}
