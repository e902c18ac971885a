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

use pulp::{Arch, Simd, WithSimd};

/// Most states of one balance. All loops run over so many, so that they are unrolled: what a balance has less are
/// parts of no variance that enter nothing.
pub const MOST: usize = 8;
/// Columns that go through the filter side by side.
const LANES: usize = 8;
/// Variance of a level of which nothing is known, over that of the other parts.
pub const DIFFUSE: f64 = 1e8;

/// How one part of the noise goes in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Forgets with this time constant in s.
    Forgetting(f64),
    /// Stays what it is over a run.
    Constant,
    /// The level that all integrated parts enter, itself driven by white noise: its standard deviation grows with
    /// the root of time. Nothing is known of it at the start and after a gap. At most one a balance, the first part.
    Walk,
    /// Forgets with this time constant in s and is integrated into the walk.
    Integrated(f64),
    /// White noise that has passed two poles whose time constants are this one, in s, but for [`APART`]: what a filtered
    /// reading errs by. At most one a balance, of at most [`MOST`] less one parts.
    Filtered(f64),
}

/// By what factor the poles of filtered noise differ from their mean: equal ones would be no sum of two parts.
const APART: f64 = 1.2;

/// The second state of filtered noise is the last one.
const TWIN: usize = MOST - 1;

/// Filtered noise is the difference of two parts that one white noise drives, each forgetting with one of the poles.
#[derive(Clone, Copy)]
struct Pair {
    /// State of the first part; that of the second is [`TWIN`].
    at: usize,
    /// Variances of both and their covariance where the difference has a variance of one.
    variances: [f64; 3],
}

impl Pair {
    fn of(parts: &[Part<'_>]) -> Option<Self> {
        let is_filtered = |part: &Part<'_>| matches!(part.kind, Kind::Filtered(_));
        let at = parts.iter().position(is_filtered)?;
        debug_assert!(parts.len() < MOST, "{} parts", parts.len());
        // Rates over that of the mean.
        let (fast, slow) = (APART, 1.0 / APART);
        let variances = [0.5 / slow, 0.5 / fast, 1.0 / (slow + fast)];
        let whole = variances[0] + variances[1] - 2.0 * variances[2];
        Some(Self {
            at,
            variances: variances.map(|v| v / whole),
        })
    }

    /// What a unit of variance adds over a step, to the first part, the second and what they share.
    #[inline(always)]
    fn driven(&self, start: f64, decay: &[f64; MOST]) -> [f64; 3] {
        let (a, b) = (decay[self.at], decay[TWIN]);
        let [first, second, shared] = self.variances;
        [
            first * (start + 1.0 - a * a),
            second * (start + 1.0 - b * b),
            shared * (start + 1.0 - a * b),
        ]
    }
}

/// One part of the noise on one run.
#[derive(Clone, Debug)]
pub struct Part<'a> {
    /// How it goes in time.
    pub kind: Kind,
    /// Standard deviation (of a walk: after one second).
    pub std: f64,
    /// By what it enters each reading; empty where by one.
    pub gain: &'a [f64],
}

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

/// What each part keeps of itself over a step of time.
fn decays(parts: &[Part<'_>], dt: f64) -> [f64; MOST] {
    let mut all = core::array::from_fn(|i| match parts.get(i).map(|part| part.kind) {
        Some(Kind::Forgetting(tau) | Kind::Integrated(tau)) => (-dt / tau).exp(),
        Some(Kind::Filtered(tau)) => (-dt / (APART * tau)).exp(),
        _ => 1.0,
    });
    for part in parts {
        if let Kind::Filtered(tau) = part.kind {
            all[TWIN] = (-dt * APART / tau).exp();
        }
    }
    all
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

// Each pass is compiled for the wider registers of newer processors, too, and the widest that is there runs. None
// fuses a product with a sum, so all give the same digits.

/// All gains and the innovations' variances.
struct Covariance<'a> {
    whitener: &'a mut Whitener,
    parts: &'a [Part<'a>],
    noise: f64,
    diffuse: f64,
}

