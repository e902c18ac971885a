//! How well base and repaired model fit, and their traces.

use super::Outcome;
use crate::fit::Joint;
use crate::mechanism::Balance;
use crate::model::Model;
use crate::outcome::{BeforeAfter, Fit, Score, Trace};
use crate::proof::{self, score};

/// Longest trace handed on for plots, in points.
const TRACE_POINTS: usize = 1200;

impl Outcome<'_> {
    pub(super) fn scores(&self) -> Fit {
        match (self.tyre, self.dynamics) {
            (Some(stage), _) => {
                let of =
                    |kept: bool| proof::of_stage(&self.tyre_joint(stage, kept).parts[0], stage);
                Fit {
                    fit: of(false),
                    holdout: of(true),
                }
            }
            (None, Some(stage)) => {
                let of = |proof: bool| {
                    let joint = self.dynamics_joint(stage, proof);
                    BeforeAfter {
                        before: self.dynamics_score(&joint, &Model::default()),
                        after: self.dynamics_score(&joint, &stage.search.chosen.fitted.model),
                    }
                };
                Fit {
                    fit: of(false),
                    holdout: of(true),
                }
            }
            (None, None) => Fit::default(),
        }
    }

    pub(super) fn dynamics_score(&self, joint: &Joint<'_>, model: &Model) -> Score {
        // Without a tyre balance the figure is the vehicle's (or the wheel's, over the radius) imbalance.
        let Some(part) = joint.parts.last() else {
            return Score::default();
        };
        let unit = if part.balance == Balance::Wheel {
            1.0 / self.data.context.radius
        } else {
            1.0
        };
        let mut innovations = Vec::new();
        let (mut square, mut count) = (0.0, 0.0);
        for &run in part.runs {
            let residual: Vec<f64> = part.residual(model, &model.vector(), run);
            let window = ((0.25 / self.data.series[run].typical_dt) as usize).max(1);
            for segment in part.segments(run) {
                // Means over a quarter of a second: sample by sample a differenced speed is all noise.
                for chunk in residual[segment.clone()].chunks(window) {
                    let mean = unit * chunk.iter().sum::<f64>() / chunk.len() as f64;
                    square += mean * mean;
                    count += 1.0;
                }
            }
            innovations.extend(part.whiten(&residual, run));
        }
        score(
            square,
            count,
            0.0,
            part.noise.whitener.sigma * unit,
            &innovations,
        )
    }

    pub(super) fn traces(&self) -> Vec<Trace> {
        let Some(stage) = self.tyre else {
            return Vec::new();
        };
        let data = self.data;
        data.series
            .iter()
            .enumerate()
            .map(|(run, s)| {
                let (before, after) = (stage.base(data, run), stage.repaired(data, run));
                let step = s.len().div_ceil(TRACE_POINTS).max(1);
                let usable: Vec<usize> =
                    s.tyre.iter().flat_map(Clone::clone).step_by(step).collect();
                let take = |x: &[f64]| usable.iter().map(|k| x[*k]).collect::<Vec<f64>>();
                Trace {
                    recording: s.name.clone(),
                    holdout: self.split.by_block || self.split.proof_runs.contains(&run),
                    time_s: take(&s.time),
                    slip: usable
                        .iter()
                        .map(|k| s.slip(*k, data.context.radius))
                        .collect(),
                    measured_n: take(&s.drag),
                    before_n: take(&before),
                    after_n: take(&after),
                }
            })
            .collect()
    }
}
