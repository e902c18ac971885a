//! What many streams have in common.

use host_sim::fit::Curve;
use rayon::prelude::*;

use super::contenders::{Outcome, batch};
use super::streams::{Disturbance, Stream, stream};

/// Runs one estimator over one stream.
pub type Contender<'a> = dyn Fn(Curve, &Stream) -> Outcome + Sync + 'a;

/// Sums over streams.
pub struct Summary {
    pub rmse: [f64; 2],
    pub bias: [f64; 2],
    pub nees: f64,
    pub coverage: f64,
    pub nis: f64,
    pub lag: f64,
}

pub fn summary<'a>(outcomes: impl Iterator<Item = &'a Outcome>) -> Summary {
    let mut s = Summary {
        rmse: [0.0; 2],
        bias: [0.0; 2],
        nees: 0.0,
        coverage: 0.0,
        nis: 0.0,
        lag: 0.0,
    };
    let mut n = 0.0;
    for outcome in outcomes {
        n += 1.0;
        for index in 0..2 {
            s.rmse[index] += outcome.error[index].powi(2);
            s.bias[index] += outcome.error[index];
        }
        s.nees += outcome.nees;
        s.coverage += if outcome.nees < 1.0 { 1.0 } else { 0.0 };
        s.nis += outcome.nis;
        s.lag += outcome.lag;
    }
    s.rmse = s.rmse.map(|sum: f64| (sum / n).sqrt());
    s.bias = s.bias.map(|sum| sum / n);
    s.nees /= n;
    s.coverage /= n;
    s.nis /= n;
    s.lag /= n;
    s
}

pub fn run<const N: usize>(
    truth: Curve,
    slips: &[f64],
    disturbance: Disturbance,
    seeds: u64,
    contenders: [&Contender<'_>; N],
) -> (Summary, [Summary; N]) {
    let outcomes: Vec<(Outcome, [Outcome; N])> = (0..seeds)
        .into_par_iter()
        .filter_map(|seed| {
            let stream = stream(truth, slips, disturbance, seed);
            // Streams on which the likelihood has no peak count for nobody.
            let batch = batch(truth, &stream)?;
            Some((batch, contenders.map(|contender| contender(truth, &stream))))
        })
        .collect();
    let batch = summary(outcomes.iter().map(|(batch, _)| batch));
    let others =
        std::array::from_fn(|which| summary(outcomes.iter().map(|(_, others)| &others[which])));
    (batch, others)
}
