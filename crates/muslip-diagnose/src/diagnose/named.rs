//! What is named, how sure it is, and what is left unexplained.

use std::collections::BTreeMap;

use super::answer::{Answer, Unsaid, Why};
use crate::audit::{Ring, Timing};
use crate::constants::{
    AUDITED, DOUBTED, FAIR_CHANCE, FEW_RUNS_SURE, FORM_OF_DELAY_S, LEAST_BRAKE_EARLY_IN_STEP_S,
    LEAST_CONFIDENCE, LEAST_CONFIDENCE_OF_ALIASES, LEAST_DELAY_S, LEAST_PREDICTED,
    LEAST_STDS_OF_FIGURE, LEAST_T_NOT_FED, PREDICTED_APART, RARE_SHARE, SURE_DELAY, TIED,
    UNKNOWN_STDS, VAGUE_DELAY_S,
};
use crate::decide::{Claim, Trial, few_reach, rivals, softness};
use crate::figures::{figures, stds_from_none, with_form};
use crate::innovations::dependence::Dependence;
use crate::innovations::hypothesis::Judged;
use crate::mechanism::{Audited, Balance, Id, Reported, Speed};
use crate::number::finite_or_zero;
use crate::outcome::{
    Alternative, Evidence, NamedMechanism, ReportedParameter, Unexplained, sentence,
};
use crate::separating::separating_test;

/// Smallest delay in s that is named where the timing is as sure as this.
pub(super) fn least_delay(late: &Timing) -> f64 {
    (FORM_OF_DELAY_S + SURE_DELAY * late.std.max(1e-4)).max(LEAST_DELAY_S)
}

