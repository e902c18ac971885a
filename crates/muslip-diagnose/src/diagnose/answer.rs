//! What the argument came to: the recordings as given, and what was decided about them.

use nalgebra::DMatrix;

use crate::audit::Audit;
use crate::campaign::{Rig, Run};
use crate::chain::recorded::Recorded;
use crate::chain::timing::Timing;
use crate::data::Data;
use crate::decide::{Asked, Decision, Trial, could_stand, decide, gains_beyond_chain};
use crate::innovations::hypothesis::{Judged, whole_over_slow};
use crate::innovations::noise::BalanceParts;
use crate::mechanism::{Balance, Context, Id};
use crate::model::Term;
use crate::number::finite_or_zero;
use crate::series::Series;
use crate::split::Split;

/// What was given, as it was recorded.
pub(super) struct Given<'a> {
    pub(super) rig: &'a Rig,
    pub(super) runs: &'a [Run],
    /// Samples of the recordings that are one here.
    pub(super) averaged: usize,
    pub(super) data: Data,
}

/// A name that works through the force.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct NameOfForce {
    pub(super) id: Id,
    /// Whether it is a memory.
    pub(super) remembers: bool,
    /// Whether it gains more than a measuring chain leaves, or rings longer than its filters and gains much.
    pub(super) beyond_chain: bool,
    /// Whether so little speaks for it ([`Trial::is_weak`]) that a measuring chain's errors may have chosen it, where one shows or a
    /// speed is surely out of step.
    pub(super) weak: bool,
    /// Its confidence.
    pub(super) confidence: f64,
    /// What has a fair chance beside it in its round.
    pub(super) chances: Vec<Id>,
}

/// Why a name is not said.
#[derive(Clone, Copy)]
pub(super) enum Why {
    /// None of its figures is told from none.
    NoFigure,
    /// It is too unlikely: its confidence.
    Unlikely(f64),
}

/// A name that is not said.
pub(super) struct Unsaid {
    /// Its entry in the catalogue.
    pub(super) entry: usize,
    /// Why.
    pub(super) why: Why,
}

/// What the argument came to, made without what is kept.
pub(super) struct Answer<'a> {
    pub(super) given: &'a Given<'a>,
    pub(super) kept: Split,
    pub(super) audit: &'a Audit,
    pub(super) data: Data,
    /// The recordings at one time, smoothed as predicts the drag best.
    pub(super) to_predict: Data,
    pub(super) timing: Timing,
    /// What unseen runs refuted before.
    pub(super) not_asked: Vec<Id>,
    pub(super) decision: Decision,
    /// Names that came out and are not said.
    pub(super) unsaid: Vec<Unsaid>,
}

impl<'a> Answer<'a> {
    /// The argument with none of the names that are not asked for; `None` where nothing usable is left. It keeps timing
    /// and windows of an `other` that was held before, and asks for its names.
    pub(super) fn of(
        given: &'a Given<'a>,
        kept: &Split,
        audit: &'a Audit,
        other: Option<&Self>,
        not_asked: Vec<Id>,
    ) -> Option<Self> {
        let recorded = Recorded::new(given.rig, given.runs, audit, kept);
        let (mut data, timing, base) = recorded.timed(other.map(|other| &other.timing))?;
        data.tell_law_error(&base.parts);
        data.scale_slow_wheel(whole_over_slow(&data, &base));
        data.share = other.map_or(1.0, |other| {
            tyre_readings(&data) / tyre_readings(&other.data)
        });
        let reach_factor = other.map_or_else(
            || recorded.best_reach(&timing, data.context.reach_factor),
            |other| other.to_predict.context.reach_factor,
        );
        let mut to_predict = recorded.smoothed(&timing, reach_factor);
        // Sizes that give the parameters of terms their scale are the argument's.
        to_predict.context = Context {
            reach_factor,
            ..data.context.clone()
        };
        // Delays of the speeds are the chain's: they are named by what the timing shows.
        let mut excluded = data.catalogue.delays();
        excluded.extend_from_slice(&not_asked);
        let asked = Asked {
            excluded,
            named: other.map_or_else(Vec::new, Self::entries),
        };
        let decision = decide(&data, base, &asked, timing.untold());
        let mut answer = Self {
            given,
            kept: kept.clone(),
            audit,
            data,
            to_predict,
            timing,
            not_asked,
            decision,
            unsaid: Vec::new(),
        };
        answer.unsaid = answer.not_said();
        let unsaid: Vec<usize> = answer.unsaid.iter().map(|own| own.entry).collect();
        answer.decision = answer.decision.without(&answer.data, &unsaid);
        Some(answer.with_whole_level())
    }

