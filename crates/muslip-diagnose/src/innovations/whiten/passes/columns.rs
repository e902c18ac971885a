//! The passes of columns: forward to their innovations, back to what the parts explain of them, and forward again to
//! what each part is expected to have been.

use pulp::{Simd, WithSimd};

use crate::innovations::whiten::course::Sizes;
use crate::innovations::whiten::lanes::{LANES, Lane};
use crate::innovations::whiten::part::{MEAN_OF_WALK, MOST, TWIN};
use crate::innovations::whiten::{ByVariance, Whitener};

/// States of `G` groups of columns.
type States<const G: usize> = [[Lane; G]; MOST];

/// The pass of [`Whitener::apply`] for `G` of the groups of columns.
pub struct Apply<'a, const G: usize> {
    pub whitener: &'a Whitener,
    /// Columns and innovations, reading by reading.
    pub columns: &'a [Lane],
    pub out: &'a mut [Lane],
    /// Groups a reading, and the first of these.
    pub groups: usize,
    pub first: usize,
}

impl<const G: usize> WithSimd for Apply<'_, G> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let Whitener { course, found } = self.whitener;
        let readings = self.columns.chunks_exact(self.groups);
        let out = self.out.chunks_exact_mut(self.groups);
        let gains = found.gains.iter().zip(&found.inverse);
        let mut x: States<G> = [[[0.0; LANES]; G]; MOST];
        for (((step, (gain, inverse)), column), out) in
            course.steps.iter().zip(gains).zip(readings).zip(out)
        {
            for i in 1..MOST {
                if course.integrated[i] != 0.0 {
                    for g in 0..G {
                        for l in 0..LANES {
                            x[0][g][l] += step.dt * x[i][g][l];
                        }
                    }
                }
            }
            let decay = course.decay_of(step);
            let mut e: [Lane; G] = core::array::from_fn(|g| column[self.first + g]);
            for i in 0..MOST {
                for g in 0..G {
                    for l in 0..LANES {
                        x[i][g][l] *= decay[i];
                        e[g][l] -= step.row[i] * x[i][g][l];
                    }
                }
            }
            for i in 0..MOST {
                for g in 0..G {
                    for l in 0..LANES {
                        x[i][g][l] += gain[i] * e[g][l];
                    }
                }
            }
            for g in 0..G {
                out[self.first + g] = e[g].map(|e| e * inverse);
            }
        }
    }
}

/// The pass back of [`Whitener::explained`] for one group of sums of columns. `LAST` is whether the last lane holds a sum
/// that is told apart.
pub struct Squares<'a, const LAST: bool> {
    pub whitener: &'a Whitener,
    /// Innovations of the sums, reading by reading.
    pub sums: &'a [Lane],
    /// Groups a reading, and this one.
    pub groups: usize,
    pub group: usize,
    /// Of all lanes but one that is told apart, and of that.
    pub out: &'a mut [ByVariance; 2],
}

/// Sum over the lanes but for the last where that is told apart, and the last.
#[inline(always)]
fn across<const LAST: bool>(lane: &Lane) -> [f64; 2] {
    let count = if LAST { LANES - 1 } else { LANES };
    let mut sum = lane[0];
    for own in &lane[1..count] {
        sum += own;
    }
    [sum, lane[LANES - 1]]
}

/// Products lane by lane.
#[inline(always)]
fn times(a: &Lane, b: &Lane) -> Lane {
    core::array::from_fn(|l| a[l] * b[l])
}

/// What a reading explains of a unit of the walk's variance by being a mean of it and not where it ends, beside what the end
/// does: by the column over its covariance, and by how the walk's end is pushed by later readings.
#[inline(always)]
fn mean_for_end(u: &Lane, later: &Lane, meant: f64) -> Lane {
    let [own, shared] = MEAN_OF_WALK;
    core::array::from_fn(|l| {
        let less = (1.0 - own) * u[l] + 2.0 * (1.0 - shared) * later[l];
        -meant * u[l] * less
    })
}

