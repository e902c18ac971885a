//! Which mechanisms are named: candidates by their score, finalists at their own best, unseen runs last.

use rayon::prelude::*;

use crate::data::Data;
use crate::innovations::candidates::{Candidate, Table, table};
use crate::innovations::hypothesis::{Effort, Judged, capped, judge, table_grams, total};
use crate::innovations::noise::Slopes;
use crate::innovations::rows::rows;
use crate::innovations::screen::{Score, scores};
use crate::mechanism::{Evidence, Id};
use crate::model::{Model, Term};

/// Price of a free parameter in nats: about half the logarithm of the independent readings.
const PRICE_OF_PARAMETER: f64 = 4.0;
/// Price of a choice among the vocabulary in nats.
const PRICE_OF_NAME: f64 = 3.4;
/// Least gain in nats, all prices taken off.
const LEAST_GAIN: f64 = 6.0;
/// Least t of the gains on unseen runs.
const LEAST_T: f64 = 1.7;
/// Finalists that are judged in each round, from each of the two screens.
const FINALISTS: [usize; 2] = [4, 2];
/// Most names.
const MOST_NAMES: usize = 3;

/// A mechanism as it stands against the model without it.
#[derive(Clone)]
pub struct Trial {
    /// Which.
    pub id: Id,
    /// Entry of the catalogue.
    pub entry: usize,
    /// Gain in nats, prices taken off.
    pub gain: f64,
    /// Mean gain on unseen runs in nats, and its t over the runs.
    pub unseen: (f64, f64),
    /// The model with it.
    pub judged: Judged,
}

/// What was decided.
pub struct Decision {
    /// The base model alone.
    pub base: Judged,
    /// The chosen model.
    pub chosen: Judged,
    /// Trials of each round, best first.
    pub rounds: Vec<Vec<Trial>>,
}

/// Mean and t of what unseen runs gain; half runs where a parameter belongs to its run.
fn unseen_gain(base: &Judged, with: &Judged, halves: bool) -> (f64, f64) {
    let (a, b) = if halves {
        (&base.unseen_halves, &with.unseen_halves)
    } else {
        (&base.unseen, &with.unseen)
    };
    let gains: Vec<f64> = a
        .iter()
        .zip(b)
        .map(|(a, b)| a - b)
        .filter(|g| g.is_finite() && *g != 0.0)
        .collect();
    let n = gains.len() as f64;
    if gains.is_empty() {
        return (0.0, 0.0);
    }
    let mean = gains.iter().sum::<f64>() / n;
    if gains.len() < 2 {
        return (mean, if mean > 0.0 { LEAST_T } else { 0.0 });
    }
    let spread = (gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    (mean, mean / spread.max(1e-9) * n.sqrt())
}

fn evidence(data: &Data, model: &Model) -> Vec<Evidence> {
    data.series
        .iter()
        .map(|s| {
            let r = rows::<f64>(&data.catalogue, model, &model.vector(), s, &data.context);
            let mut weight = vec![0.0; s.len()];
            for k in s.tyre.iter().flat_map(Clone::clone) {
                weight[k] = s.drag_sigma.powi(-2).min(1e12);
            }
            Evidence {
                predicted: s.drag.iter().zip(&r.tyre).map(|(a, b)| a - b).collect(),
                residual: if r.tyre.is_empty() {
                    vec![0.0; s.len()]
                } else {
                    r.tyre
                },
                weight,
            }
        })
        .collect()
}

/// Parameters at which a finalist starts.
fn start_of(data: &Data, candidate: &Candidate, score: &Score) -> Vec<f64> {
    let mut p = candidate.start.clone();
    let bounds = data
        .catalogue
        .get(candidate.entry)
        .parameters(&data.context);
    if candidate.free.is_empty() {
        if p.len() == 1 && score.coefficients[0] > 0.0 {
            p[0] *= score.coefficients[0].clamp(0.3, 3.0);
        }
    } else {
        for (at, &i) in candidate.free.iter().enumerate() {
            p[i] += score.coefficients[at];
        }
    }
    for (p, b) in p.iter_mut().zip(bounds) {
        *p = p.clamp(b.low, b.high);
    }
    p
}

/// Best candidates of a screen: at most `count` ids, at most two forms of each.
fn best<'a>(table: &'a Table, all: &[Score], count: usize) -> Vec<(&'a Candidate, Score)> {
    let mut out: Vec<(&Candidate, Score)> = Vec::new();
    let mut ids: Vec<Id> = Vec::new();
    for score in all {
        let candidate = &table.candidates[score.candidate];
        // An effect that would have to be turned round is not that effect.
        if candidate.free.is_empty() && !(score.coefficients[0] > 0.0) {
            continue;
        }
        let price = PRICE_OF_PARAMETER * candidate.columns.len() as f64;
        if !(score.gain > price) {
            continue;
        }
        if out.iter().filter(|(c, _)| c.id == candidate.id).count() >= 2
            || out.iter().any(|(c, _)| c.entry == candidate.entry)
        {
            continue;
        }
        if !ids.contains(&candidate.id) {
            if ids.len() == count {
                continue;
            }
            ids.push(candidate.id);
        }
        out.push((candidate, score.clone()));
    }
    out
}