impl Answer<'_> {
    /// All that is named, strongest first.
    pub(super) fn mechanisms(&self) -> Vec<NamedMechanism> {
        let mut all = self.named();
        all.extend(self.named_delays());
        all.extend(self.named_by_audit());
        all.sort_by(|a, b| b.evidence.delta_bic.total_cmp(&a.evidence.delta_bic));
        all
    }

    /// Names of the decision.
    fn named(&self) -> Vec<NamedMechanism> {
        let chosen = &self.decision.chosen;
        let covariance = self.covariance(chosen);
        chosen
            .model
            .terms
            .iter()
            .enumerate()
            .filter_map(|(place, term)| {
                let mechanism = self.data.catalogue.get(term.entry);
                let id = mechanism.id();
                let (trial, sure) = self.sureness(term.entry)?;
                let reported = figures(&self.data, &chosen.model, &covariance, place);
                let values: Vec<Reported<f64>> = reported.iter().map(|(r, _)| r.clone()).collect();
                let samples: usize = self.data.series.iter().map(|s| s.len()).sum();
                Some(NamedMechanism {
                    id: id.as_str(),
                    balance: id.balance().as_str(),
                    statement: sentence(&mechanism.statement(&values, &term.parameters)),
                    equation: mechanism.equation().to_owned(),
                    parameters: reported
                        .iter()
                        .map(|(r, std)| ReportedParameter::new(r, *std))
                        .collect(),
                    evidence: Evidence {
                        delta_bic: 2.0 * trial.weight(),
                        holdout_nll_gain_per_sample: finite_or_zero(
                            trial.gain_on_unseen_runs(self.data.series.len())
                                / samples.max(1) as f64,
                        ),
                        confidence: sure.confidence,
                    },
                    separating_test: sure
                        .others
                        .first()
                        .filter(|o| o.confidence > 0.05)
                        .and_then(|o| Id::parse(o.id))
                        .map_or(String::new(), |other| separating_test(id, other).to_owned()),
                    confusable_with: sure.others,
                    effect_sigma: finite_or_zero(
                        (2.0 * trial.gain_that_counts() / samples.max(1) as f64).sqrt(),
                    ),
                })
            })
            .collect()
    }

    /// The trial by which a name was taken up, and how sure it is before its proof.
    pub(super) fn sureness(&self, entry: usize) -> Option<(&Trial, Sureness)> {
        let of_entry = |t: &&Trial| t.mechanism().is_some_and(|m| m.1 == entry);
        let mut rounds = self.decision.rounds.iter().rev();
        let (trial, round) =
            rounds.find_map(|round| Some((round.iter().find(of_entry)?, round)))?;
        let mechanism = self.data.catalogue.get(entry);
        let (share, others) = beside_double(
            shares(trial, round),
            mechanism.rare_double(&self.data.series, &self.data.context),
        );
        let most = if trial.predicts > LEAST_PREDICTED {
            1.0
        } else {
            DOUBTED
        };
        let steadiness = if few_reach(trial) {
            trial.steadiness().max(LEAST_T_NOT_FED)
        } else {
            trial.steadiness()
        };
        let sure = confidence(share, steadiness, self.data.series.len());
        let sureness = Sureness {
            share,
            confidence: sure.min(most),
            others,
        };
        Some((trial, sureness))
    }

    /// Names that are not said: none of whose figures is told from none, or that are too unlikely. Few recordings make no name
    /// likely: there each is said that has a figure.
    pub(super) fn not_said(&self) -> Vec<Unsaid> {
        let few = surest(self.data.series.len()) < FEW_RUNS_SURE;
        let terms = self.decision.chosen.model.terms.iter();
        let not_said = terms.filter_map(|term| {
            let (taken_up, sure) = self.sureness(term.entry)?;
            let aliases = self.data.catalogue.get(term.entry).id().aliases();
            let of_alias =
                |other: &&Alternative| aliases.iter().any(|a| a.with.as_str() == other.id);
            let aliases = sure.others.iter().filter(of_alias).map(|o| o.confidence);
            let aliases: Vec<f64> = aliases.collect();
            let why = if !self.has_a_figure(term.entry, &taken_up.judged) {
                Why::NoFigure
            } else if few || likely(sure.confidence, sure.share, &aliases) {
                return None;
            } else {
                Why::Unlikely(sure.confidence)
            };
            Some(Unsaid {
                entry: term.entry,
                why,
            })
        });
        not_said.collect()
    }

    /// Whether a figure of a name is told from what it would be without it, where the name was taken up: a free dependence that
    /// was taken up since may span it.
    fn has_a_figure(&self, entry: usize, taken_up: &Judged) -> bool {
        let mut terms = taken_up.model.terms.iter();
        let Some(place) = terms.position(|term| term.entry == entry) else {
            return true;
        };
        let covariance = self.covariance(taken_up);
        let figures = figures(&self.data, &taken_up.model, &covariance, place);
        let told = |(own, std): &(Reported<f64>, f64)| {
            stds_from_none(own, *std, &self.data) > LEAST_STDS_OF_FIGURE
        };
        let parameters = &taken_up.model.terms[place].parameters;
        let first = taken_up.model.places_of(place).start;
        let by_no_figure = self.data.catalogue.get(entry).by_no_figure();
        let varies = |own: &usize| {
            let std = covariance[(first + own, first + own)].sqrt();
            std > 0.0 && parameters[*own].abs() > LEAST_STDS_OF_FIGURE * std
        };
        figures.iter().any(told) || by_no_figure.iter().any(varies)
    }

    /// What no name accounts for: dependences of the chosen model, the one that is left beside it, and a hum that stands
    /// out of the noise.
    pub(super) fn unexplained(&self) -> Vec<Unexplained> {
        let gained: f64 = (self.decision.base.loss - self.decision.chosen.loss).max(1e-9);
        let left = self.decision.left.iter();
        let left = left.map(|left| (&left.dependence, left.gain, left.share));
        let told = |(own, gain, share): (&Dependence, f64, f64)| Unexplained {
            balance: own.balance.as_str(),
            variable: own.variable.word(&self.data),
            form: String::new(),
            z: finite_or_zero((2.0 * gain.max(0.0)).sqrt()),
            share: share.clamp(0.0, 1.0),
        };
        let chosen = self.decision.chosen.extra.iter().map(|own| {
            let gain = self
                .decision
                .rounds
                .iter()
                .flatten()
                .find_map(|t| match &t.claim {
                    Claim::Dependence(d)
                        if d.variable == own.variable
                            && d.balance == own.balance
                            && d.action == own.action =>
                    {
                        Some(t.gain)
                    }
                    _ => None,
                })
                .unwrap_or(0.0);
            (own, gain, gain / gained)
        });
        let hum = self.audit.loud_hum.iter().map(|hum| Unexplained {
            balance: Balance::Tyre.as_str(),
            // The contract's word for a fixed frequency.
            variable: "time_s".into(),
            form: format!(
                "repeats at {:.2} Hz with {:.3} {}",
                hum.frequency_hz, hum.finding.value, hum.finding.unit
            ),
            z: finite_or_zero(hum.finding.value / hum.finding.std),
            share: hum.share.clamp(0.0, 1.0),
        });
        chosen.chain(left).map(told).chain(hum).collect()
    }

    /// Delays of the speeds that the base simulation's residuals show.
    pub(super) fn named_delays(&self) -> Vec<NamedMechanism> {
        let delays = self.data.catalogue.delays().into_iter();
        let named = delays.filter_map(|id| {
            let [late, audited] = self.delays_of(id)?;
            let sure = late.std < VAGUE_DELAY_S && late.value > least_delay(&late);
            // Fitted with a law that may be wrong it is believed where the audit, which has none, says so too.
            let told = audited.value > AUDITED * audited.std;
            (sure && told).then(|| self.delay(id, "delay", late, 1.0))?
        });
        named.collect()
    }

    /// What the audit shows of mechanisms that the decision neither names nor has given up. A logger out of step, or a
    /// vibration that is none of the load cell's, may look the same.
    fn named_by_audit(&self) -> Vec<NamedMechanism> {
        let catalogue = &self.data.catalogue;
        let terms = self.decision.chosen.model.terms.iter();
        let unsaid = self.unsaid.iter().map(|own| own.entry);
        let entries = terms.map(|term| term.entry).chain(unsaid);
        let ids = entries.map(|entry| catalogue.get(entry).id());
        let settled: Vec<Id> = ids.chain(self.not_asked.iter().copied()).collect();
        let shown = catalogue.entries().iter().filter_map(|mechanism| {
            let facts = mechanism.facts();
            match facts.audited.filter(|_| !settled.contains(&facts.id))? {
                Audited::EarlyBrake => self.late_torque(facts.id),
                Audited::Ring => self.ring(facts.id),
            }
        });
        shown.collect()
    }

    /// A lag of the brake, by how much its reading comes before its torque.
    fn late_torque(&self, id: Id) -> Option<NamedMechanism> {
        let late = self.timing.brake_before_torque()?;
        let audited = self.audit.brake_late;
        let told = audited.value < -AUDITED * audited.std;
        let sure = late.value > LEAST_BRAKE_EARLY_IN_STEP_S + UNKNOWN_STDS * late.std;
        (told && sure).then(|| self.delay(id, "time_constant", late, DOUBTED))?
    }

    /// A mode of the load cell, by the drag's spectrum.
    fn ring(&self, id: Id) -> Option<NamedMechanism> {
        let Ring {
            frequency_hz,
            frequency_std_hz,
            damping_ratio,
            damping_std,
            gain,
        } = self.audit.ring?;
        let figures = [
            (
                Reported::new("frequency", "Hz", frequency_hz),
                frequency_std_hz,
            ),
            (
                Reported::new("damping_ratio", "1", damping_ratio),
                damping_std,
            ),
        ];
        self.told(id, &figures, 2.0 * gain, DOUBTED)
    }

    /// What the timing says of a delay that is its own to name.
    pub(super) fn delay_of(&self, id: Id) -> Option<Timing> {
        self.delays_of(id).map(|[fitted, _]| fitted)
    }

    /// The same, and what the audit says of it.
    fn delays_of(&self, id: Id) -> Option<[Timing; 2]> {
        let (fitted, audited) = match self.data.catalogue.of(id)?.facts().late? {
            Speed::Wheel => (self.timing.wheel, self.audit.wheel_late),
            Speed::Vehicle => (self.timing.vehicle, self.audit.vehicle_late),
        };
        Some([self.timing.against_drag(fitted), audited])
    }

    /// A delay as a mechanism; its parameter's name, and the most that it can be sure.
    fn delay(&self, id: Id, name: &'static str, late: Timing, most: f64) -> Option<NamedMechanism> {
        let z = late.value.abs() / late.std.max(1e-5);
        let figures = [(Reported::new(name, "s", late.value), late.std)];
        self.told(id, &figures, z * z, most)
    }

    /// What timing or audit tell as a mechanism, in that mechanism's own words; with each figure's standard deviation.
    fn told(
        &self,
        id: Id,
        figures: &[(Reported<f64>, f64)],
        delta_bic: f64,
        most: f64,
    ) -> Option<NamedMechanism> {
        let mechanism = self.data.catalogue.of(id)?;
        let reported: Vec<Reported<f64>> = figures.iter().map(|(own, _)| own.clone()).collect();
        let values: Vec<f64> = reported.iter().map(|own| own.value).collect();
        Some(NamedMechanism {
            id: id.as_str(),
            balance: id.balance().as_str(),
            statement: sentence(&mechanism.statement(&reported, &values)),
            equation: mechanism.equation().to_owned(),
            parameters: figures
                .iter()
                .map(|(own, std)| ReportedParameter::new(own, with_form(*std, own, &self.data)))
                .collect(),
            evidence: Evidence {
                delta_bic,
                // Not measured: timing and spectrum are of all runs together.
                holdout_nll_gain_per_sample: 0.0,
                confidence: surest(self.data.series.len()).min(0.97).min(most),
            },
            confusable_with: Vec::new(),
            separating_test: String::new(),
            effect_sigma: 0.0,
        })
    }
}

