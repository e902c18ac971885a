//! Whitening by a Kalman filter: residuals become innovations, of unit variance and independent, under a covariance
//! that is a sum of simple parts.
//!
//! Every part is a state of the filter: an Ornstein-Uhlenbeck process times a known gain, a constant of the run, a
//! walk (white noise integrated), or a process that is integrated into the walk. So a pass costs O(n), gaps and
//! locked stretches are steps of time without a reading, and one pass of gains serves any number of columns.

#![expect(
    clippy::needless_range_loop,
    reason = "rows and columns of one matrix are told apart by their indices"
)]

mod part;
mod passes;
#[cfg(test)]
mod tests;

use pulp::Arch;

use part::{Pair, TWIN, decays, kinds};
use passes::{Apply, Covariance, LANES, Squares, Traces};

pub use part::{Kind, MOST, Part};

/// Variance of a level of which nothing is known, over that of the other parts.
pub const DIFFUSE: f64 = 1e8;

/// The filter's gains on one run: what whitens any column.
pub struct Whitener {
    /// One where a part is integrated into the walk, else nothing.
    integrated: [f64; MOST],
    filtered: Option<Pair>,
    /// Samples in use, in order.
    pub samples: Vec<usize>,
    steps: Vec<Step>,
    decays: Vec<[f64; MOST]>,
    /// Logarithms of the innovations' variances.
    pub log_variances: Vec<f64>,
}

struct Step {
    gain: [f64; MOST],
    row: [f64; MOST],
    inverse: f64,
    dt: f64,
    decay: u32,
    /// Whether nothing is known of the level before this reading.
    fresh: bool,
}

/// One number for each part's variance and for that of the readings' own noise.
#[derive(Clone, Copy, Debug, Default)]
pub struct ByVariance {
    /// By part, in their order.
    pub parts: [f64; MOST],
    /// Of the readings' own noise.
    pub white: f64,
}

/// The place of this step of time among the last few: jitter makes many, a clock few.
fn recent(spans: &[f64], dt: f64) -> Option<usize> {
    let from = spans.len().saturating_sub(8);
    spans[from..]
        .iter()
        .rposition(|s| same(dt, *s))
        .map(|at| from + at)
}

/// Whether two steps of time may share their decays.
fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * b
}

