//! Which mechanisms are named: candidates by their score, finalists at their own best, unseen runs last.

use rayon::prelude::*;

use crate::data::Data;
use crate::innovations::candidates::{Candidate, Table, table};
use crate::innovations::dependence::{self, Dependence};
use crate::innovations::gram::total;
use crate::innovations::hypothesis::{
    Effort, Guess, Judged, capped, judge, noise_stride, table_grams,
};
use crate::innovations::noise::Slopes;
use crate::innovations::rows::rows_of;
use crate::innovations::screen::{Score, scores};
use crate::law::{closest, left_of};
use crate::looked::{self, POWER, Seen};
use crate::mechanism::{Balance, Evidence, Id};
use crate::model::{Model, Term};

/// Price of a free parameter in nats: about half the logarithm of the independent readings.
const PRICE_OF_PARAMETER: f64 = 4.0;
/// Price of a choice among the vocabulary in nats.
const PRICE_OF_NAME: f64 = 3.4;
/// Least gain in nats, all prices taken off.
const LEAST_GAIN: f64 = 5.0;
/// Least effect that is worth a name, as a share of one whitened reading's standard deviation: of the gain, half
/// its square a reading.
const LEAST_EFFECT: f64 = 0.07;
/// Least t of the gains on unseen runs: about Student's at five percent, one-sided, for as many runs as campaigns have.
const LEAST_T: f64 = 2.0;
/// Least t of gains that are small, but of all unseen runs.
const LEAST_T_IN_ALL: f64 = 4.0;
/// The same of a free dependence, which says nothing of what it is.
const LEAST_T_OF_DEPENDENCE: f64 = 3.0;
/// Least gain of a free dependence over that of the least effect worth a name.
const DEPENDENCE_WORTH: f64 = 3.0;
/// A free dependence is said instead of a mechanism where it gains so many times as much, and so many nats more.
const DEPENDENCE_SHARE: f64 = 1.1;
const DEPENDENCE_NATS: f64 = 15.0;
/// Least memory in s that is told from a chain without any error of timing.
const LEAST_MEMORY_S: f64 = 2.5e-3;
/// Gains in nats that differ by less are alike.
const ALIKE_NATS: f64 = 0.5;
/// Least logarithm by which a name that works through the force lowers the mean square error of the drag.
const LEAST_PREDICTED: f64 = 0.01;
/// Of names that gain alike, to this share, the one comes first that predicts the drag better by this logarithm.
const ALIKE_SHARE: f64 = 0.7;
pub const PREDICTED_APART: f64 = 0.1;
/// Finalists that are judged in each round, from each of the two screens.
const FINALISTS: [usize; 2] = [4, 1];
/// Most names.
const MOST_NAMES: usize = 3;

/// What a trial adds to a model.
#[derive(Clone)]
pub enum Claim {
    /// A mechanism of the vocabulary, by its entry of the catalogue.
    Mechanism(Id, usize),
    /// A free dependence on a variable.
    Dependence(Dependence),
}

/// A claim as it stands against the model without it.
#[derive(Clone)]
pub struct Trial {
    /// Which.
    pub claim: Claim,
    /// Gain in nats, prices taken off.
    pub gain: f64,
    /// Mean gain on unseen runs in nats, and its t over the runs.
    pub unseen: (f64, f64),
    /// Whether its memory is longer than what the chain's own timing was off by.
    pub outlasts_chain: bool,
    /// Readings in the balances that are judged.
    pub readings: usize,
    /// Gain in nats if the noise were no larger than the sensors make plausible: how large the effect is, whatever
    /// the runs' own differences hide of it.
    pub size: f64,
    /// By how much the model with it predicts the drag better: minus the mean over runs of the logarithm of the mean
    /// square error over that without it. Infinite for what does not work through the force.
    pub predicts: f64,
    /// The model with it.
    pub judged: Judged,
}

impl Trial {
    /// The mechanism, where it is one.
    #[must_use]
    pub fn mechanism(&self) -> Option<(Id, usize)> {
        match &self.claim {
            Claim::Mechanism(id, entry) => Some((*id, *entry)),
            Claim::Dependence(_) => None,
        }
    }

    /// The balance that its claim is of.
    fn balance(&self, data: &Data) -> Balance {
        match &self.claim {
            Claim::Mechanism(_, entry) => data.catalogue.get(*entry).id().balance(),
            Claim::Dependence(own) => own.balance,
        }
    }

    /// Sets it against another state of the model without it.
    fn set_against(&mut self, data: &Data, before: &Judged, base: &Judged) {
        self.gain -= before.loss - base.loss;
        self.unseen = unseen_gain(base, &self.judged, is_per_run(data, &self.claim));
    }
}

