//! Sizes of the noise's parts by restricted maximum likelihood, by Newton's steps.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::gram::{Columns, Packed, Solved, solve};
use super::noise::{BalanceParts, Source};
use super::whiten::{ByVariance, Course, Kind, Lanes, MOST, Whitener, traces, whiteners};
use crate::constants::{LOG_SIZE_STD, LOG_SIZE_STD_BEYOND};
use crate::data::Data;

/// Farthest a log size goes from its start.
const FARTHEST: f64 = 7.0;
/// The same of a walk.
const FARTHEST_WALK: f64 = 1.5;
/// Longest step of a log size.
const LONGEST_STEP: f64 = 1.5;
/// A balancing step that gains less, in nats, is the last, and a Newton step that promises less is not taken.
const SMALL_GAIN: f64 = 0.2;
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
        .map(|s| 0.5 * ((s.log_std - s.log_start) / LOG_SIZE_STD).powi(2) + 0.5 * beyond(s).powi(2))
        .sum()
}

/// By how many of its priors a size lies beyond what the sensors make plausible.
fn beyond(source: &Source) -> f64 {
    ((source.log_std - source.log_cap) / LOG_SIZE_STD_BEYOND).max(0.0)
}

/// A log size no farther from where it starts than it may go.
fn within_reach(source: &Source, log_std: f64) -> f64 {
    // A walk is the drag's own noise, which is known.
    let reach = if source.kind == Some(Kind::Walk) {
        FARTHEST_WALK
    } else {
        FARTHEST
    };
    let most = source.log_most.min(source.log_start + reach);
    log_std.clamp(source.log_start - reach, most)
}

/// Slope of [`penalty`] by the log size of one part.
fn penalty_slope(source: &Source) -> f64 {
    (source.log_std - source.log_start) / (LOG_SIZE_STD * LOG_SIZE_STD)
        + beyond(source) / LOG_SIZE_STD_BEYOND
}

/// Curvature of [`penalty`] by the same.
fn penalty_curvature(source: &Source) -> f64 {
    let of_cap = if beyond(source) > 0.0 {
        LOG_SIZE_STD_BEYOND.powi(-2)
    } else {
        0.0
    };
    LOG_SIZE_STD.powi(-2) + of_cap
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
    /// Whether a size is as far from its start as it goes, and would go on.
    held: Vec<bool>,
    /// Curvature by the log sizes: the average information (Gilmour, Thompson and Cullis 1995, Biometrics 51), with the
    /// prior's own. By variances it is the mean of the observed and the expected information, and needs no trace of a
    /// product; by their logarithms a slope is left out, which is nothing on average.
    curvature: DMatrix<f64>,
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
        let curvature = self.curvature(parts, &whiteners, &white, &weights);
        slopes(parts, value, &traces(&whiteners), &explained, curvature)
    }

    /// Twice Wᵀ P W, W being what each part is expected to have been in what is left, P what weighs residuals of fitted
    /// columns, with the prior's own curvature.
    fn curvature(
        &self,
        parts: &BalanceParts,
        whiteners: &[&Whitener],
        white: &[(Lanes, DMatrix<f64>)],
        weights: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let sizes = parts.sizes();
        let last = weights.ncols() - 1;
        let left = weights.column(last);
        let by_run: Vec<(DMatrix<f64>, DMatrix<f64>)> = whiteners
            .par_iter()
            .zip(&self.runs)
            .zip(white)
            .map(|((whitener, run), (white, _))| {
                let own: Vec<f64> = run.columns.which.iter().map(|i| left[*i]).collect();
                let expected = whitener.apply(&whitener.expected(white, &own, &sizes));
                let of_each = expected.products(0, whitener.samples().len());
                let unknown = weights.columns(0, last).select_rows(&run.columns.which);
                (of_each, expected.products_with(white) * unknown)
            })
            .collect();
        let mut of_each = DMatrix::zeros(MOST + 1, MOST + 1);
        let mut by_columns = DMatrix::zeros(MOST + 1, last);
        for (own, columns) in &by_run {
            of_each += own;
            by_columns += columns;
        }
        let information = 2.0 * (of_each - &by_columns * by_columns.transpose());
        let place = places(parts);
        DMatrix::from_fn(place.len(), place.len(), |i, j| {
            let prior = if i == j {
                penalty_curvature(&parts.sources[i])
            } else {
                0.0
            };
            information[(place[i], place[j])] + prior
        })
    }
}