impl Whitener {
    /// Runs the filter's covariance over every `stride`-th reading of a run. `segments` are the stretches in use, `white` the
    /// standard deviation of each reading's own noise, `diffuse` the variance of a level of which nothing is known; at
    /// most [`MOST`] parts.
    #[must_use]
    pub fn new(
        time: &[f64],
        segments: &[core::ops::Range<usize>],
        stride: usize,
        white: f64,
        diffuse: f64,
        parts: &[Part<'_>],
    ) -> Self {
        debug_assert!(parts.len() <= MOST, "{} parts", parts.len());
        let walk = parts.first().is_some_and(|part| part.kind == Kind::Walk);
        let is_integrated = |part: &Part<'_>| matches!(part.kind, Kind::Integrated(_));
        let mut out = Self {
            integrated: core::array::from_fn(|i| match parts.get(i) {
                Some(part) if walk && is_integrated(part) => 1.0,
                _ => 0.0,
            }),
            filtered: Pair::of(parts),
            samples: Vec::new(),
            steps: Vec::new(),
            decays: Vec::new(),
            log_variances: Vec::new(),
        };
        let mut before = f64::NAN;
        let mut spans: Vec<f64> = Vec::new();
        for segment in segments {
            let mut fresh = walk;
            for k in segment.clone().step_by(stride.max(1)) {
                let dt = if before.is_nan() {
                    0.0
                } else {
                    time[k] - before
                };
                before = time[k];
                let decay = recent(&spans, dt).unwrap_or_else(|| {
                    spans.push(dt);
                    out.decays.push(decays(parts, dt));
                    spans.len() - 1
                });
                out.samples.push(k);
                let mut row = core::array::from_fn(|i| {
                    parts.get(i).map_or(0.0, |part| match part.kind {
                        Kind::Integrated(_) => 0.0,
                        _ => part.gain.get(k).copied().unwrap_or(1.0),
                    })
                });
                if let Some(pair) = &out.filtered {
                    row[TWIN] = -row[pair.at];
                }
                out.steps.push(Step {
                    gain: [0.0; MOST],
                    row,
                    inverse: 0.0,
                    dt,
                    decay: decay as u32,
                    fresh,
                });
                fresh = false;
            }
        }
        Arch::new().dispatch(Covariance {
            whitener: &mut out,
            parts,
            noise: white * white,
            diffuse,
        });
        out
    }

    /// Σ yᵀ V⁻¹ K V⁻¹ y over the given innovations (each over its standard deviation), K being what a unit of a
    /// variance adds to V: minus the slope of Σ yᵀ V⁻¹ y. By one pass back through the filter (Koopman and Shephard
    /// 1992, Biometrika 79: exact score of a model in state space). `parts` are those that the filter was made with.
    #[must_use]
    pub fn squares(&self, innovations: &[&[f64]], parts: &[Part<'_>]) -> ByVariance {
        let kinds = kinds(parts);
        let mut out = ByVariance::default();
        for group in innovations.chunks(LANES) {
            Arch::new().dispatch(Squares {
                whitener: self,
                innovations: group,
                kinds: &kinds,
                out: &mut out,
            });
        }
        self.with_twin(out)
    }

    /// What filtered noise's second state says belongs to its part.
    fn with_twin(&self, mut of: ByVariance) -> ByVariance {
        if let Some(pair) = &self.filtered {
            of.parts[pair.at] += core::mem::take(&mut of.parts[TWIN]);
        }
        of
    }

    /// What a unit of each part's variance adds before a reading.
    #[inline(always)]
    fn driven(&self, at: usize, kinds: &[Kind; MOST]) -> [f64; MOST] {
        let start = if at == 0 { 1.0 } else { 0.0 };
        let step = &self.steps[at];
        let decay = &self.decays[step.decay as usize];
        let mut all = core::array::from_fn(|i| match kinds[i] {
            Kind::Walk => step.dt,
            Kind::Constant => start,
            Kind::Forgetting(_) | Kind::Integrated(_) | Kind::Filtered(_) => {
                start + 1.0 - decay[i] * decay[i]
            }
        });
        if let Some(pair) = &self.filtered {
            let [first, second, _] = pair.driven(start, decay);
            all[pair.at] = first;
            all[TWIN] = second;
        }
        all
    }

    /// What both states of filtered noise are driven by together, where there is such noise: its part, twice that.
    #[inline(always)]
    fn driven_together(&self, at: usize) -> Option<(usize, f64)> {
        let pair = self.filtered.as_ref()?;
        let start = if at == 0 { 1.0 } else { 0.0 };
        let decay = &self.decays[self.steps[at].decay as usize];
        Some((pair.at, 2.0 * pair.driven(start, decay)[2]))
    }

    /// Tr V⁻¹ K, K being what a unit of a variance adds to V: the slope of log|V|, by the same pass.
    #[must_use]
    pub fn traces(&self, parts: &[Part<'_>]) -> ByVariance {
        let kinds = kinds(parts);
        self.with_twin(Arch::new().dispatch(Traces {
            whitener: self,
            kinds: &kinds,
        }))
    }

    /// Innovations of several columns, each over its own standard deviation.
    #[must_use]
    pub fn apply(&self, columns: &[&[f64]]) -> Vec<Vec<f64>> {
        let mut out = vec![vec![0.0; self.samples.len()]; columns.len()];
        for (group, into) in columns.chunks(LANES).zip(out.chunks_mut(LANES)) {
            Arch::new().dispatch(Apply {
                whitener: self,
                columns: group,
                out: into,
            });
        }
        out
    }
}