impl WithSimd for Covariance<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let mut p = [[0.0; MOST]; MOST];
        // What drives each part: once over its memory, or over a second.
        let (mut forgotten, mut walked) = ([0.0; MOST], 0.0);
        for (i, part) in self.parts.iter().enumerate().take(MOST) {
            let variance = part.std * part.std;
            match part.kind {
                Kind::Walk => walked = variance,
                Kind::Constant => p[i][i] = variance,
                Kind::Forgetting(_) | Kind::Integrated(_) => {
                    p[i][i] = variance;
                    forgotten[i] = variance;
                }
                Kind::Filtered(_) => {}
            }
        }
        let Whitener {
            integrated,
            filtered,
            steps,
            decays,
            log_variances,
            ..
        } = self.whitener;
        let pair = filtered.map(|pair| {
            let std = self.parts[pair.at].std;
            (pair, std * std)
        });
        for (at, step) in steps.iter_mut().enumerate() {
            let decay = &decays[step.decay as usize];
            let along = along(integrated, step.dt);
            predict(&mut p, decay, &along);
            p[0][0] += walked * step.dt;
            for i in 0..MOST {
                p[i][i] += forgotten[i] * (1.0 - decay[i] * decay[i]);
            }
            if let Some((pair, variance)) = &pair {
                let start = if at == 0 { 1.0 } else { 0.0 };
                let [first, second, shared] = pair.driven(start, decay);
                p[pair.at][pair.at] += variance * first;
                p[TWIN][TWIN] += variance * second;
                p[pair.at][TWIN] += variance * shared;
                p[TWIN][pair.at] += variance * shared;
            }
            if step.fresh {
                forget_level(&mut p, self.diffuse);
            }
            let (gain, variance) = update(&mut p, &step.row, self.noise);
            step.gain = gain;
            step.inverse = 1.0 / variance.sqrt();
            log_variances.push(variance.ln());
        }
    }
}

/// The pass back of [`Whitener::traces`].
struct Traces<'a> {
    whitener: &'a Whitener,
    kinds: &'a [Kind; MOST],
}

impl WithSimd for Traces<'_> {
    type Output = ByVariance;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let mut out = ByVariance::default();
        let mut s = [[0.0; MOST]; MOST];
        for (at, step) in self.whitener.steps.iter().enumerate().rev() {
            let mut w = [0.0; MOST];
            for j in 0..MOST {
                for i in 0..MOST {
                    w[i] += s[j][i] * step.gain[j];
                }
            }
            let mut d = step.inverse * step.inverse;
            for i in 0..MOST {
                d += step.gain[i] * w[i];
            }
            out.white += d;
            for i in 0..MOST {
                for j in 0..MOST {
                    s[i][j] +=
                        step.row[i] * step.row[j] * d - step.row[i] * w[j] - w[i] * step.row[j];
                }
            }
            if step.fresh {
                for i in 0..MOST {
                    s[0][i] = 0.0;
                    s[i][0] = 0.0;
                }
            }
            let driven = self.whitener.driven(at, self.kinds);
            for i in 0..MOST {
                out.parts[i] += s[i][i] * driven[i];
            }
            if let Some((i, together)) = self.whitener.driven_together(at) {
                out.parts[i] += s[i][TWIN] * together;
            }
            let decay = &self.whitener.decays[step.decay as usize];
            let along = along(&self.whitener.integrated, step.dt);
            for row in &mut s {
                let level = row[0];
                for j in 0..MOST {
                    row[j] = row[j] * decay[j] + along[j] * level;
                }
            }
            let level = s[0];
            for i in 0..MOST {
                for j in 0..MOST {
                    s[i][j] = s[i][j] * decay[i] + along[i] * level[j];
                }
            }
        }
        out
    }
}

/// The pass back of [`Whitener::squares`] for at most [`LANES`] columns.
struct Squares<'a> {
    whitener: &'a Whitener,
    innovations: &'a [&'a [f64]],
    kinds: &'a [Kind; MOST],
    out: &'a mut ByVariance,
}

impl WithSimd for Squares<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let mut s = [[0.0; LANES]; MOST];
        for (at, step) in self.whitener.steps.iter().enumerate().rev() {
            let mut u = [0.0; LANES];
            for (u, white) in u.iter_mut().zip(self.innovations) {
                *u = white[at] * step.inverse;
            }
            for i in 0..MOST {
                for l in 0..LANES {
                    u[l] -= step.gain[i] * s[i][l];
                }
            }
            self.out.white += u.iter().map(|u| u * u).sum::<f64>();
            for i in 0..MOST {
                for l in 0..LANES {
                    s[i][l] += step.row[i] * u[l];
                }
            }
            if step.fresh {
                s[0] = [0.0; LANES];
            }
            let driven = self.whitener.driven(at, self.kinds);
            for i in 0..MOST {
                let square: f64 = s[i].iter().map(|x| x * x).sum();
                self.out.parts[i] += square * driven[i];
            }
            if let Some((i, together)) = self.whitener.driven_together(at) {
                let product: f64 = s[i].iter().zip(&s[TWIN]).map(|(a, b)| a * b).sum();
                self.out.parts[i] += product * together;
            }
            let decay = &self.whitener.decays[step.decay as usize];
            let level = s[0];
            let along = along(&self.whitener.integrated, step.dt);
            for i in 0..MOST {
                for l in 0..LANES {
                    s[i][l] = s[i][l] * decay[i] + along[i] * level[l];
                }
            }
        }
    }
}

