//! Which mechanisms: every one alone, then small sets by a beam search, never greedily by one.
//!
//! A set is judged by its loss on whitened innovations plus a price for its parameters; one more
//! mechanism is admitted only if it buys more than chance, more than a tolerance below which nobody
//! could care, and more than the misfit that the form of those already named may leave.

use rayon::prelude::*;

use crate::ablation::Ablation;
use crate::fit::{Fitted, Joint, Linearised};
use crate::mechanism::{Balance, Evidence, Id, Stage};
use crate::model::{Model, Term};
use crate::omnibus::Levers;

/// Thresholds of the search.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Smallest effect worth naming, as a share of the noise's standard deviation (root mean square).
    pub tolerance: f64,
    /// Smallest gain in nats, whatever the number of samples.
    pub least_gain: f64,
    /// Share of what has been explained that the form of a mechanism may leave unexplained.
    pub form_misfit: f64,
    /// Largest number of mechanisms in one balance.
    pub most: usize,
    /// Models kept at each size.
    pub beam: usize,
    /// Parts of the argument left out, to measure their worth.
    pub ablation: Ablation,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            tolerance: 0.12,
            least_gain: 14.0,
            form_misfit: 0.03,
            most: 4,
            beam: 4,
            ablation: Ablation::default(),
        }
    }
}

impl Limits {
    /// The same for wheel and vehicle: an innovation there is mostly noise of a differenced speed, so the same
    /// effect is a smaller share of it.
    #[must_use]
    pub fn for_dynamics(&self) -> Self {
        Self {
            tolerance: 0.4 * self.tolerance,
            ..*self
        }
    }
}

/// A fitted model with its price.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The fit.
    pub fitted: Fitted,
    /// Loss plus price in nats.
    pub criterion: f64,
    /// Mechanisms in it, sorted.
    pub ids: Vec<Id>,
}

/// What a search leaves.
pub struct Search {
    /// The base model alone.
    pub base: Candidate,
    /// Best model of each set of mechanisms that was tried, by criterion.
    pub tried: Vec<Candidate>,
    /// The chosen one.
    pub chosen: Candidate,
    /// Number of innovations.
    pub count: usize,
}

impl Search {
    /// Takes out all that was tried with a mechanism whose name was withdrawn: it is no alternative to what is left.
    pub fn forget(&mut self, id: Id) {
        self.tried.retain(|candidate| !candidate.ids.contains(&id));
    }
}

impl Joint<'_> {
    /// The chosen model without one of its mechanisms, the others fitted anew.
    #[must_use]
    pub fn without(&self, search: &Search, place: usize) -> Fitted {
        let mut fewer = search.chosen.fitted.model.clone();
        fewer.terms.remove(place);
        if fewer.terms.is_empty() {
            search.base.fitted.clone()
        } else {
            self.fit(&fewer, 12)
        }
    }
}

/// Price of a model's mechanisms in nats.
#[must_use]
pub fn price(model: &Model, count: usize) -> f64 {
    let parameters: usize = model.terms.iter().map(|t| t.parameters.len()).sum();
    // Each parameter costs half the log of the sample size (Schwarz 1978); each mechanism the choice
    // among the catalogue.
    0.5 * parameters as f64 * (count.max(2) as f64).ln() + 3.5 * model.terms.len() as f64
}

/// Gain in nats that the next mechanism must bring to a set that has gained `explained` already.
#[must_use]
pub fn required(limits: &Limits, count: usize, explained: f64) -> f64 {
    let tolerance = 0.5 * limits.tolerance * limits.tolerance * count as f64;
    limits
        .least_gain
        .max(tolerance)
        .max(limits.form_misfit * explained)
}

/// Share of the deceleration, root mean square, that the drag must account for to say anything of the mass.
const DRAG_SHARE: f64 = 0.1;

/// Whether the vehicle balance weighs mass against drag: without drag any mass goes with some other force.
fn drag_slows(joint: &Joint<'_>) -> bool {
    joint
        .parts
        .iter()
        .filter(|part| part.balance == Balance::Vehicle)
        .all(|part| {
            let data = part.data;
            let (mut drag, mut inertia) = (0.0, 0.0);
            for &run in part.runs {
                let series = &data.series[run];
                for k in part.segments(run).iter().flat_map(Clone::clone) {
                    if let Some(reading) = series.drag.get(k) {
                        drag += reading * reading;
                    }
                    inertia += (data.context.mass * series.speed.rate[k]).powi(2);
                }
            }
            drag > DRAG_SHARE * DRAG_SHARE * inertia
        })
}

