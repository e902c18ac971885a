//! Which mechanisms are named: candidates by their score, finalists at their own best, unseen runs last.

mod finalists;
mod rank;
mod trial;

use finalists::{Screen, effort};
use rank::rank;
pub use rank::softness;
use trial::{Before, left_open, needed, stands};
pub use trial::{Claim, Trial, could_stand, rivals};

use crate::chain::timing::Untold;
use crate::constants::{
    ALIKE_NATS, DEPENDENCE_NATS, DEPENDENCE_SHARE, FORM_LEFT, MOST_NAMES, STILL_SPEAKS,
};
use crate::data::Data;
use crate::innovations::dependence::{self, Dependence};
use crate::innovations::hypothesis::{Guess, Judged, judge, judge_added};
use crate::looked::Seen;
use crate::mechanism::{Balance, Id, Kind, Memory};
use crate::model::Model;

/// How often the noise of a model is fitted anew before others are tried beside it.
const MOST_SETTLING: usize = 5;

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

/// What was taken up in the rounds before.
#[derive(Default)]
struct TakenUp {
    /// Names, and how much spoke for each.
    names: Vec<(Id, f64)>,
    /// What all of it gained at the sensors' noise, in nats.
    at_sensors: f64,
    /// Names that stood beside what was taken up before, and how much spoke for each.
    stood: Vec<(Id, f64)>,
    /// Names that counter-forms refuted: beside what was taken up in their place they are what its form leaves.
    refuted: Vec<Id>,
}

impl TakenUp {
    fn add(&mut self, trial: &Trial) {
        self.at_sensors += trial.at_sensors.0.max(0.0);
        let name = trial.mechanism().map(|(id, _)| (id, trial.weight()));
        self.names.extend(name);
    }

    /// Whether a name stood before, and what was taken up since has taken little of what speaks for it: of two effects the
    /// order in which they are found is an accident.
    fn still_stands(&self, trial: &Trial) -> bool {
        let Some((id, _)) = trial.mechanism() else {
            return false;
        };
        let as_much =
            |&(other, weight): &(Id, f64)| other == id && trial.weight() > STILL_SPEAKS * weight;
        could_stand(trial) && self.stood.iter().any(as_much)
    }
}

/// Whether a trial is of an alias of what was named, and so small beside it that it is what that name's form leaves.
fn left_by_form(trial: &Trial, before: &TakenUp) -> bool {
    let Some((id, _)) = trial.mechanism() else {
        return false;
    };
    before.names.iter().any(|&(other, weight)| {
        let small = trial.weight() < FORM_LEFT * weight;
        small && is_alias(id, other)
    })
}

/// The trial that is taken up: a mechanism, unless a free dependence accounts for much more in a balance that it touches.
/// One in another balance is no other account of it, and has its turn later.
fn next<'a>(data: &Data, trials: &'a [Trial], before: &TakenUp) -> Option<&'a Trial> {
    let own = |t: &&Trial| (stands(t) || before.still_stands(t)) && !left_by_form(t, before);
    let standing = || trials.iter().filter(own);
    let Some(named) = standing().find(|t| t.mechanism().is_some()) else {
        return standing().next();
    };
    // That something is there is shown by what stands; what it is, by what all recordings together say.
    let likelier = |t: &&Trial| {
        let of_same = t.claim.balance(data) == named.claim.balance(data);
        t.mechanism().is_some() && of_same && could_stand(t) && !left_by_form(t, before)
    };
    let named = trials.iter().find(likelier).map_or(named, |likeliest| {
        let apart = likeliest.weight() - named.weight() > softness(likeliest.weight());
        if apart { likeliest } else { named }
    });
    let named = standing()
        .find(|t| in_more_balances(data, t, named))
        .unwrap_or(named);
    // Much more at the sensors' noise, too: what the runs' own differences hide of a name says nothing against it.
    let of_named = touches(data, named);
    let instead = |t: &&Trial| {
        of_named.contains(&t.claim.balance(data))
            && much_more(t.weight(), named.weight())
            && much_more(t.at_sensors.0, named.at_sensors.0)
    };
    let mut free = standing().filter(|t| t.mechanism().is_none());
    Some(free.find(instead).unwrap_or(named))
}