/// What belongs to a run cannot be carried to another: its first half tells its second.
fn is_per_run(data: &Data, claim: &Claim) -> bool {
    match claim {
        Claim::Mechanism(_, entry) => data.catalogue.get(*entry).form().contains("per_run"),
        Claim::Dependence(_) => false,
    }
}

/// What was decided.
pub struct Decision {
    /// The base model alone.
    pub base: Judged,
    /// The chosen model.
    pub chosen: Judged,
    /// Trials of each round, best first.
    pub rounds: Vec<Vec<Trial>>,
    /// How large each mechanism would have to be to be seen beside the base model.
    pub seen: Vec<Seen>,
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
fn effort(data: &Data) -> Effort {
    Effort {
        steps: 8,
        noise_steps: 20,
        noise_stride: noise_stride(data),
    }
}

/// What a round found.
struct Round {
    /// Best first.
    trials: Vec<Trial>,
    /// How large each mechanism would have to be to be seen.
    seen: Vec<Seen>,
}

/// Standard deviations from which an effect of one parameter is named in four cases of five.
fn detectable() -> f64 {
    (2.0 * (LEAST_GAIN + PRICE_OF_PARAMETER + PRICE_OF_NAME)).sqrt() + POWER
}

/// One round: every finalist beside the model so far.
fn round(data: &Data, so_far: &Judged, excluded: &[Id], chain_s: f64) -> Round {
    let effort = effort(data);
    let slopes = Slopes::new(data, &so_far.model.base);
    let free = dependence::all(data);
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
        &free,
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

/// Best first; of those that gain alike, the one first that claims the least.
fn rank(data: &Data, trials: &mut [Trial]) {
    trials.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    least_claims_first(trials, |t| t.gain, |t| balances(data, t));
    better_predicted_first(trials, |t| t.gain, |t| t.predicts);
}

/// Of those that gain much the same and work through the force, the one first that predicts the drag clearly better.
fn better_predicted_first<T>(
    best_first: &mut [T],
    gain: impl Fn(&T) -> f64,
    predicts: impl Fn(&T) -> f64,
) {
    let alike = |own: &T, other: &T| gain(own) > ALIKE_SHARE * gain(other);
    let better = |own: &T, other: &T| predicts(own) > predicts(other) + PREDICTED_APART;
    sort_neighbours(best_first, |own, other| {
        alike(own, other) && predicts(own).is_finite() && better(own, other)
    });
}

/// Balances that a trial's claim is about.
fn balances(data: &Data, trial: &Trial) -> usize {
    match trial.claim {
        Claim::Mechanism(_, entry) => data.catalogue.get(entry).guide().touches.len(),
        Claim::Dependence(_) => 1,
    }
}

/// Of neighbours that gain alike, the one first that claims the least: a mass in error says less than a drag
/// channel's scale in error, which all balances would show if they could.
fn least_claims_first<T>(
    best_first: &mut [T],
    gain: impl Fn(&T) -> f64,
    claims: impl Fn(&T) -> usize,
) {
    sort_neighbours(best_first, |own, other| {
        gain(other) - gain(own) < ALIKE_NATS && claims(own) < claims(other)
    });
}

/// Lets each go before the one next to it, again and again, as long as it `precedes` that: for orders that hold
/// between neighbours only.
fn sort_neighbours<T>(all: &mut [T], precedes: impl Fn(&T, &T) -> bool) {
    for from in 1..all.len() {
        let mut at = from;
        while at > 0 && precedes(&all[at], &all[at - 1]) {
            all.swap(at - 1, at);
            at -= 1;
        }
    }
}

/// The model so far, as what a trial adds to it is weighed against it.
struct Before<'a> {
    data: &'a Data,
    judged: &'a Judged,
    /// What the chain's own timing was off by, in s.
    chain_s: f64,
    /// Sum of squares of the drag that its best law leaves, by run.
    squares: Vec<f64>,
}

impl<'a> Before<'a> {
    fn new(data: &'a Data, judged: &'a Judged, chain_s: f64) -> Self {
        Self {
            data,
            judged,
            chain_s,
            squares: squares_by_best_law(data, judged),
        }
    }

