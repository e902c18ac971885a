//! A round: candidates by their score, finalists at their own best.

use rayon::prelude::*;

use super::rank::rank;
use super::trial::{Before, Claim, LEAST_GAIN, PRICE_OF_NAME, PRICE_OF_PARAMETER, Trial};
use crate::data::Data;
use crate::innovations::candidates::{Candidate, Table, table};
use crate::innovations::dependence::Dependence;
use crate::innovations::gram::total;
use crate::innovations::hypothesis::{
    Effort, Guess, Judged, capped, judge, noise_stride, table_grams,
};
use crate::innovations::noise::Slopes;
use crate::innovations::rows::rows_of;
use crate::innovations::screen::{Score, scores};
use crate::looked::{self, POWER, Seen};
use crate::mechanism::{Evidence, Id};
use crate::model::{Model, Term};

/// Finalists that are judged in each round, from each of the two screens.
const FINALISTS: [usize; 2] = [4, 1];

fn evidence(data: &Data, model: &Model) -> Vec<Evidence> {
    data.series
        .iter()
        .enumerate()
        .map(|(run, s)| {
            let r = rows_of(data, model, run);
            let mut weight = vec![0.0; s.len()];
            for k in s.tyre.iter().flat_map(Clone::clone) {
                weight[k] = s.drag_sigma.powi(-2).min(1e12);
            }
            let none = r.tyre.is_empty();
            Evidence {
                predicted: if none {
                    vec![0.0; s.len()]
                } else {
                    s.drag.iter().zip(&r.tyre).map(|(a, b)| a - b).collect()
                },
                residual: if none { vec![0.0; s.len()] } else { r.tyre },
                weight,
            }
        })
        .collect()
}

