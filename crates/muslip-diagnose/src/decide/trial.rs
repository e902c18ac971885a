//! What a claim gains beside the model so far.

use crate::chain::untold::Untold;
use crate::constants::{
    FEWEST_RUNS_AGREED, LARGE_GAIN_OF_BRAKE, LEAST_EFFECT, LEAST_MEMORY_S, LEAST_STD_S, LEAST_T,
    MOST_AGAINST, PRICE_OF_NAME, PRICE_OF_PARAMETER, REAL_MEMORY_PREDICTED, REAL_MEMORY_T,
    STEPS_UNCHAINED, WORTHS_OF_BRAKE,
};
use crate::data::Data;
use crate::innovations::dependence::Dependence;
use crate::innovations::hypothesis::{Beside, Judged, Unseen};
use crate::law::{closest, squares_and_within_runs};
use crate::mechanism::{Balance, Id, Kind, Memory};
use crate::model::Term;
use crate::number::mean_and_std;
use crate::variable::Variable;

/// What a trial adds to a model.
#[derive(Clone)]
pub enum Claim {
    /// A mechanism of the vocabulary, by its entry of the catalogue.
    Mechanism(Id, usize),
    /// A free dependence on a variable.
    Dependence(Dependence),
}

impl Claim {
    /// The mechanism and its entry, where it is one.
    fn mechanism(&self) -> Option<(Id, usize)> {
        match self {
            Self::Mechanism(id, entry) => Some((*id, *entry)),
            Self::Dependence(_) => None,
        }
    }

    /// The balance that it is of.
    pub fn balance(&self, data: &Data) -> Balance {
        match self {
            Self::Mechanism(_, entry) => data.catalogue.get(*entry).id().balance(),
            Self::Dependence(own) => own.balance,
        }
    }

    /// What belongs to a run cannot be carried to another: its first half tells its second.
    fn is_per_run(&self, data: &Data) -> bool {
        match self {
            Self::Mechanism(_, entry) => data.catalogue.get(*entry).form().contains("per_run"),
            Self::Dependence(own) => own.is_per_run(),
        }
    }

    /// Whether it works through the force that is predicted.
    fn works_through_force(&self, data: &Data) -> bool {
        match self {
            Self::Mechanism(_, entry) => data.catalogue.get(*entry).facts().through_force,
            Self::Dependence(own) => own.balance == Balance::Tyre,
        }
    }
}

/// A claim as it stands against the model without it.
#[derive(Clone)]
pub struct Trial {
    /// Which.
    pub claim: Claim,
    /// Gain in nats, prices taken off.
    pub gain: f64,
    /// Prices taken off the gain in nats.
    pub price: f64,
    /// Mean gain on unseen runs in nats, and its t over the runs.
    pub unseen: (f64, f64),
    /// On how many unseen runs.
    pub runs: usize,
    /// [`Data::share`].
    pub share: f64,
    /// Gain on all unseen runs in nats if the noise were no larger than the sensors make plausible, and the t of the
    /// runs' gains under the root, signs kept: they are as uneven as the runs.
    pub at_sensors: (f64, f64),
    /// Whether nothing was named before it in its balance, errors of the speeds left aside, or less than it gains at the
    /// sensors' noise: what a name leaves is easily that name's own form.
    pub first: bool,
    /// Whether its parameters are the mechanism's own, plausible, and not at a limit where its form is another's; and no
    /// counter-form refutes it.
    pub own: bool,
    /// Another mechanism that its parameters say as well.
    pub says_as_well: Option<Id>,
    /// Whether a measuring chain leaves what looks like it.
    pub fed_by_chain: bool,
    /// Whether what the load is read off by looks like it.
    pub like_noise_of_load: bool,
    /// Whether it is the tyre's.
    pub of_tyre: bool,
    /// Whether it rings, longer than any filter of a measuring chain.
    pub rings: bool,
    /// Whether it is a memory: what was before counts.
    pub remembers: bool,
    /// Whether that is as long as a recording can show.
    pub lasts: bool,
    /// Whether its memory is longer than what the chain's own timing was off by, and no longer than the channels show.
    pub outlasts_chain: bool,
    /// Whether it stands beside every memory of the chain's that outweighs it, is none that another leaves, and touches its
    /// balance.
    pub beside_chain: bool,
    /// Readings in the balances that are judged.
    pub readings: usize,
    /// Gain in nats if the noise were no larger than the sensors make plausible: how large the effect is, whatever
    /// the runs' own differences hide of it.
    pub size: f64,
    /// By how much the model with it predicts the drag better: minus the mean over runs of the logarithm of the mean
    /// square error over that without it. Infinite for what does not work through the force.
    pub predicts: f64,
    /// The same where each run has a peak friction of its own: what runs differ by is no more of it.
    pub predicts_within: f64,
    /// Whether no unseen run speaks against it, at the noise as fitted and at the sensors'.
    pub unanimous: [bool; 2],
    /// What all unseen runs gain but the one that gains most, in nats, at both.
    pub without_best: [f64; 2],
    /// The model with it.
    pub judged: Judged,
}

