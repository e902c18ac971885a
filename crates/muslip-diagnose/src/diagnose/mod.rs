//! The diagnosis: the stages of the argument in their order, and its result put together from what each found.

mod answer;
mod figures;
mod located;
mod model_out;
mod named;
mod proven;

use std::collections::BTreeMap;

use self::answer::Given;
use self::proven::Proven;
use crate::audit::{Audit, audit};
use crate::campaign::{Rig, Run};
use crate::constants::LEAST_OF_TYRE;
use crate::data::Data;
use crate::law::plain;
use crate::looked::looked_for;
use crate::mechanism::Id;
use crate::model::Model;
use crate::number::finite_or_zero;
use crate::outcome::{Diagnosis, Fault, Fit, Recording, Role, ValueAndStd, Verdict};
use crate::progress::Progress;
use crate::repaired::Repaired;
use crate::series::Series;
use crate::split::Split;

/// Share of the work that is done when all is decided.
const DECIDED: f64 = 0.9;

/// Samples above which neighbours are averaged first: memory and time would grow with them. What is lost is faster than the
/// means, and a caveat says so. With a third as many a campaign of ten million samples at 1 kHz, means over 0.1 s, was
/// consistent although its load cell lagged by 12 ms and the law left ten times the drag's noise.
const MOST_SAMPLES: usize = 300_000;

/// Diagnoses a campaign of recordings: the measuring chain first, then physics on innovations. Deterministic: the
/// same input gives the same result, whatever the number of threads. The recordings are given up, so that long ones
/// need not stay in memory.
#[must_use]
pub fn diagnose(rig: &Rig, runs: Vec<Run>, progress: Progress<'_>) -> Diagnosis {
    progress(0.0, "cleaning and smoothing the recordings");
    let total: usize = runs.iter().map(Run::len).sum();
    let averaged = total.div_ceil(MOST_SAMPLES).max(1);
    // One after the other, so that the long recordings do not outlive their means.
    let runs: Vec<Run> = runs.into_iter().map(|run| run.averaged(averaged)).collect();
    progress(0.1, "auditing the measuring chain");
    let audit = audit(rig, &runs);
    let runs: Vec<Run> = runs
        .into_iter()
        .map(|run| audit.without_leaks(run))
        .collect();
    let given = Given {
        data: Data::new(rig, &runs),
        rig,
        runs: &runs,
        averaged,
    };
    // Each time the question is held it takes most of what is left to tell: what is done never falls.
    let mut done = 0.2;
    let mut hold = |not_asked: Vec<Id>| {
        let weighing = if not_asked.is_empty() {
            "weighing mechanisms"
        } else {
            "the same without what unseen runs refute"
        };
        progress(done, weighing);
        let proven = Proven::of(&given, &audit, not_asked, || {
            let proving = done + 0.5 * (DECIDED - done);
            progress(proving, "the same again without what is kept for the proof");
        });
        done += 0.8 * (DECIDED - done);
        proven
    };
    let Some(mut proven) = hold(Vec::new()) else {
        return given.undecided(audit);
    };
    loop {
        let refuted = proven.refuted();
        if refuted.is_empty() {
            break;
        }
        let not_asked = [proven.answer.not_asked, refuted].concat();
        let seen = proven.answer.decision.seen;
        let Some(again) = hold(not_asked) else {
            return given.undecided(audit);
        };
        proven = again;
        proven.answer.decision.seen = seen;
    }
    progress(DECIDED, "report");
    let diagnosis = proven.assemble();
    progress(1.0, "done");
    diagnosis
}

impl Given<'_> {
    /// The law fitted by plain least squares to the channels as recorded, smoothed by windows that are so many times as wide,
    /// by what is not kept.
    fn plain_law(&self, kept: &Split, reach_factor: f64) -> Vec<f64> {
        let own = &self.data;
        let mut series = if reach_factor == own.context.reach_factor {
            own.series.clone()
        } else {
            Data::smoothed(self.rig, self.runs, reach_factor).series
        };
        kept.take_out(&mut series);
        plain(self.rig, &series).model.base
    }

    fn undecided(&self, audit: Audit) -> Diagnosis {
        let rig = self.rig;
        let estimate = |value: f64| ValueAndStd { value, std: value };
        let law = Model::of_law(rig.peak_friction, rig.critical_slip).base;
        let repaired = Repaired {
            schema: "muslip.model/1".to_owned(),
            rig: rig.clone(),
            base_alone: law.clone(),
            base: law,
            context: self.data.context.clone(),
            ..Repaired::default()
        };
        Diagnosis {
            schema: "muslip.diagnosis/1",
            verdict: Verdict::Undecided,
            recordings: self.recordings(&Split::default()),
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
            looked_for: Id::ALL.iter().map(|id| looked_for(*id, &[])).collect(),
            data_faults: self.faults(&Split::default()),
            chain: audit.chain(),
            fit: Fit::default(),
            caveats: Vec::new(),
            traces: Vec::new(),
            found: repaired.clone(),
            repaired,
        }
    }

    fn recordings(&self, split: &Split) -> Vec<Recording> {
        let role = |run: usize| {
            if split.keeps_whole(run) {
                Role::Holdout
            } else {
                Role::Fit
            }
        };
        self.runs
            .iter()
            .enumerate()
            .map(|(run, r)| Recording {
                path: r.name.clone(),
                samples: r.len() * self.averaged,
                role: role(run),
            })
            .collect()
    }

    fn faults(&self, split: &Split) -> Vec<Fault> {
        let mut faults: Vec<Fault> = self.data.faults.iter().map(Fault::from).collect();
        let series = &self.data.series;
        let told = |name: &str| {
            let mut known = self.data.faults.iter();
            known.any(|f| f.recording == name && f.channel == "drag_force_n")
        };
        let few = |s: &&Series| s.tyre_count() < LEAST_OF_TYRE && !told(&s.name);
        for s in series.iter().filter(few) {
            faults.push(Fault {
                recording: s.name.clone(),
                channel: "drag_force_n".to_owned(),
                start_s: finite_or_zero(s.time.first().copied().unwrap_or(0.0)),
                end_s: finite_or_zero(s.time.last().copied().unwrap_or(0.0)),
                what: "too few usable samples for the tyre balance".to_owned(),
            });
        }
        if split.by_block {
            faults.push(Fault {
                recording: series.first().map_or(String::new(), |s| s.name.clone()),
                channel: "time_s".to_owned(),
                start_s: 0.0,
                end_s: 0.0,
                what: format!(
                    "{} recording(s): fewer than four, so the proof is by blocks of the same runs",
                    series.len()
                ),
            });
        }
        faults
    }
}