/// Whether an entry can show in these balances (force gain acts on wheel and vehicle alike).
#[must_use]
pub fn belongs(joint: &Joint<'_>, entry: usize) -> bool {
    let mechanism = joint.data().catalogue.get(entry);
    if matches!(mechanism.id(), Id::VehicleInertia | Id::ForceGain) && !drag_slows(joint) {
        return false;
    }
    if matches!(mechanism.id(), Id::VehicleSpeedDelay | Id::WheelSpeedDelay) {
        return false; // For the audit of the chain to find; this search cannot tell them from a lag.
    }
    joint.parts.iter().any(|part| match part.balance {
        Balance::Tyre => mechanism.stage() <= Stage::Chain,
        Balance::Wheel => mechanism.stage() == Stage::Wheel || mechanism.id() == Id::ForceGain,
        Balance::Vehicle => mechanism.stage() == Stage::Vehicle,
    })
}

/// What a model leaves over, for mechanisms that look where to start.
#[must_use]
pub fn evidence(joint: &Joint<'_>, model: &Model) -> Vec<Evidence> {
    let data = joint.data();
    let problem = &joint.parts[0];
    if !joint.is_tyre() {
        return vec![Evidence::default(); data.series.len()];
    }
    let levers = Levers::new(data, model);
    (0..data.series.len())
        .map(|run| {
            let n = data.series[run].len();
            let mut weight = vec![0.0; n];
            if problem.runs.contains(&run) {
                for segment in problem.segments(run) {
                    for k in segment.clone() {
                        weight[k] = problem.noise.scale[run][k].powi(-2);
                    }
                }
            }
            let predicted = levers.reading[run].clone();
            let residual = predicted
                .iter()
                .zip(data.series[run].drag.iter().chain(core::iter::repeat(&0.0)))
                .map(|(f, y)| y - f)
                .collect();
            Evidence {
                predicted,
                residual,
                weight,
            }
        })
        .collect()
}

/// Starts of every entry, best first once they have been judged.
type Starts = Vec<Vec<Vec<f64>>>;

/// A model with one more mechanism, its predicted loss, and its starts in order of promise.
type Extended = (Model, f64, Vec<Vec<f64>>);

/// Starts kept for later rounds.
const KEPT_STARTS: usize = 3;
/// Single mechanisms that are fitted whatever the best of them promises.
const FIRST_FITS: usize = 12;
/// Share of the best promise from which a single mechanism is fitted, too.
const FITTED_SHARE: f64 = 0.25;
/// Steps of a fit before it is compared with the others.
const FIRST_STEPS: usize = 4;
/// Steps of those that are then still in reach of the best.
const LAST_STEPS: usize = 11;

/// How far behind the best of its size a set may lie to be led further, in nats.
fn reach(explained: f64) -> f64 {
    40.0 + 0.5 * explained.max(0.0)
}

/// Fits all a few steps, and those in reach of the best to the end.
fn fitted_in_turn(joint: &Joint<'_>, models: Vec<Model>, reference: f64) -> Vec<Candidate> {
    let begun: Vec<Candidate> = models
        .par_iter()
        .map(|model| candidate(joint, joint.fit(model, FIRST_STEPS)))
        .collect();
    let best = begun
        .iter()
        .map(|c| c.criterion)
        .fold(f64::INFINITY, f64::min);
    let last = best + reach(reference - best);
    begun
        .into_par_iter()
        .map(|one| {
            if one.criterion <= last {
                candidate(joint, joint.fit(&one.fitted.model, LAST_STEPS))
            } else {
                one
            }
        })
        .collect()
}

