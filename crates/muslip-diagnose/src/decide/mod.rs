//! Which mechanisms are named: candidates by their score, finalists at their own best, unseen runs last.

mod finalists;
mod rank;
mod trial;

use finalists::{Screen, effort};
pub use rank::PREDICTED_APART;
use rank::{ALIKE_NATS, rank};
use trial::Before;
pub use trial::{Claim, Trial, stands, through_force};

use crate::data::Data;
use crate::innovations::dependence::{self, Dependence};
use crate::innovations::hypothesis::{Guess, Judged, judge};
use crate::looked::Seen;
use crate::mechanism::Id;
use crate::model::Model;

/// A free dependence is said instead of a mechanism where it gains so many times as much, and so many nats more.
const DEPENDENCE_SHARE: f64 = 1.33;
const DEPENDENCE_NATS: f64 = 15.0;
/// Most names.
const MOST_NAMES: usize = 3;

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

/// The trial that is taken up: a mechanism, unless a free dependence accounts for much more in the same balance. One
/// in another balance is no other account of it, and has its turn later.
fn taken_up<'a>(data: &Data, trials: &'a [Trial]) -> Option<&'a Trial> {
    let standing = || trials.iter().filter(|t| stands(t));
    let Some(named) = standing().find(|t| t.mechanism().is_some()) else {
        return standing().next();
    };
    let instead = |t: &&Trial| {
        let of_same = t.claim.balance(data) == named.claim.balance(data);
        of_same && t.weight() > DEPENDENCE_SHARE * named.weight() + DEPENDENCE_NATS
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
    let free = dependence::all(data);
    while chosen.model.terms.len() + chosen.extra.len() < MOST_NAMES {
        let screen = Screen::new(data, &chosen, &free, excluded, chain_s);
        seen.get_or_insert_with(|| screen.seen());
        let mut trials = screen.trials();
        // What only the chain remembers has taken the place of other names.
        let of_chain = memories_of_chain(&trials);
        if !of_chain.is_empty() && taken_up(data, &trials).is_none() {
            trials.extend(screen.trials_without(&of_chain));
            rank(data, &mut trials);
        }
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

/// Mechanisms whose memory is no longer than the chain's.
fn memories_of_chain(trials: &[Trial]) -> Vec<Id> {
    let of_chain = trials.iter().filter(|t| !t.outlasts_chain);
    of_chain.filter_map(|t| Some(t.mechanism()?.0)).collect()
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
            let mut trial = Before::new(data, without, chain_s).tried(claim, names.clone(), size);
            trial.first = true;
            !stands(&trial)
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
