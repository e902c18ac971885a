//! Sizes of the noise's parts by restricted maximum likelihood, along its exact slopes.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::gram::{Columns, Packed, Solved, solve};
use super::noise::{BalanceParts, Source};
use super::whiten::{ByVariance, Course, Kind, Lanes, Whitener, traces, whiteners};
use crate::data::Data;

/// Prior standard deviation of a part's log size about where it starts: wide, so that a part that the data say
/// nothing of stays plausible.
const PRIOR: f64 = 3.0;
/// The same of how far it lies beyond what the sensors make plausible: what belongs to a run or goes slowly could
/// otherwise take up any effect at no cost.
const PRIOR_BEYOND: f64 = 0.8;
/// Farthest a log size goes from its start.
const FARTHEST: f64 = 7.0;
/// The same of a walk.
const FARTHEST_WALK: f64 = 1.5;
/// Longest step of a log size.
const LONGEST_STEP: f64 = 1.5;
/// A step that gains less, in nats, is the last.
const SMALL_GAIN: f64 = 0.05;
/// Share of what the slope promises that a step has to gain.
const ENOUGH: f64 = 1e-4;

/// Columns of one balance that the sizes of its noise are fitted under, and how densely they are read.
#[derive(Clone, Copy)]
pub struct Readings<'a> {
    /// The campaign.
    pub data: &'a Data,
    /// Columns by run, the residual first; all others are fitted.
    pub columns: &'a [Columns],
    /// Prior precision by column.
    pub precision: &'a (dyn Fn(usize) -> f64 + Sync),
    /// Inner products of the same columns in all other balances, which share the coefficients.
    pub others: &'a DMatrix<f64>,
    /// Every so many samples.
    pub stride: usize,
}

/// Minus the logarithm of the prior of the parts' sizes.
#[must_use]
pub fn penalty(parts: &BalanceParts) -> f64 {
    parts
        .sources
        .iter()
        .map(|s| 0.5 * ((s.log_std - s.log_start) / PRIOR).powi(2) + 0.5 * beyond(s).powi(2))
        .sum()
}

/// By how many of its priors a size lies beyond what the sensors make plausible.
fn beyond(source: &Source) -> f64 {
    ((source.log_std - source.log_cap) / PRIOR_BEYOND).max(0.0)
}

/// Slope of [`penalty`] by the log size of one part.
fn penalty_slope(source: &Source) -> f64 {
    (source.log_std - source.log_start) / (PRIOR * PRIOR) + beyond(source) / PRIOR_BEYOND
}

/// The balance under noise of these sizes.
struct Loss {
    /// Negative restricted log likelihood with the prior of the sizes, in nats.
    value: f64,
    /// Its slopes by the log sizes.
    slope: DVector<f64>,
    /// Steps of the log sizes to where each part explains as much as it takes up (the multiplicative update of
    /// variance components: Zhou, Hu, Zhou and Lange 2019, J. Comput. Graph. Stat. 28). It sees a part that is far too
    /// small, of which the slope says nothing.
    balance: DVector<f64>,
}

/// A run's readings of a balance.
struct OfRun {
    course: Arc<Course>,
    columns: Packed,
}

/// What stays whatever the sizes are.
struct Fitting<'a> {
    readings: &'a Readings<'a>,
    runs: Vec<OfRun>,
    courses: Vec<Option<Arc<Course>>>,
    /// Number of columns.
    width: usize,
}

impl<'a> Fitting<'a> {
    fn new(readings: &'a Readings<'a>, parts: &BalanceParts) -> Self {
        let columns = readings.columns;
        let courses = parts.courses(readings.data, readings.stride);
        let runs = courses
            .into_par_iter()
            .zip(columns)
            .filter_map(|(course, own)| {
                let course = course.filter(|_| own.first().is_some_and(|c| !c.is_empty()))?;
                Some(OfRun {
                    columns: Packed::new(own, &course.samples),
                    course,
                })
            });
        let runs: Vec<OfRun> = runs.collect();
        Self {
            readings,
            courses: runs
                .iter()
                .map(|run| Some(Arc::clone(&run.course)))
                .collect(),
            runs,
            width: columns.iter().map(Vec::len).max().unwrap_or(0),
        }
    }

