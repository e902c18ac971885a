//! The result of a diagnosis by innovations, put together from what each stage found.

mod figures;
mod located;
mod model_out;
mod named;

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use crate::audit::{Audit, audit};
use crate::campaign::{Rig, Run};
use crate::chain::timing::{Timing, timed};
use crate::data::Data;
use crate::decide::{Decision, decide, through_force};
use crate::innovations::dependence::Dependence;
use crate::innovations::hypothesis::Judged;
use crate::mechanism::{Balance, Id};
use crate::model::{Model, TYRE_BASE};
use crate::omnibus::finite_or_zero;
use crate::outcome::{Diagnosis, Estimate, Fault, Fit, LookedFor, Recording, Role, Verdict};
use crate::repaired::Repaired;

/// Diagnoses a campaign: the chain first, then physics on innovations.
#[must_use]
pub fn diagnose(rig: &Rig, runs: &[Run], progress: &(dyn Fn(f64, &str) + Sync)) -> Diagnosis {
    progress(0.05, "auditing the measuring chain");
    let audit = audit(rig, runs);
    progress(0.15, "bringing the channels to one time");
    let Some((data, timing, base)) = timed(rig, runs, &audit) else {
        return undecided(rig, runs, audit);
    };
    progress(0.4, "weighing mechanisms");
    // Delays of the speeds are the chain's: they are named by what the timing shows.
    let decision = decide(
        &data,
        base,
        &[Id::VehicleSpeedDelay, Id::WheelSpeedDelay],
        timing.off_by(),
    );
    progress(0.9, "report");
    Answer {
        rig,
        runs,
        audit,
        data: &data,
        timing,
        decision,
    }
    .assemble()
}

fn undecided(rig: &Rig, runs: &[Run], audit: Audit) -> Diagnosis {
    let fault = |r: &Run| Fault {
        recording: r.name.clone(),
        channel: "drag_force_n".to_owned(),
        start_s: finite_or_zero(r.time_s.first().copied().unwrap_or(0.0)),
        end_s: finite_or_zero(r.time_s.last().copied().unwrap_or(0.0)),
        what: "too few usable samples in every balance".to_owned(),
    };
    let estimate = |value: f64| Estimate { value, std: value };
    Diagnosis {
        schema: "muslip.diagnosis/1",
        verdict: Verdict::Undecided,
        recordings: recordings(runs),
        noise: BTreeMap::new(),
        base: [
            ("peak_friction".to_owned(), estimate(rig.peak_friction)),
            ("critical_slip".to_owned(), estimate(rig.critical_slip)),
        ]
        .into(),
        r#where: Vec::new(),
        regions: Vec::new(),
        mechanisms: Vec::new(),
        unexplained: Vec::new(),
        looked_for: Id::ALL
            .iter()
            .map(|id| LookedFor {
                id: id.as_str(),
                identifiable: false,
                minimum_detectable: None,
            })
            .collect(),
        data_faults: runs.iter().map(fault).collect(),
        chain: audit.findings,
        fit: Fit::default(),
        caveats: Vec::new(),
        traces: Vec::new(),
        repaired: Repaired {
            schema: "muslip.model/1".to_owned(),
            rig: rig.clone(),
            base_alone: law_of(rig),
            base: law_of(rig),
            ..Repaired::default()
        },
    }
}

/// Every recording was fitted; each was unseen in its turn.
fn recordings(runs: &[Run]) -> Vec<Recording> {
    runs.iter()
        .map(|r| Recording {
            path: r.name.clone(),
            samples: r.len(),
            role: Role::Fit,
        })
        .collect()
}

fn law_of(rig: &Rig) -> Vec<f64> {
    Model::of_law(rig.peak_friction, rig.critical_slip).base
}

struct Answer<'a> {
    rig: &'a Rig,
    runs: &'a [Run],
    audit: Audit,
    data: &'a Data,
    timing: Timing,
    decision: Decision,
}

impl Answer<'_> {
    fn assemble(self) -> Diagnosis {
        let plain = model_out::plain_law(self.rig, self.runs);
        let base_alone = self.base_alone(&plain);
        let mut mechanisms = self.named();
        let delays = self.named_delays();
        let repaired = self.repaired(&base_alone, &delays);
        mechanisms.extend(delays);
        // A model that says nothing of the drag predicts it as the base does.
        let says_something = !repaired.tyre.is_empty()
            || !repaired.corrections.is_empty()
            || !repaired.late.is_none();
        let better = says_something && self.predicts_better(&base_alone, &repaired);
        if says_something && !better {
            for named in &mut mechanisms {
                if Id::parse(named.id).is_some_and(through_force) {
                    named.evidence.confidence = named.evidence.confidence.min(0.5);
                }
            }
        }
        mechanisms.sort_by(|a, b| b.evidence.delta_bic.total_cmp(&a.evidence.delta_bic));
        let unexplained = self.unexplained();
        let verdict = match (mechanisms.is_empty(), unexplained.is_empty()) {
            (true, true) => Verdict::Consistent,
            (false, true) => Verdict::Explained,
            (false, false) => Verdict::PartlyExplained,
            (true, false) => Verdict::Unexplained,
        };
        let (r#where, regions) = if mechanisms.is_empty() && unexplained.is_empty() {
            (Vec::new(), Vec::new())
        } else {
            self.located()
        };
        Diagnosis {
            schema: "muslip.diagnosis/1",
            verdict,
            recordings: recordings(self.runs),
            noise: self.noise(),
            base: self.base(),
            r#where,
            regions,
            mechanisms,
            unexplained,
            looked_for: self.looked_for(),
            data_faults: self.data.faults.iter().map(Fault::from).collect(),
            chain: self.audit.findings.clone(),
            fit: self.fit(),
            caveats: self.caveats(),
            traces: self.traces(),
            repaired: if better { repaired } else { base_alone },
        }
    }

    /// Covariance in the order of the model's whole vector.
    fn covariance(&self, judged: &Judged) -> DMatrix<f64> {
        let n = judged.model.vector().len();
        let own: Vec<usize> = [0, 1].into_iter().chain(TYRE_BASE..n).collect();
        let mut all = DMatrix::zeros(n, n);
        for (i, &a) in own.iter().enumerate() {
            for (j, &b) in own.iter().enumerate() {
                all[(a, b)] = finite_or_zero(judged.covariance[(i, j)]);
            }
        }
        all
    }

    /// Coefficients of each free dependence.
    fn dependences(&self) -> Vec<(&Dependence, Vec<f64>)> {
        let chosen = &self.decision.chosen;
        let mut at = 2 + chosen.model.vector().len() - TYRE_BASE;
        chosen
            .extra
            .iter()
            .map(|own| {
                let from = at;
                at += own.knots.len();
                (
                    own,
                    (from..at).map(|i| finite_or_zero(chosen.left[i])).collect(),
                )
            })
            .collect()
    }

    /// White noise of a balance's readings as fitted.
    fn white(&self, balance: Balance) -> Option<f64> {
        let parts = self
            .decision
            .chosen
            .parts
            .iter()
            .find(|p| p.balance == balance)?;
        parts
            .sources
            .iter()
            .find(|s| s.kind.is_none())
            .map(|s| s.log_std.exp())
    }
}
