//! The tyre balance: base fit, noise, mechanisms, and what they leave.

use crate::campaign::Run;
use crate::choose::{Limits, Search, candidate, refine, required, search};
use crate::data::Data;
use crate::dynamics_stage::CrossEvidence;
use crate::fit::{BalanceNoise, Fitted, Joint, Problem, moved};
use crate::mechanism::{Balance, Id, Stage};
use crate::model::{Model, tyre};
use crate::noise::loss;
use crate::omnibus::{Action, Levers};
use crate::otherwise::Otherwise;
use crate::place_or_time::better_in_time;
use crate::remainder::{Remainder, applied, candidates, counterparts};
use crate::saturated::{self, Slow};
use crate::split::Split;
use crate::validation::validated;

/// What the tyre balance says.
pub struct TyreStage {
    /// Noise under the final model.
    pub noise: BalanceNoise,
    /// All sets tried and the one chosen.
    pub search: Search,
    /// The repaired model before any correction.
    pub model: Model,
    /// Dependences that no mechanism explains, claimed in the result.
    pub unexplained: Vec<Remainder>,
    /// Corrections carried by the repaired model: those claimed, and what the form of a named mechanism leaves.
    pub corrections: Vec<Remainder>,
}

/// Fraction of a free dependence's gain that a set of mechanisms must reach to be preferred to it.
const MECHANISM_SHARE: f64 = 0.85;
/// The same of a dependence on a recorded column: that it fits at all is no chance.
const RECORDED_SHARE: f64 = 1.0;
/// The same where it stands against several mechanisms at once: one cause is likelier than two or three.
const RECORDED_SHARE_OF_SEVERAL: f64 = 1.15;
/// The same where one mechanism says much the same as the free dependence.
const COUNTERPART_SHARE: f64 = 0.7;
/// Fraction of the strongest dependence that one on a recorded column must reach to be preferred to it.
const RECORDED_PREFERENCE: f64 = 0.75;

/// Worth in nats from which what the form of a named mechanism leaves is corrected, though not claimed.
const LEAST_CORRECTION: f64 = 25.0;

/// The dependence that mechanisms have to compete with.
fn strongest_rival(free: &[Remainder], count: usize) -> Option<&Remainder> {
    let top = free.first()?;
    free.iter()
        .find(|r| r.recorded() && r.worth(count) >= RECORDED_PREFERENCE * top.worth(count))
        .or(Some(top))
}

/// A problem over the fitted part of the campaign.
#[must_use]
pub fn problem<'a>(data: &'a Data, split: &'a Split, noise: &'a BalanceNoise) -> Problem<'a> {
    Problem {
        data,
        balance: Balance::Tyre,
        noise,
        runs: &split.fit_runs,
        segments: split.fit.of(Balance::Tyre),
        chain: None,
    }
}

fn joint_under<'a>(data: &'a Data, split: &'a Split, noise: &'a BalanceNoise) -> Joint<'a> {
    Joint {
        parts: vec![problem(data, split, noise)],
    }
}

/// Start of the base fit: the rig file's law, inputs as smoothed.
#[must_use]
pub fn start(data: &Data) -> Model {
    let [peak, critical] = data.context.nominal;
    Model::of_law(peak, critical)
}

/// Best of several starts in the slip at the peak.
fn base_fit(joint: &Joint<'_>) -> Fitted {
    let first = start(joint.data());
    let mut best = joint.fit(&first, 25);
    for factor in [0.4f64, 2.5] {
        let mut other = first.clone();
        other.base[1] += factor.ln();
        let fitted = joint.fit(&other, 25);
        if fitted.loss < best.loss - 1e-6 {
            best = fitted;
        }
    }
    best
}

/// Reading minus contact force on every run: what the measuring chain adds.
#[must_use]
pub fn chain(data: &Data, model: &Model) -> Option<Vec<Vec<f64>>> {
    let acts = model
        .terms
        .iter()
        .any(|t| data.catalogue.get(t.entry).stage() > Stage::Contact);
    acts.then(|| {
        let p = model.vector();
        data.series
            .iter()
            .map(|series| {
                let state = tyre(&data.catalogue, model, &p, series, &data.context);
                let contact = state.contact.unwrap_or_else(|| state.force.clone());
                state
                    .force
                    .iter()
                    .zip(&contact)
                    .map(|(r, c)| if (r - c).is_finite() { r - c } else { 0.0 })
                    .collect()
            })
            .collect()
    })
}

