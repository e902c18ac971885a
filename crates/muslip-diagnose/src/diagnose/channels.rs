//! Noise and base law as found, faults of the data, and what a reader must know beside the verdict.

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use super::Outcome;
use crate::confidence::covariance;
use crate::mechanism::Balance;
use crate::noise::robust_sigma;
use crate::omnibus::finite_or_zero;
use crate::outcome::{ChannelNoise, Estimate, Fault};
use crate::tyre_stage::TyreStage;

impl Outcome<'_> {
    pub(super) fn noise(&self) -> BTreeMap<String, ChannelNoise> {
        let data = self.data;
        let declared = |name: &str| data.rig.declared_noise.get(name).copied();
        let mean = |f: &dyn Fn(&crate::prepare::Series) -> f64| {
            let all: Vec<f64> = data
                .series
                .iter()
                .map(f)
                .filter(|x| x.is_finite())
                .collect();
            if all.is_empty() {
                0.0
            } else {
                (all.iter().map(|x| x * x).sum::<f64>() / all.len() as f64).sqrt()
            }
        };
        let mut noise = BTreeMap::new();
        let mut put = |name: &str, sigma: f64| {
            noise.insert(
                name.to_owned(),
                ChannelNoise {
                    sigma: finite_or_zero(sigma),
                    declared: declared(name),
                },
            );
        };
        let drag = self.tyre.map_or_else(
            || mean(&|s| s.drag_sigma),
            |stage| self.residual_sigma(stage),
        );
        put("drag_force_n", drag);
        put("normal_force_n", mean(&|s| s.load.sigma));
        put("wheel_speed_rad_s", mean(&|s| s.wheel.sigma));
        put("vehicle_speed_m_s", mean(&|s| s.speed.sigma));
        if data.series.iter().any(|s| s.torque.is_some()) {
            let scale = data.rig.torque_per_pressure_nm_pa;
            let sigma = mean(&|s| s.torque.as_ref().map_or(f64::NAN, |t| t.sigma));
            match scale {
                Some(gain) if data.rig.declared_noise.contains_key("brake_pressure_pa") => {
                    put("brake_pressure_pa", sigma / gain)
                }
                _ => put("brake_torque_nm", sigma),
            }
        }
        noise
    }

    /// Standard deviation of the tyre residual after the repair, in N.
    pub(super) fn residual_sigma(&self, stage: &TyreStage) -> f64 {
        let mut all = Vec::new();
        for &run in &self.split.fit_runs {
            let after = stage.repaired(self.data, run);
            for segment in &self.split.fit.of(Balance::Tyre)[run] {
                all.extend(
                    segment
                        .clone()
                        .map(|k| self.data.series[run].drag[k] - after[k]),
                );
            }
        }
        robust_sigma(&all)
    }

    pub(super) fn base(&self, repaired: &DMatrix<f64>) -> BTreeMap<String, Estimate> {
        let mut base = BTreeMap::new();
        let [peak, critical] = self.data.context.nominal;
        let mut put = |name: &str, value: f64, std: f64| {
            base.insert(name.to_owned(), Estimate { value, std });
        };
        match self.tyre {
            Some(stage) => {
                let joint = self.tyre_joint(stage, false);
                let fitted = &stage.search.base.fitted;
                let spread = covariance(&joint, fitted);
                let p = &fitted.model.base;
                put(
                    "peak_friction",
                    p[0].exp(),
                    p[0].exp() * spread[(0, 0)].max(0.0).sqrt(),
                );
                put(
                    "critical_slip",
                    p[1].exp(),
                    p[1].exp() * spread[(1, 1)].max(0.0).sqrt(),
                );
                if !stage.search.chosen.ids.is_empty() {
                    let spread = repaired;
                    let p = &stage.model.base;
                    put(
                        "repaired_peak_friction",
                        p[0].exp(),
                        p[0].exp() * spread[(0, 0)].max(0.0).sqrt(),
                    );
                    put(
                        "repaired_critical_slip",
                        p[1].exp(),
                        p[1].exp() * spread[(1, 1)].max(0.0).sqrt(),
                    );
                }
            }
            None => {
                put("peak_friction", peak, peak);
                put("critical_slip", critical, critical);
            }
        }
        for estimate in base.values_mut() {
            estimate.value = finite_or_zero(estimate.value);
            estimate.std = finite_or_zero(estimate.std);
        }
        base
    }
    pub(super) fn faults(&self) -> Vec<Fault> {
        let mut faults: Vec<Fault> = self.data.faults.iter().map(Fault::from).collect();
        if self.tyre.is_none() {
            for s in &self.data.series {
                faults.push(Fault {
                    recording: s.name.clone(),
                    channel: "drag_force_n".to_owned(),
                    start_s: finite_or_zero(s.time.first().copied().unwrap_or(0.0)),
                    end_s: finite_or_zero(s.time.last().copied().unwrap_or(0.0)),
                    what: if s.tyre_count() < 30 {
                        "too few usable samples for the tyre balance".to_owned()
                    } else {
                        "drag that says nothing of friction: no braking in the recordings"
                            .to_owned()
                    },
                });
            }
        }
        if self.split.fit_runs.len() + self.split.proof_runs.len() > 0
            && self.split.by_block
            && self.data.series.len() < 4
        {
            faults.push(Fault {
                recording: self
                    .data
                    .series
                    .first()
                    .map_or(String::new(), |s| s.name.clone()),
                channel: "time_s".to_owned(),
                start_s: 0.0,
                end_s: 0.0,
                what: format!(
                    "{} recording(s): fewer than four, so the proof is by blocks of the same runs",
                    self.data.series.len()
                ),
            });
        }
        faults
    }

    pub(super) fn caveats(&self) -> Vec<String> {
        let mut caveats = vec![
            "A wrong scale of slip or of the normal force, or a constant camber or surface, cannot be told from another peak friction or slip at the peak.".to_owned(),
        ];
        if !self.data.rig.coasting {
            caveats
                .push("The speed is held or driven: the vehicle balance says nothing.".to_owned());
        }
        if self.data.series.iter().all(|s| s.torque.is_none()) {
            caveats.push("No brake column: the wheel balance could not be formed.".to_owned());
        }
        if self.data.averaged > 1 {
            caveats.push(format!(
                "The recordings are long: means over {} samples were diagnosed, so delays and ringing faster than that could not be seen.",
                self.data.averaged
            ));
        }
        if self.split.by_block {
            caveats.push(
                "Fewer than four recordings: the proof is by blocks of the same runs.".to_owned(),
            );
        }
        caveats
    }
}