/// Where each part stands in what is told by part: those that remember in their order, then the readings' own noise.
fn places(parts: &BalanceParts) -> Vec<usize> {
    let mut remembered = 0..;
    let place = |kind: Option<Kind>| kind.and_then(|_| remembered.next()).unwrap_or(MOST);
    parts.sources.iter().map(|s| s.kind).map(place).collect()
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
    curvature: DMatrix<f64>,
) -> Result<Loss, Option<f64>> {
    let n = parts.sources.len();
    let [mut trace, mut square] = [DVector::zeros(n), DVector::zeros(n)];
    for (own, [unknown, left]) in traces.iter().zip(explained) {
        trace += by_size(parts, own) - by_size(parts, unknown);
        square += by_size(parts, left);
    }
    let slope = DVector::from_fn(n, |i, _| {
        trace[i] - square[i] + penalty_slope(&parts.sources[i])
    });
    let held = |(s, slope): (&Source, &f64)| {
        let downhill = s.log_std - 1e-6 * slope.signum();
        (within_reach(s, downhill) - downhill).abs() > 0.5e-6
    };
    let loss = Loss {
        value,
        held: parts.sources.iter().zip(slope.iter()).map(held).collect(),
        slope,
        curvature,
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
    let own = |place: usize| of.parts.get(place).copied().unwrap_or(of.white);
    let sources = parts.sources.iter().zip(places(parts));
    let sources = sources.map(|(s, place)| (2.0 * s.log_std).exp() * own(place));
    DVector::from_iterator(parts.sources.len(), sources)
}

/// A part whose balancing step is longer is far from where the curvature holds.
const FAR: f64 = 0.7;

impl Loss {
    /// Newton's step of the parts that are near their best, beside the balancing one of those that are far, and what the
    /// quadratic promises it to gain; `None` where the curvature is not positive definite.
    fn newton(&self) -> Option<(DVector<f64>, f64)> {
        let n = self.slope.len();
        let far = |i: &usize| {
            let own = self.balance[*i];
            own.abs() > FAR && own * self.slope[*i] < 0.0
        };
        let free = (0..n).filter(|i| !self.held[*i]);
        let (far, near): (Vec<usize>, Vec<usize>) = free.partition(far);
        let mut step = DVector::zeros(n);
        for &i in &far {
            step[i] = self.balance[i];
        }
        let slope = (&self.slope + &self.curvature * &step).select_rows(&near);
        let own = self.curvature.select_rows(&near).select_columns(&near);
        let solved = own.cholesky()?.solve(&slope);
        for (at, &i) in near.iter().enumerate() {
            step[i] = -solved[at];
        }
        let promised = if far.is_empty() {
            -self.slope.dot(&step) - 0.5 * step.dot(&(&self.curvature * &step))
        } else {
            f64::INFINITY
        };
        Some((step, promised))
    }
}

/// Fits the log sizes of all parts by Newton's steps under the average information, in at most so many steps; the loss
/// that is reached. A balancing step goes before the first, unless that promises next to nothing, and after one that gains
/// little.
pub fn fit(readings: &Readings<'_>, parts: &mut BalanceParts, steps: usize) -> f64 {
    let fitting = Fitting::new(readings, parts);
    let Ok(mut here) = fitting.loss(parts, f64::INFINITY) else {
        return f64::INFINITY;
    };
    let mut balancing = true;
    for _ in 0..steps {
        let (newton, promised) = here.newton().unzip();
        if promised.unwrap_or(f64::INFINITY) < SMALL_GAIN {
            break;
        }
        let mut directions = [newton, Some(here.balance.clone())];
        if balancing {
            directions.reverse();
        }
        let mut directions = directions.into_iter().flatten();
        let next = directions.find_map(|own| along(&fitting, parts, &here, own));
        let Some((there, next)) = next else { break };
        let little = here.value - next.value < SMALL_GAIN;
        (*parts, here) = (there, next);
        if little && balancing {
            break;
        }
        balancing = little;
    }
    here.value
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
            s.log_std = within_reach(s, s.log_std + share * by);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::innovations::noise::{Slopes, parts};
    use crate::innovations::rows::rows_of;
    use crate::innovations::toy::{CRITICAL, Noise, PEAK, stop};
    use crate::model::Model;

    /// Asks something of the search in every balance of a toy campaign: of the residual, with the noise as it starts.
    fn in_every_balance(seed: u64, ask: impl Fn(&Readings<'_>, &BalanceParts)) {
        let data = stop(Noise::TYPICAL, seed);
        let law = Model::of_law(PEAK, CRITICAL);
        let all = parts(&data, &Slopes::new(&data, &law));
        assert_eq!(all.len(), 3);
        for start in all {
            let balance = start.balance;
            let residual = |run: usize| {
                let rows = rows_of(&data, &law, run);
                vec![data.blocks[run][balance as usize].mean(rows.of(balance))]
            };
            let columns: Vec<Columns> = (0..data.series.len()).map(residual).collect();
            let readings = Readings {
                data: &data,
                columns: &columns,
                precision: &|_| 0.0,
                others: &DMatrix::zeros(1, 1),
                stride: 1,
            };
            ask(&readings, &start);
        }
    }

    fn loss(fitting: &Fitting<'_>, parts: &BalanceParts) -> Loss {
        fitting.loss(parts, f64::INFINITY).ok().unwrap()
    }

    #[test]
    fn slopes_are_differences() {
        in_every_balance(6, |readings, start| {
            let fitting = Fitting::new(readings, start);
            let slope = loss(&fitting, start).slope;
            for (i, source) in start.sources.iter().enumerate() {
                let by = |h: f64| {
                    let mut there = start.clone();
                    there.sources[i].log_std += h;
                    loss(&fitting, &there).value
                };
                let (own, h) = (slope[i], 1e-3);
                let difference = (by(h) - by(-h)) / (2.0 * h);
                let apart = (own - difference).abs();
                assert!(apart < 1e-3 * own.abs().max(1.0), "{}", source.name);
            }
        });
    }

    #[test]
    fn the_search_ends_where_newton_promises_less_than_a_nat() {
        in_every_balance(6, |readings, start| {
            let mut best = start.clone();
            fit(readings, &mut best, 60);
            let (_, promised) = loss(&Fitting::new(readings, &best), &best)
                .newton()
                .unwrap();
            assert!(promised < 1.0, "{:?}: {promised}", start.balance);
        });
    }

    #[test]
    fn no_size_is_fitted_beyond_the_most_that_it_may_be() {
        in_every_balance(6, |readings, start| {
            let mut parts = start.clone();
            for source in &mut parts.sources {
                source.log_std -= 1.0;
                source.log_most = source.log_std;
            }
            let most: Vec<f64> = parts.sources.iter().map(|s| s.log_most).collect();
            let held = fit(readings, &mut parts, 60);
            let within = parts
                .sources
                .iter()
                .zip(&most)
                .all(|(s, most)| s.log_std <= *most);
            assert!(within, "{:?}", start.balance);
            // Freely the loss falls further: the bound is what held it.
            let free = fit(readings, &mut start.clone(), 60);
            assert!(free < held - 10.0, "{free} {held}");
        });
    }

    #[test]
    fn sizes_seven_times_too_small_or_too_large_lead_to_a_loss_within_a_nat() {
        in_every_balance(7, |readings, start| {
            let from = |by: f64| {
                let mut parts = start.clone();
                for source in &mut parts.sources {
                    source.log_std += by;
                }
                fit(readings, &mut parts, 60)
            };
            let (small, own, large) = (from(-2.0), from(0.0), from(2.0));
            let range = small.max(own).max(large) - small.min(own).min(large);
            assert!(range < 1.0, "{:?}: {small} {own} {large}", start.balance);
        });
    }
}