impl Trial {
    /// The mechanism, where it is one.
    #[must_use]
    pub fn mechanism(&self) -> Option<(Id, usize)> {
        self.claim.mechanism()
    }

    /// How alike the runs speak for it: the larger t of the two levels, one of signed roots being about twice the plain
    /// one.
    #[must_use]
    pub fn steadiness(&self) -> f64 {
        self.unseen.1.max(0.5 * self.at_sensors.1)
    }
}

/// What each unseen run gains; half runs where a parameter belongs to its run.
fn gains(base: &Unseen, with: &Unseen, halves: bool) -> Vec<f64> {
    let (a, b) = if halves {
        (&base.halves, &with.halves)
    } else {
        (&base.runs, &with.runs)
    };
    a.iter()
        .zip(b)
        .map(|(a, b)| a - b)
        .filter(|g| g.is_finite() && *g != 0.0)
        .collect()
}

/// Mean and t over the runs.
fn mean_and_t(gains: &[f64]) -> (f64, f64) {
    let n = gains.len() as f64;
    if gains.is_empty() {
        return (0.0, 0.0);
    }
    let (mean, spread) = mean_and_std(gains);
    if gains.len() < 2 {
        return (mean, if mean > 0.0 { LEAST_T } else { 0.0 });
    }
    (mean, mean / spread.max(1e-9) * n.sqrt())
}

/// Sum, and t of the signed roots.
fn sum_and_t(gains: &[f64]) -> (f64, f64) {
    let roots: Vec<f64> = gains.iter().map(|g| g.signum() * g.abs().sqrt()).collect();
    (gains.iter().sum(), mean_and_t(&roots).1)
}

/// Whether unseen runs together, these gains at the fitted noise and that at the sensors', gain more by a lag of the brake than
/// any reading of a brake through a chain does, of so many readings and this share of the runs: more readings as much more.
fn gains_beyond_reading(gains: &[f64], at_sensors: f64, readings: usize, share: f64) -> bool {
    let least = (LARGE_GAIN_OF_BRAKE * share).max(WORTHS_OF_BRAKE * worth_of(readings));
    gains.len() >= FEWEST_RUNS_AGREED && gains.iter().sum::<f64>().min(at_sensors) > least
}

/// Gain of the least effect that is worth a name, of so many readings, nats.
pub fn worth_of(readings: usize) -> f64 {
    0.5 * LEAST_EFFECT * LEAST_EFFECT * readings as f64
}

/// Whether a claim may be what a name leaves, by whether that is a memory of the force and whether a chain feeds the
/// claim, where it is a mechanism: what such a memory leaves looks like what a chain leaves, or like a dependence on a
/// rate, but like no other mechanism.
fn may_leave(memory_of_force: bool, fed_by_chain: Option<bool>) -> bool {
    !memory_of_force || fed_by_chain != Some(false)
}

