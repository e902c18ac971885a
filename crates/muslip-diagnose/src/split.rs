//! What is fitted and what is kept for the proof.
//!
//! With four runs or more whole runs are kept, those nearest to the campaign's typical operation (a proof by
//! extrapolation would test the plan, not the physics); with fewer, blocks of every run.

use core::ops::Range;

use crate::data::Data;
use crate::mechanism::Balance;
use crate::smooth::median_in_place;

/// Stretches by run for each balance.
#[derive(Clone, Debug, Default)]
pub struct Segments {
    tyre: Vec<Vec<Range<usize>>>,
    wheel: Vec<Vec<Range<usize>>>,
    vehicle: Vec<Vec<Range<usize>>>,
}

impl Segments {
    /// Stretches of a balance.
    #[must_use]
    pub fn of(&self, balance: Balance) -> &[Vec<Range<usize>>] {
        match balance {
            Balance::Tyre => &self.tyre,
            Balance::Wheel => &self.wheel,
            Balance::Vehicle => &self.vehicle,
        }
    }
}

/// The split of a campaign.
#[derive(Clone, Debug, Default)]
pub struct Split {
    /// Runs that parameters and choices see.
    pub fit_runs: Vec<usize>,
    /// Runs kept for the proof (the same ones where blocks are kept).
    pub proof_runs: Vec<usize>,
    /// Whether blocks are kept instead of runs.
    pub by_block: bool,
    /// Stretches that are fitted.
    pub fit: Segments,
    /// Stretches kept for the proof.
    pub proof: Segments,
}

/// Cuts the usable stretches of the run at this position.
type Cut<'a> = &'a dyn Fn(usize, &[Range<usize>]) -> Vec<Range<usize>>;

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
        let all = |cut: Cut<'_>| Segments {
            tyre: data
                .series
                .iter()
                .enumerate()
                .map(|(r, s)| cut(r, &s.tyre))
                .collect(),
            wheel: data
                .series
                .iter()
                .enumerate()
                .map(|(r, s)| cut(r, &s.wheel_balance))
                .collect(),
            vehicle: data
                .series
                .iter()
                .enumerate()
                .map(|(r, s)| cut(r, &s.vehicle_balance))
                .collect(),
        };
        if usable.len() >= 4 {
            let kept = Self::typical(data, &usable, (usable.len() / 5).max(1));
            let fit_runs: Vec<usize> = usable
                .iter()
                .copied()
                .filter(|r| !kept.contains(r))
                .collect();
            let whole = all(&|_, segments| segments.to_vec());
            return Self {
                fit_runs,
                proof_runs: kept,
                by_block: false,
                fit: whole.clone(),
                proof: whole,
            };
        }
        let cut = |run: usize, segments: &[Range<usize>], proof: bool| {
            blocks(data.series[run].len(), segments, proof)
        };
        Self {
            fit_runs: usable.clone(),
            proof_runs: usable.clone(),
            by_block: true,
            fit: all(&|run, segments| cut(run, segments, false)),
            proof: all(&|run, segments| cut(run, segments, true)),
        }
    }

    /// The runs nearest to the median of mean speed and mean load, never the first or the last.
    fn typical(data: &Data, usable: &[usize], count: usize) -> Vec<usize> {
        let means: Vec<[f64; 2]> = usable
            .iter()
            .map(|&r| {
                let s = &data.series[r];
                let rolling: Vec<usize> = (0..s.len()).filter(|&k| s.rolling[k]).collect();
                let n = rolling.len().max(1) as f64;
                [
                    rolling.iter().map(|&k| s.speed.smooth[k]).sum::<f64>() / n,
                    rolling.iter().map(|&k| s.load.smooth[k]).sum::<f64>() / n,
                ]
            })
            .collect();
        let median =
            |i: usize| median_in_place(&mut means.iter().map(|m| m[i]).collect::<Vec<f64>>());
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
}