/// Surest that so many runs can make a name.
fn surest(runs: usize) -> f64 {
    1.0 - 0.5f64.powf(1.0 + 0.75 * runs as f64)
}

/// How sure a name is.
pub(super) struct Sureness {
    /// Share of the likelihood that it has among the finalists of its round and none.
    share: f64,
    /// What is left of that by the number of runs, and by how alike they speak.
    pub(super) confidence: f64,
    /// The other finalists with theirs, the likeliest first.
    others: Vec<Alternative>,
}

impl Sureness {
    /// The others that have a fair chance beside it.
    pub(super) fn chances(&self) -> Vec<Id> {
        let near = |other: &&Alternative| other.confidence > FAIR_CHANCE * self.share;
        let near = self.others.iter().filter(near);
        near.filter_map(|other| Id::parse(other.id)).collect()
    }
}

/// Share of the likelihood that a name has among the other finalists of its round and none, and theirs.
fn shares(trial: &Trial, round: &[Trial]) -> (f64, Vec<Alternative>) {
    let softness = softness(trial.weight());
    // What predicts the drag worse is less likely however much it gains, for the chain's nuisances may do its work.
    let worse = |t: &Trial| {
        let by = trial.predicts - t.predicts;
        if by.is_finite() {
            (by / PREDICTED_APART).max(0.0)
        } else {
            0.0
        }
    };
    let weight = |t: &Trial| (((t.weight() - trial.weight()) / softness).min(0.0) - worse(t)).exp();
    let mut by_id: BTreeMap<Id, f64> = BTreeMap::new();
    let own = trial.mechanism().map(|m| m.0);
    let mut outside = 0.0f64;
    for other in round
        .iter()
        .filter(|t| rivals(t) || t.mechanism().map(|m| m.0) == own)
    {
        match other.mechanism() {
            Some((id, _)) => {
                let w = by_id.entry(id).or_insert(0.0);
                *w = w.max(weight(other));
            }
            None => outside = outside.max(0.5 * weight(other)),
        }
    }
    let none = (-(trial.weight() / softness)).exp();
    let total = by_id.values().sum::<f64>() + none + outside;
    let own_share = own.and_then(|id| by_id.get(&id).copied()).unwrap_or(1.0) / total;
    let mut others: Vec<Alternative> = by_id
        .iter()
        .filter(|(id, _)| Some(**id) != own)
        .map(|(id, w)| Alternative {
            id: id.as_str(),
            confidence: w / total,
        })
        .filter(|a| a.confidence > 0.01)
        .collect();
    others.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
    (own_share, others)
}