/// Effort of a finalist's judgement.
fn effort(data: &Data) -> Effort {
    let samples: usize = data.series.iter().map(|s| s.len()).sum();
    Effort {
        steps: 4,
        sweeps: 2,
        stride: (samples / 9000).max(1),
    }
}

/// One round: every finalist beside the model so far.
fn round(data: &Data, so_far: &Judged, excluded: &[Id]) -> Vec<Trial> {
    let effort = effort(data);
    let slopes = Slopes::new(data, &so_far.model.base);
    let table = table(
        data,
        &so_far.model,
        &slopes,
        &evidence(data, &so_far.model),
        true,
        &|id| {
            !excluded.contains(&id)
                && !so_far
                    .model
                    .terms
                    .iter()
                    .any(|t| data.catalogue.get(t.entry).id() == id)
        },
    );
    let mut finalists: Vec<(&Candidate, Vec<f64>)> = Vec::new();
    for (parts, count) in [
        (capped(&so_far.parts), FINALISTS[0]),
        (so_far.parts.clone(), FINALISTS[1]),
    ] {
        let sum = total(&table_grams(data, &parts, &table, effort.stride));
        let Some((_, _, all)) = scores(&table, &sum) else {
            continue;
        };
        for (candidate, score) in best(&table, &all, count) {
            if !finalists.iter().any(|(c, _)| c.entry == candidate.entry) {
                finalists.push((candidate, start_of(data, candidate, &score)));
            }
        }
    }
    let mut trials: Vec<Trial> = finalists
        .par_iter()
        .filter_map(|(candidate, start)| {
            let mut model = so_far.model.clone();
            model.terms.push(Term {
                entry: candidate.entry,
                parameters: start.clone(),
            });
            let judged = judge(data, &model, Some(&capped(&so_far.parts)), effort)?;
            Some(tried(data, so_far, candidate.entry, judged))
        })
        .collect();
    trials.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    trials
}

fn tried(data: &Data, base: &Judged, entry: usize, judged: Judged) -> Trial {
    let mechanism = data.catalogue.get(entry);
    let free = judged.free as f64 - base.free as f64;
    let per_run = !mechanism.predicts() || mechanism.form().contains("per_run");
    Trial {
        id: mechanism.id(),
        entry,
        gain: base.loss - judged.loss - PRICE_OF_PARAMETER * free - PRICE_OF_NAME,
        unseen: unseen_gain(base, &judged, per_run),
        judged,
    }
}

/// Whether a trial stands.
#[must_use]
pub fn stands(trial: &Trial) -> bool {
    trial.gain > LEAST_GAIN && trial.unseen.0 > 0.0 && trial.unseen.1 > LEAST_T
}

/// Decides what is named beside the base model.
#[must_use]
pub fn decide(data: &Data, base: Judged, excluded: &[Id]) -> Decision {
    let mut chosen = base.clone();
    let mut rounds = Vec::new();
    while chosen.model.terms.len() < MOST_NAMES {
        let trials = round(data, &chosen, excluded);
        let next = trials.iter().find(|t| stands(t)).map(|t| t.judged.clone());
        rounds.push(trials);
        match next {
            Some(judged) => chosen = judged,
            None => break,
        }
    }
    if chosen.model.terms.len() > 1 {
        chosen = without_idle(data, chosen);
    }
    Decision {
        base,
        chosen,
        rounds,
    }
}

/// Takes names out that the others do not need.
fn without_idle(data: &Data, mut chosen: Judged) -> Judged {
    let mut at = 0;
    while chosen.model.terms.len() > 1 && at < chosen.model.terms.len() {
        let mut model = chosen.model.clone();
        let term = model.terms.remove(at);
        match judge(data, &model, Some(&chosen.parts), effort(data)) {
            Some(without) if !stands(&tried(data, &without, term.entry, chosen.clone())) => {
                chosen = without
            }
            _ => at += 1,
        }
    }
    chosen
}
