//! The proof: how well base law and repaired model predict recordings, by figures that the repaired model's own
//! file is enough to work out again.

use core::ops::Range;

use serde::{Deserialize, Serialize};

use crate::campaign::Run;
use crate::data::Data;
use crate::fit::Problem;
use crate::mechanism::Context;
use crate::noise::{NoiseSize, Whitener, loss, whiteness};
use crate::omnibus::finite_or_zero;
use crate::outcome::{BeforeAfter, Score};
use crate::prepare::{Series, prepare};
use crate::repaired::{Repaired, RepairedError, Which};
use crate::split;
use crate::tyre_stage::TyreStage;

/// What a likelihood of drag readings needs beside the model's prediction.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Likelihood {
    /// Size of the noise of one sample.
    pub size: NoiseSize,
    /// Autoregressive coefficients of the noise over its size, at the fitted sampling step.
    pub colour: Vec<f64>,
    /// Standard deviation of the innovations over that size.
    pub innovation_sigma: f64,
}

impl Likelihood {
    pub(crate) fn new(size: NoiseSize, whitener: &Whitener) -> Self {
        Self {
            size,
            colour: whitener.ar.clone(),
            innovation_sigma: whitener.sigma,
        }
    }

    fn whitener(&self) -> Whitener {
        Whitener {
            ar: self.colour.clone(),
            sigma: self.innovation_sigma,
            ..Whitener::unit()
        }
    }
}

/// Figures of recordings by what the model's maker did with them; `None` where none of a kind was given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Proof {
    /// Recordings (or their blocks) that the model was fitted to.
    pub fit: Option<BeforeAfter>,
    /// Recordings (or blocks) that were kept from it.
    pub holdout: Option<BeforeAfter>,
    /// Recordings that the model's file does not know.
    pub fresh: Option<BeforeAfter>,
}

/// One run under judgement: both residuals, the noise's size, and the stretches that count.
struct Judged {
    before: Vec<f64>,
    after: Vec<f64>,
    scale: Vec<f64>,
    segments: Vec<Range<usize>>,
}

/// Figures before and after over several runs; `None` without a sample.
fn judge(runs: &[Judged], whitener: &Whitener) -> Option<BeforeAfter> {
    let counted = runs.iter().any(|run| !run.segments.is_empty());
    counted.then(|| BeforeAfter {
        before: judge_one(runs, whitener, |run| &run.before),
        after: judge_one(runs, whitener, |run| &run.after),
    })
}

fn judge_one(runs: &[Judged], whitener: &Whitener, of: fn(&Judged) -> &[f64]) -> Score {
    let mut innovations = Vec::new();
    let (mut square, mut count, mut log_scale) = (0.0, 0.0, 0.0);
    for run in runs {
        let residual = of(run);
        for k in run.segments.iter().flat_map(Clone::clone) {
            square += residual[k] * residual[k];
            log_scale += run.scale[k].ln();
            count += 1.0;
        }
        let scaled: Vec<f64> = residual
            .iter()
            .zip(&run.scale)
            .map(|(r, s)| r / s)
            .collect();
        whitener.apply(&scaled, &run.segments, &mut innovations);
    }
    score(square, count, log_scale, whitener.sigma, &innovations)
}

/// The figures of a balance from the sums over its samples and from its innovations.
pub(crate) fn score(
    square: f64,
    count: f64,
    log_scale: f64,
    sigma: f64,
    innovations: &[f64],
) -> Score {
    if !(count > 0.0) {
        return Score::default();
    }
    let n = innovations.len().max(1) as f64;
    let mean_loss = innovations.iter().map(|e| loss(*e)).sum::<f64>() / n;
    Score {
        rmse_n: finite_or_zero((square / count).sqrt()),
        nll_per_sample: finite_or_zero(
            mean_loss
                + 0.5 * core::f64::consts::TAU.ln()
                + sigma.max(1e-300).ln()
                + log_scale / count,
        ),
        whiteness_p: whiteness(innovations).map(finite_or_zero),
    }
}

