//! The repaired model as plain data.

use nalgebra::DMatrix;

use super::Outcome;
use crate::omnibus::finite_or_zero;
use crate::proof::Likelihood;
use crate::repaired::{Domain, KnownRecording, NoiseModel, Repaired};
use crate::tyre_stage;

impl Outcome<'_> {
    pub(super) fn repaired(
        &self,
        tyre_covariance: &DMatrix<f64>,
        dynamics_covariance: &DMatrix<f64>,
    ) -> Repaired {
        let data = self.data;
        let rows = |m: &DMatrix<f64>| -> Vec<Vec<f64>> {
            (0..m.nrows())
                .map(|i| (0..m.ncols()).map(|j| finite_or_zero(m[(i, j)])).collect())
                .collect()
        };
        let stds = |m: &DMatrix<f64>| -> Vec<f64> {
            (0..m.nrows())
                .map(|i| finite_or_zero(m[(i, i)].max(0.0).sqrt()))
                .collect()
        };
        let start = tyre_stage::start(data).base;
        let (base_alone, base, tyre, corrections, sigma) = match self.tyre {
            Some(stage) => (
                stage.search.base.fitted.model.base.clone(),
                stage.model.base.clone(),
                Repaired::terms(
                    &data.catalogue,
                    &data.context,
                    &stage.model,
                    &stds(tyre_covariance),
                ),
                stage
                    .corrections
                    .iter()
                    .map(|r| r.correction.clone())
                    .collect(),
                self.residual_sigma(stage),
            ),
            None => (
                start.clone(),
                start,
                Vec::new(),
                Vec::new(),
                data.context.drag_sigma,
            ),
        };
        let dynamics = self.dynamics.map_or(Vec::new(), |stage| {
            Repaired::terms(
                &data.catalogue,
                &data.context,
                &stage.search.chosen.fitted.model,
                &stds(dynamics_covariance),
            )
        });
        let mut domain = Domain::default();
        for (name, low, high) in [
            ("vehicle_speed_m_s", 0.0, data.context.max_speed),
            ("drag_force_n", 0.0, data.context.max_drag),
        ] {
            domain.ranges.insert(name.to_owned(), [low, high]);
        }
        let range = |f: &dyn Fn(&crate::prepare::Series, usize) -> f64| {
            let mut limits = [f64::INFINITY, f64::NEG_INFINITY];
            for s in &data.series {
                for k in (0..s.len()).filter(|k| s.rolling[*k]) {
                    let x = f(s, k);
                    if x.is_finite() {
                        limits = [limits[0].min(x), limits[1].max(x)];
                    }
                }
            }
            limits
        };
        for (name, limits) in [
            ("slip", range(&|s, k| s.slip(k, data.context.radius))),
            ("vehicle_speed_m_s", range(&|s, k| s.speed.smooth[k])),
            ("normal_force_n", range(&|s, k| s.load.smooth[k])),
        ] {
            if limits[0].is_finite() && limits[1].is_finite() {
                domain.ranges.insert(name.to_owned(), limits);
            }
        }
        Repaired {
            schema: "muslip.model/1".to_owned(),
            averaged: data.averaged,
            proof_by_blocks: self.split.by_block,
            rig: data.rig.clone(),
            late: crate::chain::correct::Lateness::default(),
            base_alone,
            base,
            tyre,
            dynamics,
            corrections,
            covariance: rows(tyre_covariance),
            dynamics_covariance: rows(dynamics_covariance),
            noise: NoiseModel {
                sigma_n: finite_or_zero(sigma),
                share_of_force: 0.0,
                step_s: Some(finite_or_zero(data.context.dt)),
                channels: self
                    .noise()
                    .into_iter()
                    .map(|(name, noise)| (name, noise.sigma))
                    .collect(),
                likelihood: self.tyre.and_then(|stage| {
                    let size = stage.noise.size?;
                    Some(Likelihood::new(size, &stage.noise.whitener))
                }),
            },
            domain,
            context: data.context.clone(),
            recordings: data
                .series
                .iter()
                .map(|s| KnownRecording {
                    path: s.name.clone(),
                    first_time_s: finite_or_zero(s.time.first().copied().unwrap_or(0.0)),
                    samples: s.len() * data.averaged,
                    holdout: !self.split.by_block && self.split.proof_runs.contains(&s.index),
                })
                .collect(),
        }
    }
}
