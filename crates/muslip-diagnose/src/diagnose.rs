//! The whole argument: residuals, noise, screening, location, joint fit, choice, proof, remainder.

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use crate::ablation::Ablation;
use crate::campaign::{Rig, Run};
use crate::choose::{Limits, Search};
use crate::confidence::{alternatives, covariance, figures, membership};
use crate::data::Data;
use crate::dynamics_stage::{self, DynamicsStage};
use crate::fit::{Fitted, Joint, Problem};
use crate::locate::{intervals, regions};
use crate::looked::looked_for;
use crate::mechanism::{Balance, Id, Reported};
use crate::model::Model;
use crate::noise::robust_sigma;
use crate::outcome::{
    Alternative, BeforeAfter, ChannelNoise, Diagnosis, Estimate, Evidence, Fault, Figure, Fit,
    Interval, NamedMechanism, Recording, Region, Role, Score, Trace, Unexplained, Verdict,
};
use crate::proof::{self, Likelihood, score};
use crate::repaired::{Domain, KnownRecording, NoiseModel, Repaired};
use crate::separating::separating_test;
use crate::split::Split;
use crate::tyre_stage::{self, TyreStage};

/// Called with the share of the work done (0..=1) and what is being done.
pub type Progress<'a> = &'a (dyn Fn(f64, &str) + Sync);

/// Samples above which neighbours are averaged first: memory and time would grow without telling more of anything
/// but the fastest effects.
const MOST_SAMPLES: usize = 300_000;

/// Diagnoses a campaign of recordings. Deterministic: the same input gives the same result, whatever
/// the number of threads. The recordings are given up, so that long ones need not stay in memory.
#[must_use]
pub fn diagnose(rig: &Rig, runs: Vec<Run>, progress: Progress<'_>) -> Diagnosis {
    diagnose_without(rig, runs, Ablation::default(), progress)
}

/// The same with parts of the argument left out.
#[must_use]
pub fn diagnose_without(
    rig: &Rig,
    runs: Vec<Run>,
    ablation: Ablation,
    progress: Progress<'_>,
) -> Diagnosis {
    progress(0.0, "cleaning and smoothing the recordings");
    let total: usize = runs.iter().map(Run::len).sum();
    let averaged = total.div_ceil(MOST_SAMPLES).max(1);
    // One after the other, so that the long recordings do not outlive their means.
    let runs: Vec<Run> = runs.into_iter().map(|run| run.averaged(averaged)).collect();
    let mut data = Data::new(rig, &runs, ablation);
    data.averaged = averaged;
    let split = Split::new(&data);
    let limits = Limits {
        ablation,
        ..Limits::default()
    };
    let tyre = tyre_stage::analyse(&data, &runs, &split, &limits, &progress);
    progress(0.75, "wheel and vehicle");
    let chain = tyre
        .as_ref()
        .and_then(|t| tyre_stage::chain(&data, &t.model));
    let dynamics = dynamics_stage::analyse(&data, &split, &limits.for_dynamics(), chain.as_deref());
    progress(0.85, "proof and report");
    let outcome = Outcome {
        data: &data,
        split: &split,
        limits: &limits,
        tyre: tyre.as_ref(),
        dynamics: dynamics.as_ref(),
        chain: chain.as_deref(),
    }
    .assemble();
    progress(1.0, "done");
    outcome
}

struct Outcome<'a> {
    data: &'a Data,
    split: &'a Split,
    limits: &'a Limits,
    tyre: Option<&'a TyreStage>,
    dynamics: Option<&'a DynamicsStage>,
    chain: Option<&'a [Vec<f64>]>,
}

/// Longest trace handed on for plots, in points.
const TRACE_POINTS: usize = 1200;