/// Figures of the tyre balance within a diagnosis: the noise's size follows the repaired model's reading, as it does
/// for whoever has its file alone.
pub(crate) fn of_stage(problem: &Problem<'_>, stage: &TyreStage) -> BeforeAfter {
    let size = stage.noise.size.unwrap_or_default();
    let runs: Vec<Judged> = problem
        .runs
        .iter()
        .map(|&run| {
            judged(
                problem.data,
                run,
                &stage.base(problem.data, run),
                &stage.repaired(problem.data, run),
                &size,
                problem.segments(run).to_vec(),
            )
        })
        .collect();
    judge(&runs, &stage.noise.whitener).unwrap_or_default()
}

fn judged(
    data: &Data,
    run: usize,
    base: &[f64],
    repaired: &[f64],
    size: &NoiseSize,
    segments: Vec<Range<usize>>,
) -> Judged {
    let series = &data.series[run];
    let residual =
        |model: &[f64]| -> Vec<f64> { series.drag.iter().zip(model).map(|(y, f)| y - f).collect() };
    Judged {
        before: residual(base),
        after: residual(repaired),
        scale: sizes(series, &data.context, repaired, size),
        segments,
    }
}

fn sizes(series: &Series, context: &Context, force: &[f64], size: &NoiseSize) -> Vec<f64> {
    force
        .iter()
        .enumerate()
        .map(|(k, f)| size.sigma(*f, series.slip_force_noise(k, context)))
        .collect()
}

/// Which figures a stretch of a recording enters.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Fit,
    Holdout,
    Fresh,
}

impl Repaired {
    /// Size of a reading's noise before colour, row by row, for the drag that the model expects of a run, in N; what
    /// noise of the run's own speeds does to the prediction is counted in.
    #[must_use]
    pub fn reading_sigma(&self, run: &Run, expected_n: &[f64]) -> Vec<f64> {
        let Some(likelihood) = &self.noise.likelihood else {
            return expected_n
                .iter()
                .map(|f| self.noise.of_reading(*f))
                .collect();
        };
        let (series, _) = prepare(&self.rig, run, &[], 0, self.context.reach_factor);
        sizes(&series, &self.context, expected_n, &likelihood.size)
    }

    /// The figures of `diagnosis.json`, worked out again from recordings: those that the model was made from, in the
    /// order of its file, give what the diagnosis says. Recordings without a drag column do not count.
    ///
    /// # Errors
    /// [`RepairedError::NoLikelihood`] where the tyre balance was not fitted; else as for [`Repaired::predict`].
    pub fn prove(&self, runs: &[Run]) -> Result<Proof, RepairedError> {
        let likelihood = self
            .noise
            .likelihood
            .as_ref()
            .ok_or(RepairedError::NoLikelihood)?;
        let (mut fit, mut holdout, mut fresh) = (Vec::new(), Vec::new(), Vec::new());
        for run in runs {
            let run = run.clone().averaged(self.averaged.max(1));
            let known = self.known(&run).map(|at| self.recordings[at].holdout);
            let base = self.predict(&run, Which::Base)?.drag_force_n;
            let repaired = self.predict(&run, Which::Repaired)?.drag_force_n;
            let (series, _) = prepare(&self.rig, &run, &[], 0, self.context.reach_factor);
            let data = self.data_of(series, Vec::new());
            let whole = data.series[0].tyre.clone();
            let samples = data.series[0].len();
            let parts = match known {
                None => vec![(Kind::Fresh, whole)],
                Some(_) if self.proof_by_blocks => vec![
                    (Kind::Fit, split::blocks(samples, &whole, false)),
                    (Kind::Holdout, split::blocks(samples, &whole, true)),
                ],
                Some(true) => vec![(Kind::Holdout, whole)],
                Some(false) => vec![(Kind::Fit, whole)],
            };
            for (kind, segments) in parts {
                let part = judged(&data, 0, &base, &repaired, &likelihood.size, segments);
                match kind {
                    Kind::Fit => fit.push(part),
                    Kind::Holdout => holdout.push(part),
                    Kind::Fresh => fresh.push(part),
                }
            }
        }
        let whitener = likelihood.whitener();
        Ok(Proof {
            fit: judge(&fit, &whitener),
            holdout: judge(&holdout, &whitener),
            fresh: judge(&fresh, &whitener),
        })
    }
}
