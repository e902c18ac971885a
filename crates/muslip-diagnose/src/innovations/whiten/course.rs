//! The readings of one run as the filter meets them, and the sizes of the noise that it meets them with: the first is
//! made once, the second are tried by the hundred.

use super::ByVariance;
use super::part::{Kind, MOST, Pair, Part, TWIN, decays, kinds};

/// The readings of one run in use, in their order: by what the noise enters them and how it goes in between.
pub struct Course {
    /// One where a part is integrated into the walk, else nothing.
    pub(super) integrated: [f64; MOST],
    pub(super) filtered: Option<Pair>,
    pub(super) kinds: [Kind; MOST],
    /// Samples in use, in order.
    pub samples: Vec<usize>,
    pub(super) steps: Vec<Step>,
    /// What each state keeps of itself over a step, by step of time.
    decays: Vec<[f64; MOST]>,
    /// What a unit of each part's variance adds over it.
    driven: Vec<[f64; MOST]>,
    /// The same at the start.
    at_start: [f64; MOST],
}

/// A reading, and the step of time before it.
pub struct Step {
    pub(super) row: [f64; MOST],
    pub(super) dt: f64,
    /// Over how much of the time before it, in s, the reading is a mean of the walk.
    pub(super) meant: f64,
    decay: u32,
    /// Whether nothing is known of the level before this reading.
    pub(super) fresh: bool,
}

/// No reading.
pub const NOTHING: Step = Step {
    row: [0.0; MOST],
    dt: 0.0,
    meant: 0.0,
    decay: u32::MAX,
    fresh: false,
};

/// A run without readings.
static NONE: Course = Course {
    integrated: [0.0; MOST],
    filtered: None,
    kinds: [Kind::Constant; MOST],
    samples: Vec::new(),
    steps: Vec::new(),
    decays: Vec::new(),
    driven: Vec::new(),
    at_start: [0.0; MOST],
};

/// Sizes of the noise.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    /// Standard deviation of each reading's own noise.
    pub white: f64,
    /// Variance of a level of which nothing is known.
    pub diffuse: f64,
    /// Standard deviations of the parts, in their order.
    pub parts: [f64; MOST],
}

impl Sizes {
    #[inline(always)]
    pub(super) fn variance(&self, part: usize) -> f64 {
        self.parts[part] * self.parts[part]
    }
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

/// By what each state enters a reading.
fn row_of(parts: &[Part<'_>], filtered: Option<&Pair>, k: usize) -> [f64; MOST] {
    let mut row = core::array::from_fn(|i| {
        parts.get(i).map_or(0.0, |part| match part.kind {
            Kind::Integrated(_) => 0.0,
            _ => part.gain.get(k).copied().unwrap_or(1.0),
        })
    });
    if let Some(pair) = filtered {
        row[TWIN] = -row[pair.at];
    }
    row
}

/// How long the reading at a sample was taken, in s: since the one before, or as long as until the next one.
fn length(time: &[f64], segment: &core::ops::Range<usize>, k: usize) -> f64 {
    let from = k.saturating_sub(1).max(segment.start);
    let to = (from + 1).min(segment.end - 1);
    time[to] - time[from]
}

impl Course {
    /// Every `stride`-th reading of a run. `segments` are the stretches in use; at most [`MOST`] parts.
    #[must_use]
    pub fn new(
        time: &[f64],
        segments: &[core::ops::Range<usize>],
        stride: usize,
        parts: &[Part<'_>],
    ) -> Self {
        debug_assert!(parts.len() <= MOST, "{} parts", parts.len());
        let walk = parts.first().is_some_and(|part| part.kind == Kind::Walk);
        let is_integrated = |part: &Part<'_>| matches!(part.kind, Kind::Integrated(_));
        let filtered = Pair::of(parts);
        let mut out = Self {
            integrated: core::array::from_fn(|i| match parts.get(i) {
                Some(part) if walk && is_integrated(part) => 1.0,
                _ => 0.0,
            }),
            kinds: kinds(parts),
            at_start: [0.0; MOST],
            filtered,
            samples: Vec::new(),
            steps: Vec::new(),
            decays: Vec::new(),
            driven: Vec::new(),
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
                    let decay = decays(parts, dt);
                    out.driven.push(out.driven_over(&decay, 0.0));
                    out.decays.push(decay);
                    spans.len() - 1
                });
                if out.steps.is_empty() {
                    out.at_start = out.driven_over(&out.decays[decay], 1.0);
                }
                out.samples.push(k);
                out.steps.push(Step {
                    row: row_of(parts, out.filtered.as_ref(), k),
                    dt,
                    meant: if walk { length(time, segment, k) } else { 0.0 },
                    decay: decay as u32,
                    fresh,
                });
                fresh = false;
            }
        }
        out
    }

    /// One without readings.
    pub(super) fn none() -> &'static Self {
        &NONE
    }

    /// What each state keeps of itself before a reading.
    #[inline(always)]
    pub(super) fn decay_of(&self, step: &Step) -> &[f64; MOST] {
        self.decays.get(step.decay as usize).unwrap_or(&[1.0; MOST])
    }

    /// What a unit of each part's variance adds over a step that keeps this, but for a walk's; `start` is one at the
    /// start, else nothing.
    fn driven_over(&self, decay: &[f64; MOST], start: f64) -> [f64; MOST] {
        let mut all = core::array::from_fn(|i| match self.kinds[i] {
            Kind::Walk => 0.0,
            Kind::Constant => start,
            Kind::Forgetting(_) | Kind::Integrated(_) | Kind::Filtered(_) => {
                start + 1.0 - decay[i] * decay[i]
            }
        });
        if let Some(pair) = &self.filtered {
            let [first, second, _] = pair.driven(start, decay[pair.at], decay[TWIN]);
            all[pair.at] = first;
            all[TWIN] = second;
        }
        all
    }

    /// Variance of the walk over a second, where there is one.
    #[inline(always)]
    pub(super) fn walked(&self, sizes: &Sizes) -> f64 {
        if self.kinds[0] == Kind::Walk {
            sizes.variance(0)
        } else {
            0.0
        }
    }

    /// What a unit of each part's variance adds before a reading.
    #[inline(always)]
    pub(super) fn driven(&self, at: usize, step: &Step) -> [f64; MOST] {
        let mut all = if at == 0 {
            self.at_start
        } else {
            self.driven[step.decay as usize]
        };
        if self.kinds[0] == Kind::Walk {
            all[0] = step.dt;
        }
        all
    }

    /// What both states of filtered noise are driven by together, where there is such noise: twice that.
    #[inline(always)]
    pub(super) fn driven_together(&self, at: usize, step: &Step) -> f64 {
        let start = if at == 0 { 1.0 } else { 0.0 };
        let decay = self.decay_of(step);
        self.filtered.as_ref().map_or(0.0, |pair| {
            2.0 * pair.driven(start, decay[pair.at], decay[TWIN])[2]
        })
    }

    /// What filtered noise's second state says belongs to its part.
    pub(super) fn with_twin(&self, mut of: ByVariance) -> ByVariance {
        if let Some(pair) = &self.filtered {
            of.parts[pair.at] += core::mem::take(&mut of.parts[TWIN]);
        }
        of
    }
}