    fn tried(&self, claim: Claim, judged: Judged, size: f64) -> Trial {
        let (data, base) = (self.data, self.judged);
        let free = judged.free as f64 - base.free as f64;
        let per_run = is_per_run(data, &claim);
        let counts = judged.grams.iter().flatten().map(|g| g.count);
        let readings = counts.sum::<usize>() / judged.parts.len().max(1);
        let in_force = match &claim {
            Claim::Mechanism(id, _) => through_force(*id),
            Claim::Dependence(own) => own.balance == Balance::Tyre,
        };
        let predicts = if in_force {
            self.predicted_better(&judged)
        } else {
            f64::INFINITY
        };
        let outlasts_chain = match &claim {
            Claim::Mechanism(id, entry) => {
                let least = least_memory_s(data, *id, *entry).max(self.chain_s);
                memory_s(data, *id, *entry, &judged.model).is_none_or(|memory| memory > least)
            }
            Claim::Dependence(_) => true,
        };
        Trial {
            claim,
            gain: base.loss - judged.loss - PRICE_OF_PARAMETER * free - PRICE_OF_NAME,
            unseen: unseen_gain(base, &judged, per_run),
            outlasts_chain,
            predicts,
            readings,
            size,
            judged,
        }
    }

    /// Minus the mean over runs of the logarithm of the mean square error of the drag by this model over that by the
    /// one before.
    fn predicted_better(&self, with: &Judged) -> f64 {
        let after = squares_by_best_law(self.data, with);
        let ratios: Vec<f64> = self
            .squares
            .iter()
            .zip(after)
            .map(|(before, after)| (before / after).ln())
            .filter(|ratio| ratio.is_finite())
            .collect();
        ratios.iter().sum::<f64>() / ratios.len().max(1) as f64
    }
}

/// Sum of squares of the drag that a model leaves, by run, with the law that predicts best and nothing of the chain's
/// nuisances: those may stand for an effect.
fn squares_by_best_law(data: &Data, judged: &Judged) -> Vec<f64> {
    let drags = judged.drag_to_explain(data);
    let best = closest(data, &judged.model, &drags);
    let runs = data.series.iter().enumerate();
    runs.map(|(run, s)| s.tyre_square(&left_of(data, &best, run, &drags[run])))
        .collect()
}

/// Whether a mechanism works through the force that is predicted.
#[must_use]
pub fn through_force(id: Id) -> bool {
    let timing = matches!(
        id,
        Id::EffectiveRadius | Id::EncoderRipple | Id::WheelSpeedDelay | Id::VehicleSpeedDelay
    );
    id.balance() == Balance::Tyre && !timing
}

/// Shortest memory in s that is named: a filtered reading of the brake holds less noise than the reading itself, which
/// looks like a short lag, so there its descriptor's smallest useful effect holds.
fn least_memory_s(data: &Data, id: Id, entry: usize) -> f64 {
    if id.balance() == Balance::Wheel {
        (data.catalogue.get(entry).guide().smallest_size)(&data.context)
    } else {
        LEAST_MEMORY_S
    }
}

/// Memory of a mechanism in s, where it has one.
fn memory_s(data: &Data, id: Id, entry: usize, model: &Model) -> Option<f64> {
    let term = model.terms.iter().find(|t| t.entry == entry)?;
    let first = *term.parameters.first()?;
    match id {
        Id::BrakeLag | Id::ForceLag | Id::ForceDelay => Some(first),
        Id::RelaxationLength => Some(first / data.context.mean_speed),
        Id::StructuralResonance => Some(1.0 / (core::f64::consts::TAU * first)),
        _ => None,
    }
}

/// Whether a trial stands.
#[must_use]
pub fn stands(trial: &Trial) -> bool {
    let worth = 0.5 * LEAST_EFFECT * LEAST_EFFECT * trial.readings as f64;
    let worth_it = trial.size > worth;
    let least_gain = if trial.mechanism().is_some() {
        LEAST_GAIN
    } else {
        DEPENDENCE_WORTH * worth
    };
    // What belongs to a run leaves of an effect between runs a few nats, but from every run.
    let alike_in_all = trial.gain > 0.0 && trial.unseen.1 > LEAST_T_IN_ALL;
    let enough = trial.gain > least_gain || (trial.mechanism().is_some() && alike_in_all);
    let predicts = trial.predicts > LEAST_PREDICTED;
    enough && worth_it && seen_on_unseen_runs(trial) && trial.outlasts_chain && predicts
}

/// Whether unseen runs gain, and alike.
fn seen_on_unseen_runs(trial: &Trial) -> bool {
    let (mean, t) = trial.unseen;
    let least = match trial.claim {
        Claim::Mechanism(..) => LEAST_T,
        Claim::Dependence(_) => LEAST_T_OF_DEPENDENCE,
    };
    mean > 0.0 && t >= least
}

/// The trial that is taken up: a mechanism, unless a free dependence accounts for much more in the same balance. One
/// in another balance is no other account of it, and has its turn later.
fn taken_up<'a>(data: &Data, trials: &'a [Trial]) -> Option<&'a Trial> {
    let standing = || trials.iter().filter(|t| stands(t));
    let Some(named) = standing().find(|t| t.mechanism().is_some()) else {
        return standing().next();
    };
    let instead = |t: &&Trial| {
        let of_same = t.balance(data) == named.balance(data);
        of_same && t.gain > DEPENDENCE_SHARE * named.gain + DEPENDENCE_NATS
    };
    let mut free = standing().filter(|t| t.mechanism().is_none());
    Some(free.find(instead).unwrap_or(named))
}