/// A model with one more mechanism, at the start from which one step is predicted to gain most, with
/// the loss predicted there; and all starts in that order.
fn extended(
    joint: &Joint<'_>,
    known: &Linearised,
    model: &Model,
    entry: usize,
    starts: &[Vec<f64>],
) -> Option<Extended> {
    let mut judged: Vec<(f64, Model, Vec<f64>, Vec<f64>)> = starts
        .iter()
        .filter_map(|start| {
            let mut trial = model.clone();
            trial.terms.push(Term {
                entry,
                parameters: start.clone(),
            });
            let (predicted, moved) = joint.outlook(known, &trial);
            predicted
                .is_finite()
                .then_some((predicted, trial, moved, start.clone()))
        })
        .collect();
    judged.sort_by(|a, b| a.0.total_cmp(&b.0));
    let order = judged.iter().map(|j| j.3.clone()).collect();
    let (predicted, trial, moved, _) = judged.into_iter().next()?;
    // Where the predicted step would not hold, the fit starts without it and falls back on damping.
    let stepped = trial.with(&moved);
    let from = if joint.loss(&stepped) < joint.loss(&trial) {
        stepped
    } else {
        trial
    };
    Some((from, predicted, order))
}

/// A fit with its price.
pub(crate) fn candidate(joint: &Joint<'_>, fitted: Fitted) -> Candidate {
    Candidate {
        criterion: fitted.loss + price(&fitted.model, joint.count()),
        ids: fitted.model.ids(&joint.data().catalogue),
        fitted,
    }
}

/// Keeps the best of each set of mechanisms, sorted by criterion.
fn keep_best(candidates: Vec<Candidate>) -> Vec<Candidate> {
    let mut kept: Vec<Candidate> = Vec::new();
    for one in candidates {
        match kept.iter_mut().find(|c| c.ids == one.ids) {
            Some(known) => {
                if one.criterion < known.criterion {
                    *known = one;
                }
            }
            None => kept.push(one),
        }
    }
    kept.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    kept
}

/// Models with one more mechanism than those given, fitted; best first. `starts` is reordered and
/// shortened as starts are judged.
fn extend(
    joint: &Joint<'_>,
    beam: &[Candidate],
    starts: &mut Starts,
    least_promise: f64,
) -> Vec<Candidate> {
    let data = joint.data();
    let count = joint.count();
    let first = beam.iter().all(|c| c.ids.is_empty());
    let eligible: Vec<usize> = (0..data.catalogue.entries().len())
        .filter(|entry| belongs(joint, *entry))
        .collect();
    let mut jobs: Vec<(usize, usize)> = Vec::new();
    let evidences: Vec<Vec<Evidence>> = beam
        .iter()
        .map(|c| evidence(joint, &c.fitted.model))
        .collect();
    for (place, candidate) in beam.iter().enumerate() {
        for &entry in &eligible {
            if !candidate.ids.contains(&data.catalogue.get(entry).id()) {
                jobs.push((place, entry));
            }
        }
    }
    let linear: Vec<Linearised> = beam
        .par_iter()
        .map(|c| joint.linearised(&c.fitted.model))
        .collect();
    let known: &Starts = starts;
    let judged: Vec<Option<Extended>> = jobs
        .par_iter()
        .map(|&(place, entry)| {
            let own = &known[entry];
            let looked;
            // A patch is looked for in what the model at hand leaves over.
            let from = if own.is_empty() || data.catalogue.get(entry).id() == Id::SurfacePatch {
                looked = data.catalogue.get(entry).starts(
                    &data.context,
                    &data.series,
                    &evidences[place],
                );
                looked.as_slice()
            } else if place == 0 {
                own.as_slice()
            } else {
                // What is led further beside the best is there in case of a wrong turn, not to be searched again.
                &own[..1]
            };
            extended(
                joint,
                &linear[place],
                &beam[place].fitted.model,
                entry,
                from,
            )
        })
        .collect();
    let mut promising: Vec<(Model, f64)> = Vec::new();
    for ((place, entry), found) in jobs.iter().zip(judged) {
        let Some((model, predicted, mut order)) = found else {
            continue;
        };
        if first {
            order.truncate(KEPT_STARTS);
            starts[*entry] = order;
        }
        let promised = predicted + price(&model, count);
        if first || beam[*place].criterion - promised >= least_promise {
            promising.push((model, promised));
        }
    }
    promising.sort_by(|a, b| a.1.total_cmp(&b.1));
    // A step promises too much or too little where the effect is strong; several are fitted.
    let most = if first {
        FIRST_FITS
    } else {
        3 * beam.len().max(1)
    };
    let reference = beam[0].criterion;
    let share = promising
        .first()
        .map_or(0.0, |best| FITTED_SHARE * (reference - best.1));
    let mut rank = 0;
    promising.retain(|(_, promised)| {
        rank += 1;
        rank <= most || (first && reference - promised >= share)
    });
    let models = promising.into_iter().map(|(model, _)| model).collect();
    keep_best(fitted_in_turn(joint, models, reference))
}

