//! A model judged with everything that it may claim: its parameters, the chain's nuisances and the noise are fitted
//! with it, so that two models are compared each at its own best.

use nalgebra::DVector;

use super::candidates::{Table, table};
use super::dependence::Dependence;
use super::estimate;
use super::gram::{Gram, grams, solve, total};
use super::noise::{BalanceParts, Slopes, parts};
use super::rows::rows_of;
use super::screen::precision;
use crate::data::Data;
use crate::model::{Model, TYRE_BASE};

/// A model at its best, and what it says of every run.
#[derive(Clone)]
pub struct Judged {
    /// Base law and terms.
    pub model: Model,
    /// Free dependences beside them.
    pub extra: Vec<Dependence>,
    /// Noise under it.
    pub parts: Vec<BalanceParts>,
    /// Negative log likelihood at the best, the noise's prior included, in nats.
    pub loss: f64,
    /// Number of free parameters beside base and nuisances.
    pub free: usize,
    /// Inner products of base, terms and nuisances by half run: `[run][half]`.
    pub grams: Vec<[Gram; 2]>,
    /// Root mean square of the drag's residual in N.
    pub residual_n: f64,
    /// Negative log likelihood of each run under parameters from all others.
    pub unseen: Vec<f64>,
    /// The same of each half run under parameters from all other halves.
    pub unseen_halves: Vec<f64>,
    /// Nuisances of the chain among the columns, the last ones.
    pub nuisances: usize,
    /// Prior precision by column of the grams.
    pub prior: Vec<f64>,
    /// Coefficients still left at the end: base, terms, nuisances.
    pub left: DVector<f64>,
    /// Covariance of base and terms' parameters, in the model's order.
    pub covariance: nalgebra::DMatrix<f64>,
}

/// How much work a judgement may be.
#[derive(Clone, Copy)]
pub struct Effort {
    /// Steps towards the best parameters.
    pub steps: usize,
    /// Sweeps over the noise's parts.
    pub sweeps: usize,
    /// Every so many samples.
    pub stride: usize,
    /// Of these every so many for the sizes of the noise.
    pub noise_stride: usize,
}

fn bounds(data: &Data, model: &Model) -> Vec<(f64, f64)> {
    let mut all = vec![(f64::NEG_INFINITY, f64::INFINITY); model.base.len()];
    let [peak, critical] = data.context.nominal;
    all[0] = ((0.05 * peak).ln(), (10.0 * peak).ln());
    all[1] = ((0.05 * critical).ln(), (10.0 * critical).ln());
    for term in &model.terms {
        all.extend(
            data.catalogue
                .get(term.entry)
                .parameters(&data.context)
                .iter()
                .map(|p| (p.low, p.high)),
        );
    }
    all
}

/// Inner products of all columns of a table under this noise, summed over the balances, by run and half.
#[must_use]
pub fn table_grams(
    data: &Data,
    parts: &[BalanceParts],
    table: &Table,
    stride: usize,
) -> Vec<[Gram; 2]> {
    let width = 1
        + table.base
        + table.nuisances.len()
        + table.candidates.last().map_or(0, |c| c.columns.end);
    let mut by_run = vec![[Gram::empty(width), Gram::empty(width)]; data.series.len()];
    for part in parts {
        for (into, own) in by_run.iter_mut().zip(grams(
            data,
            part,
            &table.columns[part.balance as usize],
            stride,
        )) {
            for (into, own) in into.iter_mut().zip(own) {
                into.add(&own);
            }
        }
    }
    by_run
}

/// The noise with every part at most as large as the sensors make plausible.
#[must_use]
pub fn capped(parts: &[BalanceParts]) -> Vec<BalanceParts> {
    let mut all = parts.to_vec();
    for source in all.iter_mut().flat_map(|p| &mut p.sources) {
        source.log_std = source.log_std.min(source.log_cap);
    }
    all
}

/// Sizes of the noise carried over to gains taken about another model.
fn with_sizes(mut fresh: Vec<BalanceParts>, old: &[BalanceParts]) -> Vec<BalanceParts> {
    for (new, old) in fresh.iter_mut().zip(old) {
        for (new, old) in new.sources.iter_mut().zip(&old.sources) {
            new.log_std = old.log_std;
        }
    }
    fresh
}

