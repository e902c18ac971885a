//! The repaired model as plain data, and whether it is the one that predicts.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::answer::Answer;
use crate::chain::correct::Lateness;
use crate::constants::{
    LEAST_GAIN_OF_PREDICTION, LEAST_STDS_EXPORTED, LEAST_STDS_GAINED, MOST_WORSE, PREDICTED_APART,
};
use crate::data::{Catalogue, Data};
use crate::law::closest;
use crate::mechanism::Stage;
use crate::model::{Model, TYRE_BASE, Term};
use crate::number::{finite_or_zero, mean_and_std};
use crate::repaired::{
    Domain, KnownRecording, NoiseModel, Predicting, Repaired, RepairedTerm, Which,
};
use crate::series::Series;

/// Terms of a model with the covariance of all its parameters.
struct Terms {
    terms: Vec<RepairedTerm>,
    covariance: Vec<Vec<f64>>,
}

impl Answer<'_> {
    /// The model with what was named, its channels at one time where they are named late.
    pub(super) fn repaired(&self) -> Repaired {
        let data = &self.data;
        let reach_factor = self.to_predict.context.reach_factor;
        let chosen = &self.decision.chosen;
        let unplaced = chosen.model.without_order(&data.catalogue, &data.context);
        let covariance = self.covariance(chosen);
        let [tyre, dynamics] = [true, false].map(|tyre| self.terms(tyre, &covariance));
        let late = if self.named_delays().is_empty() {
            Lateness::default()
        } else {
            self.timing.told()
        };
        Repaired {
            schema: "muslip.model/1".to_owned(),
            averaged: self.given.averaged,
            rig: data.rig.clone(),
            late,
            base_alone: self.given.plain_law(&self.kept, reach_factor),
            base: self.predicting_base(&chosen.model),
            base_unplaced: if unplaced.terms.len() < chosen.model.terms.len() {
                self.predicting_base(&unplaced)
            } else {
                Vec::new()
            },
            tyre: tyre.terms,
            dynamics: dynamics.terms,
            corrections: chosen.corrections(data),
            covariance: tyre.covariance,
            dynamics_covariance: dynamics.covariance,
            noise: NoiseModel {
                sigma_n: finite_or_zero(data.context.drag_sigma),
                step_s: Some(finite_or_zero(self.given.data.context.dt)),
                channels: self
                    .noise()
                    .into_iter()
                    .map(|(n, c)| (n, c.sigma))
                    .collect(),
                ..NoiseModel::default()
            },
            domain: self.domain(),
            context: self.to_predict.context.clone(),
            recordings: self
                .given
                .runs
                .iter()
                .map(|r| KnownRecording {
                    path: r.name.clone(),
                    first_time_s: finite_or_zero(r.time_s.first().copied().unwrap_or(0.0)),
                    samples: r.len() * self.given.averaged,
                    holdout: false,
                })
                .collect(),
            ..Repaired::default()
        }
    }

    /// What its repaired model predicts by without the memories of the force among its terms, with the law that then predicts
    /// best; nothing where there is none.
    pub(super) fn predicting_without_memories(&self, with: &Predicting) -> Option<Predicting> {
        let Data {
            catalogue, context, ..
        } = &self.data;
        let chosen = &self.decision.chosen.model;
        let mut model = chosen.clone();
        model.terms.retain(|term| !self.remembers_force(term));
        if model.terms.len() == chosen.terms.len() {
            return None;
        }
        let base = self.predicting_base(&model);
        model.terms.retain(|term| !is_dynamic(catalogue, term));
        Some(Predicting {
            base,
            tyre: Repaired::terms(catalogue, context, &model, &[]),
            ..with.clone()
        })
    }

    /// The range of operation of the recordings.
    fn domain(&self) -> Domain {
        let data = &self.data;
        let mut domain = Domain::default();
        let mut put = |name: &str, limits: [f64; 2]| {
            if limits.iter().all(|x| x.is_finite()) {
                domain.ranges.insert(name.to_owned(), limits);
            }
        };
        let range = |f: &dyn Fn(&Series, usize) -> f64| {
            let mut limits = [f64::INFINITY, f64::NEG_INFINITY];
            for s in &data.series {
                for x in (0..s.len()).filter(|k| s.rolling[*k]).map(|k| f(s, k)) {
                    if x.is_finite() {
                        limits = [limits[0].min(x), limits[1].max(x)];
                    }
                }
            }
            limits
        };
        put("drag_force_n", [0.0, data.context.max_drag]);
        put("slip", range(&|s, k| s.slip(k, data.context.radius)));
        put("vehicle_speed_m_s", range(&|s, k| s.speed.smooth[k]));
        put("normal_force_n", range(&|s, k| s.load.smooth[k]));
        domain
    }

    /// Named terms of the tyre's balance, beside the base law, or of the others; `all` is the covariance of every
    /// parameter.
    fn terms(&self, tyre: bool, all: &DMatrix<f64>) -> Terms {
        let data = &self.data;
        let chosen = &self.decision.chosen;
        let mut model = Model {
            base: Vec::new(),
            terms: Vec::new(),
        };
        let mut places: Vec<usize> = Vec::new();
        if tyre {
            model.base.clone_from(&chosen.model.base);
            places.extend(0..TYRE_BASE);
        }
        let mut at = TYRE_BASE;
        for term in &chosen.model.terms {
            let own = at..at + term.parameters.len();
            at = own.end;
            if is_dynamic(&data.catalogue, term) != tyre {
                model.terms.push(term.clone());
                places.extend(own);
            }
        }
        let stds: Vec<f64> = places
            .iter()
            .map(|&i| all[(i, i)].max(0.0).sqrt())
            .collect();
        let row = |&i: &usize| places.iter().map(|&j| all[(i, j)]).collect();
        Terms {
            terms: Repaired::terms(&data.catalogue, &data.context, &model, &stds),
            covariance: places.iter().map(row).collect(),
        }
    }

    /// How the repaired model predicts the drag of the recordings beside the law fitted to raw channels: each as it is
    /// known, and as one that was never seen, whose own values are read off it anew and whose place is not known.
    pub(super) fn predicts(&self, base: &Repaired, with: &Repaired) -> Predicts {
        let runs = self.given.runs.par_iter().enumerate();
        let gains = runs.map(|(place, run)| {
            let mut inputs = with.inputs(run, Which::Repaired);
            let mut plain = (base.late != with.late).then(|| base.inputs(run, Which::Repaired));
            let mut gain = |known: bool| {
                let place = if known { place } else { with.recordings.len() };
                for data in [Some(&mut inputs), plain.as_mut()].into_iter().flatten() {
                    data.series[0].index = place;
                }
                let error = |model: &Repaired, data: &Data| {
                    let predicted = model.predict_from(data, Which::Repaired, known);
                    mean_square(&predicted.ok()?.drag_force_n, &run.drag_force_n)
                };
                let plain = error(base, plain.as_ref().unwrap_or(&inputs))?;
                Some((plain / error(with, &inputs)?).ln())
            };
            Some((gain(false)?, gain(true)?))
        });
        let gains: Vec<(f64, f64)> = gains.collect::<Option<_>>().unwrap_or_default();
        let (unseen, known): (Vec<f64>, Vec<f64>) = gains.into_iter().unzip();
        // Shares of the error itself: that one recording gains ten times as much as another is no reason for doubt.
        let shares: Vec<f64> = unseen.iter().map(|g| 1.0 - (-0.5 * g).exp()).collect();
        let gained = surely_gained(&unseen);
        Predicts {
            known: gained || surely_gained(&known),
            unseen: gained
                && each_clearly_gains(&unseen)
                && next_gains(&shares, LEAST_STDS_EXPORTED)
                && self
                    .decision
                    .chosen
                    .law_outweighs_corrections(&self.to_predict),
        }
    }

    /// The law's two parameters that predict best beside the terms of a model and the corrections: by plain least
    /// squares, for a prediction has noisy inputs, too.
    fn predicting_base(&self, model: &Model) -> Vec<f64> {
        let data = &self.to_predict;
        let drags = self.decision.chosen.drag_to_explain(data);
        closest(data, model, &drags).base
    }
}