impl<const LAST: bool> WithSimd for Squares<'_, LAST> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let Whitener { course, found } = self.whitener;
        let (groups, group, out) = (self.groups, self.group, self.out);
        let mut s = [[0.0; LANES]; MOST];
        for (at, step) in course.steps.iter().enumerate().rev() {
            let (gain, inverse) = (&found.gains[at], found.inverse[at]);
            let mut u = self.sums[at * groups + group].map(|white| white * inverse);
            for i in 0..MOST {
                for l in 0..LANES {
                    u[l] -= gain[i] * s[i][l];
                }
            }
            let [rest, last] = across::<LAST>(&times(&u, &u));
            out[0].white += rest;
            if LAST {
                out[1].white += last;
            }
            let mean = mean_for_end(&u, &s[0], step.meant);
            let [rest, last] = across::<LAST>(&mean);
            out[0].parts[0] += rest;
            if LAST {
                out[1].parts[0] += last;
            }
            for i in 0..MOST {
                for l in 0..LANES {
                    s[i][l] += step.row[i] * u[l];
                }
            }
            if step.fresh {
                s[0] = [0.0; LANES];
            }
            let driven = course.driven(at, step);
            for i in 0..MOST {
                let [rest, last] = across::<LAST>(&times(&s[i], &s[i]));
                out[0].parts[i] += rest * driven[i];
                if LAST {
                    out[1].parts[i] += last * driven[i];
                }
            }
            if let Some(pair) = &course.filtered {
                let together = course.driven_together(at, step);
                let [rest, last] = across::<LAST>(&times(&s[pair.at], &s[TWIN]));
                out[0].parts[pair.at] += rest * together;
                if LAST {
                    out[1].parts[pair.at] += last * together;
                }
            }
            let decay = course.decay_of(step);
            let level = s[0];
            for i in 0..MOST {
                let along = course.integrated[i] * step.dt;
                for l in 0..LANES {
                    s[i][l] = s[i][l] * decay[i] + along * level[l];
                }
            }
        }
    }
}

/// The passes of [`Whitener::expected`]: back over one column's innovations, then forward to what each part is expected to
/// have been, given the column.
pub struct Expected<'a> {
    pub whitener: &'a Whitener,
    pub sizes: &'a Sizes,
    /// Innovations of the column, each over its standard deviation.
    pub innovations: &'a [f64],
}

/// What the readings from one on say of what drove the states before it, for units of variance.
#[derive(Clone, Copy, Default)]
struct Pushed {
    /// By how much each state was pushed.
    states: [f64; MOST],
    /// By how much the walk's end was, beyond the mean that was read.
    still_to_come: f64,
    /// The column over its covariance.
    own: f64,
}

impl WithSimd for Expected<'_> {
    /// By reading: of the parts, then of the readings' own noise.
    type Output = Vec<[f64; MOST + 1]>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let pushed = self.pushed();
        self.followed(&pushed)
    }
}

impl Expected<'_> {
    /// Back over the readings.
    #[inline(always)]
    fn pushed(&self) -> Vec<Pushed> {
        let Whitener { course, found } = self.whitener;
        let n = course.steps.len();
        let mut pushed = vec![Pushed::default(); n];
        let mut s = [0.0; MOST];
        for (at, step) in course.steps.iter().enumerate().rev() {
            let mut u = self.innovations[at] * found.inverse[at];
            for i in 0..MOST {
                u -= found.gains[at][i] * s[i];
            }
            let later = s[0];
            for i in 0..MOST {
                s[i] += step.row[i] * u;
            }
            if step.fresh {
                s[0] = 0.0;
            }
            let driven = course.driven(at, step);
            let mut states: [f64; MOST] = core::array::from_fn(|i| driven[i] * s[i]);
            if let Some(pair) = &course.filtered {
                let shared = 0.5 * course.driven_together(at, step);
                states[pair.at] += shared * s[TWIN];
                states[TWIN] += shared * s[pair.at];
            }
            let [own, shared] = MEAN_OF_WALK;
            states[0] -= step.meant * (1.0 - shared) * u;
            pushed[at] = Pushed {
                states,
                still_to_come: step.meant * ((shared - own) * u + (1.0 - shared) * later),
                own: u,
            };
            let decay = course.decay_of(step);
            let level = s[0];
            for i in 0..MOST {
                s[i] = s[i] * decay[i] + course.integrated[i] * step.dt * level;
            }
        }
        pushed
    }

    /// Forward: what enters each reading by each part that is pushed so.
    #[inline(always)]
    fn followed(&self, pushed: &[Pushed]) -> Vec<[f64; MOST + 1]> {
        let course = &self.whitener.course;
        let variance: [f64; MOST] = core::array::from_fn(|i| match &course.filtered {
            Some(pair) if i == TWIN => self.sizes.variance(pair.at),
            _ => self.sizes.variance(i),
        });
        let white = self.sizes.white * self.sizes.white;
        let (mut state, mut level) = ([0.0; MOST], [0.0; MOST]);
        let readings = course.steps.iter().zip(pushed);
        readings
            .map(|(step, pushed)| {
                let decay = course.decay_of(step);
                let mut out = [0.0; MOST + 1];
                for i in 0..MOST {
                    level[i] += course.integrated[i] * step.dt * state[i];
                    state[i] = decay[i] * state[i] + variance[i] * pushed.states[i];
                }
                if step.fresh {
                    level = [0.0; MOST];
                    state[0] = 0.0;
                }
                for i in 0..MOST {
                    out[i] = step.row[i] * state[i] + step.row[0] * level[i];
                }
                if let Some(pair) = &course.filtered {
                    out[pair.at] += core::mem::take(&mut out[TWIN]);
                }
                out[0] -= variance[0] * pushed.still_to_come;
                out[MOST] = white * pushed.own;
                out
            })
            .collect()
    }
}
