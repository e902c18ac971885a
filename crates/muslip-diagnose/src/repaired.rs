//! The repaired model as plain data: what `model.toml` holds, and how it predicts a recording.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::campaign::{Rig, Run};
use crate::chain::coast::Coasting;
use crate::chain::correct::Lateness;
use crate::correction::{Action, Levers, hat};
use crate::data::{Catalogue, Data};
use crate::mechanism::{Context, Law, Parameter};
use crate::model::{Model, Term, tyre};
pub use crate::noise::Likelihood;
use crate::number::finite_or_zero;
use crate::prepare::prepare;
use crate::series::Series;
use crate::variable::Variable;

/// A mechanism with its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RepairedTerm {
    /// Id in the vocabulary.
    pub id: String,
    /// Form, empty where there is one only.
    #[serde(default)]
    pub form: String,
    /// Equation, hidden states included.
    pub equation: String,
    /// Parameters in the form's order.
    pub parameters: Vec<RepairedParameter>,
}

/// A parameter of a mechanism in a repaired model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RepairedParameter {
    /// Name.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
    /// Unit in ASCII.
    pub unit: String,
}

/// An empirical correction: hat functions of a variable. Outside its knots the nearest one's value holds, for the law beside it was
/// fitted with it and is wrong without it; where nothing else stands beside that law, the base law takes over from both.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Correction {
    /// Variable.
    pub variable: String,
    /// `friction` (a factor 1 + c), `force` (added, in units of the mean load), `critical_slip` (a factor 1 + c) or `slip`
    /// (added to the slip that is read).
    pub acts_on: String,
    /// Short form in words; empty where only the table holds.
    #[serde(default)]
    pub form: String,
    /// Knots in the variable's unit, increasing.
    pub knots: Vec<f64>,
    /// Correction at each knot.
    pub values: Vec<f64>,
    /// For a periodic correction: angular rates in rad per unit of the variable with cosine and sine coefficients.
    #[serde(default)]
    pub harmonics: Vec<[f64; 3]>,
}

/// Size of the drag's noise: variance = constant² + (share · force)² and so on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NoiseModel {
    /// Standard deviation of one drag sample in N.
    pub sigma_n: f64,
    /// Part of it that grows with the force, as a share of the force.
    pub share_of_force: f64,
    /// Sampling step in s at which its colour holds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_s: Option<f64>,
    /// Standard deviation of each channel's own noise by column, as the diagnosis found it.
    #[serde(default)]
    pub channels: BTreeMap<String, f64>,
    /// Size by operating point, and colour; `None` where the tyre balance could not be fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub likelihood: Option<Likelihood>,
}

impl NoiseModel {
    /// Standard deviation of a reading of this force in N.
    #[must_use]
    pub fn of_reading(&self, force: f64) -> f64 {
        self.sigma_n.hypot(self.share_of_force * force)
    }
}

/// The range of operation that the model was fitted on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Domain {
    /// Smallest and largest value by variable.
    pub ranges: BTreeMap<String, [f64; 2]>,
}

/// A recording that the model was made from: what had happened before it began.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KnownRecording {
    /// Path as given.
    pub path: String,
    /// First time stamp in s, to recognise the file by.
    pub first_time_s: f64,
    /// Rows, to recognise the file by.
    pub samples: usize,
    /// Whether `proof` was made without it.
    #[serde(default)]
    pub holdout: bool,
}

/// What predicts: the base law alone, and the law with what was found beside it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Predicting {
    /// How late the channels are against the drag.
    #[serde(default, skip_serializing_if = "Lateness::is_none")]
    pub late: Lateness,
    /// Base law alone.
    pub base_alone: Vec<f64>,
    /// The law in the repaired tyre model.
    pub base: Vec<f64>,
    /// Mechanisms of the tyre balance.
    #[serde(default)]
    pub tyre: Vec<RepairedTerm>,
    /// Empirical corrections of the tyre balance.
    #[serde(default)]
    pub corrections: Vec<Correction>,
}