/// Whether a term is of the wheel's balance or the vehicle's.
fn is_dynamic(catalogue: &Catalogue, term: &Term) -> bool {
    let stage = catalogue.get(term.entry).stage();
    matches!(stage, Stage::Wheel | Stage::Vehicle)
}

/// Which recordings a repaired model predicts better than the law alone does.
#[derive(Clone, Copy, Default)]
pub(super) struct Predicts {
    /// Those that it was made from.
    pub known: bool,
    /// The same, as if they had never been seen, and each of them clearly.
    pub unseen: bool,
}

/// Whether logarithms of the squared error's ratio, one a recording, show a gain: on the whole, no loss on any of them,
/// and spread so little that the next recording is likely to gain too.
fn surely_gained(gains: &[f64]) -> bool {
    let mean = mean_and_std(gains).0;
    let sure = mean > LEAST_GAIN_OF_PREDICTION && next_gains(gains, LEAST_STDS_GAINED);
    sure && gains.iter().all(|g| *g > -MOST_WORSE.ln())
}

/// Whether each recording is predicted clearly better.
fn each_clearly_gains(gains: &[f64]) -> bool {
    gains.iter().all(|gain| *gain > PREDICTED_APART)
}

/// Whether the next recording gains unless it lies further off the mean than so many standard deviations.
fn next_gains(gains: &[f64], stds: f64) -> bool {
    let (mean, std) = mean_and_std(gains);
    mean > stds * std * (1.0 + 1.0 / gains.len() as f64).sqrt()
}

/// Mean square of the error of a predicted drag; `None` without a reading.
fn mean_square(predicted: &[f64], drag: &[f64]) -> Option<f64> {
    let errors: Vec<f64> = predicted
        .iter()
        .zip(drag)
        .map(|(a, b)| (a - b).powi(2))
        .filter(|e| e.is_finite())
        .collect();
    (!errors.is_empty()).then(|| errors.iter().sum::<f64>() / errors.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gain_is_sure_where_the_next_recording_gains_too() {
        // Mean 0.3; the next one's standard deviation is 0.129 with these four, 0.356 with those.
        assert!(surely_gained(&[0.2, 0.4, 0.2, 0.4]));
        assert!(!surely_gained(&[0.0, 0.6, 0.05, 0.55]));
        assert!(next_gains(&[0.2, 0.4, 0.2, 0.4], 2.3));
        assert!(!next_gains(&[0.2, 0.4, 0.2, 0.4], 2.4));
        assert!(surely_gained(&[0.03]), "one recording has no spread");
        assert!(!surely_gained(&[0.01, 0.01]), "less than chance");
        assert!(
            !surely_gained(&[0.5, 0.5, 0.5, -0.011]),
            "one lost a percent"
        );
        assert!(!surely_gained(&[]) && !surely_gained(&[f64::NAN, 0.5]));
    }

    #[test]
    fn a_model_is_exported_where_no_recording_is_predicted_as_well_without_it() {
        assert!(each_clearly_gains(&[0.11, 0.5, 0.3]));
        assert!(!each_clearly_gains(&[0.09, 0.5, 0.3]) && !each_clearly_gains(&[f64::NAN]));
    }
}