/// Fits and judges a model from this start under a first guess of the noise.
#[must_use]
pub fn judge(
    data: &Data,
    start: &Model,
    extra: &[Dependence],
    guess: Option<&[BalanceParts]>,
    effort: Effort,
) -> Option<Judged> {
    let mut model = start.clone();
    let bounds = bounds(data, &model);
    let none = vec![crate::mechanism::Evidence::default(); data.series.len()];
    let mut parts_now: Option<Vec<BalanceParts>> = guess.map(<[BalanceParts]>::to_vec);
    let own: Vec<usize> = [0, 1]
        .into_iter()
        .chain(TYRE_BASE..start.vector().len())
        .collect();
    let mut best: Option<(f64, Model)> = None;
    let mut shrink = 1.0;
    let mut step: Option<Vec<f64>> = None;
    for pass in 0..=effort.steps {
        let slopes = Slopes::new(data, &model.base);
        let fresh = parts(data, &slopes);
        let mut noise = match &parts_now {
            Some(old) => with_sizes(fresh, old),
            None => fresh,
        };
        let table = table(data, &model, &slopes, &none, extra, &[], &|_| false);
        let prior = |i: usize| precision(&table, i);
        let last = pass == effort.steps;
        let mut refitted = false;
        if last || (guess.is_none() && pass == effort.steps / 2) {
            for part in &mut noise {
                let columns = &table.columns[part.balance as usize];
                let stride = effort.stride * effort.noise_stride;
                let fit = |part: &mut BalanceParts| {
                    estimate::fit(data, part, columns, &prior, stride, effort.sweeps)
                };
                // What swallowed an effect before it was in the model must be let go of: from below, too.
                let mut small = capped(core::slice::from_ref(part)).remove(0);
                let from_above = fit(part);
                if guess.is_some() && fit(&mut small) < from_above {
                    *part = small;
                }
            }
            refitted = true;
        }
        parts_now = Some(noise.clone());
        let grams = table_grams(data, &noise, &table, effort.stride);
        let sum = total(&grams);
        let chosen: Vec<usize> = (1..sum.products.nrows()).collect();
        let solved = solve(&sum.products, &chosen, &prior)?;
        // What the nuisances alone leave at these parameters: steps are judged by it.
        let nuisances: Vec<usize> = (1 + table.base..sum.products.nrows()).collect();
        let here = solve(&sum.products, &nuisances, &prior)?.rss + sum.log_variance;
        if last {
            let penalty: f64 = noise.iter().map(estimate::penalty).sum();
            let unseen = |own: &Gram| outside(own, &sum, &chosen, &prior);
            let runs = grams
                .iter()
                .map(|run| unseen(&total(core::slice::from_ref(run))));
            let halves = grams.iter().flatten().map(unseen);
            let k = own.len();
            return Some(Judged {
                loss: 0.5 * (sum.log_variance + solved.rss) + penalty,
                free: start.vector().len() - start.base.len()
                    + extra.iter().map(|e| e.knots.len()).sum::<usize>(),
                extra: extra.to_vec(),
                covariance: solved.covariance.view((0, 0), (k, k)).into_owned(),
                nuisances: table.nuisances.len(),
                prior: (0..sum.products.nrows()).map(prior).collect(),
                left: solved.coefficients.clone(),
                residual_n: drag_residual(data, &model),
                unseen: runs.collect::<Option<_>>()?,
                unseen_halves: halves.collect::<Option<_>>()?,
                model,
                parts: noise,
                grams,
            });
        }
        match &best {
            Some((value, old)) if here > *value + 1e-6 && !refitted => {
                // Too far: back, and half as far.
                model = old.clone();
                shrink *= 0.4;
            }
            _ => {
                best = Some((here, model.clone()));
                step = Some(
                    solved
                        .coefficients
                        .iter()
                        .take(own.len())
                        .copied()
                        .collect(),
                );
            }
        }
        let Some(step) = &step else { continue };
        let mut p = model.vector();
        for (at, &index) in own.iter().enumerate() {
            let (low, high) = bounds[index];
            let most = if index < 2 {
                0.4
            } else if (high - low).is_finite() {
                0.25 * (high - low)
            } else {
                f64::INFINITY
            };
            let by = (shrink * step[at]).clamp(-most, most);
            if by.is_finite() {
                p[index] = (p[index] + by).clamp(low, high);
            }
        }
        model = model.with(&p);
    }
    None
}

/// Root mean square of the drag's residual in N.
fn drag_residual(data: &Data, model: &Model) -> f64 {
    let (mut square, mut count) = (0.0, 0.0);
    for (run, s) in data.series.iter().enumerate() {
        let e = rows_of(data, model, run).tyre;
        if e.is_empty() {
            continue;
        }
        for k in s.tyre.iter().flat_map(Clone::clone) {
            if e[k].is_finite() {
                square += e[k] * e[k];
                count += 1.0;
            }
        }
    }
    (square / f64::max(count, 1.0)).sqrt()
}

/// Negative log likelihood of a part of the readings under parameters from all others.
fn outside(own: &Gram, sum: &Gram, chosen: &[usize], prior: &dyn Fn(usize) -> f64) -> Option<f64> {
    let rest = &sum.products - &own.products;
    let solved = solve(&rest, chosen, prior)?;
    let mut c = DVector::zeros(own.products.nrows());
    c[0] = 1.0;
    for (at, &i) in chosen.iter().enumerate() {
        c[i] = solved.coefficients[at];
    }
    Some(0.5 * (own.log_variance + c.dot(&(&own.products * &c))))
}