/// Whether one gain is so much more than another that the other's form does not make up for it.
fn much_more(own: f64, than: f64) -> bool {
    own > DEPENDENCE_SHARE * than + DEPENDENCE_NATS
}

/// Balances that a name touches, of those that the recordings form.
fn touches(data: &Data, trial: &Trial) -> Vec<Balance> {
    let entry = trial.mechanism().map(|(_, entry)| entry);
    let all = entry.map_or(&[][..], |entry| data.catalogue.get(entry).guide().touches);
    let formed = all.iter().copied().filter(|balance| data.forms(*balance));
    formed.collect()
}

/// Whether a trial is of an alias of a name that accounts for what more balances show, and for much more: one number fits
/// all of them.
fn in_more_balances(data: &Data, trial: &Trial, named: &Trial) -> bool {
    let (Some((id, _)), Some((of, _))) = (trial.mechanism(), named.mechanism()) else {
        return false;
    };
    let wider = || wider(&touches(data, trial), &touches(data, named));
    is_alias(id, of) && much_more(trial.at_sensors.0, named.at_sensors.0) && wider()
}

/// Whether a name is an alias of another.
fn is_alias(id: Id, of: Id) -> bool {
    of.aliases().iter().any(|alias| alias.with == id)
}

/// Whether these balances are all of those, and more.
fn wider(these: &[Balance], those: &[Balance]) -> bool {
    these.len() > those.len() && those.iter().all(|balance| these.contains(balance))
}

/// What every round is held with.
struct Question<'a> {
    data: &'a Data,
    free: Vec<Dependence>,
    excluded: &'a [Id],
    untold: Untold,
}