/// A repaired model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Repaired {
    /// `muslip.model/1`.
    pub schema: String,
    /// Samples that were averaged into one before anything else; 0 and 1 mean none.
    #[serde(default)]
    pub averaged: usize,
    /// Whether blocks of every recording were kept for the proof instead of whole recordings.
    #[serde(default)]
    pub proof_by_blocks: bool,
    /// Rig as declared.
    pub rig: Rig,
    /// How late the channels are against the drag: taken off before the repaired model runs.
    #[serde(default, skip_serializing_if = "Lateness::is_none")]
    pub late: Lateness,
    /// Base law alone, refitted: logarithms of peak friction and slip at the peak, and the input shares.
    pub base_alone: Vec<f64>,
    /// The same five in the repaired tyre model.
    pub base: Vec<f64>,
    /// The same for a recording whose place among the campaign's is not known, where something goes by their order;
    /// else empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub base_unplaced: Vec<f64>,
    /// Mechanisms of the tyre balance.
    #[serde(default)]
    pub tyre: Vec<RepairedTerm>,
    /// Mechanisms of the wheel and vehicle balances.
    #[serde(default)]
    pub dynamics: Vec<RepairedTerm>,
    /// Empirical corrections of the tyre balance.
    #[serde(default)]
    pub corrections: Vec<Correction>,
    /// Covariance of base and tyre parameters, row by row.
    #[serde(default)]
    pub covariance: Vec<Vec<f64>>,
    /// Covariance of the dynamics' parameters, row by row.
    #[serde(default)]
    pub dynamics_covariance: Vec<Vec<f64>>,
    /// Noise of a drag reading.
    pub noise: NoiseModel,
    /// Where it holds.
    pub domain: Domain,
    /// Sizes that give the parameters their scale.
    pub context: Context,
    /// What the same argument came to without the recordings, or their blocks, that are kept for the proof: it gives
    /// the figures of the proof.
    #[serde(default)]
    pub proof: Predicting,
    /// Recordings that it was made from.
    #[serde(default)]
    pub recordings: Vec<KnownRecording>,
}

/// Which of the two models predicts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    /// The base law alone, refitted.
    Base,
    /// The repaired model.
    Repaired,
}

/// A prediction of the drag reading, one value a row of the recording.
#[derive(Clone, Debug, Default)]
pub struct Prediction {
    /// Time in s.
    pub time_s: Vec<f64>,
    /// Expected drag reading in N; finite on every row.
    pub drag_force_n: Vec<f64>,
    /// Standard deviation of a reading about it in N.
    pub drag_force_sigma_n: Vec<f64>,
    /// Expected contact force in N, before the measuring chain.
    pub contact_force_n: Vec<f64>,
}

/// A model file that this program cannot run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RepairedError {
    /// A mechanism or form that the vocabulary does not have.
    #[error("unknown mechanism \"{0}\"")]
    UnknownMechanism(String),
    /// A mechanism with another number of parameters than its form has.
    #[error("mechanism \"{id}\" takes {expected} parameters, not {found}")]
    ParameterCount {
        /// Mechanism.
        id: String,
        /// Number expected.
        expected: usize,
        /// Number found.
        found: usize,
    },
    /// A value that is not finite, or a vector of the wrong length.
    #[error("{0} is not a usable value")]
    BadValue(String),
    /// A model made where the tyre balance could not be fitted.
    #[error("the model has no [noise.likelihood]: its tyre balance was not fitted")]
    NoLikelihood,
}

impl Repaired {
    /// What predicts.
    #[must_use]
    pub fn predicting(&self) -> Predicting {
        Predicting {
            late: self.late,
            base_alone: self.base_alone.clone(),
            base: self.base.clone(),
            tyre: self.tyre.clone(),
            corrections: self.corrections.clone(),
        }
    }

    /// The model without what was found of the drag. Its proof stays that of what was found, and says why it went.
    #[must_use]
    pub(crate) fn without_findings(&self) -> Self {
        Self {
            late: Lateness::default(),
            base: self.base_alone.clone(),
            base_unplaced: Vec::new(),
            tyre: Vec::new(),
            corrections: Vec::new(),
            ..self.clone()
        }
    }