/// The pass of [`Whitener::apply`] for at most [`LANES`] columns.
struct Apply<'a> {
    whitener: &'a Whitener,
    columns: &'a [&'a [f64]],
    out: &'a mut [Vec<f64>],
}

impl WithSimd for Apply<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let mut x = [[0.0; LANES]; MOST];
        for (at, (step, &k)) in self
            .whitener
            .steps
            .iter()
            .zip(&self.whitener.samples)
            .enumerate()
        {
            let along = along(&self.whitener.integrated, step.dt);
            for i in 1..MOST {
                for l in 0..LANES {
                    x[0][l] += along[i] * x[i][l];
                }
            }
            let decay = &self.whitener.decays[step.decay as usize];
            let mut e = [0.0; LANES];
            for (e, c) in e.iter_mut().zip(self.columns) {
                *e = c[k];
            }
            for i in 0..MOST {
                for l in 0..LANES {
                    x[i][l] *= decay[i];
                    e[l] -= step.row[i] * x[i][l];
                }
            }
            for i in 0..MOST {
                for l in 0..LANES {
                    x[i][l] += step.gain[i] * e[l];
                }
            }
            for (o, e) in self.out.iter_mut().zip(e) {
                o[at] = e * step.inverse;
            }
        }
    }
}

/// How the parts go in time; what there is not stays nothing.
fn kinds(parts: &[Part<'_>]) -> [Kind; MOST] {
    core::array::from_fn(|i| parts.get(i).map_or(Kind::Constant, |part| part.kind))
}

/// How much of each part goes into the walk over a step of time.
#[inline(always)]
fn along(integrated: &[f64; MOST], dt: f64) -> [f64; MOST] {
    integrated.map(|integrated| integrated * dt)
}

/// Covariance after a step of time, without what drives it: the level takes up what is integrated over the step.
#[inline(always)]
fn predict(p: &mut [[f64; MOST]; MOST], decay: &[f64; MOST], along: &[f64; MOST]) {
    let mut level = p[0];
    for i in 1..MOST {
        for j in 0..MOST {
            level[j] += along[i] * p[i][j];
        }
    }
    p[0] = level;
    for i in 0..MOST {
        let mut sum = p[i][0];
        for j in 1..MOST {
            sum += along[j] * p[i][j];
        }
        p[i][0] = sum;
    }
    for i in 0..MOST {
        for j in 0..MOST {
            p[i][j] *= decay[i] * decay[j];
        }
    }
}

/// After a gap nothing is known of the level.
fn forget_level(p: &mut [[f64; MOST]; MOST], diffuse: f64) {
    for j in 0..MOST {
        p[0][j] = 0.0;
        p[j][0] = 0.0;
    }
    p[0][0] = diffuse;
}

/// Takes a reading up; the gains, and the variance of the reading's innovation.
#[inline(always)]
fn update(p: &mut [[f64; MOST]; MOST], row: &[f64; MOST], noise: f64) -> ([f64; MOST], f64) {
    let mut ph = [0.0; MOST];
    // By rows: the covariance is symmetric.
    for j in 0..MOST {
        for i in 0..MOST {
            ph[i] += p[j][i] * row[j];
        }
    }
    let mut variance = noise;
    for i in 0..MOST {
        variance += row[i] * ph[i];
    }
    let variance = variance.max(1e-30);
    let inverse = 1.0 / variance;
    for i in 0..MOST {
        for j in 0..MOST {
            p[i][j] -= ph[i] * ph[j] * inverse;
        }
    }
    (ph.map(|x| x * inverse), variance)
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use rand::RngExt as _;
    use rand::SeedableRng as _;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const WHITE: f64 = 0.7;

    /// Irregular times with a gap, and a gain that varies.
    fn times(draw: &mut ChaCha8Rng) -> (Vec<f64>, Vec<f64>) {
        let mut t = 0.0;
        let time = (0..80)
            .map(|k| {
                t += if k == 45 {
                    0.6
                } else {
                    draw.random_range(0.004..0.03)
                };
                t
            })
            .collect();
        (
            time,
            (0..80).map(|_| draw.random_range(-2.0..2.0)).collect(),
        )
    }

    /// Covariance of the readings, built impulse by impulse: every independent cause of noise drives the recursion
    /// alone.
    fn dense(
        time: &[f64],
        segments: &[core::ops::Range<usize>],
        parts: &[Part<'_>],
    ) -> DMatrix<f64> {
        let used: Vec<usize> = segments.iter().flat_map(Clone::clone).collect();
        let n = used.len();
        let mut covariance = DMatrix::identity(n, n) * (WHITE * WHITE);
        let starts: Vec<usize> = segments.iter().map(|s| s.start).collect();
        for part in parts {
            if let Kind::Filtered(tau) = part.kind {
                // The covariance of white noise behind two poles, in closed form.
                let (a, b) = (1.0 / (APART * tau), APART / tau);
                let at = |lag: f64| {
                    (-a * lag).exp() * (0.5 / a - 1.0 / (a + b))
                        + (-b * lag).exp() * (0.5 / b - 1.0 / (a + b))
                };
                covariance += DMatrix::from_fn(n, n, |i, j| {
                    let gain = |i: usize| part.gain.get(used[i]).copied().unwrap_or(1.0);
                    let lag = (time[used[i]] - time[used[j]]).abs();
                    part.std * part.std * gain(i) * gain(j) * at(lag) / at(0.0)
                });
            }
        }
        let mut add = |effect: &DVector<f64>| covariance += effect * effect.transpose();
        for part in parts {
            for cause in 0..n {
                let mut effect = DVector::zeros(n);
                let (mut x, mut level) = (0.0, 0.0);
                for (i, &k) in used.iter().enumerate() {
                    let dt = if i == 0 {
                        0.0
                    } else {
                        time[k] - time[used[i - 1]]
                    };
                    let here = if i == cause { 1.0 } else { 0.0 };
                    let first = i == 0;
                    match part.kind {
                        Kind::Forgetting(tau) => {
                            let decay = (-dt / tau).exp();
                            let fresh = if first {
                                1.0
                            } else {
                                (1.0 - decay * decay).sqrt()
                            };
                            x = decay * x + here * fresh * part.std;
                        }
                        Kind::Constant => x += if first { here * part.std } else { 0.0 },
                        Kind::Walk => {
                            if starts.contains(&k) {
                                x = here * (WHITE * WHITE * DIFFUSE).sqrt();
                            } else {
                                x += here * part.std * dt.sqrt();
                            }
                        }
                        Kind::Integrated(tau) => {
                            level += dt * x;
                            if starts.contains(&k) {
                                level = 0.0;
                            }
                            let decay = (-dt / tau).exp();
                            let fresh = if first {
                                1.0
                            } else {
                                (1.0 - decay * decay).sqrt()
                            };
                            x = decay * x + here * fresh * part.std;
                        }
                        Kind::Filtered(_) => {}
                    }
                    let gain = part.gain.get(k).copied().unwrap_or(1.0);
                    effect[i] = if matches!(part.kind, Kind::Integrated(_)) {
                        level
                    } else {
                        gain * x
                    };
                }
                add(&effect);
            }
        }
        covariance
    }

    fn worst_difference(parts: &[Part<'_>], time: &[f64], draw: &mut ChaCha8Rng) -> f64 {
        let segments = [2..30, 34..45, 45..80];
        let whitener = Whitener::new(time, &segments, 1, WHITE, WHITE * WHITE * DIFFUSE, parts);
        let covariance = dense(time, &segments, parts);
        let factor = covariance.clone().cholesky().unwrap();
        let columns: Vec<Vec<f64>> = (0..11)
            .map(|_| (0..80).map(|_| draw.random_range(-1.0..1.0)).collect())
            .collect();
        let refs: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let white = whitener.apply(&refs);
        let mut worst = 0.0f64;
        for (a, own) in columns.iter().zip(&white) {
            for (b, other) in columns.iter().zip(&white) {
                let pick = |x: &[f64]| {
                    DVector::from_iterator(
                        whitener.samples.len(),
                        whitener.samples.iter().map(|k| x[*k]),
                    )
                };
                let expected = pick(a).dot(&factor.solve(&pick(b)));
                let found: f64 = own.iter().zip(other).map(|(a, b)| a * b).sum();
                worst = worst.max((found - expected).abs() / expected.abs().max(1.0));
            }
        }
        let log_det = 2.0 * factor.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        worst.max((whitener.log_variances.iter().sum::<f64>() - log_det).abs() / log_det.abs())
    }

    #[test]
    fn the_filter_equals_dense_algebra_with_gaps_and_stretches_left_out() {
        let mut draw = ChaCha8Rng::seed_from_u64(7);
        for _ in 0..5 {
            let (time, gain) = times(&mut draw);
            let parts = [
                Part {
                    kind: Kind::Forgetting(0.05),
                    std: 0.8,
                    gain: &gain,
                },
                Part {
                    kind: Kind::Constant,
                    std: 1.3,
                    gain: &gain,
                },
                Part {
                    kind: Kind::Forgetting(0.4),
                    std: 0.5,
                    gain: &[],
                },
                Part {
                    kind: Kind::Filtered(0.06),
                    std: 0.9,
                    gain: &gain,
                },
            ];
            assert!(worst_difference(&parts, &time, &mut draw) < 1e-9);
        }
    }

    #[test]
    fn the_filter_equals_dense_algebra_where_levels_are_unknown() {
        let mut draw = ChaCha8Rng::seed_from_u64(8);
        for _ in 0..5 {
            let (time, gain) = times(&mut draw);
            let parts = [
                Part {
                    kind: Kind::Walk,
                    std: 0.6,
                    gain: &[],
                },
                Part {
                    kind: Kind::Forgetting(0.05),
                    std: 0.8,
                    gain: &gain,
                },
                Part {
                    kind: Kind::Integrated(0.1),
                    std: 2.0,
                    gain: &[],
                },
            ];
            // A variance of 1e8 leaves dense algebra itself six digits.
            let worst = worst_difference(&parts, &time, &mut draw);
            assert!(worst < 1e-5, "{worst}");
        }
    }

    #[test]
    fn slopes_of_the_likelihood_are_its_differences() {
        let mut draw = ChaCha8Rng::seed_from_u64(9);
        let (time, gain) = times(&mut draw);
        let columns: Vec<Vec<f64>> = (0..11)
            .map(|_| (0..80).map(|_| draw.random_range(-3.0..3.0)).collect())
            .collect();
        let refs: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let segments = [2..30, 34..45, 45..80];
        let parts = |variances: &[f64]| {
            let kinds = [
                Kind::Walk,
                Kind::Forgetting(0.05),
                Kind::Integrated(0.1),
                Kind::Constant,
                Kind::Integrated(0.7),
                Kind::Filtered(0.06),
            ];
            let gained = [false, true, false, true, false, true];
            kinds
                .into_iter()
                .zip(gained)
                .zip(variances)
                .map(|((kind, gained), variance)| Part {
                    kind,
                    std: variance.sqrt(),
                    gain: if gained { &gain } else { &[] },
                })
                .collect::<Vec<_>>()
        };
        let filter = |variances: &[f64; 7]| {
            Whitener::new(
                &time,
                &segments,
                1,
                variances[6].sqrt(),
                1e6,
                &parts(&variances[..6]),
            )
        };
        let value = |variances: &[f64; 7]| {
            let whitener = filter(variances);
            let squares: f64 = whitener.apply(&refs).iter().flatten().map(|x| x * x).sum();
            whitener.log_variances.iter().sum::<f64>() + squares
        };
        let here = [0.4, 0.6, 2.0, 1.2, 0.8, 0.7, 0.5];
        let whitener = filter(&here);
        let traces = whitener.traces(&parts(&here[..6]));
        let white = whitener.apply(&refs);
        let white: Vec<&[f64]> = white.iter().map(Vec::as_slice).collect();
        let squares = whitener.squares(&white, &parts(&here[..6]));
        for i in 0..7 {
            let own = if i == 6 {
                traces.white - squares.white
            } else {
                traces.parts[i] - squares.parts[i]
            };
            let by = |h: f64| {
                let mut there = here;
                there[i] += h;
                value(&there)
            };
            // The level's variance of 1e6 leaves the value ten digits: smaller steps measure its rounding.
            let h = 5e-4 * here[i];
            let difference = (by(h) - by(-h)) / (2.0 * h);
            assert!(
                (own - difference).abs() < 1e-4 * difference.abs().max(1.0),
                "{i}: {own} {difference}"
            );
        }
    }
}