impl Question<'_> {
    /// One round beside a model: all trials, best first, and how large each mechanism would have to be to be seen.
    fn round(&self, so_far: &Judged, taken_up: &TakenUp) -> (Vec<Trial>, Vec<Seen>) {
        let data = self.data;
        let before = Before::new(data, so_far, self.untold, taken_up.at_sensors);
        let screen = Screen::new(data, before, &self.free, self.excluded);
        let mut trials = screen.trials();
        self.tell_from_clocks(&screen, &mut trials);
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
        let by_clock = |t: &&Trial| memory_of(data, t).is_some_and(|kind| kind != Kind::Tyre);
        let mut clocks: Vec<[f64; 2]> = trials.iter().filter(by_clock).map(gains_of).collect();
        if clocks.is_empty() {
            let all = clocks_of(data);
            let tried = screen.trials_of(&all);
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
    /// `beside` them.
    fn hold_beside_chain(&self, beside: &[Trial], trials: &mut [Trial], taken_up: &TakenUp) {
        let data = self.data;
        let of_chain = |t: &&Trial| !t.outlasts_chain;
        let memories: Vec<Trial> = trials
            .iter()
            .chain(beside)
            .filter(of_chain)
            .cloned()
            .collect();
        for memory in memories {
            let of_memory = touches(data, &memory);
            let outweighed = |trial: &&mut Trial| {
                let named = trial.mechanism().is_some() && could_be_taken(trial);
                named
                    && !trial.remembers
                    && of_memory.contains(&trial.claim.balance(data))
                    && outweighs(&memory, trial)
            };
            let mut outweighed = trials.iter_mut().filter(outweighed).peekable();
            if outweighed.peek().is_none() {
                continue;
            }
            let with_memory = settled(data, under_own_noise(data, memory.judged.clone()));
            let at_sensors = taken_up.at_sensors + memory.at_sensors.0.max(0.0);
            let before = Before::new(data, &with_memory, self.untold, at_sensors);
            for trial in outweighed {
                trial.beside_chain = stands_beside(data, trial, &before);
            }
        }
    }
}

/// Whether more speaks for a memory of the chain's than for a name: clearly more, but where a chain leaves what looks like the
/// name, too, for that has nothing but its weight to speak for it.
fn outweighs(memory: &Trial, trial: &Trial) -> bool {
    let least = if trial.fed_by_chain {
        0.0
    } else {
        softness(memory.weight())
    };
    memory.weight() - trial.weight() > least
}

/// Names that a counter-form clearly outweighs: what there is of them is something else.
fn refuted(data: &Data, trials: &[Trial]) -> Vec<Id> {
    let weights = |counter: bool| {
        trials.iter().filter_map(move |t| {
            let (id, entry) = t.mechanism()?;
            let own = data.catalogue.get(entry).facts().counter_form == counter;
            own.then(|| (id, t.weight()))
        })
    };
    let most = |id: Id| {
        let own = weights(false).filter(|own| own.0 == id);
        own.map(|own| own.1).fold(f64::NEG_INFINITY, f64::max)
    };
    weights(true)
        .filter(|&(id, weight)| weight - most(id) > softness(weight))
        .map(|own| own.0)
        .collect()
}

/// Whose memory of the tyre's balance a trial is of.
fn memory_of(data: &Data, trial: &Trial) -> Option<Kind> {
    let (_, entry) = trial.mechanism().filter(|_| trial.remembers)?;
    let mechanism = data.catalogue.get(entry);
    (mechanism.id().balance() == Balance::Tyre).then(|| mechanism.guide().kind)
}

/// Memories of the drag that go by the clock.
fn clocks_of(data: &Data) -> Vec<Id> {
    let entries = data.catalogue.entries().iter();
    let clocks = entries.filter(|mechanism| {
        let guide = mechanism.guide();
        let of_drag = mechanism.facts().through_force && mechanism.id().balance() == Balance::Tyre;
        of_drag && guide.memory == Memory::Kernel && guide.kind != Kind::Tyre
    });
    let mut ids: Vec<Id> = clocks.map(|mechanism| mechanism.id()).collect();
    ids.sort_unstable();
    ids.dedup();
    ids
}

/// What a trial gains at both levels of the noise, nats.
fn gains_of(trial: &Trial) -> [f64; 2] {
    [trial.gain, trial.at_sensors.0].map(|gain| gain.max(0.0))
}

/// Whether a trial gains much more than this at both levels of the noise.
fn says_much_more(trial: &Trial, than: [f64; 2]) -> bool {
    much_more(trial.gain, than[0]) && much_more(trial.at_sensors.0, than[1])
}

/// Lets a memory of the tyre that the timing is too vague for outlast the chain where it says much more than every memory
/// of the drag that goes by the clock, each with what it gains: a tyre goes by how far it has rolled. From none nothing is
/// told.
fn tell_from_clocks(data: &Data, trials: &mut [Trial], clocks: &[[f64; 2]]) {
    if clocks.is_empty() {
        return;
    }
    let own = trials.iter_mut();
    for trial in own.filter(|t| t.lasts && memory_of(data, t) == Some(Kind::Tyre)) {
        trial.outlasts_chain |= clocks.iter().all(|clock| says_much_more(trial, *clock));
    }
}

/// Takes names from trials that these refute, or that were refuted before.
fn refute(data: &Data, trials: &mut [Trial], before: &[Id]) {
    let now = refuted(data, trials);
    for trial in trials {
        let lost = |id: Id| now.contains(&id) || before.contains(&id);
        trial.own &= !trial.mechanism().is_some_and(|(id, _)| lost(id));
    }
}

/// Whether a trial is one that [`next`] may take.
fn could_be_taken(trial: &Trial) -> bool {
    stands(trial) || could_stand(trial)
}

/// Whether a mechanism could still be taken beside a model that has what it was tried without. How large it is was settled
/// where it was tried; what cannot be judged beside the other is not told from it.
fn stands_beside(data: &Data, trial: &Trial, before: &Before<'_>) -> bool {
    let with_other = before.judged;
    let Some((_, entry)) = trial.mechanism() else {
        return false;
    };
    let mut model = with_other.model.clone();
    let own = trial.judged.model.terms.iter().filter(|t| t.entry == entry);
    model.terms.extend(own.cloned());
    let both = judge_added(
        data,
        &model,
        &with_other.extra,
        before.beside(),
        effort(data),
    );
    both.is_some_and(|both| {
        let again = before.tried(trial.claim.clone(), both, trial.size);
        stands(&again) || !stands(trial) && could_stand(&again)
    })
}

/// Decides what is named beside the base model; `untold` is what the chain's own timing does not tell.
#[must_use]
pub fn decide(data: &Data, base: Judged, excluded: &[Id], untold: Untold) -> Decision {
    let question = Question {
        data,
        free: dependence::all(data),
        excluded,
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

/// A model whose noise is fitted until it stays: what it is short of its best would count for what is tried beside it.
fn settled(data: &Data, mut judged: Judged) -> Judged {
    for _ in 0..MOST_SETTLING {
        let guess = Guess::Sizes(&judged.parts);
        let Some(next) = judge(data, &judged.model, &judged.extra, guess, effort(data)) else {
            break;
        };
        let gained = judged.loss - next.loss;
        if gained > 0.0 {
            judged = next;
        }
        if gained < ALIKE_NATS {
            break;
        }
    }
    judged
}

/// The model so far under noise like a trial's, where that is better: sizes of the noise that only the trial came
/// upon are no gain of its.
fn at_noise_of(data: &Data, so_far: &Judged, trial: &Trial) -> Option<Judged> {
    let guess = Guess::Sizes(&trial.judged.parts);
    let again = judge(data, &so_far.model, &so_far.extra, guess, effort(data))?;
    (again.loss < so_far.loss - ALIKE_NATS).then_some(again)
}

/// A model that was judged under another's noise, judged anew under what its own force makes of it.
fn under_own_noise(data: &Data, judged: Judged) -> Judged {
    again(data, &judged.model, &judged.extra, &judged).unwrap_or(judged)
}

/// Judges a model anew from the noise of one that is like it.
fn again(data: &Data, model: &Model, extra: &[Dependence], like: &Judged) -> Option<Judged> {
    judge(data, model, extra, Guess::Sizes(&like.parts), effort(data))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::innovations::toy::{self, Noise, stop};

    /// A trial of a name that is clear: as many nats at both levels of the noise, unseen runs with this t.
    fn of_name(data: &Data, base: &Judged, id: Id, nats: f64, t: f64) -> Trial {
        Trial {
            claim: Claim::Mechanism(id, toy::entry_of(data, id)),
            gain: nats,
            price: 0.0,
            unseen: (nats, t),
            runs: 6,
            at_sensors: (nats, t),
            first: false,
            own: true,
            says_as_well: None,
            fed_by_chain: false,
            remembers: false,
            lasts: true,
            outlasts_chain: true,
            beside_chain: true,
            readings: 1,
            size: f64::INFINITY,
            predicts: 0.2,
            unanimous: [false, false],
            judged: base.clone().without_columns(),
        }
    }

    #[test]
    fn a_gain_that_no_chain_leaves_needs_no_more_even_runs_than_what_chains_do_not_feed() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        // So many nats on each of six unseen runs.
        let fed = |nats: f64, t: f64| Trial {
            fed_by_chain: true,
            predicts: 0.5,
            ..of_name(&data, &base, Id::StructuralResonance, nats, t)
        };
        assert!(stands(&fed(60.0, 1.6)));
        assert!(!stands(&fed(60.0, 1.4)) && !stands(&fed(40.0, 1.6)));
        assert!(stands(&fed(40.0, 2.1)));
    }

    #[test]
    fn a_dependence_that_few_runs_reach_is_left_open_where_none_speaks_against_it() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let free = dependence::all(&data).swap_remove(0);
        let is_open = |nats, predicts, against: bool| {
            left_open(&Trial {
                claim: Claim::Dependence(free.clone()),
                gain: -5.0,
                at_sensors: (nats, 1.0),
                predicts,
                unanimous: [false, !against],
                ..of_name(&data, &base, Id::LoadSensitivity, nats, 0.5)
            })
        };
        assert!(is_open(200.0, 0.6, false));
        assert!(!is_open(200.0, 0.6, true));
        assert!(!is_open(200.0, 0.4, false) && !is_open(100.0, 0.6, false));
        // Of a large gain less is asked.
        assert!(is_open(600.0, 0.1, false));
        assert!(!is_open(600.0, 0.1, true) && !is_open(600.0, 0.04, false));
    }

    #[test]
    fn a_name_is_refuted_by_its_counter_form_where_that_says_clearly_more() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let entries = data.catalogue.entries();
        let counter = entries.iter().position(|m| m.facts().counter_form).unwrap();
        let stays_beside = |before: &[Id], of_counter: f64, named: Id| {
            let mut trials = [
                of_name(&data, &base, named, 100.0, 3.0),
                Trial {
                    claim: Claim::Mechanism(entries[counter].id(), counter),
                    ..of_name(&data, &base, Id::SlipHysteresis, of_counter, 3.0)
                },
            ];
            refute(&data, &mut trials, before);
            trials[0].own
        };
        let stays = |of_counter: f64, named: Id| stays_beside(&[], of_counter, named);
        // Softness of 110 nats is 7.3.
        assert!(!stays(110.0, Id::SlipHysteresis));
        assert!(stays(106.0, Id::SlipHysteresis));
        assert!(stays(900.0, Id::LoadSensitivity));
        // Once refuted it stays so beside what was taken up in its place.
        assert!(!stays_beside(
            &[Id::SlipHysteresis],
            10.0,
            Id::SlipHysteresis
        ));
    }

    #[test]
    fn a_tyre_s_memory_that_outweighs_all_in_time_is_none_of_the_chain_s() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let memory = |id, nats, at_sensors| Trial {
            remembers: true,
            lasts: true,
            outlasts_chain: false,
            at_sensors: (at_sensors, 3.0),
            ..of_name(&data, &base, id, nats, 3.0)
        };
        let told_from = |clocks: &[[f64; 2]]| {
            let mut trials = [
                memory(Id::RelaxationLength, 72.0, 85.0),
                memory(Id::ForceLag, 72.0, 85.0),
            ];
            tell_from_clocks(&data, &mut trials, clocks);
            trials.map(|t| t.outlasts_chain)
        };
        let told = |lag| told_from(&[[0.0; 2], lag]);
        // Much more is a third and 15 nats; of the lag itself nothing is said.
        assert_eq!(told([2.0, 8.0]), [true, false]);
        assert_eq!(told([45.0, 8.0]), [false, false]);
        assert_eq!(told([2.0, 60.0]), [false, false]);
        // What was not asked cannot be told from.
        assert_eq!(told_from(&[]), [false, false]);
    }

    #[test]
    fn a_lag_a_delay_and_a_mode_of_the_load_cell_go_by_the_clock() {
        let data = stop(Noise::TYPICAL, 4);
        assert_eq!(
            clocks_of(&data),
            [Id::ForceDelay, Id::ForceLag, Id::StructuralResonance]
        );
    }

    #[test]
    fn what_a_chain_leaves_too_is_outweighed_by_any_memory_of_the_chain_that_is_heavier() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let of = |id, nats, fed_by_chain| Trial {
            fed_by_chain,
            ..of_name(&data, &base, id, nats, 3.0)
        };
        // Softness of 100 nats is 7.
        let memory = of(Id::RelaxationLength, 100.0, true);
        assert!(outweighs(&memory, &of(Id::SlipHysteresis, 99.0, true)));
        assert!(!outweighs(&memory, &of(Id::SlipHysteresis, 101.0, true)));
        assert!(!outweighs(&memory, &of(Id::LoadSensitivity, 94.0, false)));
        assert!(outweighs(&memory, &of(Id::LoadSensitivity, 92.0, false)));
    }

    #[test]
    fn several_runs_that_agree_on_the_drag_are_enough_where_no_chain_leaves_the_like() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let wear = |t: f64, predicts: f64| Trial {
            predicts,
            at_sensors: (2.0, 1.0),
            ..of_name(&data, &base, Id::WearDrift, 2.0, t)
        };
        assert!(stands(&wear(3.6, 0.32)) && needed(&wear(3.6, 0.32)));
        let refused = [
            wear(2.9, 0.32),
            wear(3.6, 0.2),
            // An inertia predicts no drag.
            wear(3.6, f64::INFINITY),
            Trial {
                fed_by_chain: true,
                ..wear(3.6, 0.32)
            },
            Trial {
                runs: 3,
                ..wear(3.6, 0.32)
            },
            Trial {
                gain: -0.1,
                ..wear(3.6, 0.32)
            },
        ];
        assert!(refused.iter().all(|trial| !stands(trial) && !needed(trial)));
    }

    #[test]
    fn what_does_not_stand_for_its_size_alone_is_a_rival_of_what_stands() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let radius = |nats: f64, t: f64| Trial {
            at_sensors: (nats, 1.0),
            predicts: 0.2,
            ..of_name(&data, &base, Id::EffectiveRadius, nats, t)
        };
        let small = |trial: Trial| Trial { size: 0.0, ..trial };
        assert!(stands(&radius(9.0, 3.0)) && rivals(&radius(9.0, 3.0)));
        assert!(!stands(&small(radius(9.0, 3.0))) && rivals(&small(radius(9.0, 3.0))));
        // As large as may be, but not seen.
        assert!(!rivals(&radius(9.0, 1.2)) && !rivals(&radius(3.0, 2.9)));
        // Small, and hidden by the runs' own differences.
        let hidden = Trial {
            first: true,
            at_sensors: (60.0, 9.0),
            ..radius(1.0, 0.0)
        };
        assert!(!stands(&small(hidden.clone())) && rivals(&small(hidden)));
        let refuted = Trial {
            own: false,
            ..radius(9.0, 3.0)
        };
        assert!(!rivals(&refuted));
    }

    #[test]
    fn one_parameter_that_two_balances_bear_out_comes_before_one_that_one_of_them_does() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let first = |gain_at_sensors: f64, mass_at_sensors: f64| {
            let at = |id, nats, at_sensors| Trial {
                at_sensors: (at_sensors, 14.0),
                ..of_name(&data, &base, id, nats, 3.0)
            };
            let mut trials = [
                at(Id::VehicleInertia, 20.0, mass_at_sensors),
                at(Id::ForceGain, 8.0, gain_at_sensors),
            ];
            rank(&data, &mut trials);
            let taken = next(&data, &trials, &TakenUp::default()).unwrap();
            taken.mechanism().unwrap().0
        };
        assert_eq!(first(1500.0, 900.0), Id::ForceGain);
        // The wheel balance says nothing for it.
        assert_eq!(first(900.0, 900.0), Id::VehicleInertia);
        assert_eq!(first(900.0, 2500.0), Id::VehicleInertia);
    }

    #[test]
    fn a_name_that_stood_before_another_was_taken_up_stands_while_as_much_speaks_for_it() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let load = |nats, t| of_name(&data, &base, Id::LoadSensitivity, nats, t);
        let stood = load(100.0, 3.0);
        let mut before = TakenUp::default();
        before.add(&of_name(&data, &base, Id::EncoderRipple, 600.0, 3.0));
        before.stood = vec![(Id::LoadSensitivity, stood.weight())];
        let is_taken = |trial: Trial, before: &TakenUp| next(&data, &[trial], before).is_some();
        // Less even than before it would not stand by itself.
        assert!(is_taken(load(100.0, 3.0), &TakenUp::default()));
        assert!(!is_taken(load(90.0, 1.3), &TakenUp::default()));
        assert!(is_taken(load(90.0, 1.3), &before));
        // Nor where what was taken up says most of it, or where it is not even likely.
        assert!(!is_taken(load(40.0, 1.3), &before));
        assert!(!is_taken(load(90.0, 0.5), &before));
        // Nothing is said of other names.
        let other = of_name(&data, &base, Id::WearDrift, 90.0, 1.3);
        assert!(!is_taken(other, &before));
    }
}