    /// The model as it was made without what is kept for the proof.
    #[must_use]
    pub fn unseeing(&self) -> Self {
        let Predicting {
            late,
            base_alone,
            base,
            tyre,
            corrections,
        } = self.proof.clone();
        Self {
            late,
            base_alone,
            base,
            tyre,
            corrections,
            ..self.clone()
        }
    }

    /// Describes the terms of a fitted model.
    #[must_use]
    pub fn terms(
        catalogue: &Catalogue,
        context: &Context,
        model: &Model,
        stds: &[f64],
    ) -> Vec<RepairedTerm> {
        let mut at = model.base.len();
        model
            .terms
            .iter()
            .map(|term| {
                let mechanism = catalogue.get(term.entry);
                let described: Vec<Parameter> = mechanism.parameters(context);
                let from = at;
                at += term.parameters.len();
                RepairedTerm {
                    id: mechanism.id().as_str().to_owned(),
                    form: mechanism.form().to_owned(),
                    equation: mechanism.equation().to_owned(),
                    parameters: described
                        .iter()
                        .zip(&term.parameters)
                        .enumerate()
                        .map(|(i, (d, value))| RepairedParameter {
                            name: d.name.clone(),
                            value: *value,
                            std: stds.get(from + i).copied().unwrap_or(0.0),
                            unit: d.unit.to_owned(),
                        })
                        .collect(),
                }
            })
            .collect()
    }

    fn model_of(
        &self,
        catalogue: &Catalogue,
        base: &[f64],
        terms: &[RepairedTerm],
    ) -> Result<Model, RepairedError> {
        let mut model = Model {
            base: base.to_vec(),
            terms: Vec::new(),
        };
        for term in terms {
            let entry = catalogue
                .entries()
                .iter()
                .position(|m| m.id().as_str() == term.id && m.form() == term.form)
                .ok_or_else(|| {
                    RepairedError::UnknownMechanism(
                        format!("{} {}", term.id, term.form).trim().to_owned(),
                    )
                })?;
            let expected = catalogue.get(entry).parameters(&self.context).len();
            if expected != term.parameters.len() {
                return Err(RepairedError::ParameterCount {
                    id: term.id.clone(),
                    expected,
                    found: term.parameters.len(),
                });
            }
            let parameters: Vec<f64> = term.parameters.iter().map(|p| p.value).collect();
            if parameters.iter().any(|v| !v.is_finite()) {
                return Err(RepairedError::BadValue(format!(
                    "a parameter of {}",
                    term.id
                )));
            }
            model.terms.push(Term { entry, parameters });
        }
        Ok(model)
    }

    /// The tyre model in the engine's own form.
    ///
    /// # Errors
    /// [`RepairedError`] where the file names what this program does not know.
    pub fn tyre_model(&self, catalogue: &Catalogue, which: Which) -> Result<Model, RepairedError> {
        match which {
            Which::Base => self.model_of(catalogue, law("base", &self.base_alone)?, &[]),
            Which::Repaired => self.model_of(catalogue, law("base", &self.base)?, &self.tyre),
        }
    }

    /// The tyre model for one recording: one that it was made from, or another.
    fn model_for(
        &self,
        catalogue: &Catalogue,
        which: Which,
        known: bool,
    ) -> Result<Model, RepairedError> {
        let model = self.tyre_model(catalogue, which)?;
        let unplaced = &self.base_unplaced;
        if which == Which::Base || unplaced.is_empty() || known {
            return Ok(model);
        }
        Ok(Model {
            base: law("base_unplaced", unplaced)?.to_vec(),
            ..model.without_order(catalogue, &self.context)
        })
    }

    /// The models of wheel and vehicle in the engine's own form.
    ///
    /// # Errors
    /// [`RepairedError`] where the file names what this program does not know.
    pub fn dynamics_model(&self, catalogue: &Catalogue) -> Result<Model, RepairedError> {
        self.model_of(catalogue, &[], &self.dynamics)
    }