/// Members of a level that are close enough to its best to be led further.
fn beam_of(level: &[Candidate], explained: f64, limits: &Limits) -> Vec<Candidate> {
    level
        .iter()
        .filter(|c| c.criterion - level[0].criterion <= reach(explained))
        .take(limits.beam)
        .cloned()
        .collect()
}

/// Names the mechanisms of one balance, or of wheel and vehicle together.
#[must_use]
pub fn search(joint: &Joint<'_>, base: Fitted, limits: &Limits) -> Search {
    let count = joint.count();
    let base = candidate(joint, base);
    let mut starts: Starts = vec![Vec::new(); joint.data().catalogue.entries().len()];
    let mut tried: Vec<Candidate> = Vec::new();
    let mut chosen = base.clone();
    let mut beam = vec![base.clone()];
    for _ in 0..limits.most {
        let explained = base.criterion - chosen.criterion;
        let needed = required(limits, count, explained);
        let level = extend(joint, &beam, &mut starts, 0.4 * needed);
        let Some(best) = level.first().cloned() else {
            break;
        };
        tried.extend(level.iter().cloned());
        if chosen.criterion - best.criterion < needed {
            break;
        }
        chosen = best;
        beam = beam_of(&level, base.criterion - chosen.criterion, limits);
    }
    tried = keep_best(tried);
    Search {
        base,
        tried,
        chosen,
        count,
    }
}

/// The same search judged again under other noise: every set tried is fitted anew from where it stood, and
/// one more mechanism is looked for.
#[must_use]
pub fn refine(joint: &Joint<'_>, search: &Search, limits: &Limits) -> Search {
    let count = joint.count();
    let size = search.chosen.ids.len();
    let base = candidate(joint, joint.fit(&search.base.fitted.model, 15));
    // Sets of the chosen size that were near, and the chosen set's own subsets.
    let reach = 60.0 + 0.35 * (search.base.criterion - search.chosen.criterion);
    let again: Vec<&Candidate> = search
        .tried
        .iter()
        .filter(|c| {
            (c.ids.len() == size && c.criterion - search.chosen.criterion <= reach)
                || (c.ids.len() < size && c.ids.iter().all(|id| search.chosen.ids.contains(id)))
        })
        .take(16)
        .collect();
    let mut tried: Vec<Candidate> = again
        .par_iter()
        .map(|c| candidate(joint, joint.fit(&c.fitted.model, 15)))
        .collect();
    tried = keep_best(tried);
    let mut chosen = tried
        .iter()
        .find(|c| c.ids.len() == size)
        .cloned()
        .unwrap_or_else(|| base.clone());
    // Fewer, where the last one no longer buys enough.
    loop {
        let without: Option<Candidate> = tried
            .iter()
            .filter(|c| {
                c.ids.len() + 1 == chosen.ids.len()
                    && c.ids.iter().all(|id| chosen.ids.contains(id))
            })
            .min_by(|a, b| a.criterion.total_cmp(&b.criterion))
            .cloned()
            .or_else(|| (chosen.ids.len() == 1).then(|| base.clone()));
        match without {
            Some(fewer)
                if fewer.criterion - chosen.criterion
                    < required(limits, count, base.criterion - fewer.criterion) =>
            {
                chosen = fewer
            }
            _ => break,
        }
    }
    // One more, where the sharper noise shows it.
    if chosen.ids.len() == size && size < limits.most {
        let mut starts: Starts = vec![Vec::new(); joint.data().catalogue.entries().len()];
        let needed = required(limits, count, base.criterion - chosen.criterion);
        let level = extend(
            joint,
            core::slice::from_ref(&chosen),
            &mut starts,
            0.4 * needed,
        );
        if let Some(best) = level.first()
            && chosen.criterion - best.criterion >= needed
        {
            chosen = best.clone();
        }
        tried.extend(level);
    }
    Search {
        base,
        tried: keep_best(tried),
        chosen,
        count,
    }
}