/// Whether hardly any of these speaks against what all together show. An effect that few runs reach, a channel's limit
/// or the speed's end, makes gains so uneven that no t shows it; but where it is not it costs nothing.
fn unanimous(gains: &[f64]) -> bool {
    let sum_of = |sign: f64| gains.iter().map(|g| (sign * g).max(0.0)).sum::<f64>();
    gains.len() > 1 && sum_of(-1.0) < MOST_AGAINST * sum_of(1.0)
}

/// The sum of these without the largest.
fn without_best(gains: &[f64]) -> f64 {
    gains.iter().sum::<f64>() - gains.iter().copied().fold(0.0, f64::max)
}

/// A memory, beside what the chain remembers.
struct Remembered {
    /// Whether it is as long as a recording can show.
    lasts: bool,
    /// Whether it is longer than what the chain's own timing was off by, and no longer than the channels show.
    outlasts_chain: bool,
    /// Whether it is of what the timing left to be explained.
    of_left: bool,
}

/// The term of a claim in the model that has it, where it is a mechanism.
fn term_of<'a>(claim: &Claim, judged: &'a Judged) -> Option<&'a Term> {
    let (_, entry) = claim.mechanism()?;
    judged.model.terms.iter().find(|t| t.entry == entry)
}

/// The model so far, as what a trial adds to it is weighed against it.
pub struct Before<'a> {
    data: &'a Data,
    /// It.
    pub judged: &'a Judged,
    /// What the chain's own timing does not tell.
    untold: Untold,
    /// What was taken up before gained at the sensors' noise, in nats.
    taken_up: f64,
    /// Sum of squares of the drag that its best law leaves, by run, and where each run has a peak friction of its own.
    squares: [Vec<f64>; 2],
    /// Its loss and its noise.
    beside: Beside,
    /// What it says of unseen runs where the noise is no larger than the sensors make plausible.
    unseen_at_sensors: Option<Unseen>,
}

impl<'a> Before<'a> {
    pub fn new(data: &'a Data, judged: &'a Judged, untold: Untold, taken_up: f64) -> Self {
        let beside = Beside::new(data, judged);
        Self {
            data,
            judged,
            untold,
            taken_up,
            squares: squares_by_best_law(data, judged),
            unseen_at_sensors: judged.unseen_under(data, &beside.at_sensors),
            beside,
        }
    }

    /// Its loss and its noise.
    pub fn beside(&self) -> &Beside {
        &self.beside
    }

    pub fn tried(&self, claim: Claim, judged: Judged, size: f64) -> Trial {
        let (data, base) = (self.data, self.judged);
        let free = judged.free as f64 - base.free as f64;
        let per_run = claim.is_per_run(data);
        let counts = judged.grams.iter().flatten().map(|g| g.count);
        let readings = counts.sum::<usize>() / judged.parts.len().max(1);
        let mechanism = claim.mechanism();
        let term = term_of(&claim, &judged);
        let fed_by_chain = mechanism.map(|(_, entry)| {
            let own = data.catalogue.get(entry);
            own.fed_by_chain()
                || term.is_some_and(|term| own.begins_with_recordings(&term.parameters))
        });
        let [predicts, predicts_within] = if claim.works_through_force(data) {
            self.predicted_better(&judged)
        } else {
            [f64::INFINITY; 2]
        };
        let own_gains = gains(&base.unseen, &judged.unseen, per_run);
        let gains_at_sensors = self.gains_at_sensors(&judged, per_run);
        let at_sensors = sum_and_t(&gains_at_sensors);
        let own = term.is_none_or(|term| {
            let mechanism = data.catalogue.get(term.entry);
            let facts = mechanism.facts();
            mechanism.owns(&term.parameters, &data.context)
                && mechanism.is_plausible(&term.parameters, &data.context)
                && !facts.counter_form
                && !(facts.another_curve && self.has_a_curve_beside())
        });
        let unseen = mean_and_t(&own_gains);
        let much = gains_beyond_reading(&own_gains, at_sensors.0, readings, data.share);
        let remembered = term.and_then(|term| self.remembered(term, predicts, at_sensors.1, much));
        let of_left = remembered.as_ref().is_some_and(|memory| memory.of_left);
        let price = PRICE_OF_PARAMETER * free + PRICE_OF_NAME;
        Trial {
            gain: base.loss - judged.loss - price,
            price,
            unseen,
            runs: own_gains.len(),
            share: data.share,
            first: !self.is_named_before(&claim, fed_by_chain) || at_sensors.0 > self.taken_up,
            at_sensors,
            own,
            says_as_well: term.and_then(|term| {
                let mechanism = data.catalogue.get(term.entry);
                mechanism.says_as_well(&term.parameters, &data.context)
            }),
            // No chain feeds a memory of what was left to be explained because none shows.
            fed_by_chain: fed_by_chain == Some(true) && !of_left,
            like_noise_of_load: mechanism
                .is_some_and(|(_, entry)| data.catalogue.get(entry).facts().like_noise_of_load),
            of_tyre: mechanism
                .is_some_and(|(_, entry)| data.catalogue.get(entry).guide().kind == Kind::Tyre),
            remembers: remembered.is_some(),
            rings: term.is_some_and(|term| data.catalogue.get(term.entry).rings(&term.parameters)),
            lasts: remembered.as_ref().is_none_or(|memory| memory.lasts),
            outlasts_chain: remembered.is_none_or(|memory| memory.outlasts_chain),
            beside_chain: true,
            predicts,
            predicts_within,
            readings,
            size,
            unanimous: [&own_gains, &gains_at_sensors].map(|gains| unanimous(gains)),
            without_best: [&own_gains, &gains_at_sensors].map(|gains| without_best(gains)),
            judged: judged.without_columns(),
            claim,
        }
    }