    /// Position of a recording among those that the model was made from, by file name, length and first time.
    pub(crate) fn known(&self, run: &Run) -> Option<usize> {
        let averaged = self.averaged.max(1);
        self.recordings.iter().position(|r| {
            // A long recording was averaged before: as given it has an incomplete last mean, and an earlier first time.
            let as_averaged = r.samples == run.len() * averaged
                && run.time_s.first().is_some_and(|t| *t == r.first_time_s);
            let as_given = r.samples == run.len() / averaged * averaged
                && mean_of(&run.time_s, averaged).is_some_and(|t| t == r.first_time_s);
            (as_averaged || as_given) && file_name(&r.path) == file_name(&run.name)
        })
    }

    /// A campaign of one run under this model.
    pub(crate) fn data_of(&self, series: Series, extra_names: Vec<String>) -> Data {
        Data {
            extra_names,
            ..Data::of(&self.rig, vec![series], self.context.clone())
        }
    }

    /// A run prepared as those that the model was made from.
    pub(crate) fn prepared(&self, run: &Run) -> Data {
        let index = self.known(run).unwrap_or(self.recordings.len());
        let mut extra_names: Vec<String> = run.extra.iter().map(|(name, _)| name.clone()).collect();
        extra_names.sort();
        let reach_factor = self.context.reach_factor;
        let (series, _) = prepare(&self.rig, run, &extra_names, index, reach_factor);
        self.data_of(series, extra_names)
    }

    /// A run with every channel at the drag's time. Beyond what its late channel tells the law alone slows a coasting vehicle: the one
    /// beside mechanisms may be any, which they make up for, and each of them has to predict from the same speeds.
    fn in_time(&self, run: &Run) -> Run {
        let mut corrected = self.late.corrected(run);
        if let (true, Ok([log_peak, log_critical, ..])) =
            (self.rig.coasting, law("base_alone", &self.base_alone))
        {
            let coasting = Coasting {
                mass_kg: self.rig.mass_kg,
                radius_m: self.rig.radius_m,
                law: Law::rudd(log_peak.exp(), log_critical.exp()),
            };
            coasting.draw_on(run, &self.late, &mut corrected);
        }
        corrected
    }

    /// What a prediction of a recording is made from: its other columns, by the repaired model at the drag's time.
    pub(crate) fn inputs(&self, run: &Run, which: Which) -> Data {
        let mut blind = match which {
            Which::Base => run.clone(),
            Which::Repaired => self.in_time(run),
        };
        blind.drag_force_n = Vec::new();
        self.prepared(&blind)
    }

    /// Predicts the drag reading of a recording from its other columns.
    ///
    /// # Errors
    /// [`RepairedError`] where the model cannot be run.
    pub fn predict(&self, run: &Run, which: Which) -> Result<Prediction, RepairedError> {
        let known = self.known(run).is_some();
        self.predict_from(&self.inputs(run, which), which, known)
    }

    /// The same from [`Self::inputs`], of a recording that the model was made from or of another.
    pub(crate) fn predict_from(
        &self,
        data: &Data,
        which: Which,
        known: bool,
    ) -> Result<Prediction, RepairedError> {
        let model = self.model_for(&data.catalogue, which, known)?;
        let series = &data.series[0];
        let state = tyre(
            &data.catalogue,
            &model,
            &model.vector(),
            series,
            &data.context,
        );
        let contact = state.contact.clone().unwrap_or_else(|| state.force.clone());
        let mut force = state.force;
        if which == Which::Repaired && !self.corrections.is_empty() {
            let levers = Levers::new(data, &model);
            for correction in &self.corrections {
                let added = correction.apply(data, &levers, 0)?;
                for (f, a) in force.iter_mut().zip(added) {
                    *f += a;
                }
            }
            self.leave_to_base(data, &model, &mut force)?;
        }
        let mut last = 0.0;
        for f in &mut force {
            // A row without usable inputs gets its predecessor's prediction: never a gap in the file.
            if f.is_finite() {
                last = *f;
            } else {
                *f = last;
            }
        }
        let drag_force_sigma_n = force.iter().map(|f| self.noise.of_reading(*f)).collect();
        Ok(Prediction {
            time_s: series.time.clone(),
            drag_force_n: force,
            drag_force_sigma_n,
            contact_force_n: contact
                .iter()
                .map(|f| if f.is_finite() { *f } else { 0.0 })
                .collect(),
        })
    }

