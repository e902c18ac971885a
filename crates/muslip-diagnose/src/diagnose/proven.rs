//! An answer beside the same argument made without what is kept for the proof, and the diagnosis put together from both.

use super::answer::{Answer, Given, NameOfForce};
use super::figures::{fit_of, traces};
use super::model_out::Predicts;
use crate::audit::{Audit, Finding};
use crate::constants::{BEYOND_REFUTATION, DOUBTED, MOST_WORSE, TOLD_OF_CHANNEL};
use crate::data::Catalogue;
use crate::mechanism::{Balance, Describe, Facts, Id};
use crate::outcome::{Diagnosis, Fit, NamedMechanism, Verdict};
use crate::proof::Predicted;
use crate::repaired::{Predicting, Repaired};
use crate::split::Split;

/// What the argument comes to without what is kept.
struct Again {
    names: Vec<NameOfForce>,
    /// Whether a memory is among them, or would be were fewer runs as even as all of them.
    remembers: bool,
    /// Whether what is kept is predicted worse by a percent of the squared error with the memories among them than without
    /// any.
    remembers_worse: bool,
}

/// What the argument came to, and how the model that it comes to without what is kept predicts that.
pub(super) struct Proven<'a> {
    pub(super) answer: Answer<'a>,
    kept: Split,
    /// What the argument without what is kept comes to; nothing where it could not be held.
    again: Option<Again>,
    found: Repaired,
    predicted: Vec<Predicted>,
    fit: Fit,
}

impl<'a> Proven<'a> {
    /// The argument with none of the names that are not asked for, and its proof; `None` where nothing usable is left.
    pub(super) fn of(
        given: &'a Given<'a>,
        audit: &'a Audit,
        not_asked: Vec<Id>,
        proving: impl FnOnce(),
    ) -> Option<Self> {
        let answer = Answer::of(given, &Split::default(), audit, None, not_asked)?;
        proving();
        let kept = Split::new(&given.data);
        let mut found = answer.repaired();
        let mut again_names = None;
        let mut without_memories = None;
        found.proof = if answer.found_nothing() {
            let law = given.plain_law(&kept, answer.to_predict.context.reach_factor);
            Predicting {
                base_alone: law.clone(),
                base: law,
                ..Predicting::default()
            }
        } else {
            let not_asked = answer.not_asked.clone();
            let again = Answer::of(given, &kept, audit, Some(&answer), not_asked);
            again.map_or_else(Predicting::default, |again| {
                let names = again.names_of_force();
                again_names = Some(Again {
                    remembers: names.iter().any(|name| name.remembers) || again.could_remember(),
                    names,
                    remembers_worse: false,
                });
                let predicting = again.repaired().predicting();
                without_memories = again.predicting_without_memories(&predicting);
                predicting
            })
        };
        found.proof_by_blocks = kept.by_block;
        for (run, recording) in found.recordings.iter_mut().enumerate() {
            recording.holdout = kept.keeps_whole(run);
        }
        // Where the tyre's balance cannot be formed there is no prediction to prove.
        let predicted_by = |found: &Repaired| {
            if answer.data.forms(Balance::Tyre) {
                found.unseeing().predicted(given.runs).unwrap_or_default()
            } else {
                Vec::new()
            }
        };
        let predicted = predicted_by(&found);
        found.set_noise(&predicted);
        let fit = fit_of(&found, &predicted);
        // With the law's two parameters fitted anew, not beside the law alone: what the timing of the channels does to a
        // prediction is no memory's fault.
        if let (Some(again), Some(proof)) = (&mut again_names, without_memories) {
            let without = Repaired {
                proof,
                ..found.clone()
            };
            let fit_without = fit_of(&without, &predicted_by(&without));
            let [own, other] = [&fit, &fit_without].map(|fit| fit.holdout.after.rmse_n.powi(2));
            again.remembers_worse = own > MOST_WORSE * other;
        }
        Some(Self {
            answer,
            kept,
            again: again_names,
            found,
            predicted,
            fit,
        })
    }

    /// Whether what is kept is predicted worse than by the law alone.
    fn predicts_worse(&self) -> bool {
        self.fit.holdout.after.rmse_n > self.fit.holdout.before.rmse_n
    }

    /// Names that the argument without what is kept speaks against.
    pub(super) fn refuted(&self) -> Vec<Id> {
        let named = self.answer.names_of_force();
        self.again
            .as_ref()
            .map_or_else(Vec::new, |again| refuted(&named, again))
    }

    /// What works through the force is not sure where the force is not predicted any better.
    fn doubt(&self, mechanisms: &mut [NamedMechanism]) {
        for named in mechanisms.iter_mut() {
            let facts = facts_of(named, &self.answer.data.catalogue);
            if facts.is_some_and(|facts| facts.through_force) {
                named.evidence.confidence = named.evidence.confidence.min(DOUBTED);
            }
        }
    }