/// Parameters at which a finalist starts.
fn start_of(data: &Data, candidate: &Candidate, score: &Score) -> Vec<f64> {
    let mut p = candidate.start.clone();
    let Some(entry) = candidate.entry else {
        return p;
    };
    let bounds = data.catalogue.get(entry).parameters(&data.context);
    if candidate.free.is_empty() {
        // What is no effect's size cannot be scaled.
        if p.len() == 1 && data.catalogue.get(entry).amplitude() == Some(0) {
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

/// Gain of a candidate as it starts: of its best size, where it has one, else of the whole effect, no more and no less.
fn gain_at_start(data: &Data, candidate: &Candidate, score: &Score) -> f64 {
    let sized = |entry: usize| data.catalogue.get(entry).amplitude().is_some();
    if candidate.free.is_empty() && candidate.entry.is_some_and(|entry| !sized(entry)) {
        let c = score.coefficients[0];
        if c > 0.0 {
            score.gain * (2.0 * c - 1.0) / (c * c)
        } else {
            f64::NEG_INFINITY
        }
    } else {
        score.gain
    }
}

/// Best candidates of a screen: at most `count` ids, at most two forms of each, each form at its best start.
fn best(data: &Data, table: &Table, all: &[Score], count: usize) -> Vec<(usize, Score)> {
    let at_start = |s: &Score| gain_at_start(data, &table.candidates[s.candidate], s);
    let mut out: Vec<(usize, Score)> = Vec::new();
    let mut ids: Vec<Id> = Vec::new();
    for score in all {
        let candidate = &table.candidates[score.candidate];
        let Some(id) = candidate.id else { continue };
        // An effect that would have to be turned round is not that effect.
        if candidate.free.is_empty() && !(score.coefficients[0] > 0.0) {
            continue;
        }
        let price = PRICE_OF_PARAMETER * candidate.columns.len() as f64;
        if !(score.gain > price) {
            continue;
        }
        if out
            .iter()
            .filter(|(c, _)| table.candidates[*c].id == candidate.id)
            .count()
            >= 2
            || out
                .iter()
                .any(|(c, _)| table.candidates[*c].entry == candidate.entry)
        {
            continue;
        }
        if !ids.contains(&id) {
            if ids.len() == count {
                continue;
            }
            ids.push(id);
        }
        let starts = all
            .iter()
            .filter(|s| table.candidates[s.candidate].entry == candidate.entry);
        let best = starts
            .max_by(|a, b| at_start(a).total_cmp(&at_start(b)))
            .unwrap_or(score);
        out.push((best.candidate, best.clone()));
    }
    out
}

/// Effort of a finalist's judgement.
pub fn effort(data: &Data) -> Effort {
    Effort {
        steps: 8,
        noise_steps: 20,
        noise_stride: noise_stride(data),
    }
}

/// What a round found.
pub struct Round {
    /// Best first.
    pub trials: Vec<Trial>,
    /// How large each mechanism would have to be to be seen.
    pub seen: Vec<Seen>,
}

/// Standard deviations from which an effect of one parameter is named in four cases of five.
fn detectable() -> f64 {
    (2.0 * (LEAST_GAIN + PRICE_OF_PARAMETER + PRICE_OF_NAME)).sqrt() + POWER
}

/// One round: every finalist beside the model so far.
pub fn round(
    data: &Data,
    so_far: &Judged,
    free: &[Dependence],
    excluded: &[Id],
    chain_s: f64,
) -> Round {
    let effort = effort(data);
    let slopes = Slopes::new(data, &so_far.model.base);
    let taken = |id: Id| {
        let entry = |t: &Term| data.catalogue.get(t.entry).id() == id;
        excluded.contains(&id) || so_far.model.terms.iter().any(entry)
    };
    let found = evidence(data, &so_far.model);
    let table = table(
        data,
        &so_far.model,
        &slopes,
        &found,
        &so_far.extra,
        free,
        // What belongs to a balance that cannot be formed is not named for another.
        &|id| !taken(id) && data.forms(id.balance()),
    );
    let mechanisms = table.candidates.len() - free.len();
    let mut finalists: Vec<(usize, Vec<f64>, f64)> = Vec::new();
    let mut sizes: Vec<(usize, f64)> = Vec::new();
    let mut seen = Vec::new();
    for (parts, count) in [
        (capped(&so_far.parts), FINALISTS[0]),
        (so_far.parts.clone(), FINALISTS[1]),
    ] {
        let sum = total(&table_grams(data, &parts, &table));
        let Some(all) = scores(&table, &sum) else {
            continue;
        };
        if sizes.is_empty() {
            seen = looked::seen(data, &table, &all, detectable());
            sizes = all.iter().map(|s| (s.candidate, s.gain)).collect();
        }
        let size = |candidate: usize| {
            let own = sizes.iter().find(|s| s.0 == candidate);
            own.map_or(0.0, |s| s.1)
        };
        for (index, score) in best(data, &table, &all, count) {
            let candidate = &table.candidates[index];
            if !finalists
                .iter()
                .any(|f| table.candidates[f.0].entry == candidate.entry)
            {
                finalists.push((index, start_of(data, candidate, &score), size(index)));
            }
        }
        // The best free dependence of either screen.
        let free = all.iter().find(|s| s.candidate >= mechanisms);
        if let Some(score) = free
            && !finalists.iter().any(|f| f.0 == score.candidate)
        {
            finalists.push((score.candidate, Vec::new(), size(score.candidate)));
        }
    }
    let before = Before::new(data, so_far, chain_s);
    let mut trials: Vec<Trial> = finalists
        .par_iter()
        .filter_map(|(index, start, size)| {
            let candidate = &table.candidates[*index];
            let mut model = so_far.model.clone();
            let mut extra = so_far.extra.clone();
            let claim = match (candidate.id, candidate.entry) {
                (Some(id), Some(entry)) => {
                    model.terms.push(Term {
                        entry,
                        parameters: start.clone(),
                    });
                    Claim::Mechanism(id, entry)
                }
                _ => {
                    let free = free[index - mechanisms].clone();
                    extra.push(free.clone());
                    Claim::Dependence(free)
                }
            };
            let judged = judge(data, &model, &extra, Some(Guess::beside(so_far)), effort)?;
            Some(before.tried(claim, judged, *size))
        })
        .collect();
    rank(data, &mut trials);
    Round { trials, seen }
}