    /// Leaves a force in N by a model with corrections, along the first run, to the base law where that run goes beyond the knots
    /// of one of them; not where the model has a mechanism, which the base law has not.
    ///
    /// # Errors
    /// [`RepairedError`] where the base law cannot be run.
    pub fn leave_to_base(
        &self,
        data: &Data,
        model: &Model,
        force: &mut [f64],
    ) -> Result<(), RepairedError> {
        if !model.terms.is_empty() {
            return Ok(());
        }
        let alone = self.tyre_model(&data.catalogue, Which::Base)?;
        let (series, p) = (&data.series[0], alone.vector());
        let base = tyre(&data.catalogue, &alone, &p, series, &data.context).force;
        for correction in &self.corrections {
            let known = correction.known(data, 0);
            let unknown = known.into_iter().map(|known| 1.0 - known);
            for ((force, base), unknown) in force.iter_mut().zip(&base).zip(unknown) {
                if unknown > 0.0 {
                    *force += unknown * (base - *force);
                }
            }
        }
        Ok(())
    }
}

/// The parameters of a law as the file has them under this key.
fn law<'a>(key: &str, base: &'a [f64]) -> Result<&'a [f64], RepairedError> {
    if base.len() == crate::model::TYRE_BASE && base.iter().all(|v| v.is_finite()) {
        Ok(base)
    } else {
        Err(RepairedError::BadValue(key.to_owned()))
    }
}

/// First mean over so many samples.
fn mean_of(time: &[f64], samples: usize) -> Option<f64> {
    Some(time.get(..samples)?.iter().sum::<f64>() / samples as f64)
}

fn file_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

impl Correction {
    /// Force added on one run in N.
    ///
    /// # Errors
    /// [`RepairedError::BadValue`] for an action or a variable that does not exist.
    pub fn apply(
        &self,
        data: &Data,
        levers: &Levers,
        run: usize,
    ) -> Result<Vec<f64>, RepairedError> {
        let action = Action::parse(&self.acts_on)
            .ok_or_else(|| RepairedError::BadValue(format!("acts_on = \"{}\"", self.acts_on)))?;
        let n = data.series[run].len();
        let Some(values) = self.variable_on(data, run) else {
            // A column that this recording does not have: no correction.
            return Ok(vec![0.0; n]);
        };
        Ok((0..n)
            .map(|k| {
                let mut amount = match hat(&self.knots, values[k]) {
                    Some((at, w)) if self.values.len() == self.knots.len() => {
                        self.values[at] * (1.0 - w) + self.values[at + 1] * w
                    }
                    _ => 0.0,
                };
                for [rate, cos, sin] in &self.harmonics {
                    let (s, c) = (rate * values[k]).sin_cos();
                    amount += cos * c + sin * s;
                }
                let lever = levers.of(data, action, run, k);
                let added = amount * lever;
                if added.is_finite() { added } else { 0.0 }
            })
            .collect())
    }

    /// The variable on one run; nothing where the recording does not have it.
    fn variable_on(&self, data: &Data, run: usize) -> Option<Vec<f64>> {
        let mut variables = Variable::all(data).into_iter();
        let variable = variables.find(|v| v.key(data) == self.variable)?;
        Some(variable.values(data, run))
    }