    /// The diagnosis.
    pub(super) fn assemble(self) -> Diagnosis {
        let answer = &self.answer;
        let found = &self.found;
        let mut mechanisms = answer.mechanisms();
        // A model that says nothing of the drag predicts it as the base does.
        let says_something =
            !found.tyre.is_empty() || !found.corrections.is_empty() || !found.late.is_none();
        let base_alone = found.without_findings();
        let predicts = if says_something && !self.predicts_worse() {
            answer.predicts(&base_alone, found)
        } else {
            Predicts::default()
        };
        if says_something && !predicts.known {
            self.doubt(&mut mechanisms);
        }
        // What is no likelier than not, or not borne out by unseen runs, is not the strongest, whatever it gained.
        mechanisms.sort_by_key(|named| named.evidence.confidence <= DOUBTED);
        let chain = with_named(answer.audit, &mechanisms, &answer.data.catalogue);
        let unexplained = answer.unexplained();
        let verdict = match (mechanisms.is_empty(), unexplained.is_empty()) {
            (true, true) => Verdict::Consistent,
            (false, true) => Verdict::Explained,
            (false, false) => Verdict::PartlyExplained,
            (true, false) => Verdict::Unexplained,
        };
        let (r#where, regions) = if mechanisms.is_empty() && unexplained.is_empty() {
            (Vec::new(), Vec::new())
        } else {
            answer.located(found.noise.sigma_n)
        };
        Diagnosis {
            schema: "muslip.diagnosis/1",
            verdict,
            recordings: answer.given.recordings(&self.kept),
            noise: answer.noise(),
            base: answer.base(),
            r#where,
            regions,
            mechanisms,
            unexplained,
            looked_for: answer.looked_for(),
            data_faults: answer.given.faults(&self.kept),
            chain,
            caveats: answer.caveats(&self.kept),
            traces: traces(&self.kept, &self.predicted, answer.data.context.radius),
            fit: self.fit,
            repaired: if predicts.unseen {
                self.found.clone()
            } else {
                base_alone
            },
            found: self.found,
        }
    }
}

/// What a name's mechanism says of itself.
fn facts_of(named: &NamedMechanism, catalogue: &Catalogue) -> Option<Facts> {
    let id = Id::parse(named.id)?;
    catalogue.of(id).map(Describe::facts)
}

/// What the audit says of the channels, and what sure names do that say what a channel does: an encoder's ripple, a filter of
/// the drag. Without the tyre law, which these need to be seen by, the audit may not find them. (A delay of the drag is told by
/// how early the others are.)
fn with_named(audit: &Audit, named: &[NamedMechanism], catalogue: &Catalogue) -> Vec<Finding> {
    let mut chain = audit.chain();
    for name in named {
        let facts = facts_of(name, catalogue);
        let Some((facts, figure)) = facts.zip(name.parameters.first()) else {
            continue;
        };
        let Some(word) = facts.finding else { continue };
        // A filter by which a recording was thinned is not the channel's.
        let mut all = audit.findings.iter();
        let known = all.any(|own| own.channel == facts.channel && own.finding == word);
        if !known && name.evidence.confidence >= TOLD_OF_CHANNEL {
            let value = (figure.value, figure.std);
            let own = Finding::of(facts.channel, word, value, &figure.unit);
            chain.push(own.saying(name.statement.clone()));
        }
    }
    chain
}

