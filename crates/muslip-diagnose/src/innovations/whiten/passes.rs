//! The filter's passes over a run.
//!
//! Each is compiled for the wider registers of newer processors, too, and the widest that is there runs. None fuses a
//! product with a sum, so all give the same digits.

use pulp::{Simd, WithSimd};

use super::part::{Kind, MOST, Part, TWIN};
use super::{ByVariance, Whitener};

/// Columns that go through the filter side by side.
pub const LANES: usize = 8;

/// All gains and the innovations' variances.
pub struct Covariance<'a> {
    pub whitener: &'a mut Whitener,
    pub parts: &'a [Part<'a>],
    pub noise: f64,
    pub diffuse: f64,
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
pub struct Traces<'a> {
    pub whitener: &'a Whitener,
    pub kinds: &'a [Kind; MOST],
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
pub struct Squares<'a> {
    pub whitener: &'a Whitener,
    pub innovations: &'a [&'a [f64]],
    pub kinds: &'a [Kind; MOST],
    pub out: &'a mut ByVariance,
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
pub struct Apply<'a> {
    pub whitener: &'a Whitener,
    pub columns: &'a [&'a [f64]],
    pub out: &'a mut [Vec<f64>],
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