/// Analyses the tyre balance; `None` where it holds nothing that could be fitted.
#[must_use]
pub fn analyse(
    data: &Data,
    runs: &[Run],
    split: &Split,
    limits: &Limits,
    progress: &dyn Fn(f64, &str),
) -> Option<TyreStage> {
    let guess = saturated::first_guess(data, Balance::Tyre);
    let guessed = Joint {
        parts: vec![problem(data, split, &guess)],
    };
    if guessed.count() < 60 {
        return None;
    }
    progress(0.1, "fitting the base law");
    let base = base_fit(&guessed);
    let noise = saturated::estimate(&guessed.parts[0], &base, Slow::Ignored);
    let joint = joint_under(data, split, &noise);
    let base = joint.fit(&base.model, 20);
    if !speaks(&joint, &base) {
        return None;
    }
    progress(0.2, "screening mechanisms");
    let mut found = search(&joint, base, limits);
    progress(0.5, "judging again under the noise that is left");
    let noise = saturated::estimate(&joint.parts[0], &found.chosen.fitted, Slow::Counted);
    if !found.chosen.ids.is_empty() {
        found = refine(&joint_under(data, split, &noise), &found, limits);
    }
    if !found.chosen.ids.is_empty()
        && let Some(cross) = CrossEvidence::new(
            data,
            split,
            limits,
            chain(data, &found.chosen.fitted.model).as_deref(),
        )
    {
        found = cross.rerank(found);
    }
    let joint = joint_under(data, split, &noise);
    found = validated(&joint, found, limits);
    let mut otherwise = Otherwise::new(data, runs, split, &noise);
    if !limits.ablation.errors_in_variables {
        found = otherwise.kept(&joint, found);
    }
    progress(0.65, "looking at what is left");
    Some(remainders(
        &joint,
        found,
        noise.clone(),
        limits,
        &mut otherwise,
    ))
}

/// Whether the recordings say anything about friction: a law must do better than no force at all.
fn speaks(joint: &Joint<'_>, base: &Fitted) -> bool {
    let silent = base.model.with(&{
        let mut p = base.model.vector();
        p[0] = -30.0;
        p
    });
    joint.loss(&silent) - base.loss > 60.0
}

fn remainders(
    joint: &Joint<'_>,
    mut found: Search,
    noise: BalanceNoise,
    limits: &Limits,
    otherwise: &mut Otherwise<'_>,
) -> TyreStage {
    let problem = &joint.parts[0];
    let count = found.count;
    let in_time = better_in_time(joint, &found);
    let clocked = in_time.is_some();
    if let Some(without) = in_time {
        found.chosen = candidate(joint, without);
        found.forget(Id::SurfacePatch);
    }
    let explained = found.base.criterion - found.chosen.criterion;
    let dependences = |model: &Model| {
        let mut all = if limits.ablation.remainder {
            Vec::new()
        } else {
            candidates(problem, model)
        };
        if clocked {
            all.retain(|r| r.word == "time_s" || r.recorded());
        }
        all
    };
    let left = dependences(&found.chosen.fitted.model);
    let mut unexplained: Vec<Remainder> = Vec::new();
    let mut corrections: Vec<Remainder> = Vec::new();
    if found.chosen.ids.is_empty() {
        if let Some(top) = left.first()
            && top.worth(count) >= required(limits, count, 0.0)
            && (limits.ablation.errors_in_variables
                || otherwise.holds(joint, &found.base.fitted.model, top))
        {
            unexplained.push(top.clone());
            corrections.push(top.clone());
        }
    } else {
        // Does one free dependence account for more than the mechanisms do?
        let free = dependences(&found.base.fitted.model);
        let rival = strongest_rival(&free, count).filter(|top| {
            let counterpart = counterparts(&top.word)
                .iter()
                .any(|id| found.chosen.ids.contains(id));
            // A mechanism that says much the same has the better of it, unless it takes several.
            let share = match (top.recorded(), counterpart, found.chosen.ids.len()) {
                (true, _, 1) => RECORDED_SHARE,
                (true, ..) => RECORDED_SHARE_OF_SEVERAL,
                (false, true, 1) => COUNTERPART_SHARE,
                _ => MECHANISM_SHARE,
            };
            top.worth(count) * share > explained
        });
        let best_left = left.first();
        if let Some(rival) = rival {
            // Together they may be needed: then both are said.
            let together = explained + best_left.map_or(0.0, |l| l.worth(count).max(0.0));
            let needed = required(limits, count, 3.0 * rival.worth(count));
            if together - rival.worth(count) < needed {
                found.chosen = found.base.clone();
                unexplained.push(rival.clone());
                corrections.push(rival.clone());
            }
        }
        if unexplained.is_empty()
            && let Some(top) = best_left
            && top.worth(count) > LEAST_CORRECTION
            && (limits.ablation.errors_in_variables
                || otherwise.holds(joint, &found.chosen.fitted.model, top))
        {
            if top.worth(count) >= required(limits, count, 2.0 * explained) {
                unexplained.push(top.clone());
                corrections.push(top.clone());
            } else if top.correction.carries() {
                corrections.push(top.clone());
            }
        }
    }
    let fitted = &found.chosen.fitted;
    let model = match corrections.first() {
        Some(first) => match corrected(joint, fitted, first) {
            Some((model, amended)) => {
                corrections[0] = amended;
                model
            }
            None => {
                corrections.clear();
                fitted.model.clone()
            }
        },
        None => fitted.model.clone(),
    };
    TyreStage {
        noise,
        search: found,
        model,
        unexplained,
        corrections,
    }
}

