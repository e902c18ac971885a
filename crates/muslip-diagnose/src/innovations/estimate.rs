//! Sizes of the noise's parts by restricted maximum likelihood, along its exact slopes.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::gram::{Columns, innovations, products, solve};
use super::noise::{BalanceParts, Source};
use super::whiten::{ByVariance, Kind, Whitener};
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
    pub precision: &'a dyn Fn(usize) -> f64,
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

struct Filtered {
    whitener: Whitener,
    which: Vec<usize>,
    white: Vec<Vec<f64>>,
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

/// `None` where the columns cannot be told apart, or where the value is no lower than `below`: slopes cost more than
/// the value, and are of use only where a step is taken.
fn loss(readings: &Readings<'_>, parts: &BalanceParts, below: f64) -> Result<Loss, Option<f64>> {
    let Readings {
        data,
        columns,
        precision,
        others,
        stride,
    } = *readings;
    let q = columns.iter().map(Vec::len).max().unwrap_or(0);
    let filtered: Vec<(usize, Filtered)> = (0..data.series.len())
        .into_par_iter()
        .filter(|run| columns[*run].first().is_some_and(|c| !c.is_empty()))
        .map(|run| {
            let whitener = parts.whitener(data, run, stride);
            let (which, white) = innovations(&whitener, &columns[run]);
            (
                run,
                Filtered {
                    whitener,
                    which,
                    white,
                },
            )
        })
        .collect();
    let mut sum = others.clone();
    let mut log_variance = 0.0;
    for (_, f) in &filtered {
        sum += products(q, &f.which, &f.white, 0, f.whitener.samples.len());
        log_variance += f.whitener.log_variances.iter().sum::<f64>();
    }
    let fitted: Vec<usize> = (1..q).filter(|i| sum[(*i, *i)] > 0.0).collect();
    let solved = solve(&sum, &fitted, precision).ok_or(None)?;
    let value = 0.5 * (log_variance + solved.rss + solved.log_det) + penalty(parts);
    if !(value < below) {
        return Err(value.is_finite().then_some(value));
    }
    // What is left of the residual, then the directions in which the fitted columns are not known.
    let unknown = &solved.unknown;
    let mut weights = DMatrix::zeros(q, 1 + fitted.len());
    weights[(0, 0)] = 1.0;
    for (i, &column) in fitted.iter().enumerate() {
        weights[(column, 0)] = solved.coefficients[i];
        for j in 0..fitted.len() {
            weights[(column, 1 + j)] = unknown[(i, j)];
        }
    }
    let shares: Vec<[DVector<f64>; 2]> = filtered
        .par_iter()
        .map(|(run, f)| shares(parts, *run, f, &weights))
        .collect();
    let n = parts.sources.len();
    let [trace, square] = shares
        .into_iter()
        .fold([DVector::zeros(n), DVector::zeros(n)], |a, b| {
            [&a[0] + &b[0], &a[1] + &b[1]]
        });
    let prior = |i: usize| penalty_slope(&parts.sources[i]);
    let loss = Loss {
        value,
        slope: DVector::from_fn(n, |i, _| trace[i] - square[i] + prior(i)),
        balance: DVector::from_fn(n, |i, _| {
            let step = 0.5 * (square[i] / trace[i]).ln();
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

/// What a run's readings say of every part: what it takes up (the trace), and what it explains.
fn shares(
    parts: &BalanceParts,
    run: usize,
    filtered: &Filtered,
    weights: &DMatrix<f64>,
) -> [DVector<f64>; 2] {
    let n = filtered.whitener.samples.len();
    let which = &filtered.which;
    let white = DMatrix::from_fn(n, which.len(), |k, i| filtered.white[i][k]);
    let used = DMatrix::from_fn(which.len(), weights.ncols(), |i, j| weights[(which[i], j)]);
    let combined = white * used;
    let combined: Vec<&[f64]> = (0..weights.ncols())
        .map(|j| &combined.as_slice()[j * n..(j + 1) * n])
        .collect();
    let own = parts.parts(run);
    let by_size = |x: &ByVariance| {
        let mut at = 0;
        DVector::from_iterator(
            parts.sources.len(),
            parts.sources.iter().map(|s| {
                let by_variance = if s.kind.is_some() {
                    at += 1;
                    x.parts[at - 1]
                } else {
                    x.white
                };
                (2.0 * s.log_std).exp() * by_variance
            }),
        )
    };
    let trace = by_size(&filtered.whitener.traces(&own))
        - by_size(&filtered.whitener.squares(&combined[1..], &own));
    [
        trace,
        by_size(&filtered.whitener.squares(&combined[..1], &own)),
    ]
}

/// Steps that balance what the parts explain before the search turns to the slopes.
const BALANCING_STEPS: usize = 6;

/// Fits the log sizes of all parts: first by balancing them, then by a quasi-Newton search (Broyden, Fletcher,
/// Goldfarb, Shanno), in at most so many steps; the loss that is reached.
pub fn fit(readings: &Readings<'_>, parts: &mut BalanceParts, steps: usize) -> f64 {
    let Ok(mut here) = loss(readings, parts, f64::INFINITY) else {
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
        let Some((there, next)) = along(readings, parts, &here, direction) else {
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
    readings: &Readings<'_>,
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
        match loss(readings, &there, here.value + ENOUGH * share * promised) {
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