    /// How much of it is known at each sample of a run, 0 to 1: all among its knots, nothing farther from them than the last two
    /// are apart, nor where the recording does not have the variable.
    fn known(&self, data: &Data, run: usize) -> Vec<f64> {
        let all = |share: f64| vec![share; data.series[run].len()];
        let Some(values) = self.variable_on(data, run) else {
            return all(0.0);
        };
        let ([first, second, ..], [.., before, last]) = (&self.knots[..], &self.knots[..]) else {
            return all(1.0);
        };
        let beyond = |u: f64| ((first - u) / (second - first)).max((u - last) / (last - before));
        let known = values.into_iter().map(|u| 1.0 - beyond(u));
        known
            .map(|share| finite_or_zero(share).clamp(0.0, 1.0))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::innovations::toy::{Noise, settled, stop};

    #[test]
    fn beyond_its_knots_a_correction_is_that_of_the_nearest() {
        let data = stop(Noise::NONE, 7);
        let levers = Levers::new(&data, &settled(&data).model);
        let slip = Variable::Slip.values(&data, 0);
        let most = slip.iter().copied().fold(0.0, f64::max);
        let correction = Correction {
            variable: "slip".to_owned(),
            acts_on: "friction".to_owned(),
            form: String::new(),
            knots: vec![0.1 * most, 0.2 * most],
            values: vec![-0.3, 0.2],
            harmonics: Vec::new(),
        };
        let added = correction.apply(&data, &levers, 0).unwrap();
        let shares = |beyond: &dyn Fn(f64) -> bool| -> Vec<f64> {
            (0..slip.len())
                .filter(|&k| beyond(slip[k]) && levers.force[0][k].abs() > 10.0)
                .map(|k| added[k] / levers.force[0][k])
                .collect()
        };
        let (below, above) = (
            shares(&|slip| slip < 0.1 * most),
            shares(&|slip| slip > 0.5 * most),
        );
        assert!(!below.is_empty() && !above.is_empty());
        assert!(below.iter().all(|share| (share + 0.3).abs() < 1e-9));
        assert!(above.iter().all(|share| (share - 0.2).abs() < 1e-9));
    }

    #[test]
    fn beyond_what_corrections_were_made_from_the_base_law_takes_over() {
        let data = stop(Noise::NONE, 7);
        let law = settled(&data).model.base;
        let slip = Variable::Slip.values(&data, 0);
        let most = slip.iter().copied().fold(0.0, f64::max);
        let correction = |variable: &str| Correction {
            variable: variable.to_owned(),
            acts_on: "friction".to_owned(),
            form: String::new(),
            knots: vec![0.0, 0.1 * most, 0.2 * most],
            values: vec![0.1, 0.3, 0.2],
            harmonics: Vec::new(),
        };
        let repaired = |corrections: &[Correction]| Repaired {
            base_alone: law.clone(),
            base: core::iter::once(law[0] - 0.5)
                .chain(law[1..].to_vec())
                .collect(),
            corrections: corrections.to_vec(),
            context: data.context.clone(),
            ..Repaired::default()
        };
        let force = |corrections: &[Correction], which| {
            let prediction = repaired(corrections).predict_from(&data, which, false);
            prediction.unwrap().drag_force_n
        };
        let by_slip = [correction("slip")];
        let [base, alone] = [Which::Base, Which::Repaired].map(|which| force(&[], which));
        let corrected = force(&by_slip, Which::Repaired);
        let levers = Levers::new(
            &data,
            &repaired(&[])
                .tyre_model(&data.catalogue, Which::Repaired)
                .unwrap(),
        );
        let added = by_slip[0].apply(&data, &levers, 0).unwrap();
        let mut seen = [0; 2];
        for k in 0..slip.len() {
            let share = slip[k] / most;
            if share > 0.31 {
                assert!((corrected[k] - base[k]).abs() < 1e-9);
                seen[0] += 1;
            } else if (0.0..0.2).contains(&share) {
                assert!((corrected[k] - alone[k] - added[k]).abs() < 1e-9);
                seen[1] += 1;
            }
        }
        assert!(seen.iter().all(|seen| *seen > 50), "{seen:?}");
        // Nor is anything known of a column that the recording does not have.
        let unknown = force(&[correction("temperature_c")], Which::Repaired);
        assert!(unknown.iter().zip(&base).all(|(a, b)| (a - b).abs() < 1e-9));
    }
}