/// Shares of the correction and of the step that goes with it that are tried, largest first.
const STEPS: [f64; 3] = [1.0, 0.6, 0.3];
/// Share of the promised gain that the corrected model must keep.
const KEPT_PROMISE: f64 = 0.33;

/// The same dependence with its mean moved into the base law's parameter that does the same: outside its domain, and
/// where its column is missing, the base law alone must be right on average.
fn about_its_mean(problem: &Problem<'_>, model: &Model, remainder: &Remainder) -> Remainder {
    let mut moved = remainder.clone();
    let place = match Action::parse(&remainder.correction.acts_on) {
        Some(Action::Friction) => 0,
        Some(Action::CriticalSlip) => 1,
        _ => return moved,
    };
    let fixed = problem.data.rig.law_fixed;
    if fixed || remainder.correction.knots.is_empty() {
        return moved;
    }
    let levers = Levers::new(problem.data, model);
    let added = applied(problem.data, &levers, remainder);
    let lever = |run: usize, k: usize| match place {
        0 => levers.force[run][k],
        _ => levers.critical[run][k],
    };
    let (mut product, mut square) = (0.0, 0.0);
    for &run in problem.runs {
        for k in problem.segments(run).iter().flat_map(Clone::clone) {
            product += added[run][k] * lever(run, k);
            square += lever(run, k).powi(2);
        }
    }
    let mean = product / square;
    if mean.is_finite() {
        moved.own[place] += mean;
        for value in &mut moved.correction.values {
            *value -= mean;
        }
    }
    moved
}

/// The model's own parameters step along with the correction that they were regressed with, as far as the
/// linearisation holds; `None` where it does not.
fn corrected(
    joint: &Joint<'_>,
    fitted: &Fitted,
    remainder: &Remainder,
) -> Option<(Model, Remainder)> {
    if !remainder.correction.carries() {
        // A phase of each run's own carries nothing over to other runs.
        return Some((fitted.model.clone(), remainder.clone()));
    }
    let problem = &joint.parts[0];
    let remainder = &about_its_mean(problem, &fitted.model, remainder);
    let bounds = joint.bounds(&fitted.model);
    let before: f64 = problem.losses(&fitted.model).iter().sum();
    STEPS
        .iter()
        .map(|share| {
            let moved = moved(&fitted.model.vector(), &remainder.own, *share, &bounds);
            let model = fitted.model.with(&moved);
            let mut amended = remainder.clone();
            amended.correction.scale(*share);
            let levers = Levers::new(problem.data, &model);
            let added = applied(problem.data, &levers, &amended);
            let after: f64 = problem
                .runs
                .iter()
                .map(|&run| {
                    let mut residual = problem.residual(&model, &moved, run);
                    for (r, a) in residual.iter_mut().zip(&added[run]) {
                        *r -= a;
                    }
                    problem
                        .whiten(&residual, run)
                        .iter()
                        .map(|e| loss(*e))
                        .sum::<f64>()
                })
                .sum();
            (before - after, model, amended)
        })
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .filter(|(gain, ..)| *gain >= KEPT_PROMISE * remainder.gain)
        .map(|(_, model, amended)| (model, amended))
}

impl TyreStage {
    /// Prediction of the repaired model on a run, corrections included, in N.
    #[must_use]
    pub fn repaired(&self, data: &Data, run: usize) -> Vec<f64> {
        let p = self.model.vector();
        let mut force = tyre(
            &data.catalogue,
            &self.model,
            &p,
            &data.series[run],
            &data.context,
        )
        .force;
        if !self.corrections.is_empty() {
            let levers = Levers::new(data, &self.model);
            for c in &self.corrections {
                if let Ok(added) = c.correction.apply(data, &levers, run) {
                    for (f, a) in force.iter_mut().zip(added) {
                        *f += a;
                    }
                }
            }
        }
        force
    }

    /// Prediction of the base law alone on a run in N.
    #[must_use]
    pub fn base(&self, data: &Data, run: usize) -> Vec<f64> {
        let model = &self.search.base.fitted.model;
        tyre(
            &data.catalogue,
            model,
            &model.vector(),
            &data.series[run],
            &data.context,
        )
        .force
    }
}
