//! A round: candidates by their score, finalists at their own best.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::rank::rank;
use super::trial::{Before, Claim, Trial};
use crate::constants::{LEAST_GAIN, POWER, PRICE_OF_NAME, PRICE_OF_PARAMETER};
use crate::data::Data;
use crate::innovations::candidates::{Candidate, Table, table};
use crate::innovations::dependence::Dependence;
use crate::innovations::gram::total;
use crate::innovations::hypothesis::{
    Beside, Effort, Judged, Noise, judge_added, noise_stride, table_grams,
};
use crate::innovations::noise::Slopes;
use crate::innovations::rows::tyre_row_of;
use crate::innovations::screen::{Score, scores};
use crate::looked::{self, Seen};
use crate::mechanism::{Facts, Id, Residuals};
use crate::model::{Model, Term};
use crate::series::Series;

/// Finalists that are judged in each round: best at the sensors' noise, and by the geometric mean of the gains at both
/// levels, which is what trials are weighed by.
const FINALISTS: [usize; 2] = [3, 4];

fn evidence(data: &Data, model: &Model) -> Vec<Residuals> {
    data.series
        .par_iter()
        .enumerate()
        .map(|(run, s)| {
            let left = tyre_row_of(data, model, run);
            let mut weight = vec![0.0; s.len()];
            for k in s.tyre.iter().flat_map(Clone::clone) {
                weight[k] = s.drag_sigma.powi(-2).min(1e12);
            }
            let none = left.is_empty();
            Residuals {
                predicted: if none {
                    vec![0.0; s.len()]
                } else {
                    s.drag.iter().zip(&left).map(|(a, b)| a - b).collect()
                },
                residual: if none { vec![0.0; s.len()] } else { left },
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
    // What starts as nothing moves from there, together with what stands; what is no effect's size cannot be scaled.
    let sized = p.len() == 1 && data.catalogue.get(entry).facts().amplitude == Some(0);
    if candidate.free.is_empty() && sized {
        p[0] *= score.coefficients[0].clamp(0.3, 3.0);
    }
    for (p, b) in p.iter_mut().zip(bounds) {
        *p = p.clamp(b.low, b.high);
    }
    p
}

/// Gain of a candidate as it starts: of its best size, where it has one, else of the whole effect, no more and no less.
fn gain_at_start(data: &Data, candidate: &Candidate, score: &Score) -> f64 {
    let sized = |entry: usize| data.catalogue.get(entry).facts().amplitude.is_some();
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

/// The start of one form that gains most as it starts; nothing where it has none.
fn best_start<'a>(
    data: &Data,
    candidates: &[Candidate],
    all: impl Iterator<Item = &'a Score>,
    entry: Option<usize>,
) -> Option<&'a Score> {
    let at_start = |s: &Score| gain_at_start(data, &candidates[s.candidate], s);
    let own = all.filter(|s| candidates[s.candidate].entry == entry);
    own.max_by(|a, b| at_start(a).total_cmp(&at_start(b)))
}

/// Best candidates of a screen but of the ids passed over: at most `count` ids, at most two forms of each, and two of the fast
/// force, each form at its best start; and beside them the counter-forms of these ids, and what the noise of a run is like, whatever it gains:
/// of that the screen, at one size of the noise, says nothing.
fn best(
    data: &Data,
    candidates: &[Candidate],
    all: &[Score],
    count: usize,
    passed: &[Id],
) -> Vec<(usize, Score)> {
    let price = |s: &Score| {
        PRICE_OF_PARAMETER * candidates[s.candidate].columns.len() as f64 + PRICE_OF_NAME
    };
    let says = |s: &Score, fact: fn(&Facts) -> bool| {
        let entry = candidates[s.candidate].entry;
        entry.is_some_and(|entry| fact(&data.catalogue.get(entry).facts()))
    };
    let counter = |s: &Score| says(s, |facts| facts.counter_form);
    let mut best_first: Vec<&Score> = all.iter().filter(|s| !counter(s)).collect();
    best_first.sort_by(|a, b| (b.gain - price(b)).total_cmp(&(a.gain - price(a))));
    let mut out: Vec<(usize, Score)> = Vec::new();
    let mut ids: Vec<Id> = Vec::new();
    for score in best_first {
        let candidate = &candidates[score.candidate];
        let Some(id) = candidate.id else { continue };
        if passed.contains(&id) {
            continue;
        }
        // An effect that would have to be turned round is not that effect.
        let turned = candidate.free.is_empty() && !(score.coefficients[0] > 0.0);
        let gains = score.gain > price(score) && !turned;
        let asked_for = says(score, |facts| facts.like_noise_of_run);
        if !gains && !asked_for {
            continue;
        }
        let fast = |entry: Option<usize>| entry.is_some_and(|e| data.catalogue.is_of_fast_force(e));
        let of_id = |(c, _): &&(usize, Score)| {
            let other = &candidates[*c];
            other.id == candidate.id && fast(other.entry) == fast(candidate.entry)
        };
        let tried = |(c, _): &(usize, Score)| candidates[*c].entry == candidate.entry;
        if out.iter().filter(of_id).count() >= 2 || out.iter().any(tried) {
            continue;
        }
        if !ids.contains(&id) {
            if ids.len() >= count && !asked_for {
                continue;
            }
            ids.push(id);
        }
        let best = best_start(data, candidates, all.iter(), candidate.entry).unwrap_or(score);
        out.push((best.candidate, best.clone()));
    }
    let of_ids = |s: &&Score| {
        let id = candidates[s.candidate].id;
        counter(s) && s.gain > price(s) && id.is_some_and(|id| ids.contains(&id))
    };
    let mut counters: Vec<&Score> = all.iter().filter(of_ids).collect();
    counters.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    for score in counters {
        let same = |c: usize| candidates[c].entry == candidates[score.candidate].entry;
        if !out.iter().any(|(c, _)| same(*c)) {
            out.push((score.candidate, score.clone()));
        }
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

/// Standard deviations from which an effect of one parameter is named in four cases of five.
fn detectable() -> f64 {
    (2.0 * (LEAST_GAIN + PRICE_OF_PARAMETER + PRICE_OF_NAME)).sqrt() + POWER
}

/// Scores at one level with the geometric mean of the gains at both, best first.
fn at_both(one: &[Score], other: &[Score]) -> Vec<Score> {
    let gains: BTreeMap<usize, f64> = other.iter().map(|s| (s.candidate, s.gain)).collect();
    let mut all: Vec<Score> = one
        .iter()
        .filter_map(|score| {
            let other = gains.get(&score.candidate)?;
            Some(Score {
                gain: (score.gain.max(0.0) * other.max(0.0)).sqrt(),
                ..score.clone()
            })
        })
        .collect();
    all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    all
}

/// Rows of a campaign from which its candidates are scored in parts: their columns, a few hundred of each row, need not
/// stay in memory together.
const MANY_ROWS: usize = 100_000;

/// Parts of a long campaign's mechanisms, and of its free dependences.
const PARTS: usize = 4;

/// What is scored together: mechanisms and free dependences, the latter last.
fn parts<'a>(
    data: &Data,
    wanted: &'a [Id],
    free: &'a [Dependence],
) -> Vec<(&'a [Id], &'a [Dependence])> {
    let rows: usize = data.series.iter().map(Series::len).sum();
    if rows <= MANY_ROWS {
        return vec![(wanted, free)];
    }
    let of_wanted = wanted.chunks(wanted.len().div_ceil(PARTS).max(1));
    let of_free = free.chunks(free.len().div_ceil(PARTS).max(1));
    of_wanted
        .map(|ids| (ids, &free[..0]))
        .chain(of_free.map(|free| (&wanted[..0], free)))
        .collect()
}

/// Candidates with their scores at the sensors' noise and at the fitted one; nothing of a level where base and chain
/// cannot be told apart.
#[derive(Default)]
struct Scored {
    candidates: Vec<Candidate>,
    at_sensors: Vec<Score>,
    fitted: Vec<Score>,
}

impl Scored {
    /// Adds the candidates of a table.
    fn add(&mut self, data: &Data, beside: &Beside, table: Table) {
        let first = self.candidates.len();
        let at = |noise: &Noise| {
            let found = scores(&table, &total(&table_grams(data, noise, &table)));
            found.into_iter().flatten().map(move |score| Score {
                candidate: first + score.candidate,
                ..score
            })
        };
        self.at_sensors.extend(at(&beside.at_sensors));
        self.fitted.extend(at(&beside.fitted));
        self.candidates.extend(table.candidates);
    }

    /// At the sensors' noise, and as trials are weighed; with how many ids of each are judged.
    fn levels(&mut self) -> Vec<(Vec<Score>, usize)> {
        let [sensors, fitted] = [&mut self.at_sensors, &mut self.fitted].map(|all| {
            all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
            core::mem::take(all)
        });
        match (sensors.is_empty(), fitted.is_empty()) {
            (false, false) => {
                let both = at_both(&sensors, &fitted);
                vec![(sensors, FINALISTS[0]), (both, FINALISTS[1])]
            }
            (false, true) => vec![(sensors, FINALISTS[0])],
            (true, false) => vec![(fitted, FINALISTS[0])],
            (true, true) => Vec::new(),
        }
    }
}

/// What is judged at its own best, from one start or more.
struct Finalist {
    /// As the first level that has it among its best would have it.
    candidate: usize,
    /// Parameters to start from.
    starts: Vec<Vec<f64>>,
}

/// All candidates beside the model so far, scored at the sensors' noise and at the fitted one.
pub struct Screen<'a> {
    data: &'a Data,
    free: &'a [Dependence],
    before: Before<'a>,
    candidates: Vec<Candidate>,
    /// At the sensors' noise, and as trials are weighed; with how many ids of each are judged.
    levels: Vec<(Vec<Score>, usize)>,
}

impl<'a> Screen<'a> {
    /// Scores all but the ids excluded beside the model so far.
    pub fn new(
        data: &'a Data,
        before: Before<'a>,
        free: &'a [Dependence],
        excluded: &[Id],
    ) -> Self {
        let so_far = before.judged;
        let slopes = Slopes::new(data, &so_far.model);
        let taken = |id: Id| {
            let entry = |t: &Term| data.catalogue.get(t.entry).id() == id;
            excluded.contains(&id) || so_far.model.terms.iter().any(entry)
        };
        let found = evidence(data, &so_far.model);
        // What belongs to a balance that cannot be formed is not named for another.
        let wanted: Vec<Id> = Id::ALL
            .iter()
            .copied()
            .filter(|id| !taken(*id) && data.forms(id.balance()))
            .collect();
        let mut scored = Scored::default();
        for (ids, free) in parts(data, &wanted, free) {
            let wanted = |id: Id| ids.contains(&id);
            let (model, extra) = (&so_far.model, &so_far.extra);
            let table = table(
                data,
                model,
                (&slopes, &slopes.force),
                &found,
                extra,
                free,
                &wanted,
            );
            scored.add(data, before.beside(), table);
        }
        Self {
            data,
            free,
            before,
            levels: scored.levels(),
            candidates: scored.candidates,
        }
    }

    /// How large each mechanism would have to be to be seen.
    pub fn seen(&self) -> Vec<Seen> {
        self.levels.first().map_or_else(Vec::new, |(all, _)| {
            looked::seen(self.data, &self.candidates, all, detectable())
        })
    }

    /// Gain of a candidate at the first level that there is.
    fn size(&self, candidate: usize) -> f64 {
        let mut all = self.levels.iter().take(1).flat_map(|(all, _)| all);
        let own = all.find(|s| s.candidate == candidate);
        own.map_or(0.0, |s| s.gain)
    }

    /// Mechanisms that are judged: the best but those passed over, each from where either level would have it start.
    fn mechanisms(&self, passed: &[Id]) -> Vec<Finalist> {
        let candidates = &self.candidates;
        let mut out: Vec<Finalist> = Vec::new();
        for (all, count) in &self.levels {
            for (index, score) in best(self.data, candidates, all, *count, passed) {
                let candidate = &candidates[index];
                let start = start_of(self.data, candidate, &score);
                let same = |f: &&mut Finalist| candidates[f.candidate].entry == candidate.entry;
                match out.iter_mut().find(same) {
                    // From another size of the same effect the way leads to the same place.
                    Some(other) if other.candidate != index => other.starts.push(start),
                    Some(_) => {}
                    None => out.push(Finalist {
                        candidate: index,
                        starts: vec![start],
                    }),
                }
            }
        }
        out
    }

    /// The best free dependence of either level, by candidate; where that is one for each run by itself, whose many
    /// columns follow anything, the best of the others as well.
    fn dependences(&self) -> Vec<usize> {
        let first = self.candidates.len() - self.free.len();
        let mut out: Vec<usize> = Vec::new();
        for (all, _) in &self.levels {
            let best = || all.iter().map(|s| s.candidate).filter(|own| *own >= first);
            out.extend(best().next());
            out.extend(best().find(|own| !self.free[own - first].is_per_run()));
        }
        out.sort_unstable();
        out.dedup();
        out
    }

    /// Every finalist at its own best, best first.
    pub fn trials(&self) -> Vec<Trial> {
        let mut finalists = self.mechanisms(&[]);
        let free = self.dependences().into_iter();
        finalists.extend(free.map(|candidate| Finalist {
            candidate,
            starts: vec![Vec::new()],
        }));
        self.judged(&finalists)
    }

    /// The same of the mechanisms that are best where these are passed over.
    pub fn trials_without(&self, passed: &[Id]) -> Vec<Trial> {
        self.judged(&self.mechanisms(passed))
    }

    /// The same of these forms, by their entries, whatever the screen has them gain: each from its best start.
    pub fn trials_of(&self, entries: &[usize]) -> Vec<Trial> {
        let mut finalists: Vec<Finalist> = Vec::new();
        for &entry in entries {
            let all = self.levels.iter().flat_map(|(all, _)| all);
            let best = best_start(self.data, &self.candidates, all, Some(entry));
            finalists.extend(best.map(|score| Finalist {
                candidate: score.candidate,
                starts: vec![start_of(
                    self.data,
                    &self.candidates[score.candidate],
                    score,
                )],
            }));
        }
        self.judged(&finalists)
    }

    fn judged(&self, finalists: &[Finalist]) -> Vec<Trial> {
        let judged = |finalist: &Finalist| {
            let from = finalist.starts.iter();
            let each = from.filter_map(|start| self.judged_from(finalist.candidate, start));
            each.min_by(|a, b| a.1.loss.total_cmp(&b.1.loss))
                .map(|(claim, judged)| {
                    let size = self.size(finalist.candidate);
                    self.before.tried(claim, judged, size)
                })
        };
        let mut trials: Vec<Trial> = finalists.par_iter().filter_map(judged).collect();
        rank(self.data, &mut trials);
        trials
    }

    /// A candidate from one start at its own best.
    fn judged_from(&self, candidate: usize, start: &[f64]) -> Option<(Claim, Judged)> {
        let data = self.data;
        let so_far = self.before.judged;
        let mut model = so_far.model.clone();
        let mut extra = so_far.extra.clone();
        let own = &self.candidates[candidate];
        let claim = match (own.id, own.entry) {
            (Some(id), Some(entry)) => {
                model.terms.push(Term {
                    entry,
                    parameters: start.to_vec(),
                });
                Claim::Mechanism(id, entry)
            }
            _ => {
                let first_free = self.candidates.len() - self.free.len();
                let free = self.free[candidate - first_free].clone();
                extra.push(free.clone());
                Claim::Dependence(free)
            }
        };
        let judged = judge_added(data, &model, &extra, self.before.beside(), effort(data))?;
        Some((claim, judged))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::untold::Untold;
    use crate::innovations::toy::{Noise, entry_of, settled, stop};

    #[test]
    fn what_is_asked_for_is_tried_whatever_the_screen_has_it_gain() {
        let data = stop(Noise::TYPICAL, 4);
        let base = settled(&data);
        let untold = Untold::default();
        let before = Before::new(&data, &base, untold, 0.0);
        let screen = Screen::new(&data, before, &[], &[]);
        // Nothing is missing, so a lag is not among the best.
        let ids = |trials: &[Trial]| -> Vec<Id> {
            let all = trials.iter().filter_map(Trial::mechanism);
            all.map(|own| own.0).collect()
        };
        let tried = ids(&screen.trials());
        assert!(!tried.contains(&Id::ForceLag));
        // But for what the noise of a run is like.
        let like_noise_of_run = [Id::EffectiveRadius, Id::RollingResistance];
        assert!(like_noise_of_run.iter().all(|id| tried.contains(id)));
        let entries = [Id::ForceLag, Id::ForceDelay].map(|id| entry_of(&data, id));
        let asked = screen.trials_of(&entries);
        let mut found = ids(&asked);
        found.sort_unstable();
        assert_eq!(found, [Id::ForceDelay, Id::ForceLag]);
        assert!(asked.iter().all(|trial| trial.gain < 0.0));
    }
}