/// Names that the same argument without what is kept speaks against. A memory: where that knows of none at all, or names one
/// with which it predicts what is kept worse than without, for the chain's own kernels do much of what a memory does, but where
/// it gains more than a chain leaves. Any other: where that neither comes to it nor leaves it a fair chance, but comes to another in
/// its place that is no memory and has no fair chance by all recordings, or where little speaks for it. What all recordings together
/// make sure is not refuted by fewer.
fn refuted(named: &[NameOfForce], again: &Again) -> Vec<Id> {
    let has = |names: &[NameOfForce], id: Id| names.iter().any(|name| name.id == id);
    let comes_out = |id: Id| {
        let chance = |own: &NameOfForce| own.chances.contains(&id);
        has(&again.names, id) || again.names.iter().any(chance)
    };
    let replaced = |name: &NameOfForce| {
        let mut others = again.names.iter().filter(|own| !own.remembers);
        others.any(|own| !has(named, own.id) && !name.chances.contains(&own.id))
    };
    let against = |name: &&NameOfForce| {
        let contradicted = if name.remembers {
            again.remembers_worse && !name.beyond_chain || !again.remembers
        } else {
            (name.weak || replaced(name)) && !comes_out(name.id)
        };
        contradicted && name.confidence < BEYOND_REFUTATION
    };
    named.iter().filter(against).map(|name| name.id).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::audit::Word;
    use crate::mechanism::Reported;
    use crate::outcome::{Evidence, ReportedParameter};

    const fn name(id: Id, remembers: bool) -> NameOfForce {
        NameOfForce {
            id,
            remembers,
            beyond_chain: false,
            weak: false,
            confidence: 0.8,
            chances: Vec::new(),
        }
    }

    fn refuted(named: &[NameOfForce], again: &[NameOfForce], worse: bool) -> Vec<Id> {
        let remembers = again.iter().any(|name| name.remembers);
        let again = Again {
            names: again.to_vec(),
            remembers,
            remembers_worse: remembers && worse,
        };
        super::refuted(named, &again)
    }

    const LAG: NameOfForce = name(Id::ForceLag, true);
    const RELAXATION: NameOfForce = name(Id::RelaxationLength, true);
    const WEAR: NameOfForce = name(Id::WearDrift, false);
    const FADE: NameOfForce = name(Id::ThermalFade, false);

    #[test]
    fn what_a_sure_name_says_of_a_channel_is_told_of_the_chain_once() {
        let catalogue = Catalogue::default();
        let ripple = |confidence: f64| NamedMechanism {
            id: Id::EncoderRipple.as_str(),
            balance: Balance::Tyre.as_str(),
            statement: "The wheel speed reading varies.".to_owned(),
            equation: String::new(),
            parameters: vec![ReportedParameter::new(
                &Reported::new("amplitude", "1", 0.003),
                2e-4,
            )],
            evidence: Evidence {
                delta_bic: 900.0,
                holdout_nll_gain_per_sample: 0.1,
                confidence,
            },
            confusable_with: Vec::new(),
            separating_test: String::new(),
            effect_sigma: 1.0,
        };
        let told = |findings: Vec<Finding>, confidence: f64| {
            let audit = Audit {
                findings,
                ..Audit::default()
            };
            with_named(&audit, &[ripple(confidence)], &catalogue)
        };
        let one = told(Vec::new(), 0.95);
        assert_eq!(one[0].finding, Word::Ripple);
        assert_eq!(one[0].channel, "wheel_speed_rad_s");
        assert_eq!((one[0].value, one[0].std), (0.003, 2e-4));
        assert_eq!(told(one.clone(), 0.95), one);
        assert!(told(Vec::new(), 0.6).is_empty());
    }

    #[test]
    fn a_memory_has_to_come_out_again_and_to_predict_no_worse() {
        assert!(refuted(&[LAG], &[LAG], false).is_empty());
        // Which memory it is is another question.
        assert!(refuted(&[LAG], &[RELAXATION], false).is_empty());
        assert_eq!(refuted(&[LAG, WEAR], &[WEAR], false), [Id::ForceLag]);
        assert_eq!(refuted(&[LAG, WEAR], &[LAG, WEAR], true), [Id::ForceLag]);
        let sure = NameOfForce {
            confidence: 0.98,
            ..LAG
        };
        assert!(refuted(&[sure], &[], true).is_empty());
        // Of what no chain leaves a prediction says little, but it comes out again.
        let large = NameOfForce {
            beyond_chain: true,
            ..LAG
        };
        assert!(refuted(std::slice::from_ref(&large), &[LAG], true).is_empty());
        assert_eq!(refuted(&[large], &[], false), [Id::ForceLag]);
    }

    #[test]
    fn a_memory_that_fewer_runs_show_less_evenly_is_not_refuted() {
        let again = Again {
            names: Vec::new(),
            remembers: true,
            remembers_worse: false,
        };
        assert!(super::refuted(&[LAG], &again).is_empty());
        let worn = Again {
            names: vec![WEAR],
            ..again
        };
        assert!(super::refuted(&[LAG, WEAR], &worn).is_empty());
    }

    #[test]
    fn what_has_a_fair_chance_beside_what_comes_out_is_not_refuted_by_it() {
        let unsure = NameOfForce {
            chances: vec![Id::WearDrift],
            ..FADE
        };
        assert!(refuted(&[WEAR], &[unsure], false).is_empty());
    }

    #[test]
    fn what_all_recordings_give_a_fair_chance_refutes_only_what_is_weak() {
        let unsure = NameOfForce {
            chances: vec![Id::ThermalFade],
            ..WEAR
        };
        assert!(refuted(std::slice::from_ref(&unsure), &[FADE], false).is_empty());
        let weak = NameOfForce {
            weak: true,
            ..unsure.clone()
        };
        assert_eq!(refuted(&[weak], &[FADE], false), [Id::WearDrift]);
        let load = name(Id::LoadSensitivity, false);
        assert_eq!(refuted(&[unsure], &[FADE, load], false), [Id::WearDrift]);
    }

    #[test]
    fn any_other_name_gives_way_to_what_comes_out_in_its_place() {
        assert!(refuted(&[WEAR], &[WEAR, FADE], true).is_empty());
        // Fewer runs may show nothing.
        assert!(refuted(&[WEAR], &[], true).is_empty());
        assert!(refuted(&[WEAR, FADE], &[FADE], false).is_empty());
        assert_eq!(refuted(&[WEAR], &[FADE], false), [Id::WearDrift]);
        assert!(refuted(&[WEAR], &[LAG], false).is_empty());
        // Unless there is little to show.
        let weak = [NameOfForce { weak: true, ..WEAR }];
        assert_eq!(refuted(&weak, &[], false), [Id::WearDrift]);
        assert!(refuted(&weak, &weak, false).is_empty());
        assert!(refuted(&[], &[FADE], true).is_empty());
    }
}
