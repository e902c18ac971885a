//! Whether a mechanism holds on runs left out in turn: what it gains on a run that its figures were not fitted to.

use rayon::prelude::*;

use nalgebra::{DMatrix, DVector};

use crate::choose::{Limits, Search, candidate, price, required};
use crate::fit::{Fitted, Joint, bounded_step, moved};
use crate::noise::robust_sigma;
use crate::size::{LEAST_EFFECT, means, root_mean_square};

/// Fewest runs with which leaving one out says anything.
const FEWEST_RUNS: usize = 3;
/// Share of the gain that the choice asked for which must be there on the runs left out.
const KEPT_SHARE: f64 = 0.5;
/// Share of the runs, weighed by what they could show, on which a mechanism may do harm.
const HARMED_SHARE: f64 = 0.34;
/// A loss of fewer nats than this on a run left out is chance.
const CHANCE: f64 = 2.0;

/// Gains on each run when it is left out of the fit, in nats: the loss of `fewer` less that of `full`, both with
/// the parameters that the other runs give.
#[must_use]
pub fn held_out(joint: &Joint<'_>, full: &Fitted, fewer: &Fitted) -> Vec<f64> {
    let (with, without) = rayon::join(|| left_out(joint, full), || left_out(joint, fewer));
    without.iter().zip(with).map(|(a, b)| a - b).collect()
}

/// Loss on each run under the parameters that one step of the other runs' normal equations leads to.
fn left_out(joint: &Joint<'_>, fitted: &Fitted) -> Vec<f64> {
    let model = &fitted.model;
    let parts: Vec<(DMatrix<f64>, DVector<f64>)> = joint
        .runs()
        .par_iter()
        .map(|&run| joint.normal_of(model, run))
        .collect();
    let n = model.vector().len();
    let mut information = DMatrix::zeros(n, n);
    let mut gradient = DVector::zeros(n);
    for (own, slope) in &parts {
        information += own;
        gradient += slope;
    }
    let bounds = joint.bounds(model);
    let p = model.vector();
    joint
        .runs()
        .par_iter()
        .zip(&parts)
        .map(|(&run, (own, slope))| {
            let step = bounded_step(
                &(&information - own),
                &(&gradient - slope),
                1e-6,
                &p,
                &bounds,
            );
            let moved: Vec<f64> = match step {
                Some(step) => moved(&p, step.as_slice(), 1.0, &bounds),
                None => p.clone(),
            };
            joint.loss_of(&model.with(&moved), run)
        })
        .collect()
}

/// Root mean square of what a mechanism changes, over the noise; in the balance where it is largest.
fn effect(joint: &Joint<'_>, full: &Fitted, fewer: &Fitted) -> f64 {
    joint
        .parts
        .iter()
        .map(|part| {
            let of =
                |fitted: &Fitted, run| part.residual(&fitted.model, &fitted.model.vector(), run);
            let sigma = robust_sigma(&means(part, |run| of(full, run)));
            let change = root_mean_square(&means(part, |run| {
                of(fewer, run)
                    .iter()
                    .zip(of(full, run))
                    .map(|(without, with)| without - with)
                    .collect()
            }));
            if sigma > 0.0 { change / sigma } else { 0.0 }
        })
        .fold(0.0, f64::max)
}

/// Takes out of the chosen set what does not hold on runs left out in turn, weakest first.
#[must_use]
pub fn validated(joint: &Joint<'_>, mut found: Search, limits: &Limits) -> Search {
    if joint.runs().len() < FEWEST_RUNS {
        return found;
    }
    while !found.chosen.ids.is_empty() {
        let full = &found.chosen.fitted;
        let judged: Vec<(Fitted, f64)> = (0..full.model.terms.len())
            .into_par_iter()
            .map(|place| {
                let without = joint.without(&found, place);
                let mechanism = joint.data().catalogue.get(full.model.terms[place].entry);
                if !mechanism.predicts() {
                    return (without, f64::INFINITY);
                }
                let by_run = held_out(joint, full, &without);
                let total: f64 = by_run.iter().sum();
                let size: f64 = by_run.iter().map(|g| g.abs()).sum();
                let harmed: f64 = by_run.iter().filter(|g| **g < -CHANCE).map(|g| -g).sum();
                let explained =
                    (found.base.criterion - without.loss - price(&without.model, found.count))
                        .max(0.0);
                let needed = KEPT_SHARE * required(limits, found.count, explained);
                let mut excess = (total - needed).min(HARMED_SHARE * size - harmed);
                if !joint.is_tyre() {
                    let size = effect(joint, full, &without);
                    if size < LEAST_EFFECT {
                        excess = excess.min((size - LEAST_EFFECT) * without.loss);
                    }
                }
                (without, excess)
            })
            .collect();
        let Some((without, excess)) = judged.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)) else {
            break;
        };
        if excess >= 0.0 {
            break;
        }
        found.chosen = candidate(joint, without);
    }
    found
}
