//! What is named and what is left unexplained.

use nalgebra::DMatrix;

use super::Outcome;
use crate::choose::Search;
use crate::confidence::{alternatives, figures, membership};
use crate::fit::Joint;
use crate::mechanism::Reported;
use crate::omnibus::finite_or_zero;
use crate::outcome::{Alternative, Evidence, Figure, NamedMechanism, Unexplained, sentence};
use crate::separating::separating_test;
use crate::tyre_stage::TyreStage;

impl Outcome<'_> {
    /// Named mechanisms of one stage with their effect's size for sorting.
    pub(super) fn named(
        &self,
        joint: &Joint<'_>,
        proof: &Joint<'_>,
        search: &Search,
        covariance: &DMatrix<f64>,
    ) -> Vec<(f64, NamedMechanism)> {
        let data = self.data;
        let fitted = &search.chosen.fitted;
        let membership = membership(search);
        let proof_count = proof.count().max(1) as f64;
        let with_all = proof.loss(&fitted.model);
        let mut out = Vec::new();
        for (place, term) in fitted.model.terms.iter().enumerate() {
            let mechanism = data.catalogue.get(term.entry);
            let id = mechanism.id();
            // What is lost without it, the others fitted anew.
            let without = joint.without(search, place);
            let drop = without.loss - fitted.loss;
            let price = crate::choose::price(&fitted.model, search.count)
                - crate::choose::price(&without.model, search.count);
            let gain = (proof.loss(&without.model) - with_all) / proof_count;
            let reported = figures(data, &fitted.model, covariance, place);
            let confidence = membership.get(&id).copied().unwrap_or(0.0);
            // A name that does not predict data that it has not seen is no explanation.
            let confidence = if mechanism.predicts() && gain < 0.0 {
                0.6 * confidence
            } else {
                confidence
            };
            let others = alternatives(search, id);
            let values: Vec<Reported<f64>> = reported.iter().map(|(r, _)| r.clone()).collect();
            let test = match others.first() {
                Some((other, weight)) if *weight > 0.05 => separating_test(id, *other).to_owned(),
                _ => String::new(),
            };
            out.push((
                drop,
                NamedMechanism {
                    id: id.as_str(),
                    balance: id.balance().as_str(),
                    statement: sentence(&mechanism.statement(&values, &term.parameters)),
                    equation: mechanism.equation().to_owned(),
                    parameters: reported
                        .iter()
                        .map(|(r, std)| Figure::new(r, *std))
                        .collect(),
                    evidence: Evidence {
                        delta_bic: finite_or_zero(2.0 * (drop - price)),
                        holdout_nll_gain_per_sample: finite_or_zero(gain),
                        confidence: confidence.clamp(0.0, 0.999),
                    },
                    confusable_with: others
                        .iter()
                        .map(|(other, weight)| Alternative {
                            id: other.as_str(),
                            confidence: weight.clamp(0.0, 1.0),
                        })
                        .collect(),
                    separating_test: test,
                    effect_sigma: finite_or_zero(
                        (2.0 * drop.max(0.0) / search.count.max(1) as f64).sqrt(),
                    ),
                },
            ));
        }
        out
    }

    pub(super) fn unexplained(&self) -> Vec<Unexplained> {
        let mut all: Vec<Unexplained> = self.tyre.map_or_else(Vec::new, Self::unexplained_tyre);
        if let Some(stage) = self.dynamics {
            let explained =
                (stage.search.base.fitted.loss - stage.search.chosen.fitted.loss).max(0.0);
            all.extend(stage.unexplained.iter().map(|r| Unexplained {
                balance: r.balance.as_str(),
                variable: r.word.clone(),
                form: r.form.clone(),
                z: (2.0 * r.gain.max(0.0)).sqrt(),
                share: (r.gain / (r.gain + explained).max(1e-9)).clamp(0.0, 1.0),
            }));
        }
        all
    }

    pub(super) fn unexplained_tyre(stage: &TyreStage) -> Vec<Unexplained> {
        let explained = (stage.search.base.fitted.loss - stage.search.chosen.fitted.loss).max(0.0);
        stage
            .unexplained
            .iter()
            .map(|r| Unexplained {
                balance: "tyre",
                variable: r.word.clone(),
                form: r.correction.form.clone(),
                z: (2.0 * r.gain.max(0.0)).sqrt(),
                share: (r.gain / (r.gain + explained).max(1e-9)).clamp(0.0, 1.0),
            })
            .collect()
    }
}