/// The same beside what is rare and looks the same, where it was not itself tried.
fn beside_double(
    (share, mut others): (f64, Vec<Alternative>),
    double: Option<Id>,
) -> (f64, Vec<Alternative>) {
    let Some(double) = double.filter(|id| others.iter().all(|other| other.id != id.as_str()))
    else {
        return (share, others);
    };
    others.push(Alternative {
        id: double.as_str(),
        confidence: RARE_SHARE * share,
    });
    others.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
    (share / (1.0 + RARE_SHARE), others)
}

/// How sure a name with this share is: by what so many runs can show, and how alike they speak for it.
fn confidence(share: f64, steadiness: f64, runs: usize) -> f64 {
    let steady = 1.0 - (-0.8 * (steadiness - 0.5)).exp();
    (share * surest(runs) * steady).clamp(0.01, 0.99)
}

/// Whether a name with this share is likely enough to be said: by itself, with aliases that nothing in the recordings tells
/// from it, or because it is nearly sure that it is missing or one of its aliases.
fn likely(confidence: f64, share: f64, aliases: &[f64]) -> bool {
    let with = |least: f64| {
        let as_likely = aliases.iter().filter(|alias| **alias > least * share);
        confidence * (1.0 + as_likely.sum::<f64>() / share.max(1e-9))
    };
    with(TIED) > LEAST_CONFIDENCE || with(0.0) > LEAST_CONFIDENCE_OF_ALIASES
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_run_makes_no_name_surer_than_seven_tenths_and_uneven_runs_make_less() {
        // 1 - 2^-1.75, and half of it at a t at which half is left.
        let even = 1e3;
        assert!((confidence(1.0, even, 1) - 0.702_698).abs() < 1e-6);
        let half = 0.5 + core::f64::consts::LN_2 / 0.8;
        assert!((confidence(1.0, half, 1) - 0.351_349).abs() < 1e-6);
        assert!((confidence(0.5, even, 1) - 0.351_349).abs() < 1e-6);
        assert!((confidence(1.0, 0.0, 9) - 0.01).abs() < 1e-12, "clamped");
    }

    #[test]
    fn what_is_rare_and_looks_the_same_is_said_once_and_takes_little() {
        let lag = || Alternative {
            id: Id::ForceLag.as_str(),
            confidence: 0.01,
        };
        let ids = |all: &[Alternative]| all.iter().map(|own| own.id).collect::<Vec<_>>();
        let (share, others) = beside_double((0.9, vec![lag()]), Some(Id::RunOut));
        assert_eq!(ids(&others), ["run_out", "force_lag"]);
        assert!((share - 0.857_142_86).abs() < 1e-6, "{share}");
        let tried = beside_double((share, others), Some(Id::RunOut));
        assert_eq!(ids(&tried.1), ["run_out", "force_lag"]);
        assert_eq!(beside_double((0.9, vec![lag()]), None).0, 0.9);
    }

    #[test]
    fn a_name_is_said_alone_or_with_an_alias_that_nothing_tells_from_it() {
        assert!(likely(0.46, 0.6, &[]) && !likely(0.44, 0.6, &[0.1]));
        let with = |alias: f64| likely(0.3, 0.4, &[alias]);
        assert!(with(0.4) && !with(0.39));
        assert!(
            !likely(0.05, 0.4, &[0.4]),
            "two unlikely ones are unlikely together"
        );
        // Three of which each may be it: 0.31 of 0.35.
        assert!(likely(0.31, 0.35, &[0.3, 0.25]) && !likely(0.31, 0.35, &[0.3, 0.1]));
    }
}
