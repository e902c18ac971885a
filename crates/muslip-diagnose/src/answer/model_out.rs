//! The repaired model as plain data, and whether it is the one that predicts.

use super::{Answer, law_of};
use crate::ablation::Ablation;
use crate::campaign::{Rig, Run};
use crate::chain::correct::Lateness;
use crate::data::Data;
use crate::innovations::candidates::slopes_in;
use crate::innovations::rows::rows_of;
use crate::mechanism::{Balance, Stage};
use crate::model::Model;
use crate::omnibus::finite_or_zero;
use crate::outcome::NamedMechanism;
use crate::repaired::{
    Correction, Domain, KnownRecording, NoiseModel, Repaired, RepairedTerm, Which,
};

/// Least mean logarithm by which a repaired model lowers the square of a prediction's error: less is chance.
const LEAST_GAIN_OF_PREDICTION: f64 = 0.01;

impl Answer<'_> {
    /// The model that says nothing beside the law fitted to the channels as recorded.
    pub(super) fn base_alone(&self, plain: &[f64]) -> Repaired {
        let data = self.data;
        let chosen = &self.decision.chosen;
        let covariance = self.covariance(chosen);
        let mut domain = Domain::default();
        domain.ranges.insert(
            "vehicle_speed_m_s".to_owned(),
            [0.0, data.context.max_speed],
        );
        domain
            .ranges
            .insert("drag_force_n".to_owned(), [0.0, data.context.max_drag]);
        Repaired {
            schema: "muslip.model/1".to_owned(),
            averaged: 1,
            proof_by_blocks: false,
            rig: data.rig.clone(),
            late: Lateness::default(),
            base_alone: plain.to_vec(),
            base: plain.to_vec(),
            tyre: Vec::new(),
            dynamics: self.terms(false),
            corrections: Vec::new(),
            covariance: (0..covariance.nrows())
                .map(|i| covariance.row(i).iter().copied().collect())
                .collect(),
            dynamics_covariance: Vec::new(),
            noise: NoiseModel {
                sigma_n: finite_or_zero(chosen.residual_n),
                share_of_force: 0.0,
                step_s: Some(finite_or_zero(data.context.dt)),
                channels: self
                    .noise()
                    .into_iter()
                    .map(|(n, c)| (n, c.sigma))
                    .collect(),
                likelihood: None,
            },
            domain,
            context: data.context.clone(),
            recordings: self
                .runs
                .iter()
                .map(|r| KnownRecording {
                    path: r.name.clone(),
                    first_time_s: finite_or_zero(r.time_s.first().copied().unwrap_or(0.0)),
                    samples: r.len(),
                    holdout: false,
                })
                .collect(),
        }
    }

    /// Named terms of the tyre's balance, or of the others.
    fn terms(&self, tyre: bool) -> Vec<RepairedTerm> {
        let data = self.data;
        let chosen = &self.decision.chosen.model;
        let mut model = Model {
            base: chosen.base.clone(),
            terms: Vec::new(),
        };
        for term in &chosen.terms {
            let stage = data.catalogue.get(term.entry).stage();
            let dynamic = matches!(stage, Stage::Wheel | Stage::Vehicle);
            if dynamic != tyre {
                model.terms.push(term.clone());
            }
        }
        let stds = vec![0.0; model.vector().len()];
        Repaired::terms(&data.catalogue, &data.context, &model, &stds)
    }

    /// The same with the channels at one time, where they are named late, and with what else was named.
    pub(super) fn repaired(&self, base_alone: &Repaired, delays: &[NamedMechanism]) -> Repaired {
        Repaired {
            late: if delays.is_empty() {
                Lateness::default()
            } else {
                self.timing.late
            },
            base: self.predicting_base(),
            tyre: self.terms(true),
            corrections: self.corrections(),
            ..base_alone.clone()
        }
    }

    fn corrections(&self) -> Vec<Correction> {
        self.dependences()
            .into_iter()
            .filter(|(own, _)| own.balance == Balance::Tyre)
            .map(|(own, coefficients)| own.correction(self.data, &coefficients))
            .collect()
    }

    /// Whether the repaired model predicts the drag of the recordings better than the law fitted to raw channels: on
    /// the whole, and worse on few of them.
    pub(super) fn predicts_better(&self, base: &Repaired, with: &Repaired) -> bool {
        let chosen = &self.decision.chosen.model;
        let per_run = chosen.terms.iter().any(|t| {
            let entry = self.data.catalogue.get(t.entry);
            entry.form().contains("per_run")
        });
        let (mut gained, mut worse) = (0.0, 0);
        for (place, given) in self.runs.iter().enumerate() {
            let mut given = given.clone();
            if per_run {
                // What belongs to a run is read off it anew, as on a run that the model has not seen.
                given.name = format!("unseen {place}");
            }
            let (Some(a), Some(b)) = (square_error(base, &given), square_error(with, &given))
            else {
                return false;
            };
            gained += (a / b).ln();
            if b > 1.002 * a {
                worse += 1;
            }
        }
        gained > LEAST_GAIN_OF_PREDICTION * self.runs.len() as f64 && worse * 4 <= self.runs.len()
    }

    /// The law's two parameters that predict best beside the named terms: by plain least squares, for a prediction has
    /// noisy inputs, too.
    fn predicting_base(&self) -> Vec<f64> {
        let data = self.data;
        let mut model = self.decision.chosen.model.clone();
        for _ in 0..6 {
            let (mut a, mut b, mut c, mut u, mut v) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for (run, s) in data.series.iter().enumerate() {
                let e = rows_of(data, &model, run).tyre;
                if e.is_empty() {
                    continue;
                }
                let slopes = slopes_in(data, &model, run, &[0, 1]);
                for k in s.tyre.iter().flat_map(Clone::clone) {
                    let (x, y) = (slopes[0][0][k], slopes[1][0][k]);
                    if !(x + y + e[k]).is_finite() {
                        continue;
                    }
                    a += x * x;
                    b += x * y;
                    c += y * y;
                    u -= x * e[k];
                    v -= y * e[k];
                }
            }
            let determinant = a * c - b * b;
            if !(determinant > 1e-9 * a * c) {
                break;
            }
            let step = [(c * u - b * v) / determinant, (a * v - b * u) / determinant];
            model.base[0] += step[0].clamp(-0.2, 0.2);
            model.base[1] += step[1].clamp(-0.2, 0.2);
            if step.iter().all(|s| s.abs() < 1e-5) {
                break;
            }
        }
        model.base
    }
}

