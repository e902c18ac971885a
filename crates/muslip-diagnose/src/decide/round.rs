//! One round: what is tried beside the model so far, and what of it is the chain's.

use super::finalists::{Screen, effort};
use super::memory::{
    clocks_of, far_heavier, gains_of, memory_of, outweighs, says_much_more, tell_from_clocks,
};
use super::next::{TakenUp, could_be_taken, next, touches};
use super::rank::rank;
use super::refuted::refute;
use super::settled::{settled, under_own_noise};
use super::stands::{could_stand, stands};
use super::trial::{Before, Trial};
use crate::chain::untold::Untold;
use crate::data::Data;
use crate::innovations::dependence::Dependence;
use crate::innovations::hypothesis::{Judged, judge_added};
use crate::looked::Seen;
use crate::mechanism::{Id, Kind};

/// What is asked for: what not, and what in any case.
#[derive(Default)]
pub struct Asked {
    /// Mechanisms that are not asked for.
    pub excluded: Vec<Id>,
    /// Entries of what the same question came to with more recordings, which is judged whatever the screen has it gain.
    pub named: Vec<usize>,
}

/// What every round is held with.
pub struct Question<'a> {
    /// The recordings at one time.
    pub data: &'a Data,
    /// Free dependences.
    pub free: Vec<Dependence>,
    /// What is asked for.
    pub asked: &'a Asked,
    /// What the chain's own timing does not tell.
    pub untold: Untold,
}

impl Question<'_> {
    /// One round beside a model: all trials, best first, and how large each mechanism would have to be to be seen.
    pub fn round(&self, so_far: &Judged, taken_up: &TakenUp) -> (Vec<Trial>, Vec<Seen>) {
        let data = self.data;
        let before = Before::new(data, so_far, self.untold, taken_up.at_sensors);
        let screen = Screen::new(data, before, &self.free, &self.asked.excluded);
        let mut trials = screen.trials();
        self.tell_from_clocks(&screen, &mut trials);
        self.judge_named(&screen, &mut trials);
        refute(data, &mut trials, &taken_up.refuted);
        self.hold_beside_chain(&[], &mut trials, taken_up);
        // What only the chain remembers has taken the place of other names.
        let of_chain = trials.iter().any(|t| !t.outlasts_chain);
        if of_chain && next(data, &trials, taken_up).is_none() {
            let tried: Vec<Id> = trials
                .iter()
                .filter_map(|t| Some(t.mechanism()?.0))
                .collect();
            let mut others = screen.trials_without(&tried);
            self.hold_beside_chain(&trials, &mut others, taken_up);
            trials.extend(others);
            self.tell_from_clocks(&screen, &mut trials);
            refute(data, &mut trials, &taken_up.refuted);
            rank(data, &mut trials);
        }
        (trials, screen.seen())
    }

    /// Judges what was named before where it is not among the trials: how a form scores where it starts says little of what it
    /// gains at its best.
    fn judge_named(&self, screen: &Screen<'_>, trials: &mut Vec<Trial>) {
        let is_tried = |entry: usize| {
            let own = |t: &Trial| t.mechanism().is_some_and(|own| own.1 == entry);
            trials.iter().any(own)
        };
        let named = self.asked.named.iter().copied();
        let untried: Vec<usize> = named.filter(|entry| !is_tried(*entry)).collect();
        if untried.is_empty() {
            return;
        }
        let mut judged = screen.trials_of(&untried);
        self.tell_from_clocks(screen, &mut judged);
        trials.extend(judged);
        rank(self.data, trials);
    }

    /// The same as [`tell_from_clocks`] where no wheel is late by turn, for that goes by how far it has rolled as well. Where
    /// no memory that goes by the clock gains enough to be among the trials, all are tried beside them.
    fn tell_from_clocks(&self, screen: &Screen<'_>, trials: &mut [Trial]) {
        let data = self.data;
        let could_be_told = |t: &Trial| {
            let of_tyre = memory_of(data, t) == Some(Kind::Tyre);
            of_tyre && t.lasts && !t.outlasts_chain && says_much_more(t, [0.0; 2])
        };
        if self.untold.by_turn || !trials.iter().any(could_be_told) {
            return;
        }
        // What is fast in the slip is no part of what a relaxation, or another memory, is made of.
        let of_smooth = |entry: usize| !data.catalogue.is_of_fast_force(entry);
        let by_clock = |t: &&Trial| {
            let smooth = t.mechanism().is_some_and(|(_, entry)| of_smooth(entry));
            smooth && memory_of(data, t).is_some_and(|kind| kind != Kind::Tyre)
        };
        let mut clocks: Vec<[f64; 2]> = trials.iter().filter(by_clock).map(gains_of).collect();
        if clocks.is_empty() {
            let all = clocks_of(data);
            let entries = data.catalogue.entries().iter().enumerate();
            let of_clocks = entries.filter(|(_, own)| all.contains(&own.id()));
            let of_clocks = of_clocks.map(|(entry, _)| entry);
            let of_clocks: Vec<usize> = of_clocks.filter(|entry| of_smooth(*entry)).collect();
            let tried = screen.trials_of(&of_clocks);
            let is_tried = |id: &Id| {
                tried
                    .iter()
                    .any(|t| t.mechanism().is_some_and(|own| own.0 == *id))
            };
            // One that is named already, or is not asked for, tells nothing from itself.
            if !all.iter().all(is_tried) {
                return;
            }
            clocks = tried.iter().map(gains_of).collect();
        }
        tell_from_clocks(data, trials, &clocks);
    }

    /// Holds names that stand, or could in another's place, beside each memory of the chain's that outweighs them: torque
    /// or drag that comes late is an inertia, too, where nothing else is asked. Memories are among the trials and those
    /// `beside` them; of one that a far heavier one may leave counts what it gains beside that.
    fn hold_beside_chain(&self, beside: &[Trial], trials: &mut [Trial], taken_up: &TakenUp) {
        let data = self.data;
        let of_chain = |t: &&Trial| !t.outlasts_chain;
        let memories: Vec<Trial> = trials
            .iter()
            .chain(beside)
            .filter(of_chain)
            .cloned()
            .collect();
        for memory in &memories {
            let of_memory = touches(data, memory);
            let outweighed = |trial: &Trial, memory: &Trial| {
                let named = trial.mechanism().is_some() && could_be_taken(trial);
                named
                    && !trial.remembers
                    && of_memory.contains(&trial.claim.balance(data))
                    && outweighs(memory, trial)
            };
            let mut held: Vec<&mut Trial> = trials.iter_mut().collect();
            held.retain(|trial| outweighed(trial, memory));
            let heavier = far_heavier(data, memory, &memories).filter(|_| !held.is_empty());
            let left = heavier.and_then(|other| {
                self.beside_memory(other, taken_up, |before| {
                    beside_others(data, memory, before)
                })
            });
            if let Some(left) = left {
                held.retain(|trial| outweighed(trial, &left));
            }
            if held.is_empty() {
                continue;
            }
            self.beside_memory(memory, taken_up, |before| {
                for trial in held {
                    trial.beside_chain = stands_beside(data, trial, before);
                }
            });
        }
    }

    /// What is to be said beside a model that has a memory.
    fn beside_memory<R>(
        &self,
        memory: &Trial,
        taken_up: &TakenUp,
        say: impl FnOnce(&Before<'_>) -> R,
    ) -> R {
        let data = self.data;
        let with_memory = settled(data, under_own_noise(data, memory.judged.clone()));
        let at_sensors = taken_up.at_sensors + memory.at_sensors.0.max(0.0);
        say(&Before::new(data, &with_memory, self.untold, at_sensors))
    }
}

