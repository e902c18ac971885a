//! The proof: how well base law and repaired model predict recordings, by figures that the repaired model's own
//! file is enough to work out again.

use core::ops::Range;

use rayon::prelude::*;
use serde::Serialize;

use crate::campaign::Run;
use crate::data::Data;
use crate::mechanism::Context;
use crate::noise::{Likelihood, NoiseSize, Whitener, loss, whiteness};
use crate::number::finite_or_zero;
use crate::outcome::{BeforeAfter, Score};
use crate::prepare::prepare;
use crate::repaired::{Repaired, RepairedError, Which};
use crate::series::Series;
use crate::split;

/// Likelihood by what the repaired model leaves of what it was fitted to; `None` without a sample.
fn likelihood_of(runs: &[Predicted], context: &Context) -> Option<Likelihood> {
    let (mut rest, mut depends_on) = (Vec::new(), Vec::new());
    for (run, k) in runs.iter().flat_map(|run| run.samples(Kind::Fit)) {
        rest.push(run.series.drag[k] - run.after[k]);
        depends_on.push([run.after[k], run.series.slip_force_noise(k, context)]);
    }
    if rest.is_empty() {
        return None;
    }
    let size = NoiseSize::fitted(&rest, &depends_on);
    // All runs as one, so that one autoregression is fitted to them.
    let (mut all, mut segments) = (Vec::new(), Vec::new());
    for run in runs {
        let offset = all.len();
        segments.extend(
            run.segments(Kind::Fit)
                .map(|s| s.start + offset..s.end + offset),
        );
        let scaled = run.sizes(&size, context).zip(run.left(&run.after));
        all.extend(scaled.map(|(size, left)| left / size));
    }
    let whitener = Whitener::fit(&all, &segments);
    Some(Likelihood {
        size,
        colour: whitener.ar,
        innovation_sigma: whitener.sigma,
    })
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

/// Which figures a stretch of a recording enters.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Fit,
    Holdout,
    Fresh,
}

/// A recording as prepared, the readings that both models expect, and which figures its stretches enter.
pub(crate) struct Predicted {
    pub(crate) series: Series,
    /// By the base law alone, in N.
    pub(crate) before: Vec<f64>,
    /// By the repaired model, in N.
    pub(crate) after: Vec<f64>,
    kinds: Vec<(Kind, Vec<Range<usize>>)>,
}

impl Predicted {
    fn segments(&self, kind: Kind) -> impl Iterator<Item = &Range<usize>> {
        let own = self.kinds.iter().filter(move |own| own.0 == kind);
        own.flat_map(|own| &own.1)
    }

    fn samples(&self, kind: Kind) -> impl Iterator<Item = (&Self, usize)> {
        self.segments(kind)
            .flat_map(Clone::clone)
            .map(move |k| (self, k))
    }

    fn left(&self, expected: &[f64]) -> impl Iterator<Item = f64> {
        self.series.drag.iter().zip(expected).map(|(y, f)| y - f)
    }

    /// Size of each reading's noise in N: it follows the repaired model's reading, as it does for whoever has its file
    /// alone.
    fn sizes(&self, size: &NoiseSize, context: &Context) -> impl Iterator<Item = f64> {
        let force = self.after.iter().enumerate();
        force.map(|(k, f)| size.sigma(*f, self.series.slip_force_noise(k, context)))
    }
}

/// Figures before and after of what is of a kind; `None` without a sample.
fn figures(
    runs: &[Predicted],
    kind: Kind,
    likelihood: &Likelihood,
    context: &Context,
) -> Option<BeforeAfter> {
    let whitener = likelihood.whitener();
    let score_of = |expected: fn(&Predicted) -> &[f64]| {
        let mut innovations = Vec::new();
        let (mut square, mut count, mut log_scale) = (0.0, 0.0, 0.0);
        for run in runs {
            let left: Vec<f64> = run.left(expected(run)).collect();
            let sizes: Vec<f64> = run.sizes(&likelihood.size, context).collect();
            for (_, k) in run.samples(kind) {
                square += left[k] * left[k];
                log_scale += sizes[k].ln();
                count += 1.0;
            }
            let scaled: Vec<f64> = left.iter().zip(&sizes).map(|(r, s)| r / s).collect();
            let segments: Vec<Range<usize>> = run.segments(kind).cloned().collect();
            whitener.apply(&scaled, &segments, &mut innovations);
        }
        score(square, count, log_scale, whitener.sigma, &innovations)
    };
    let counted = runs.iter().any(|run| run.segments(kind).next().is_some());
    counted.then(|| BeforeAfter {
        before: score_of(|run| &run.before),
        after: score_of(|run| &run.after),
    })
}

