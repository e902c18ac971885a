//! An answer beside the same argument made without what is kept for the proof, and the diagnosis put together from both.

use super::answer::{Answer, Given};
use super::figures::{fit_of, traces};
use super::model_out::Predicts;
use crate::audit::Audit;
use crate::data::Data;
use crate::mechanism::{Balance, Id};
use crate::outcome::{Diagnosis, Fit, NamedMechanism, Verdict};
use crate::progress::Progress;
use crate::proof::Predicted;
use crate::repaired::{Predicting, Repaired};
use crate::split::Split;

/// Most confidence in what unseen runs do not bear out.
const DOUBTED: f64 = 0.5;

/// What the argument came to, and how the model that it comes to without what is kept predicts that.
pub(super) struct Proven<'a> {
    pub(super) answer: Answer<'a>,
    kept: Split,
    found: Repaired,
    predicted: Vec<Predicted>,
    fit: Fit,
}

impl<'a> Proven<'a> {
    /// The argument with none of these names, and its proof; `None` where nothing usable is left.
    pub(super) fn of(
        given: &'a Given<'a>,
        audit: &'a Audit,
        refuted: Vec<Id>,
        progress: Progress<'_>,
    ) -> Option<Self> {
        let answer = Answer::of(given, &Split::default(), audit, None, refuted)?;
        progress(0.6, "the same again without what is kept for the proof");
        let kept = Split::new(&given.data);
        let mut found = answer.repaired();
        found.proof = if answer.found_nothing() {
            let law = given.plain_law(&kept);
            Predicting {
                base_alone: law.clone(),
                base: law,
                ..Predicting::default()
            }
        } else {
            let refuted = answer.refuted.clone();
            let again = Answer::of(given, &kept, audit, Some(&answer.timing), refuted);
            again.map_or_else(Predicting::default, |again| again.repaired().predicting())
        };
        found.proof_by_blocks = kept.by_block;
        for (run, recording) in found.recordings.iter_mut().enumerate() {
            recording.holdout = kept.keeps_whole(run);
        }
        // Where the tyre's balance cannot be formed there is no prediction to prove.
        let predicted = if answer.data.forms(Balance::Tyre) {
            found.unseeing().predicted(given.runs).unwrap_or_default()
        } else {
            Vec::new()
        };
        found.set_noise(&predicted);
        let fit = fit_of(&found, &predicted);
        Some(Self {
            answer,
            kept,
            found,
            predicted,
            fit,
        })
    }

    /// Whether what is kept is predicted worse than by the law alone.
    fn predicts_worse(&self) -> bool {
        self.fit.holdout.after.rmse_n > self.fit.holdout.before.rmse_n
    }

    /// Memories of the force that unseen runs speak against: the chain's own kernels do much of what they do, but predict
    /// nothing.
    pub(super) fn refuted(&self) -> Vec<Id> {
        let answer = &self.answer;
        let Data {
            catalogue, context, ..
        } = &answer.data;
        let terms = answer.decision.chosen.model.terms.iter();
        let memories = terms.filter_map(|term| {
            let mechanism = catalogue.get(term.entry);
            mechanism.memory_s(&term.parameters, context)?;
            mechanism.facts().through_force.then(|| mechanism.id())
        });
        memories.filter(|_| self.predicts_worse()).collect()
    }

    /// What works through the force is not sure where the force is not predicted any better.
    fn doubt(&self, mechanisms: &mut [NamedMechanism]) {
        for named in mechanisms.iter_mut() {
            let id = Id::parse(named.id);
            let mechanism = id.and_then(|id| self.answer.data.catalogue.of(id));
            if mechanism.is_some_and(|m| m.facts().through_force) {
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
            chain: answer.audit.chain(),
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