    /// `None` where the columns cannot be told apart, or where the value is no lower than `below`: slopes cost more than
    /// the value, and are of use only where a step is taken.
    fn loss(&self, parts: &BalanceParts, below: f64) -> Result<Loss, Option<f64>> {
        let q = self.width;
        let whiteners = whiteners(&self.courses, &parts.sizes());
        let whiteners: Vec<&Whitener> = whiteners.iter().flatten().collect();
        let white: Vec<(Lanes, DMatrix<f64>)> = whiteners
            .par_iter()
            .zip(&self.runs)
            .map(|(whitener, run)| {
                let white = whitener.apply(&run.columns.lanes);
                let products = run.columns.products(q, &white, 0, whitener.samples().len());
                (white, products)
            })
            .collect();
        let mut sum = self.readings.others.clone();
        let mut log_variance = 0.0;
        for (whitener, (_, products)) in whiteners.iter().zip(&white) {
            sum += products;
            log_variance += whitener.log_variances().iter().sum::<f64>();
        }
        let fitted: Vec<usize> = (1..q).filter(|i| sum[(*i, *i)] > 0.0).collect();
        let solved = solve(&sum, &fitted, self.readings.precision).ok_or(None)?;
        let value = 0.5 * (log_variance + solved.rss + solved.log_det) + penalty(parts);
        if !(value < below) {
            return Err(value.is_finite().then_some(value));
        }
        let weights = weights(q, &fitted, &solved);
        let explained: Vec<[ByVariance; 2]> = whiteners
            .par_iter()
            .zip(&self.runs)
            .zip(&white)
            .map(|((whitener, run), (white, _))| {
                let own = weights.select_rows(&run.columns.which);
                whitener.explained(white, &own)
            })
            .collect();
        slopes(parts, value, &traces(&whiteners), &explained)
    }
}

/// By column, how much of it is in each direction in which the fitted columns are not known, and in what is left of the
/// residual, the last.
fn weights(q: usize, fitted: &[usize], solved: &Solved) -> DMatrix<f64> {
    let unknown = &solved.unknown;
    let last = fitted.len();
    let mut weights = DMatrix::zeros(q, 1 + last);
    weights[(0, last)] = 1.0;
    for (i, &column) in fitted.iter().enumerate() {
        weights[(column, last)] = solved.coefficients[i];
        for j in 0..last {
            weights[(column, j)] = unknown[(i, j)];
        }
    }
    weights
}

/// The loss with its slopes from what the runs' readings say of every part: what it takes up (the trace), and what it
/// explains of the directions that are not known and of what is left.
fn slopes(
    parts: &BalanceParts,
    value: f64,
    traces: &[ByVariance],
    explained: &[[ByVariance; 2]],
) -> Result<Loss, Option<f64>> {
    let n = parts.sources.len();
    let [mut trace, mut square] = [DVector::zeros(n), DVector::zeros(n)];
    for (own, [unknown, left]) in traces.iter().zip(explained) {
        trace += by_size(parts, own) - by_size(parts, unknown);
        square += by_size(parts, left);
    }
    let prior = |i: usize| penalty_slope(&parts.sources[i]);
    let loss = Loss {
        value,
        slope: DVector::from_fn(n, |i, _| trace[i] - square[i] + prior(i)),
        balance: DVector::from_fn(n, |i, _| {
            let step = 0.5 * f64::ln(square[i] / trace[i]);
            if step.is_finite() {
                step.clamp(-LONGEST_STEP, LONGEST_STEP)
            } else {
                0.0
            }
        }),
    };
    let finite = value.is_finite() && loss.slope.iter().all(|x| x.is_finite());
    if finite { Ok(loss) } else { Err(None) }
}

/// What a unit of each part's variance does, times that variance.
fn by_size(parts: &BalanceParts, of: &ByVariance) -> DVector<f64> {
    let mut remembered = of.parts.iter();
    let sources = parts.sources.iter().map(|s| {
        let own = match s.kind {
            Some(_) => remembered.next().copied().unwrap_or(0.0),
            None => of.white,
        };
        (2.0 * s.log_std).exp() * own
    });
    DVector::from_iterator(parts.sources.len(), sources)
}

