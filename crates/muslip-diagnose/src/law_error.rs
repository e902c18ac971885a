//! How much of what the drag reads beyond its law is force, and how much is the reading's own noise.
//!
//! The tyre's balance as fitted says of which parts its residual is made: errors of the slip and of the friction, which
//! act on wheel and vehicle, and noise of the reading, white, with a memory or a run's zero, which does not. A
//! fixed-interval smoother of those parts (Bryson and Frazier 1963, in the form of Bierman 1973) gives what is to be
//! expected of the law's error. Its gains depend on the parts alone, so they are laid out once; what a model leaves
//! passes in O(n).

use core::iter::zip;
use core::ops::Range;

use crate::number::Number;

/// One part that has a state: of variance one, forgotten with time.
pub struct State {
    /// Time in s after which it is forgotten; infinite where it stays what it is over a run.
    pub memory_s: f64,
    /// By how many N it enters the mean of each block.
    pub gain: Vec<f64>,
    /// Whether it is an error of the law rather than of the reading.
    pub is_force: bool,
}

/// Size of a part beside the white noise below which it has no state.
const LEAST_SIZE: f64 = 1e-3;

/// Steps that differ by less, as a share of themselves, are the same.
const ALIKE: f64 = 1e-9;

/// The smoother of one run.
#[derive(Clone, Debug, Default)]
pub struct LawError {
    /// Mean time of each block in s, and its samples.
    time: Vec<f64>,
    samples: Vec<Range<usize>>,
    /// Of each state, the time in s after which it is forgotten, and whether it is an error of the law.
    states: Vec<(f64, bool)>,
    /// Variance of each block's innovation.
    variance: Vec<f64>,
    /// By block and state: by what each enters, what the innovation adds to it, and how the law's error goes with it
    /// before the block is read.
    gain: Vec<f64>,
    update: Vec<f64>,
    of_force: Vec<f64>,
}

/// What is left of each state after a time. Blocks are mostly as far apart as those before.
struct Kept {
    since: f64,
    share: Vec<f64>,
}

impl Kept {
    fn new(states: usize) -> Self {
        Self {
            since: 0.0,
            share: vec![1.0; states],
        }
    }

    /// After so many s.
    fn after(&mut self, since: f64, states: &[(f64, bool)]) -> &[f64] {
        if (since - self.since).abs() > ALIKE * since {
            self.since = since;
            let share = states.iter().map(|(memory_s, _)| (-since / memory_s).exp());
            self.share = share.collect();
        }
        &self.share
    }
}

impl LawError {
    /// The smoother of one run's blocks, at these times and of these samples, for parts beside white noise of this
    /// standard deviation in N of a block's mean.
    #[must_use]
    pub fn new(time: &[f64], samples: &[Range<usize>], white: f64, parts: Vec<State>) -> Self {
        let least = LEAST_SIZE * white;
        let enters = |part: &State| part.gain.iter().any(|gain| gain.abs() > least);
        let parts: Vec<State> = parts.into_iter().filter(enters).collect();
        let m = parts.len();
        let mut out = Self {
            time: time.to_vec(),
            samples: samples.to_vec(),
            states: parts.iter().map(|p| (p.memory_s, p.is_force)).collect(),
            ..Self::default()
        };
        let mut covariance = vec![0.0; m * m];
        for i in 0..m {
            covariance[i * m + i] = 1.0;
        }
        let mut kept = Kept::new(m);
        for block in 0..time.len() {
            let kept = kept.after(out.since(block), &out.states);
            for i in 0..m {
                for j in 0..m {
                    covariance[i * m + j] *= kept[i] * kept[j];
                }
                covariance[i * m + i] += 1.0 - kept[i] * kept[i];
            }
            let gain: Vec<f64> = parts.iter().map(|part| part.gain[block]).collect();
            let times = |of: &dyn Fn(&State) -> bool, i: usize| -> f64 {
                let own = (0..m).filter(|j| of(&parts[*j]));
                own.map(|j| covariance[i * m + j] * gain[j]).sum()
            };
            let read: Vec<f64> = (0..m).map(|i| times(&|_| true, i)).collect();
            let of_force = (0..m).map(|i| times(&|part| part.is_force, i));
            out.of_force.extend(of_force);
            let variance = white * white + zip(&read, &gain).map(|(r, g)| r * g).sum::<f64>();
            for i in 0..m {
                for j in 0..m {
                    covariance[i * m + j] -= read[i] * read[j] / variance;
                }
            }
            out.update.extend(read.iter().map(|r| r / variance));
            out.variance.push(variance);
            out.gain.extend(gain);
        }
        out
    }

    /// Time in s of a block since the one before.
    fn since(&self, block: usize) -> f64 {
        let before = block.saturating_sub(1);
        (self.time[block] - self.time[before]).max(0.0)
    }