impl Outcome<'_> {
    fn tyre_joint<'b>(&'b self, stage: &'b TyreStage, proof: bool) -> Joint<'b> {
        let mut problem = tyre_stage::problem(self.data, self.split, &stage.noise);
        if proof {
            problem.runs = &self.split.proof_runs;
            problem.segments = self.split.proof.of(Balance::Tyre);
        }
        Joint {
            parts: vec![problem],
        }
    }

    fn dynamics_joint<'b>(&'b self, stage: &'b DynamicsStage, proof: bool) -> Joint<'b> {
        let (runs, segments) = if proof {
            (&self.split.proof_runs, &self.split.proof)
        } else {
            (&self.split.fit_runs, &self.split.fit)
        };
        Joint {
            parts: stage
                .noise
                .iter()
                .map(|(balance, noise)| Problem {
                    data: self.data,
                    balance: *balance,
                    noise,
                    runs,
                    segments: segments.of(*balance),
                    chain: self.chain,
                })
                .collect(),
        }
    }

    fn assemble(&self) -> Diagnosis {
        let mut mechanisms: Vec<(f64, NamedMechanism)> = Vec::new();
        let mut tyre_covariance = DMatrix::zeros(0, 0);
        let mut dynamics_covariance = DMatrix::zeros(0, 0);
        if let Some(stage) = self.tyre {
            let joint = self.tyre_joint(stage, false);
            tyre_covariance = covariance(&joint, &stage.fitted);
            let proof = self.tyre_joint(stage, true);
            mechanisms.extend(self.named(
                &joint,
                &proof,
                &stage.search,
                &stage.fitted,
                &tyre_covariance,
            ));
        }
        if let Some(stage) = self.dynamics {
            let joint = self.dynamics_joint(stage, false);
            let fitted = &stage.search.chosen.fitted;
            dynamics_covariance = covariance(&joint, fitted);
            let proof = self.dynamics_joint(stage, true);
            mechanisms.extend(self.named(
                &joint,
                &proof,
                &stage.search,
                fitted,
                &dynamics_covariance,
            ));
        }
        mechanisms.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mechanisms: Vec<NamedMechanism> = mechanisms.into_iter().map(|(_, m)| m).collect();
        let unexplained = self.unexplained();
        let verdict = match (
            self.tyre.is_none() && self.dynamics.is_none(),
            mechanisms.is_empty(),
            unexplained.is_empty(),
        ) {
            (true, _, _) => Verdict::Undecided,
            (_, true, true) => Verdict::Consistent,
            (_, false, true) => Verdict::Explained,
            (_, false, false) => Verdict::PartlyExplained,
            (_, true, false) => Verdict::Unexplained,
        };
        let (r#where, regions) = if mechanisms.is_empty() && unexplained.is_empty() {
            (Vec::new(), Vec::new())
        } else {
            self.located()
        };
        let limits = self.limits;
        let dynamic_limits = limits.for_dynamics();
        let mut looked = Vec::new();
        let tyre_part = self.tyre.map(|s| {
            (
                self.tyre_joint(s, false),
                s.search.base.fitted.model.clone(),
            )
        });
        let dynamics_part = self
            .dynamics
            .map(|s| (self.dynamics_joint(s, false), Model::default()));
        if let Some((joint, base)) = &tyre_part {
            looked.extend(looked_for(&[(joint, base)], limits));
        }
        if let Some((joint, base)) = &dynamics_part {
            let found = looked_for(&[(joint, base)], &dynamic_limits);
            if looked.is_empty() {
                looked = found;
            } else {
                for (known, own) in looked.iter_mut().zip(found) {
                    if !known.identifiable && known.minimum_detectable.is_none() {
                        *known = own;
                    }
                }
            }
        }
        if looked.is_empty() {
            looked = looked_for(&[], limits);
        }
        Diagnosis {
            schema: "muslip.diagnosis/1",
            verdict,
            recordings: self.recordings(),
            noise: self.noise(),
            base: self.base(),
            r#where,
            regions,
            mechanisms,
            unexplained,
            looked_for: looked,
            data_faults: self.faults(),
            fit: self.scores(),
            caveats: self.caveats(),
            traces: self.traces(),
            repaired: self.repaired(&tyre_covariance, &dynamics_covariance),
        }
    }

    fn recordings(&self) -> Vec<Recording> {
        self.data
            .series
            .iter()
            .map(|s| Recording {
                path: s.name.clone(),
                samples: s.len() * self.data.averaged,
                role: if !self.split.by_block && self.split.proof_runs.contains(&s.index) {
                    Role::Holdout
                } else {
                    Role::Fit
                },
            })
            .collect()
    }

    /// Named mechanisms of one stage with their effect's size for sorting.
    fn named(
        &self,
        joint: &Joint<'_>,
        proof: &Joint<'_>,
        search: &Search,
        fitted: &Fitted,
        covariance: &DMatrix<f64>,
    ) -> Vec<(f64, NamedMechanism)> {
        let data = self.data;
        let membership = membership(search);
        let proof_count = proof.count().max(1) as f64;
        let with_all = proof.loss(&fitted.model);
        let mut out = Vec::new();
        for (place, term) in fitted.model.terms.iter().enumerate() {
            let mechanism = data.catalogue.get(term.entry);
            let id = mechanism.id();
            // What is lost without it, the others fitted anew.
            let mut fewer = fitted.model.clone();
            fewer.terms.remove(place);
            let without = if fewer.terms.is_empty() && joint.is_tyre() {
                search.base.fitted.clone()
            } else {
                joint.fit(&fewer, 12)
            };
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
                        .map(|(r, std)| Figure {
                            name: r.name.to_owned(),
                            value: finite(r.value),
                            std: finite(*std).max(0.0),
                            unit: r.unit.to_owned(),
                        })
                        .collect(),
                    evidence: Evidence {
                        delta_bic: finite(2.0 * (drop - price)),
                        holdout_nll_gain_per_sample: finite(gain),
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
                    effect_sigma: finite((2.0 * drop.max(0.0) / search.count.max(1) as f64).sqrt()),
                },
            ));
        }
        out
    }

    fn unexplained(&self) -> Vec<Unexplained> {
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

    fn unexplained_tyre(stage: &TyreStage) -> Vec<Unexplained> {
        let explained = (stage.search.base.fitted.loss - stage.fitted.loss).max(0.0);
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

    fn noise(&self) -> BTreeMap<String, ChannelNoise> {
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
                    sigma: finite(sigma),
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
    fn residual_sigma(&self, stage: &TyreStage) -> f64 {
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

    fn base(&self) -> BTreeMap<String, Estimate> {
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
                if !stage.fitted.model.terms.is_empty() {
                    let spread = covariance(&joint, &stage.fitted);
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
            estimate.value = finite(estimate.value);
            estimate.std = finite(estimate.std);
        }
        base
    }

    fn located(&self) -> (Vec<Interval>, Vec<Region>) {
        let data = self.data;
        let mut found: Vec<Interval> = Vec::new();
        let mut where_regions = Vec::new();
        if let Some(stage) = self.tyre
            && (!stage.fitted.model.terms.is_empty() || !stage.corrections.is_empty())
        {
            let sigma = self.residual_sigma(stage);
            let channel = if stage.fitted.model.ids(&data.catalogue) == [Id::EncoderRipple] {
                "wheel_speed_rad_s"
            } else {
                "drag_force_n"
            };
            let difference: Vec<Vec<f64>> = (0..data.series.len())
                .map(|run| {
                    let after = stage.repaired(data, run);
                    stage
                        .base(data, run)
                        .iter()
                        .zip(after)
                        .map(|(b, a)| a - b)
                        .collect()
                })
                .collect();
            for (run, series) in data.series.iter().enumerate() {
                for (start_s, end_s, z) in
                    intervals(&series.time, &difference[run], &series.tyre, sigma, sigma)
                {
                    found.push(Interval {
                        recording: series.name.clone(),
                        balance: "tyre",
                        channel: channel.to_owned(),
                        start_s,
                        end_s,
                        z,
                    });
                }
            }
            let usable: Vec<_> = data.series.iter().map(|s| s.tyre.clone()).collect();
            where_regions.extend(regions(data, "tyre", &difference, &usable, sigma));
        }
        if let Some(stage) = self.dynamics
            && !(stage.search.chosen.ids.is_empty() && stage.unexplained.is_empty())
        {
            self.locate_dynamics(stage, &mut found, &mut where_regions);
        }
        (found, where_regions)
    }

    fn locate_dynamics(
        &self,
        stage: &DynamicsStage,
        found: &mut Vec<Interval>,
        where_regions: &mut Vec<Region>,
    ) {
        let data = self.data;
        let model = &stage.search.chosen.fitted.model;
        let joint = self.dynamics_joint(stage, false);
        let force_sigma = self
            .tyre
            .map_or(data.context.drag_sigma, |s| self.residual_sigma(s));
        for part in &joint.parts {
            let (unit, channel) = match part.balance {
                Balance::Wheel => (data.context.radius, "wheel_speed_rad_s"),
                _ => (1.0, "vehicle_speed_m_s"),
            };
            let sigma = force_sigma * unit;
            let gain = (stage.search.base.fitted.loss - stage.search.chosen.fitted.loss).max(0.0)
                + stage.unexplained.iter().map(|r| r.gain).sum::<f64>();
            let difference: Vec<Vec<f64>> = (0..data.series.len())
                .map(|run| {
                    let after = part.residual(model, &model.vector(), run);
                    let before = part.residual(&Model::default(), &[] as &[f64], run);
                    let mut change: Vec<f64> =
                        before.iter().zip(after).map(|(b, a)| a - b).collect();
                    for r in stage
                        .unexplained
                        .iter()
                        .filter(|r| r.balance == part.balance)
                    {
                        for (c, e) in change.iter_mut().zip(&r.effect[run]) {
                            *c -= e;
                        }
                    }
                    change
                })
                .collect();
            let usable: Vec<_> = data
                .series
                .iter()
                .map(|s| {
                    if part.balance == Balance::Wheel {
                        s.wheel_balance.clone()
                    } else {
                        s.vehicle_balance.clone()
                    }
                })
                .collect();
            let energy: f64 = difference
                .iter()
                .zip(&usable)
                .flat_map(|(d, u)| u.iter().flat_map(move |s| d[s.clone()].iter()))
                .map(|d| d * d)
                .sum();
            if !(energy > 0.0) {
                continue;
            }
            // Strength on the scale of the evidence: the differenced speeds' own noise is no measure.
            let per_sample = (energy / (2.0 * gain.max(1.0))).sqrt().max(1e-300);
            for (run, series) in data.series.iter().enumerate() {
                for (start_s, end_s, z) in intervals(
                    &series.time,
                    &difference[run],
                    &usable[run],
                    sigma,
                    per_sample,
                ) {
                    found.push(Interval {
                        recording: series.name.clone(),
                        balance: part.balance.as_str(),
                        channel: channel.to_owned(),
                        start_s,
                        end_s,
                        z,
                    });
                }
            }
            where_regions.extend(regions(
                data,
                part.balance.as_str(),
                &difference,
                &usable,
                per_sample,
            ));
        }
    }

    fn faults(&self) -> Vec<Fault> {
        let mut faults: Vec<Fault> = self
            .data
            .faults
            .iter()
            .map(|f| Fault {
                recording: f.recording.clone(),
                channel: f.channel.clone(),
                start_s: finite(f.start_s),
                end_s: finite(f.end_s),
                what: f.what.clone(),
            })
            .collect();
        if self.tyre.is_none() {
            for s in &self.data.series {
                faults.push(Fault {
                    recording: s.name.clone(),
                    channel: "drag_force_n".to_owned(),
                    start_s: finite(s.time.first().copied().unwrap_or(0.0)),
                    end_s: finite(s.time.last().copied().unwrap_or(0.0)),
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

    fn scores(&self) -> Fit {
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

    fn dynamics_score(&self, joint: &Joint<'_>, model: &Model) -> Score {
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

    fn caveats(&self) -> Vec<String> {
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

    fn traces(&self) -> Vec<Trace> {
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

    fn repaired(
        &self,
        tyre_covariance: &DMatrix<f64>,
        dynamics_covariance: &DMatrix<f64>,
    ) -> Repaired {
        let data = self.data;
        let rows = |m: &DMatrix<f64>| -> Vec<Vec<f64>> {
            (0..m.nrows())
                .map(|i| (0..m.ncols()).map(|j| finite(m[(i, j)])).collect())
                .collect()
        };
        let stds = |m: &DMatrix<f64>| -> Vec<f64> {
            (0..m.nrows())
                .map(|i| finite(m[(i, i)].max(0.0).sqrt()))
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
            base_alone,
            base,
            tyre,
            dynamics,
            corrections,
            covariance: rows(tyre_covariance),
            dynamics_covariance: rows(dynamics_covariance),
            noise: NoiseModel {
                sigma_n: finite(sigma),
                share_of_force: 0.0,
                step_s: Some(finite(data.context.dt)),
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
                    first_time_s: finite(s.time.first().copied().unwrap_or(0.0)),
                    samples: s.len() * data.averaged,
                    holdout: !self.split.by_block && self.split.proof_runs.contains(&s.index),
                })
                .collect(),
        }
    }
}

/// A number that every reader of the file can take.
fn finite(x: f64) -> f64 {
    if x.is_finite() { x } else { 0.0 }
}

/// First letter large, full stop at the end.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    match letters.next() {
        Some(first) => format!("{}{}.", first.to_uppercase(), letters.as_str()),
        None => String::new(),
    }
}
