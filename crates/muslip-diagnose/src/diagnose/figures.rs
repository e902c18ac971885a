//! Noise, base law, what was looked for, how well base and chosen model fit, and their traces.

use std::collections::BTreeMap;

use super::answer::{Answer, Why};
use super::named::least_delay;
use crate::constants::{POWER, VAGUE_DELAY_S};
use crate::looked::looked_for;
use crate::mechanism::{Balance, Id};
use crate::number::finite_or_zero;
use crate::outcome::{ChannelNoise, Fit, LookedFor, MinimumDetectable, Trace, ValueAndStd};
use crate::proof::Predicted;
use crate::repaired::Repaired;
use crate::series::Series;
use crate::split::Split;

/// Points of a trace.
const TRACE_POINTS: usize = 1200;

impl Answer<'_> {
    pub(super) fn noise(&self) -> BTreeMap<String, ChannelNoise> {
        let data = &self.data;
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

    pub(super) fn base(&self) -> BTreeMap<String, ValueAndStd> {
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
                    ValueAndStd {
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
            .map(|&id| match self.delay_of(id) {
                Some(late) => LookedFor {
                    id: id.as_str(),
                    identifiable: late.std < VAGUE_DELAY_S,
                    minimum_detectable: late.std.is_finite().then(|| MinimumDetectable {
                        name: "delay".to_owned(),
                        value: least_delay(&late) + POWER * late.std,
                        unit: "s".to_owned(),
                    }),
                },
                None => looked_for(id, &self.decision.seen),
            })
            .collect()
    }

    pub(super) fn caveats(&self, kept: &Split) -> Vec<String> {
        let mut caveats = vec![
            "A wrong scale of slip or of the normal force, or a constant camber or surface, cannot be told from another peak friction or slip at the peak.".to_owned(),
        ];
        if !self.given.rig.coasting {
            caveats
                .push("The speed is held or driven: the vehicle balance says nothing.".to_owned());
        }
        if self.data.series.iter().all(|s| s.torque.is_none()) {
            caveats.push("No brake column: the wheel balance could not be formed.".to_owned());
        }
        let averaged = self.given.averaged;
        if averaged > 1 {
            caveats.push(format!(
                "The recordings are long: means over {averaged} samples were diagnosed, so delays and ringing faster than that could not be seen."
            ));
        }
        let words = |id: Id| id.as_str().replace('_', " ");
        for &id in &self.not_asked {
            caveats.push(format!(
                "Not named: {}. Without the recordings kept for the proof the same argument does not come to it, or predicts those worse with it; so they had a part in this choice.",
                words(id)
            ));
        }
        for own in &self.unsaid {
            let why = match own.why {
                Why::NoFigure => "but none of its figures is told from none".to_owned(),
                Why::Unlikely(sure) => format!("with a confidence of {:.0} % only", 100.0 * sure),
            };
            caveats.push(format!(
                "Not named: {}, which would fit, {why}.",
                words(self.data.catalogue.get(own.entry).id()),
            ));
        }
        if kept.by_block {
            caveats.push(
                "Fewer than four recordings: the proof is by blocks of the same runs.".to_owned(),
            );
        }
        caveats
    }
}

/// Figures of the proof.
pub(super) fn fit_of(model: &Repaired, predicted: &[Predicted]) -> Fit {
    let proof = model.proof_of(predicted).unwrap_or_default();
    Fit {
        fit: proof.fit.unwrap_or_default(),
        holdout: proof.holdout.unwrap_or_default(),
    }
}

/// What both models of the proof expect of the recordings, for plots; wheel radius in m.
pub(super) fn traces(kept: &Split, predicted: &[Predicted], radius: f64) -> Vec<Trace> {
    predicted
        .iter()
        .enumerate()
        .map(|(run, own)| {
            let s = &own.series;
            let step = s.len().div_ceil(TRACE_POINTS).max(1);
            let usable: Vec<usize> = s.tyre.iter().flat_map(Clone::clone).step_by(step).collect();
            let take = |x: &[f64]| usable.iter().map(|k| x[*k]).collect::<Vec<f64>>();
            Trace {
                recording: s.name.clone(),
                holdout: kept.by_block || kept.keeps_whole(run),
                time_s: take(&s.time),
                slip: usable.iter().map(|k| s.slip(*k, radius)).collect(),
                measured_n: take(&s.drag),
                before_n: take(&own.before),
                after_n: take(&own.after),
            }
        })
        .collect()
}
