//! Which mechanisms are named: candidates by their score, finalists at their own best, unseen runs last.

mod finalists;
mod left;
mod memory;
mod next;
mod rank;
mod refuted;
mod round;
mod seen;
mod settled;
mod stands;
#[cfg(test)]
mod toy;
mod trial;

use finalists::effort;
pub use left::Left;
use next::{TakenUp, next};
pub use rank::softness;
use refuted::refuted;
pub use round::Asked;
use round::Question;
pub use seen::{few_reach, gains_beyond_chain};
use settled::{again, at_noise_of, settled, under_own_noise};
pub use stands::{could_stand, rivals};
use stands::{needed, stands};
use trial::Before;
pub use trial::{Claim, Trial};

use crate::chain::untold::Untold;
use crate::constants::MOST_NAMES;
use crate::data::Data;
use crate::innovations::dependence;
use crate::innovations::hypothesis::{Guess, Judged, judge};
use crate::looked::Seen;

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

impl Decision {
    /// The chosen model judged anew, for other series of the same recordings.
    #[must_use]
    pub fn refitted(mut self, data: &Data) -> Self {
        self.chosen = under_own_noise(data, self.chosen);
        self
    }

    /// The same without these names, by their entries: those that are left under what noise they leave.
    #[must_use]
    pub fn without(mut self, data: &Data, names: &[usize]) -> Self {
        let mut model = self.chosen.model.clone();
        model.terms.retain(|term| !names.contains(&term.entry));
        if model.terms.len() == self.chosen.model.terms.len() {
            return self;
        }
        let fewer = if model.terms.is_empty() && self.chosen.extra.is_empty() {
            Some(self.base.clone())
        } else {
            again(data, &model, &self.chosen.extra, &self.chosen).map(|own| settled(data, own))
        };
        self.chosen = fewer.unwrap_or(self.chosen);
        if self.left.is_none() {
            self.left = self.open_without(names);
        }
        self
    }

    /// What names that are not said would have explained: the free dependence that stands beside them in the round in which
    /// the last of them was taken up. One that was taken up since may explain it.
    fn open_without(&self, names: &[usize]) -> Option<Left> {
        let of = |entry: usize| move |t: &&Trial| t.mechanism().is_some_and(|m| m.1 == entry);
        let taken_in = |entry: usize| {
            let tried = |round: &Vec<Trial>| round.iter().any(|t| of(entry)(&t));
            self.rounds.iter().rposition(tried)
        };
        let unsaid = names.iter().filter_map(|name| taken_in(*name)).max()?;
        let mut taken_up = 0.0;
        for term in &self.chosen.model.terms {
            let round = taken_in(term.entry)?;
            if round > unsaid {
                return None;
            }
            let own = self.rounds[round].iter().find(of(term.entry));
            taken_up += own.map_or(0.0, |t| t.at_sensors.0.max(0.0));
        }
        let free = |t: &&Trial| t.mechanism().is_none() && stands(t);
        let standing = self.rounds[unsaid].iter().filter(free);
        let most = standing.max_by(|a, b| a.weight().total_cmp(&b.weight()))?;
        let Claim::Dependence(dependence) = &most.claim else {
            return None;
        };
        let gain = most.at_sensors.0;
        Some(Left {
            dependence: dependence.clone(),
            gain,
            share: gain / (gain + taken_up),
        })
    }
}

/// Decides what is named beside the base model; `untold` is what the chain's own timing does not tell.
#[must_use]
pub fn decide(data: &Data, base: Judged, asked: &Asked, untold: Untold) -> Decision {
    let question = Question {
        data,
        free: dependence::all(data),
        asked,
        untold,
    };
    // What it was judged by may know less than the data do now.
    let mut base = settled(data, under_own_noise(data, base));
    let mut chosen = base.clone();
    let mut rounds = Vec::new();
    let mut seen = Vec::new();
    let mut taken_up = TakenUp::default();
    let mut left = None;
    while chosen.model.terms.len() + chosen.extra.len() < MOST_NAMES {
        let (mut trials, mut sizes) = question.round(&chosen, &taken_up);
        let best = next(data, &trials, &taken_up);
        // A trial that came upon better sizes of the noise gains nothing by them, and no other loses.
        if let Some(better) = best.and_then(|t| at_noise_of(data, &chosen, t)) {
            chosen = better;
            (trials, sizes) = question.round(&chosen, &taken_up);
        }
        if rounds.is_empty() {
            base = chosen.clone();
            seen = sizes;
        }
        let best = next(data, &trials, &taken_up).cloned();
        if best.is_none() {
            left = Left::of(&trials, taken_up.at_sensors);
        }
        taken_up.refuted.extend(refuted(data, &trials));
        rounds.push(trials);
        let Some(trial) = best else { break };
        taken_up.add(&trial);
        let standing = rounds.iter().flatten().filter(|t| stands(t));
        let named = standing.filter_map(|t| Some((t.mechanism()?.0, t.weight())));
        taken_up.stood = named.collect();
        chosen = settled(data, under_own_noise(data, trial.judged));
    }
    if chosen.model.terms.len() > 1 {
        chosen = without_idle(data, chosen, untold);
    }
    Decision {
        base,
        chosen,
        rounds,
        left,
        seen,
    }
}

/// Takes names out that the others do not need. A free dependence is no other name: it may span any of them.
fn without_idle(data: &Data, chosen: Judged, untold: Untold) -> Judged {
    let mut names = chosen.clone();
    if !chosen.extra.is_empty() {
        match again(data, &chosen.model, &[], &chosen) {
            Some(own) => names = own,
            None => return chosen,
        }
    }
    let all = names.model.terms.len();
    while names.model.terms.len() > 1 {
        let Some(fewer) = without_least_needed(data, &names, untold) else {
            break;
        };
        names = fewer;
    }
    if names.model.terms.len() == all {
        return chosen;
    }
    again(data, &names.model, &chosen.extra, &names).unwrap_or(names)
}

/// The model without the name that least speaks for among those that the others do not need; nothing where all are
/// needed.
fn without_least_needed(data: &Data, names: &Judged, untold: Untold) -> Option<Judged> {
    let idle = (0..names.model.terms.len()).filter_map(|at| {
        let mut model = names.model.clone();
        let term = model.terms.remove(at);
        let fewer = again(data, &model, &[], names)?;
        // Both under one noise: that of the model without it, as when it was taken up.
        let with = judge(data, &names.model, &[], Guess::Under(&fewer), effort(data))?;
        let claim = Claim::Mechanism(data.catalogue.get(term.entry).id(), term.entry);
        let trial = Before::new(data, &fewer, untold, 0.0).tried(claim, with, f64::INFINITY);
        (!needed(&trial)).then(|| (trial.weight(), fewer))
    });
    let least = idle.min_by(|a, b| a.0.total_cmp(&b.0));
    least.map(|(_, fewer)| fewer)
}