/// Mean square of the error of a predicted drag.
fn square_error(model: &Repaired, run: &Run) -> Option<f64> {
    let predicted = model.predict(run, Which::Repaired).ok()?.drag_force_n;
    let errors: Vec<f64> = predicted
        .iter()
        .zip(&run.drag_force_n)
        .map(|(a, b)| (a - b).powi(2))
        .filter(|e| e.is_finite())
        .collect();
    Some(errors.iter().sum::<f64>() / errors.len().max(1) as f64)
}

/// The law fitted to the channels as recorded by plain least squares.
pub(super) fn plain_law(rig: &Rig, runs: &[Run]) -> Vec<f64> {
    let data = Data::new(rig, runs, Ablation::default());
    let mut base = law_of(rig);
    let square = |base: &[f64]| -> (f64, f64) {
        // The best peak friction at this slip at the peak.
        let critical = base[1].exp();
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for s in &data.series {
            for k in s.tyre.iter().flat_map(Clone::clone) {
                if !s.rolling[k] {
                    continue;
                }
                let x = s.slip(k, rig.radius_m) / critical;
                let shape = s.load.smooth[k] * 2.0 * x / (1.0 + x * x);
                let y = s.drag[k];
                if shape.is_finite() && y.is_finite() {
                    xx += shape * shape;
                    xy += shape * y;
                    yy += y * y;
                }
            }
        }
        if xx > 0.0 {
            (yy - xy * xy / xx, xy / xx)
        } else {
            (yy, rig.peak_friction)
        }
    };
    let start = base[1];
    let mut best = (f64::INFINITY, start, rig.peak_friction);
    let mut width = 1.6;
    for _ in 0..5 {
        let centre = best.1;
        for i in -6..=6 {
            let at = centre + width * f64::from(i) / 6.0;
            let (value, peak) = square(&[0.0, at]);
            if value < best.0 && peak > 0.0 {
                best = (value, at, peak);
            }
        }
        width /= 4.0;
    }
    base[0] = best.2.ln();
    base[1] = best.1;
    base
}