    /// The same with all of the level that a name scales, as the noise that is left has it: names were decided on by what the
    /// base's makes of it.
    fn with_whole_level(mut self) -> Self {
        let terms = &self.decision.chosen.model.terms;
        let scales = |entry: usize| self.data.catalogue.get(entry).facts().scales_level;
        if terms.iter().any(|term| scales(term.entry)) {
            let by = whole_over_slow(&self.data, &self.decision.chosen);
            self.data.scale_slow_wheel(by);
            self.decision = self.decision.refitted(&self.data);
        }
        self
    }

    /// Entries of its names.
    fn entries(&self) -> Vec<usize> {
        let terms = self.decision.chosen.model.terms.iter();
        terms.map(|term| term.entry).collect()
    }

    /// Its names that work through the force.
    pub(super) fn names_of_force(&self) -> Vec<NameOfForce> {
        let catalogue = &self.data.catalogue;
        let shown = self.audit.shown();
        let chained = shown.of_any || shown.of_timing || self.timing.surely_out_of_step();
        let terms = self.decision.chosen.model.terms.iter();
        terms
            .map(|term| (term, catalogue.get(term.entry)))
            .filter(|(_, mechanism)| mechanism.facts().through_force)
            .map(|(term, mechanism)| {
                let (taken_up, sure) = self.sureness(term.entry).unzip();
                NameOfForce {
                    id: mechanism.id(),
                    remembers: self.remembers_force(term),
                    weak: chained && taken_up.is_none_or(Trial::is_weak),
                    beyond_chain: taken_up.is_some_and(gains_beyond_chain),
                    confidence: sure.as_ref().map_or(0.0, |own| own.confidence),
                    chances: sure.map_or(Vec::new(), |own| own.chances()),
                }
            })
            .collect()
    }

    /// Whether a term is a memory that works through the force.
    pub(super) fn remembers_force(&self, term: &Term) -> bool {
        let mechanism = self.data.catalogue.get(term.entry);
        let memory_s = mechanism.memory_s(&term.parameters, &self.data.context);
        mechanism.facts().through_force && memory_s.is_some()
    }

    /// Whether a memory that works through the force was as good as one that stands but for how alike the runs speak for it.
    pub(super) fn could_remember(&self) -> bool {
        let through_force = |trial: &Trial| {
            trial
                .mechanism()
                .is_some_and(|(_, entry)| self.data.catalogue.get(entry).facts().through_force)
        };
        let mut trials = self.decision.rounds.iter().flatten();
        trials.any(|trial| trial.remembers && through_force(trial) && could_stand(trial))
    }

    /// Whether it says that nothing is missing.
    pub(super) fn found_nothing(&self) -> bool {
        let chosen = &self.decision.chosen;
        chosen.model.terms.is_empty() && chosen.extra.is_empty() && self.named_delays().is_empty()
    }

    /// Covariance in the order of the model's whole vector.
    pub(super) fn covariance(&self, judged: &Judged) -> DMatrix<f64> {
        let n = judged.model.vector().len();
        let own = judged.model.free_places();
        let mut all = DMatrix::zeros(n, n);
        for (i, &a) in own.iter().enumerate() {
            for (j, &b) in own.iter().enumerate() {
                all[(a, b)] = finite_or_zero(judged.covariance[(i, j)]);
            }
        }
        all
    }

    /// White noise of a balance's readings as fitted.
    pub(super) fn white(&self, balance: Balance) -> Option<f64> {
        let mut parts = self.decision.chosen.parts.iter();
        parts
            .find(|p| p.balance == balance)
            .map(BalanceParts::white)
    }
}

/// Usable readings of the tyre's balance, at least one.
fn tyre_readings(data: &Data) -> f64 {
    let all = data.series.iter().map(Series::tyre_count);
    all.sum::<usize>().max(1) as f64
}