/// Decides what is named beside the base model; `chain_s` is what the chain's own timing was off by, in s.
#[must_use]
pub fn decide(data: &Data, mut base: Judged, excluded: &[Id], chain_s: f64) -> Decision {
    let mut chosen = base.clone();
    let mut rounds = Vec::new();
    let mut seen = None;
    while chosen.model.terms.len() + chosen.extra.len() < MOST_NAMES {
        let Round {
            mut trials,
            seen: found,
        } = round(data, &chosen, excluded, chain_s);
        seen.get_or_insert(found);
        let mut next = taken_up(data, &trials).cloned();
        if let Some(better) = next.as_ref().and_then(|t| at_noise_of(data, &chosen, t)) {
            for trial in &mut trials {
                trial.set_against(data, &chosen, &better);
            }
            rank(data, &mut trials);
            if rounds.is_empty() {
                base = better.clone();
            }
            chosen = better;
            next = taken_up(data, &trials).cloned();
        }
        rounds.push(trials);
        match next {
            Some(trial) => chosen = trial.judged,
            None => break,
        }
    }
    if chosen.model.terms.len() > 1 {
        chosen = without_idle(data, chosen, chain_s);
    }
    Decision {
        base,
        chosen,
        rounds,
        seen: seen.unwrap_or_default(),
    }
}

/// The model so far under noise like a trial's, where that is better: sizes of the noise that only the trial came
/// upon are no gain of its.
fn at_noise_of(data: &Data, so_far: &Judged, trial: &Trial) -> Option<Judged> {
    let guess = Some(Guess::of(&trial.judged.parts));
    let again = judge(data, &so_far.model, &so_far.extra, guess, effort(data))?;
    (again.loss < so_far.loss - ALIKE_NATS).then_some(again)
}

/// Takes names out that the others do not need. A free dependence is no other name: it may span any of them.
fn without_idle(data: &Data, mut chosen: Judged, chain_s: f64) -> Judged {
    let judged = |model: &Model, extra: &[Dependence], guess: &Judged| {
        judge(
            data,
            model,
            extra,
            Some(Guess::of(&guess.parts)),
            effort(data),
        )
    };
    let mut names = chosen.clone();
    if !chosen.extra.is_empty() {
        match judged(&chosen.model, &[], &chosen) {
            Some(own) => names = own,
            None => return chosen,
        }
    }
    let mut at = 0;
    let mut dropped = false;
    while names.model.terms.len() > 1 && at < names.model.terms.len() {
        let mut model = names.model.clone();
        let term = model.terms.remove(at);
        let claim = Claim::Mechanism(data.catalogue.get(term.entry).id(), term.entry);
        // It was large enough when it was taken up: what counts is whether the others leave anything to it.
        let idle = judged(&model, &[], &names).filter(|without| {
            let size = f64::INFINITY;
            !stands(&Before::new(data, without, chain_s).tried(claim, names.clone(), size))
        });
        match idle {
            Some(without) => {
                names = without;
                dropped = true;
            }
            None => at += 1,
        }
    }
    if dropped {
        chosen = judged(&names.model, &chosen.extra, &names).unwrap_or(names);
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_those_that_gain_much_the_same_the_one_that_predicts_clearly_better_comes_first() {
        // Gain and prediction: what gains less than 0.7 of another, or predicts but little better, stays behind it.
        let mut all = [
            (400.0, 1.0),
            (330.0, 1.4),
            (310.0, 1.45),
            (100.0, 9.0),
            (90.0, f64::INFINITY),
        ];
        better_predicted_first(&mut all, |t| t.0, |t| t.1);
        let gains = all.map(|t| t.0);
        assert_eq!(gains, [330.0, 310.0, 400.0, 100.0, 90.0]);
    }

    #[test]
    fn of_two_that_gain_alike_the_one_that_claims_less_comes_first() {
        // Gain and claims: only neighbours within half a nat change places.
        let mut all = [(40.0, 1), (35.2, 3), (35.0, 1), (34.9, 2), (12.0, 1)];
        least_claims_first(&mut all, |t| t.0, |t| t.1);
        assert_eq!(all, [(40.0, 1), (35.0, 1), (34.9, 2), (35.2, 3), (12.0, 1)]);
    }
}
