//! The whole argument: residuals, noise, screening, location, joint fit, choice, proof, remainder.

mod channels;
mod located;
mod model_out;
mod named;
mod scores;

use nalgebra::DMatrix;

use crate::ablation::Ablation;
use crate::audit::{Finding, audit};
use crate::campaign::{Rig, Run};
use crate::choose::Limits;
use crate::confidence::covariance;
use crate::data::Data;
use crate::dynamics_stage::{self, DynamicsStage};
use crate::fit::{Joint, Problem};
use crate::looked::looked_for;
use crate::mechanism::Balance;
use crate::model::Model;
use crate::outcome::{Diagnosis, NamedMechanism, Recording, Role, Verdict};
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
    // The measuring chain first: what it does is told beside any physics.
    let chain_findings = audit(rig, &runs).findings;
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
        chain_findings,
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
    chain_findings: Vec<Finding>,
}

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
            tyre_covariance = covariance(&joint, &stage.search.chosen.fitted);
            let proof = self.tyre_joint(stage, true);
            mechanisms.extend(self.named(&joint, &proof, &stage.search, &tyre_covariance));
        }
        if let Some(stage) = self.dynamics {
            let joint = self.dynamics_joint(stage, false);
            dynamics_covariance = covariance(&joint, &stage.search.chosen.fitted);
            let proof = self.dynamics_joint(stage, true);
            mechanisms.extend(self.named(&joint, &proof, &stage.search, &dynamics_covariance));
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
            base: self.base(&tyre_covariance),
            r#where,
            regions,
            mechanisms,
            unexplained,
            looked_for: looked,
            data_faults: self.faults(),
            // The audit of the chain is yet to fill it.
            chain: self.chain_findings.clone(),
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
}