    /// Whether friction depends freely on the slip beside the law.
    fn has_a_curve_beside(&self) -> bool {
        let mut beside = self.judged.extra.iter();
        beside.any(|own| own.balance == Balance::Tyre && own.variable == Variable::Slip)
    }

    /// Whether something of a claim's balance is named already that may have left what the claim is of.
    fn is_named_before(&self, claim: &Claim, fed_by_chain: Option<bool>) -> bool {
        let data = self.data;
        let balance = claim.balance(data);
        self.judged.model.terms.iter().any(|term| {
            let mechanism = data.catalogue.get(term.entry);
            let memory_s = mechanism.memory_s(&term.parameters, &data.context);
            let through_force = mechanism.facts().through_force;
            mechanism.id().balance() == balance
                && (balance != Balance::Tyre || through_force)
                && may_leave(memory_s.is_some() && through_force, fed_by_chain)
        })
    }

    /// What a term remembers beside the chain, where it is a memory; by how much better it predicts the drag, and the t of
    /// the gains' roots at the sensors' noise; whether unseen runs gain so `much` at both levels that no reading of a brake
    /// through a chain does.
    fn remembered(
        &self,
        term: &Term,
        predicts: f64,
        t_at_sensors: f64,
        much: bool,
    ) -> Option<Remembered> {
        let data = self.data;
        let mechanism = data.catalogue.get(term.entry);
        let memory_s = mechanism.memory_s(&term.parameters, &data.context)?;
        let in_force = mechanism.facts().through_force;
        let of_left = in_force && self.untold.left;
        let alike = t_at_sensors > REAL_MEMORY_T || of_left;
        let real = in_force && predicts > REAL_MEMORY_PREDICTED && alike;
        let unchained = in_force && self.untold.unchained;
        let shown_s = shortest_shown_s(data, term.entry, real, unchained);
        let least_s = shown_s.max(least_memory_s(data, term.entry, of_left));
        // That a memory is real does not say whose it is: one of the tyre must outlast what it leaves to the chain.
        let guide = mechanism.guide();
        let shortest_s = [
            (!real && !unchained).then_some(self.untold.channels_s),
            (guide.kind == Kind::Tyre && !unchained).then(|| self.untold.shortest_of_tyre_s()),
        ];
        let chain_s = shortest_s.into_iter().flatten().fold(0.0, f64::max);
        let of_brake = guide.kind == Kind::Wheel && guide.memory == Memory::Kernel;
        let longest_s = if of_brake {
            self.untold.longest_of_brake_s()
        } else {
            f64::INFINITY
        };
        Some(Remembered {
            lasts: memory_s > shown_s,
            outlasts_chain: memory_s > least_s.max(chain_s) && memory_s < longest_s
                || of_brake && much && memory_s > shown_s,
            of_left,
        })
    }

