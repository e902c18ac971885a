//! Noise, base law, what was looked for, how well base and chosen model fit, and their traces.

use std::collections::BTreeMap;

use super::Answer;
use crate::innovations::hypothesis::Judged;
use crate::innovations::rows::rows_of;
use crate::mechanism::{Balance, Id};
use crate::omnibus::finite_or_zero;
use crate::outcome::{BeforeAfter, ChannelNoise, Estimate, Fit, LookedFor, Score, Trace};
use crate::prepare::Series;

/// Points of a trace.
const TRACE_POINTS: usize = 1200;

impl Answer<'_> {
    pub(super) fn noise(&self) -> BTreeMap<String, ChannelNoise> {
        let data = self.data;
        let mean = |f: &dyn Fn(&Series) -> f64| {
            let all: Vec<f64> = data
                .series
                .iter()
                .map(f)
                .filter(|x| x.is_finite())
                .collect();
            finite_or_zero(
                (all.iter().map(|x| x * x).sum::<f64>() / all.len().max(1) as f64).sqrt(),
            )
        };
        let white = (data.averaged as f64).sqrt();
        [
            (
                "drag_force_n",
                self.white(Balance::Tyre).unwrap_or(data.context.drag_sigma),
            ),
            ("normal_force_n", mean(&|s| s.load.sigma)),
            ("wheel_speed_rad_s", mean(&|s| s.wheel.sigma)),
            ("vehicle_speed_m_s", mean(&|s| s.speed.sigma)),
        ]
        .into_iter()
        .map(|(name, sigma)| {
            (
                name.to_owned(),
                ChannelNoise {
                    sigma: sigma * white,
                    declared: data.rig.declared_noise.get(name).copied(),
                },
            )
        })
        .collect()
    }

    pub(super) fn base(&self) -> BTreeMap<String, Estimate> {
        let mut all = BTreeMap::new();
        for (judged, prefix) in [
            (&self.decision.base, ""),
            (&self.decision.chosen, "repaired_"),
        ] {
            if !prefix.is_empty() && judged.model.terms.is_empty() {
                continue;
            }
            let covariance = self.covariance(judged);
            for (i, name) in ["peak_friction", "critical_slip"].into_iter().enumerate() {
                let value = judged.model.base[i].exp();
                all.insert(
                    format!("{prefix}{name}"),
                    Estimate {
                        value: finite_or_zero(value),
                        std: finite_or_zero(value * covariance[(i, i)].max(0.0).sqrt()),
                    },
                );
            }
        }
        all
    }

    pub(super) fn looked_for(&self) -> Vec<LookedFor> {
        Id::ALL
            .iter()
            .map(|id| LookedFor {
                id: id.as_str(),
                identifiable: match id.balance() {
                    Balance::Tyre => self.data.series.iter().any(|s| !s.tyre.is_empty()),
                    Balance::Wheel => self.data.series.iter().any(|s| s.torque.is_some()),
                    Balance::Vehicle => self.data.rig.coasting,
                },
                minimum_detectable: None,
            })
            .collect()
    }

    pub(super) fn caveats(&self) -> Vec<String> {
        let mut all = vec!["A wrong scale of slip or of the normal force, or a constant camber or surface, cannot be told from another peak friction or slip at the peak.".to_owned()];
        if !self.rig.coasting {
            all.push("The speed is held or driven: the vehicle balance says nothing.".to_owned());
        }
        if self.data.series.iter().all(|s| s.torque.is_none()) {
            all.push("No brake column: the wheel balance could not be formed.".to_owned());
        }
        all
    }

    pub(super) fn fit(&self) -> Fit {
        let score = |judged: &Judged, unseen: bool| {
            let rows: usize = judged.grams.iter().flatten().map(|g| g.count).sum();
            let nll = if unseen {
                judged.unseen.iter().sum::<f64>()
            } else {
                judged.loss
            };
            Score {
                rmse_n: finite_or_zero(judged.residual_n),
                nll_per_sample: finite_or_zero(nll / rows.max(1) as f64),
                whiteness_p: None,
            }
        };
        let of = |unseen| BeforeAfter {
            before: score(&self.decision.base, unseen),
            after: score(&self.decision.chosen, unseen),
        };
        Fit {
            fit: of(false),
            holdout: of(true),
        }
    }

    pub(super) fn traces(&self) -> Vec<Trace> {
        let data = self.data;
        data.series
            .iter()
            .enumerate()
            .map(|(run, s)| {
                let before = rows_of(data, &self.decision.base.model, run).tyre;
                let after = rows_of(data, &self.decision.chosen.model, run).tyre;
                let step = s.len().div_ceil(TRACE_POINTS).max(1);
                let usable: Vec<usize> = if before.is_empty() {
                    Vec::new()
                } else {
                    s.tyre.iter().flat_map(Clone::clone).step_by(step).collect()
                };
                Trace {
                    recording: s.name.clone(),
                    holdout: false,
                    time_s: usable.iter().map(|k| s.time[*k]).collect(),
                    slip: usable
                        .iter()
                        .map(|k| s.slip(*k, data.context.radius))
                        .collect(),
                    measured_n: usable.iter().map(|k| s.drag[*k]).collect(),
                    before_n: usable.iter().map(|k| s.drag[*k] - before[*k]).collect(),
                    after_n: usable.iter().map(|k| s.drag[*k] - after[*k]).collect(),
                }
            })
            .collect()
    }
}