/// Steps that balance what the parts explain before the search turns to the slopes.
const BALANCING_STEPS: usize = 6;

/// Fits the log sizes of all parts: first by balancing them, then by a quasi-Newton search (Broyden, Fletcher,
/// Goldfarb, Shanno), in at most so many steps; the loss that is reached.
pub fn fit(readings: &Readings<'_>, parts: &mut BalanceParts, steps: usize) -> f64 {
    let fitting = Fitting::new(readings, parts);
    let Ok(mut here) = fitting.loss(parts, f64::INFINITY) else {
        return f64::INFINITY;
    };
    let mut inverse: Option<DMatrix<f64>> = None;
    for step in 0..steps {
        let balancing = step < BALANCING_STEPS;
        let start = preconditioner(&here);
        let direction = if balancing {
            here.balance.clone()
        } else {
            -(inverse.as_ref().unwrap_or(&start) * &here.slope)
        };
        let Some((there, next)) = along(&fitting, parts, &here, direction) else {
            if balancing || inverse.take().is_some() {
                continue;
            }
            break;
        };
        let step = log_sizes(&there) - log_sizes(parts);
        let change = &next.slope - &here.slope;
        inverse = (!balancing)
            .then(|| updated(inverse.unwrap_or(start), &step, &change))
            .flatten();
        let gained = here.value - next.value;
        (*parts, here) = (there, next);
        if gained < SMALL_GAIN {
            break;
        }
    }
    here.value
}

fn log_sizes(parts: &BalanceParts) -> DVector<f64> {
    DVector::from_iterator(parts.sources.len(), parts.sources.iter().map(|s| s.log_std))
}

/// Inverse curvatures that would make a slope's step the balancing one.
fn preconditioner(here: &Loss) -> DMatrix<f64> {
    DMatrix::from_diagonal(&here.slope.zip_map(&here.balance, |slope, step| {
        let own = -step / slope;
        if own.is_finite() && own > 0.0 {
            own.clamp(1e-4, 1.0)
        } else {
            0.05
        }
    }))
}

/// The first place along a direction where the loss falls as its slope promises; `None` where there is none.
fn along(
    fitting: &Fitting<'_>,
    parts: &BalanceParts,
    here: &Loss,
    mut direction: DVector<f64>,
) -> Option<(BalanceParts, Loss)> {
    direction *= (LONGEST_STEP / direction.amax().max(1e-12)).min(1.0);
    let promised = direction.dot(&here.slope);
    if !(promised < 0.0) {
        return None;
    }
    let mut share = 1.0;
    for _ in 0..5 {
        let mut there = parts.clone();
        for (s, by) in there.sources.iter_mut().zip(direction.iter()) {
            // A walk is the drag's own noise, which is known.
            let reach = if s.kind == Some(Kind::Walk) {
                FARTHEST_WALK
            } else {
                FARTHEST
            };
            s.log_std = (s.log_std + share * by).clamp(s.log_start - reach, s.log_start + reach);
        }
        match fitting.loss(&there, here.value + ENOUGH * share * promised) {
            Ok(next) => return Some((there, next)),
            // The lowest point of the parabola through value, slope and what was met.
            Err(Some(value)) => {
                let bend = value - here.value - share * promised;
                share *= (-0.5 * share * promised / bend.max(1e-12)).clamp(0.1, 0.5);
            }
            Err(None) => share *= 0.3,
        }
    }
    None
}

/// Inverse curvatures after a step and the change of the slopes over it; `None` where they do not bend upwards.
fn updated(
    inverse: DMatrix<f64>,
    step: &DVector<f64>,
    change: &DVector<f64>,
) -> Option<DMatrix<f64>> {
    let along = step.dot(change);
    if along <= 1e-12 {
        return None;
    }
    let n = step.len();
    let left = DMatrix::identity(n, n) - step * change.transpose() / along;
    Some(&left * inverse * left.transpose() + step * step.transpose() / along)
}