    fn gains_at_sensors(&self, with: &Judged, per_run: bool) -> Vec<f64> {
        let with = with.unseen_under(self.data, &self.beside.at_sensors);
        match (&self.unseen_at_sensors, with) {
            (Some(before), Some(with)) => gains(before, &with, per_run),
            _ => Vec::new(),
        }
    }

    /// Minus the mean over runs of the logarithm of the mean square error of the drag by this model over that by the
    /// one before; and the same where each run has a peak friction of its own.
    fn predicted_better(&self, with: &Judged) -> [f64; 2] {
        let after = squares_by_best_law(self.data, with);
        core::array::from_fn(|i| {
            let ratios: Vec<f64> = self.squares[i]
                .iter()
                .zip(&after[i])
                .map(|(before, after)| (before / after).ln())
                .filter(|ratio| ratio.is_finite())
                .collect();
            ratios.iter().sum::<f64>() / ratios.len().max(1) as f64
        })
    }
}

/// Sum of squares of the drag that a model leaves, by run, with the law that predicts best and nothing of the chain's
/// nuisances: those may stand for an effect. And the same where each run has a peak friction of its own.
fn squares_by_best_law(data: &Data, judged: &Judged) -> [Vec<f64>; 2] {
    let drags = judged.drag_to_explain(data);
    let model = closest(data, &judged.model, &drags);
    squares_and_within_runs(data, &model, &drags)
}

/// Shortest memory in s that a recording shows. None is shorter than its step, or half of it where it is real: how a reading
/// changes between two samples is not known, but what it changes by from one to the next is. An acceleration takes two steps
/// to be seen, with the torque that enters at both. Where it is `unchained` the drag's lateness shows it, however a reading
/// changes in between.
fn shortest_shown_s(data: &Data, entry: usize, real: bool, unchained: bool) -> f64 {
    let (steps, least_s) = match data.catalogue.get(entry).id().balance() {
        _ if unchained => (STEPS_UNCHAINED, LEAST_STD_S),
        Balance::Wheel => (2.0, 0.0),
        _ if real => (0.5, 0.0),
        _ => (1.0, 0.0),
    };
    least_s.max(steps * data.context.dt / data.averaged as f64)
}

