//! Which mechanisms are named: candidates by their score, finalists at their own best, unseen runs last.

mod finalists;
mod rank;
mod trial;

use finalists::{Screen, effort};
use rank::rank;
pub use rank::softness;
use trial::{Before, left_open};
pub use trial::{Claim, Trial, stands, through_force};

use crate::constants::{ALIKE_NATS, DEPENDENCE_NATS, DEPENDENCE_SHARE, FORM_LEFT};
use crate::data::Data;
use crate::innovations::dependence::{self, Dependence};
use crate::innovations::hypothesis::{Guess, Judged, judge};
use crate::looked::Seen;
use crate::mechanism::Id;
use crate::model::Model;

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
    /// What is left beside the chosen model.
    pub left: Option<Left>,
    /// How large each mechanism would have to be to be seen beside the base model.
    pub seen: Vec<Seen>,
}

/// What is left beside a model: the free dependence that gains most where the noise is no larger than the sensors make
/// plausible.
pub struct Left {
    /// It.
    pub dependence: Dependence,
    /// Its gain there in nats.
    pub gain: f64,
    /// That as a share of what was taken up and it gain together.
    pub share: f64,
}

impl Left {
    /// Of a round's trials; nothing where it is so small beside what was taken up that it is what that one's form leaves.
    fn of(trials: &[Trial], taken_up: f64) -> Option<Self> {
        let open = trials.iter().filter(|t| left_open(t));
        let most = open.max_by(|a, b| a.at_sensors.0.total_cmp(&b.at_sensors.0))?;
        let Claim::Dependence(dependence) = &most.claim else {
            return None;
        };
        let gain = most.at_sensors.0;
        (gain > FORM_LEFT * taken_up).then(|| Self {
            dependence: dependence.clone(),
            gain,
            share: gain / (gain + taken_up),
        })
    }
}

/// A name that was taken up, and how much spoke for it.
type Named = (Id, f64);

/// Whether a trial is of an alias of what was named, and so small beside it that it is what that name's form leaves.
fn left_by_form(trial: &Trial, named: &[Named]) -> bool {
    let Some((id, _)) = trial.mechanism() else {
        return false;
    };
    named.iter().any(|&(other, weight)| {
        let small = trial.weight() < FORM_LEFT * weight;
        small && other.aliases().iter().any(|alias| alias.with == id)
    })
}

/// The trial that is taken up: a mechanism, unless a free dependence accounts for much more in the same balance. One
/// in another balance is no other account of it, and has its turn later.
fn taken_up<'a>(data: &Data, trials: &'a [Trial], named: &[Named]) -> Option<&'a Trial> {
    let own = |t: &&Trial| stands(t) && !left_by_form(t, named);
    let standing = || trials.iter().filter(own);
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
    let mut named: Vec<Named> = Vec::new();
    let mut left = None;
    let mut taken_up_gains = 0.0;
    let free = dependence::all(data);
    while chosen.model.terms.len() + chosen.extra.len() < MOST_NAMES {
        let screen = Screen::new(data, &chosen, &free, excluded, chain_s);
        seen.get_or_insert_with(|| screen.seen());
        let mut trials = screen.trials();
        // What only the chain remembers has taken the place of other names.
        let of_chain = trials.iter().any(|t| !t.outlasts_chain);
        if of_chain && taken_up(data, &trials, &named).is_none() {
            let tried: Vec<Id> = trials
                .iter()
                .filter_map(|t| Some(t.mechanism()?.0))
                .collect();
            trials.extend(screen.trials_without(&tried));
            rank(data, &mut trials);
        }
        let mut next = taken_up(data, &trials, &named).cloned();
        if let Some(better) = next.as_ref().and_then(|t| at_noise_of(data, &chosen, t)) {
            for trial in &mut trials {
                trial.set_against(data, &chosen, &better);
            }
            rank(data, &mut trials);
            if rounds.is_empty() {
                base = better.clone();
            }
            chosen = better;
            next = taken_up(data, &trials, &named).cloned();
        }
        if next.is_none() {
            left = Left::of(&trials, taken_up_gains);
        }
        rounds.push(trials);
        match next {
            Some(trial) => {
                taken_up_gains += trial.at_sensors.0.max(0.0);
                named.extend(trial.mechanism().map(|(id, _)| (id, trial.weight())));
                chosen = trial.judged;
            }
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
        left,
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
