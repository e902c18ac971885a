//! The pass back that says how the innovations' variances go with each part's.

use pulp::{Simd, WithSimd};

use crate::innovations::whiten::part::{MEAN_OF_WALK, MOST, TWIN};
use crate::innovations::whiten::{ByVariance, Whitener};

/// The pass back of [`crate::innovations::whiten::traces`] over `R` runs: each waits for itself at every reading, and is
/// not waited for by the others.
pub struct Traces<'a, const R: usize> {
    pub whiteners: [&'a Whitener; R],
}

impl<const R: usize> WithSimd for Traces<'_, R> {
    type Output = [ByVariance; R];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let mut runs = self.whiteners.map(Back::new);
        let lengths = self.whiteners.map(|w| w.course.steps.len());
        let together = lengths.iter().copied().min().unwrap_or(0);
        for (run, length) in runs.iter_mut().zip(lengths) {
            for at in (together..length).rev() {
                run.over(at);
            }
        }
        for at in (0..together).rev() {
            for run in &mut runs {
                run.over(at);
            }
        }
        runs.map(|run| run.whitener.course.with_twin(run.out))
    }
}

/// One run on the way back.
struct Back<'a> {
    whitener: &'a Whitener,
    s: [[f64; MOST]; MOST],
    out: ByVariance,
}

impl<'a> Back<'a> {
    fn new(whitener: &'a Whitener) -> Self {
        Self {
            whitener,
            s: [[0.0; MOST]; MOST],
            out: ByVariance::default(),
        }
    }

    /// Goes back over a reading and the step of time before it.
    #[inline(always)]
    fn over(&mut self, at: usize) {
        let Whitener { course, found } = self.whitener;
        let step = &course.steps[at];
        let (gain, inverse) = (&found.gains[at], found.inverse[at]);
        let (s, row) = (&mut self.s, &step.row);
        let mut w = [0.0; MOST];
        for j in 0..MOST {
            for i in 0..MOST {
                w[i] += s[j][i] * gain[j];
            }
        }
        let mut d = inverse * inverse;
        for i in 0..MOST {
            d += gain[i] * w[i];
        }
        self.out.white += d;
        let [own, shared] = MEAN_OF_WALK;
        self.out.parts[0] += step.meant * (2.0 * (1.0 - shared) * w[0] - (1.0 - own) * d);
        for i in 0..MOST {
            for j in 0..MOST {
                s[i][j] += row[i] * row[j] * d - row[i] * w[j] - w[i] * row[j];
            }
        }
        if step.fresh {
            for i in 0..MOST {
                s[0][i] = 0.0;
                s[i][0] = 0.0;
            }
        }
        let driven = course.driven(at, step);
        for i in 0..MOST {
            self.out.parts[i] += s[i][i] * driven[i];
        }
        if let Some(pair) = &course.filtered {
            self.out.parts[pair.at] += s[pair.at][TWIN] * course.driven_together(at, step);
        }
        let decay = course.decay_of(step);
        let along = course.integrated.map(|integrated| integrated * step.dt);
        for row in &mut *s {
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
}