    /// What is to be expected of the law's error in N at each block, of the mean of what is read there beyond the law.
    fn expected<T: Number>(&self, read: &[T]) -> Vec<T> {
        let m = self.states.len();
        let mut kept = Kept::new(m);
        let zero = T::constant(0.0);
        let mut state = vec![zero; m];
        let mut innovations = Vec::with_capacity(read.len());
        let mut out = Vec::with_capacity(read.len());
        for (block, read) in read.iter().enumerate() {
            let own = block * m..(block + 1) * m;
            let kept = kept.after(self.since(block), &self.states);
            let (mut innovation, mut force) = (*read, zero);
            for (i, gain) in self.gain[own.clone()].iter().enumerate() {
                state[i] = state[i] * kept[i];
                innovation = innovation - state[i] * *gain;
                if self.states[i].1 {
                    force += state[i] * *gain;
                }
            }
            for (state, update) in zip(&mut state, &self.update[own]) {
                *state += innovation * *update;
            }
            innovations.push(innovation);
            out.push(force);
        }
        let mut adjoint = vec![zero; m];
        for block in (0..read.len()).rev() {
            let own = block * m..(block + 1) * m;
            let back = zip(&adjoint, &self.update[own.clone()]);
            let back = back.fold(zero, |sum, (a, u)| sum + *a * *u);
            let told = innovations[block] / self.variance[block] - back;
            let kept = kept.after(self.since(block), &self.states);
            for (i, gain) in self.gain[own].iter().enumerate() {
                adjoint[i] += told * *gain;
                out[block] += adjoint[i] * self.of_force[block * m + i];
                adjoint[i] = adjoint[i] * kept[i];
            }
        }
        out
    }

    /// The same at each sample in N, of what is read beyond the law at each: straight between blocks that touch, nothing
    /// outside of them.
    #[must_use]
    pub fn at_samples<T: Number>(&self, time: &[f64], beyond: &[T]) -> Vec<T> {
        let mean = |samples: &Range<usize>| {
            let own = beyond[samples.clone()].iter();
            let own = own.filter(|x| x.value().is_finite());
            let nothing = (T::constant(0.0), 0.0);
            let (sum, count) = own.fold(nothing, |(sum, count), x| (sum + *x, count + 1.0));
            sum / f64::max(count, 1.0)
        };
        let read: Vec<T> = self.samples.iter().map(mean).collect();
        let expected = self.expected(&read);
        let mut out = vec![T::constant(0.0); time.len()];
        for (block, samples) in self.samples.iter().enumerate() {
            let touches = |a: usize, b: usize| {
                let next = self.samples.get(b);
                next.is_some_and(|next| next.start == self.samples[a].end)
            };
            for k in samples.clone() {
                let (from, to) = match time[k] < self.time[block] {
                    true if block > 0 && touches(block - 1, block) => (block - 1, block),
                    false if touches(block, block + 1) => (block, block + 1),
                    _ => (block, block),
                };
                let share = (time[k] - self.time[from]) / (self.time[to] - self.time[from]);
                let share = if from == to { 0.0 } else { share };
                out[k] = expected[from] + (expected[to] - expected[from]) * share;
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn what_is_expected_is_what_dense_algebra_expects_over_gaps_and_constants() {
        let mut draw = ChaCha8Rng::seed_from_u64(3);
        let n = 40;
        let time: Vec<f64> = (0..n)
            .map(|k| 0.01 * f64::from(k) + if k < 25 { 0.0 } else { 0.7 })
            .collect();
        let samples: Vec<Range<usize>> = (0..time.len()).map(|k| k..k + 1).collect();
        let white = 2.0;
        let memories = [
            (0.03, true),
            (0.07, false),
            (f64::INFINITY, true),
            (f64::INFINITY, false),
        ];
        let gains: Vec<Vec<f64>> = memories
            .iter()
            .map(|_| time.iter().map(|_| draw.random_range(-5.0..5.0)).collect())
            .collect();
        let read: Vec<f64> = time.iter().map(|_| draw.random_range(-9.0..9.0)).collect();
        // Of all parts and of those alone that are forces.
        let covariance = |force_only: bool| {
            DMatrix::from_fn(time.len(), time.len(), |a, b| {
                let part = |(&(memory_s, is_force), gain): (&(f64, bool), &Vec<f64>)| {
                    let alike = f64::exp(-(time[a] - time[b]).abs() / memory_s);
                    let counts = is_force || !force_only;
                    if counts {
                        gain[a] * gain[b] * alike
                    } else {
                        0.0
                    }
                };
                zip(&memories, &gains).map(part).sum::<f64>()
            })
        };
        let all = covariance(false) + DMatrix::identity(time.len(), time.len()) * (white * white);
        let weighed = all.lu().solve(&DVector::from_column_slice(&read)).unwrap();
        let dense = covariance(true) * weighed;
        let parts = zip(memories, gains).map(|((memory_s, is_force), gain)| State {
            memory_s,
            gain,
            is_force,
        });
        let found = LawError::new(&time, &samples, white, parts.collect()).at_samples(&time, &read);
        for (found, dense) in zip(&found, &dense) {
            assert!((found - dense).abs() < 1e-9, "{found} {dense}");
        }
        assert!(dense.amax() > 1.0);
    }

    #[test]
    fn nothing_is_expected_where_nothing_is_read_or_no_part_is_a_force() {
        let time = [0.0, 0.01, 0.02];
        let noise = || State {
            memory_s: 0.05,
            gain: vec![3.0; 3],
            is_force: false,
        };
        let samples = [0..1, 1..2, 2..3];
        let found = LawError::new(&time, &samples, 1.0, vec![noise()]);
        assert_eq!(found.at_samples(&time, &[4.0, -2.0, 7.0]), [0.0; 3]);
        // Neither where no block is.
        let force = State {
            is_force: true,
            ..noise()
        };
        let after_gap = LawError::new(&time[2..], &samples[2..], 1.0, vec![force]);
        let found = after_gap.at_samples(&time, &[4.0, -2.0, 10.0]);
        assert_eq!(found[..2], [0.0; 2]);
        assert!((found[2] - 9.0).abs() < 1e-12);
        let of_none = LawError::new(&[], &[], 1.0, Vec::new());
        assert_eq!(of_none.at_samples(&time, &[4.0, -2.0, 7.0]), [0.0; 3]);
    }
}