/// The figures of a balance from the sums over its samples and from its innovations.
fn score(square: f64, count: f64, log_scale: f64, sigma: f64, innovations: &[f64]) -> Score {
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
        let slip_noise = |k: usize| series.slip_force_noise(k, &self.context);
        expected_n
            .iter()
            .enumerate()
            .map(|(k, f)| likelihood.size.sigma(*f, slip_noise(k)))
            .collect()
    }

    /// The figures of `diagnosis.json`, worked out again from recordings: those that the model was made from, in the
    /// order of its file, give what the diagnosis says. Recordings without a drag column do not count.
    ///
    /// # Errors
    /// [`RepairedError::NoLikelihood`] where the tyre balance was not fitted; else as for [`Repaired::predict`].
    pub fn prove(&self, runs: &[Run]) -> Result<Proof, RepairedError> {
        let averaged = self.averaged.max(1);
        let runs: Vec<Run> = runs.iter().map(|r| r.clone().averaged(averaged)).collect();
        let (known, fresh): (Vec<Run>, Vec<Run>) =
            runs.into_iter().partition(|run| self.known(run).is_some());
        let mut proof = self.proof_of(&self.unseeing().predicted(&known)?)?;
        proof.fresh = self.proof_of(&self.predicted(&fresh)?)?.fresh;
        Ok(proof)
    }

    /// The same of recordings whose readings were predicted.
    pub(crate) fn proof_of(&self, runs: &[Predicted]) -> Result<Proof, RepairedError> {
        let likelihood = self
            .noise
            .likelihood
            .as_ref()
            .ok_or(RepairedError::NoLikelihood)?;
        let of = |kind| figures(runs, kind, likelihood, &self.context);
        Ok(Proof {
            fit: of(Kind::Fit),
            holdout: of(Kind::Holdout),
            fresh: of(Kind::Fresh),
        })
    }

    /// Gives the model the noise of the drag readings that it leaves of what it was fitted to; none where that says
    /// nothing of the tyre balance.
    pub(crate) fn set_noise(&mut self, runs: &[Predicted]) {
        self.noise.likelihood = likelihood_of(runs, &self.context);
        if let Some(likelihood) = &self.noise.likelihood {
            self.noise.sigma_n = likelihood.size.typical;
        }
    }

    /// What both models expect of recordings, averaged as the model's own were.
    pub(crate) fn predicted(&self, runs: &[Run]) -> Result<Vec<Predicted>, RepairedError> {
        runs.par_iter()
            .map(|run| {
                let known = self.known(run).map(|at| self.recordings[at].holdout);
                let mut recorded = self.prepared(run);
                let series = recorded.series[0].clone();
                recorded.series[0].forget_drag();
                let later = (!self.late.is_none()).then(|| self.inputs(run, Which::Repaired));
                let expected = |data: &Data, which: Which| {
                    let prediction = self.predict_from(data, which, known.is_some())?;
                    Ok(prediction.drag_force_n)
                };
                let before = expected(&recorded, Which::Base)?;
                let after = expected(later.as_ref().unwrap_or(&recorded), Which::Repaired)?;
                let whole = series.tyre.clone();
                let block = |proof| split::blocks(series.len(), &whole, proof);
                let kinds = match known {
                    None => vec![(Kind::Fresh, whole)],
                    Some(_) if self.proof_by_blocks => {
                        vec![(Kind::Fit, block(false)), (Kind::Holdout, block(true))]
                    }
                    Some(true) => vec![(Kind::Holdout, whole)],
                    Some(false) => vec![(Kind::Fit, whole)],
                };
                Ok(Predicted {
                    series,
                    before,
                    after,
                    kinds,
                })
            })
            .collect()
    }
}
