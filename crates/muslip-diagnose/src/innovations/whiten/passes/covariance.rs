//! The pass of the covariance: gains and the innovations' variances.

use pulp::{Simd, WithSimd};

use super::{ByRun, States, longest, steps_at};
use crate::innovations::whiten::course::{Course, Sizes};
use crate::innovations::whiten::part::{Kind, MEAN_OF_WALK, MOST, TWIN};

/// What the pass finds of one run.
#[derive(Default)]
pub struct Found {
    /// Gain of each state, by reading.
    pub gains: Vec<[f64; MOST]>,
    /// One over the standard deviation of the innovation.
    pub inverse: Vec<f64>,
    /// Logarithm of its variance.
    pub log_variances: Vec<f64>,
}

/// All gains and the innovations' variances of `R` runs.
pub struct Covariance<'a, const R: usize> {
    pub courses: [&'a Course; R],
    pub sizes: &'a Sizes,
}

impl<const R: usize> WithSimd for Covariance<'_, R> {
    type Output = [Found; R];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let Self { courses, sizes } = self;
        let mut found = courses.map(|course| {
            let n = course.steps.len();
            Found {
                gains: Vec::with_capacity(n),
                inverse: Vec::with_capacity(n),
                log_variances: Vec::with_capacity(n),
            }
        });
        let first = courses[0];
        let mut p = Lower::<R>::start(first, sizes);
        for at in 0..longest(&courses) {
            let (steps, decay) = steps_at(&courses, at);
            let dt = steps.map(|step| step.dt);
            p.predict(&first.integrated, &dt, &decay);
            p.drive(first, sizes, at, &dt, &decay);
            for (r, step) in steps.iter().enumerate() {
                if step.fresh {
                    p.forget_level(r, sizes.diffuse);
                }
            }
            let row: States<R> = core::array::from_fn(|i| steps.map(|step| step.row[i]));
            let meant = steps.map(|step| first.walked(sizes) * step.meant);
            let (gain, variance) = p.update(&row, sizes.white * sizes.white, &meant);
            let inverse = variance.map(|v| 1.0 / v.sqrt());
            for (r, found) in found.iter_mut().enumerate() {
                if at < courses[r].steps.len() {
                    found.gains.push(core::array::from_fn(|i| gain[i][r]));
                    found.inverse.push(inverse[r]);
                    found.log_variances.push(variance[r].ln());
                }
            }
        }
        found
    }
}

/// The covariance of the states of every run. It is symmetric: `[i][j]` stands for both where `j` is no more than `i`.
struct Lower<const R: usize>([States<R>; MOST]);

impl<const R: usize> Lower<R> {
    #[inline(always)]
    fn start(course: &Course, sizes: &Sizes) -> Self {
        let mut p = [[[0.0; R]; MOST]; MOST];
        for i in 0..MOST {
            if !matches!(course.kinds[i], Kind::Walk | Kind::Filtered(_)) {
                p[i][i] = [sizes.variance(i); R];
            }
        }
        Self(p)
    }

    /// After a step of time, without what drives it: the level takes up what is integrated over the step.
    #[inline(always)]
    fn predict(&mut self, integrated: &[f64; MOST], dt: &ByRun<R>, decay: &States<R>) {
        let p = &mut self.0;
        let mut level: States<R> = core::array::from_fn(|j| p[j][0]);
        for i in 1..MOST {
            if integrated[i] != 0.0 {
                for j in 0..MOST {
                    let own = p[i.max(j)][i.min(j)];
                    for r in 0..R {
                        level[j][r] += dt[r] * own[r];
                    }
                }
            }
        }
        let mut whole = level[0];
        for i in 1..MOST {
            if integrated[i] != 0.0 {
                for r in 0..R {
                    whole[r] += dt[r] * level[i][r];
                }
            }
            p[i][0] = level[i];
        }
        p[0][0] = whole;
        for i in 0..MOST {
            for j in 0..=i {
                for r in 0..R {
                    p[i][j][r] *= decay[i][r] * decay[j][r];
                }
            }
        }
    }

    /// What drives the states over a step.
    #[inline(always)]
    fn drive(
        &mut self,
        course: &Course,
        sizes: &Sizes,
        at: usize,
        dt: &ByRun<R>,
        decay: &States<R>,
    ) {
        let p = &mut self.0;
        for i in 0..MOST {
            let variance = sizes.variance(i);
            match course.kinds[i] {
                Kind::Walk => {
                    for r in 0..R {
                        p[i][i][r] += variance * dt[r];
                    }
                }
                Kind::Forgetting(_) | Kind::Integrated(_) => {
                    for r in 0..R {
                        p[i][i][r] += variance * (1.0 - decay[i][r] * decay[i][r]);
                    }
                }
                Kind::Constant | Kind::Filtered(_) => {}
            }
        }
        if let Some(pair) = &course.filtered {
            let variance = sizes.variance(pair.at);
            let start = if at == 0 { 1.0 } else { 0.0 };
            for r in 0..R {
                let own = pair.driven(start, decay[pair.at][r], decay[TWIN][r]);
                let [first, second, shared] = own.map(|x| variance * x);
                p[pair.at][pair.at][r] += first;
                p[TWIN][TWIN][r] += second;
                p[TWIN][pair.at][r] += shared;
            }
        }
    }

    /// After a gap nothing is known of the level.
    #[inline(always)]
    fn forget_level(&mut self, run: usize, diffuse: f64) {
        for own in &mut self.0 {
            own[0][run] = 0.0;
        }
        self.0[0][0][run] = diffuse;
    }

    /// Takes a reading up, a mean of a walk that has this variance over its time; the gains, and the variance of the reading's
    /// innovation.
    #[inline(always)]
    fn update(&mut self, row: &States<R>, noise: f64, meant: &ByRun<R>) -> (States<R>, ByRun<R>) {
        let p = &mut self.0;
        let mut ph = [[0.0; R]; MOST];
        for j in 0..MOST {
            for i in 0..MOST {
                let own = p[i.max(j)][i.min(j)];
                for r in 0..R {
                    ph[i][r] += own[r] * row[j][r];
                }
            }
        }
        let mut variance = [noise; R];
        for i in 0..MOST {
            for r in 0..R {
                variance[r] += row[i][r] * ph[i][r];
            }
        }
        let [own, shared] = MEAN_OF_WALK;
        for r in 0..R {
            variance[r] -= (1.0 - own) * meant[r];
            ph[0][r] -= (1.0 - shared) * meant[r];
        }
        let variance = variance.map(|v| v.max(1e-30));
        let inverse = variance.map(|v| 1.0 / v);
        for i in 0..MOST {
            for j in 0..=i {
                for r in 0..R {
                    p[i][j][r] -= ph[i][r] * ph[j][r] * inverse[r];
                }
            }
        }
        for own in &mut ph {
            for r in 0..R {
                own[r] *= inverse[r];
            }
        }
        (ph, variance)
    }
}