/// A mechanism beside a model that has what it was tried without; nothing where it cannot be judged there.
fn beside_others(data: &Data, trial: &Trial, before: &Before<'_>) -> Option<Trial> {
    let with_other = before.judged;
    let (_, entry) = trial.mechanism()?;
    let mut model = with_other.model.clone();
    let own = trial.judged.model.terms.iter().filter(|t| t.entry == entry);
    model.terms.extend(own.cloned());
    let both = judge_added(
        data,
        &model,
        &with_other.extra,
        before.beside(),
        effort(data),
    )?;
    // How large it is was settled where it was tried.
    Some(before.tried(trial.claim.clone(), both, trial.size))
}

/// Whether a mechanism could still be taken beside a model that has what it was tried without; what cannot be judged there is
/// not told from it.
fn stands_beside(data: &Data, trial: &Trial, before: &Before<'_>) -> bool {
    beside_others(data, trial, before)
        .is_some_and(|again| stands(&again) || !stands(trial) && could_stand(&again))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::innovations::toy::{Noise, entry_of, settled as toy_settled, stop};

    #[test]
    fn what_was_named_before_is_judged_whatever_the_screen_has_it_gain() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy_settled(&data);
        let lag = entry_of(&data, Id::ForceLag);
        let is_judged = |asked: &Asked| {
            let question = Question {
                data: &data,
                free: Vec::new(),
                asked,
                untold: Untold::default(),
            };
            let (trials, _) = question.round(&base, &TakenUp::default());
            let mut own = trials.iter().filter_map(Trial::mechanism);
            own.any(|own| own.1 == lag)
        };
        // Nothing is missing, so a lag is not among the best.
        assert!(!is_judged(&Asked::default()));
        let named = Asked {
            named: vec![lag],
            ..Asked::default()
        };
        assert!(is_judged(&named));
        let excluded = Asked {
            excluded: vec![Id::ForceLag],
            ..named
        };
        assert!(!is_judged(&excluded));
    }
}
