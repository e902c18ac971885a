//! What is fitted and what is kept for the proof.
//!
//! With four runs or more whole runs are kept, those nearest to the campaign's typical operation (a proof by
//! extrapolation would test the plan, not the physics); with fewer, blocks of every run.

use core::ops::Range;

use crate::constants::{FEWEST_RUNS_TO_KEEP, RUNS_FOR_ONE_KEPT};
use crate::data::Data;
use crate::series::Series;
use crate::smooth::median_in_place;

/// The split of a campaign; by default nothing is kept.
#[derive(Clone, Debug, Default)]
pub struct Split {
    /// Runs kept for the proof as a whole.
    pub proof_runs: Vec<usize>,
    /// Whether blocks of every run are kept instead.
    pub by_block: bool,
}

/// Blocks that a run is cut into, and those of them kept for the proof, where there are too few runs.
const BLOCKS: usize = 10;
const KEPT_BLOCKS: [usize; 2] = [3, 7];

/// The blocks of a run's usable stretches that are kept for the proof, or the others.
pub(crate) fn blocks(samples: usize, segments: &[Range<usize>], proof: bool) -> Vec<Range<usize>> {
    let kept = |k: usize| KEPT_BLOCKS.contains(&(k * BLOCKS / samples.max(1)));
    let mut out: Vec<Range<usize>> = Vec::new();
    for segment in segments {
        for k in segment.clone().filter(|k| kept(*k) == proof) {
            match out.last_mut() {
                Some(last) if last.end == k && k != segment.start => last.end = k + 1,
                _ => out.push(k..k + 1),
            }
        }
    }
    out.retain(|s| s.len() >= 10);
    out
}

impl Split {
    /// Splits a campaign.
    #[must_use]
    pub fn new(data: &Data) -> Self {
        let usable: Vec<usize> = (0..data.series.len())
            .filter(|&r| {
                let s = &data.series[r];
                s.tyre_count() + s.wheel_balance.len() + s.vehicle_balance.len() > 0
            })
            .collect();
        if usable.len() < FEWEST_RUNS_TO_KEEP {
            return Self {
                proof_runs: Vec::new(),
                by_block: true,
            };
        }
        Self {
            proof_runs: typical(
                &data.series,
                &usable,
                (usable.len() / RUNS_FOR_ONE_KEPT).max(1),
            ),
            by_block: false,
        }
    }

    /// Whether this run is kept for the proof as a whole.
    #[must_use]
    pub fn keeps_whole(&self, run: usize) -> bool {
        self.proof_runs.contains(&run)
    }

    /// Takes what is kept for the proof out of the balances of all runs, which may be averaged otherwise.
    pub fn take_out(&self, series: &mut [Series]) {
        for (run, s) in series.iter_mut().enumerate() {
            let samples = s.len();
            for segments in [&mut s.tyre, &mut s.wheel_balance, &mut s.vehicle_balance] {
                if self.by_block {
                    *segments = blocks(samples, segments, false);
                } else if self.keeps_whole(run) {
                    segments.clear();
                }
            }
        }
    }
}

/// The runs nearest to the median of mean speed and mean load, never the first or the last.
fn typical(series: &[Series], usable: &[usize], count: usize) -> Vec<usize> {
    let means: Vec<[f64; 2]> = usable
        .iter()
        .map(|&r| {
            let s = &series[r];
            let rolling: Vec<usize> = (0..s.len()).filter(|&k| s.rolling[k]).collect();
            let n = rolling.len().max(1) as f64;
            [
                rolling.iter().map(|&k| s.speed.smooth[k]).sum::<f64>() / n,
                rolling.iter().map(|&k| s.load.smooth[k]).sum::<f64>() / n,
            ]
        })
        .collect();
    let median = |i: usize| median_in_place(&mut means.iter().map(|m| m[i]).collect::<Vec<f64>>());
    let centre = [median(0), median(1)];
    let mut inner: Vec<usize> = (1..usable.len() - 1).collect();
    let distance = |i: usize| -> f64 {
        (0..2)
            .map(|c| ((means[i][c] - centre[c]) / centre[c].abs().max(1e-9)).powi(2))
            .sum()
    };
    inner.sort_by(|a, b| distance(*a).total_cmp(&distance(*b)).then(a.cmp(b)));
    let mut kept: Vec<usize> = inner.into_iter().take(count).map(|i| usable[i]).collect();
    kept.sort_unstable();
    kept
}