/// Shortest memory in s that is told from the chain's by its length: a filtered reading of the brake holds less noise than the
/// reading itself, which looks like a short lag, so there its descriptor's smallest useful effect holds. Of a drag that is
/// `left` late to be explained the timing's errors are known.
fn least_memory_s(data: &Data, entry: usize, left: bool) -> f64 {
    let mechanism = data.catalogue.get(entry);
    match mechanism.id().balance() {
        Balance::Wheel => (mechanism.guide().smallest_size)(&data.context),
        _ if left => 0.0,
        _ => LEAST_MEMORY_S,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::innovations::{dependence, toy};

    fn unseen(runs: &[f64], halves: &[f64]) -> Unseen {
        Unseen {
            runs: runs.to_vec(),
            halves: halves.to_vec(),
        }
    }

    #[test]
    fn a_claim_gains_what_unseen_runs_lose_in_likelihood_without_it() {
        let (before, with) = (
            unseen(&[10.0, 12.0], &[5.0, 5.0, 6.0, 6.0]),
            unseen(&[7.0, 13.0], &[5.0, 4.0, 6.5, 6.0]),
        );
        assert_eq!(gains(&before, &with, false), [3.0, -1.0]);
        // Halves that the claim says nothing of are no evidence either way.
        assert_eq!(gains(&before, &with, true), [1.0, -0.5]);
    }

    #[test]
    fn another_curve_beside_a_free_dependence_along_the_slip_is_not_asked_for() {
        let data = toy::stop(toy::Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let along = |variable: &Variable| {
            let mut all = dependence::all(&data).into_iter();
            all.find(|own| own.balance == Balance::Tyre && own.variable == *variable)
                .unwrap()
        };
        let owns = |id: Id, variable: &Variable| {
            let mut so_far = base.clone();
            so_far.extra = vec![along(variable)];
            let claim = Claim::Mechanism(id, toy::entry_of(&data, id));
            let mut with = so_far.clone();
            let entry = toy::entry_of(&data, id);
            let count = data.catalogue.get(entry).parameters(&data.context).len();
            with.model.terms.push(Term {
                entry,
                parameters: vec![0.1; count],
            });
            let before = Before::new(&data, &so_far, Untold::default(), 0.0);
            before.tried(claim, with, f64::INFINITY).own
        };
        assert!(!owns(Id::CurveShape, &Variable::Slip));
        assert!(owns(Id::CurveShape, &Variable::Time));
        assert!(owns(Id::LoadSensitivity, &Variable::Slip));
    }

    #[test]
    fn a_lag_of_the_brake_is_one_where_several_runs_gain_more_than_any_reading_of_it() {
        let gains = |nats: f64, runs: usize| vec![nats; runs];
        let beyond = |gains: &[f64]| gains_beyond_reading(gains, 90.0, 3_000, 1.0);
        assert!(beyond(&gains(16.0, 4)) && !beyond(&gains(14.0, 4)) && !beyond(&gains(90.0, 1)));
        let at_sensors = |nats: f64| gains_beyond_reading(&gains(16.0, 4), nats, 3_000, 1.0);
        assert!(at_sensors(61.0) && !at_sensors(59.0));
        // Twenty thousand readings gain 49 nats by what is worth a name at all.
        assert!(!gains_beyond_reading(&gains(30.0, 4), 120.0, 20_000, 1.0));
        // Without what is kept for the proof there is less to gain.
        assert!(gains_beyond_reading(&gains(14.0, 4), 90.0, 3_000, 0.8));
    }

    #[test]
    fn a_memory_of_the_force_leaves_nothing_like_what_no_chain_leaves() {
        let (memory, load, lag, dependence) = (true, Some(false), Some(true), None);
        assert!(!may_leave(memory, load));
        assert!(may_leave(memory, lag) && may_leave(memory, dependence));
        assert!(may_leave(!memory, load) && may_leave(!memory, lag));
    }

    #[test]
    fn runs_that_an_effect_does_not_reach_do_not_speak_against_it() {
        // Of a force channel that clips in the last run alone: no t shows it.
        let clipped = [-1.0, 0.5, 8.0, 2.0, 463.0];
        assert!(unanimous(&clipped) && mean_and_t(&clipped).1 < LEAST_T);
        assert!(!unanimous(&[9.0, 1.0, 22.0, -9.0, 4.0]));
        // One run is no company, and nothing is not for anything.
        assert!(!unanimous(&[40.0]) && !unanimous(&[]) && !unanimous(&[-3.0, -1.0]));
    }

    #[test]
    fn the_t_of_gains_is_students_and_that_of_their_roots_bears_uneven_runs() {
        let (mean, t) = mean_and_t(&[1.0, 2.0, 3.0, 4.0]);
        // Mean 2.5, standard deviation 1.2910, over four runs.
        assert!((mean - 2.5).abs() < 1e-12 && (t - 2.5 / 1.290_994 * 2.0).abs() < 1e-5);
        let (sum, roots) = sum_and_t(&[4.0, 4.0, 400.0, 9.0]);
        assert!((sum - 417.0).abs() < 1e-12);
        let (_, plain) = mean_and_t(&[4.0, 4.0, 400.0, 9.0]);
        assert!(roots > 1.4 * plain, "{roots} {plain}");
        assert!(sum_and_t(&[-4.0, 4.0, -9.0, 9.0]).1.abs() < 1e-12);
    }
}
