//! Whitening by a Kalman filter: residuals become innovations, of unit variance and independent, under a covariance
//! that is a sum of simple parts.
//!
//! Every part is a state of the filter: an Ornstein-Uhlenbeck process times a known gain, a constant of the run, a
//! walk (white noise integrated), or a process that is integrated into the walk. So a pass costs O(n), gaps and
//! locked stretches are steps of time without a reading, and one pass of gains serves any number of columns.

/// Most states of one balance.
pub const MOST: usize = 12;
/// Columns that go through the filter side by side.
const LANES: usize = 8;
/// Variance of a state of which nothing is known, over that of the reading.
const DIFFUSE: f64 = 1e8;

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
    parts: usize,
    walk: bool,
    integrated: [bool; MOST],
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
}

/// Whether two steps of time may share their decays.
fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= 2e-3 * b
}

impl Whitener {
    /// Runs the filter's covariance over every `stride`-th reading of a run. `segments` are the stretches in use, `white` the
    /// standard deviation of each reading's own noise.
    #[must_use]
    pub fn new(
        time: &[f64],
        segments: &[core::ops::Range<usize>],
        stride: usize,
        white: &dyn Fn(usize) -> f64,
        parts: &[Part<'_>],
    ) -> Self {
        let m = parts.len().min(MOST);
        let parts = &parts[..m];
        let walk = m > 0 && parts[0].kind == Kind::Walk;
        let mut integrated = [false; MOST];
        let mut p = [[0.0; MOST]; MOST];
        let mut process = [0.0; MOST];
        for (i, part) in parts.iter().enumerate() {
            let variance = part.std * part.std;
            process[i] = variance;
            integrated[i] = matches!(part.kind, Kind::Integrated(_));
            p[i][i] = if part.kind == Kind::Walk {
                0.0
            } else {
                variance
            };
        }
        let mut out = Self {
            parts: m,
            walk,
            integrated,
            samples: Vec::new(),
            steps: Vec::new(),
            decays: Vec::new(),
            log_variances: Vec::new(),
        };
        let mut before = f64::NAN;
        let mut spans: Vec<f64> = Vec::new();
        for segment in segments {
            let mut first = true;
            for k in segment.clone().step_by(stride.max(1)) {
                let dt = if before.is_nan() {
                    0.0
                } else {
                    time[k] - before
                };
                before = time[k];
                let decay = spans.iter().rposition(|s| same(dt, *s)).unwrap_or_else(|| {
                    spans.push(dt);
                    out.decays.push(core::array::from_fn(|i| {
                        match parts.get(i).map(|part| part.kind) {
                            Some(Kind::Forgetting(tau) | Kind::Integrated(tau)) => {
                                (-dt / tau).exp()
                            }
                            _ => 1.0,
                        }
                    }));
                    spans.len() - 1
                });
                let noise = white(k).powi(2);
                predict(
                    &mut p,
                    m,
                    dt,
                    &out.decays[decay],
                    walk,
                    &integrated,
                    &process,
                    parts,
                );
                if walk && first {
                    forget_level(&mut p, m, noise);
                }
                first = false;
                let row: [f64; MOST] = core::array::from_fn(|i| {
                    parts.get(i).map_or(0.0, |part| match part.kind {
                        Kind::Integrated(_) => 0.0,
                        _ => part.gain.get(k).copied().unwrap_or(1.0),
                    })
                });
                let (gain, variance) = update(&mut p, m, &row, noise);
                out.log_variances.push(variance.ln());
                out.samples.push(k);
                out.steps.push(Step {
                    gain,
                    row,
                    inverse: 1.0 / variance.sqrt(),
                    dt,
                    decay: decay as u32,
                });
            }
        }
        out
    }

    /// Innovations of several columns, each over its own standard deviation.
    #[must_use]
    pub fn apply(&self, columns: &[&[f64]]) -> Vec<Vec<f64>> {
        let mut out = vec![Vec::with_capacity(self.samples.len()); columns.len()];
        for (group, into) in columns.chunks(LANES).zip(out.chunks_mut(LANES)) {
            self.apply_group(group, into);
        }
        out
    }

    fn apply_group(&self, columns: &[&[f64]], out: &mut [Vec<f64>]) {
        let m = self.parts;
        let mut x = [[0.0; LANES]; MOST];
        for (step, &k) in self.steps.iter().zip(&self.samples) {
            if self.walk {
                for i in 1..m {
                    if self.integrated[i] {
                        for l in 0..LANES {
                            x[0][l] += step.dt * x[i][l];
                        }
                    }
                }
            }
            let decay = &self.decays[step.decay as usize];
            let mut e = [0.0; LANES];
            for (e, c) in e.iter_mut().zip(columns) {
                *e = c[k];
            }
            for i in 0..m {
                for l in 0..LANES {
                    x[i][l] *= decay[i];
                    e[l] -= step.row[i] * x[i][l];
                }
            }
            for i in 0..m {
                for l in 0..LANES {
                    x[i][l] += step.gain[i] * e[l];
                }
            }
            for (o, e) in out.iter_mut().zip(e) {
                o.push(e * step.inverse);
            }
        }
    }
}

#[expect(clippy::too_many_arguments, reason = "the filter's whole state")]
fn predict(
    p: &mut [[f64; MOST]; MOST],
    m: usize,
    dt: f64,
    decay: &[f64; MOST],
    walk: bool,
    integrated: &[bool; MOST],
    process: &[f64; MOST],
    parts: &[Part<'_>],
) {
    if walk {
        // Row, then column, of the level: it takes up what is integrated over the step.
        for i in (1..m).filter(|i| integrated[*i]) {
            for j in 0..m {
                p[0][j] += dt * p[i][j];
            }
        }
        for i in (1..m).filter(|i| integrated[*i]) {
            for row in p.iter_mut().take(m) {
                row[0] += dt * row[i];
            }
        }
    }
    for i in 0..m {
        for j in 0..m {
            p[i][j] *= decay[i] * decay[j];
        }
    }
    for (i, part) in parts.iter().enumerate() {
        p[i][i] += match part.kind {
            Kind::Walk => process[i] * dt,
            Kind::Constant => 0.0,
            Kind::Forgetting(_) | Kind::Integrated(_) => process[i] * (1.0 - decay[i] * decay[i]),
        };
    }
}

/// After a gap nothing is known of the level.
fn forget_level(p: &mut [[f64; MOST]; MOST], m: usize, noise: f64) {
    for j in 0..m {
        p[0][j] = 0.0;
        p[j][0] = 0.0;
    }
    let others: f64 = (1..m).map(|i| p[i][i]).sum();
    p[0][0] = DIFFUSE * noise.max(1e-12 * others).max(1e-30);
}

fn update(
    p: &mut [[f64; MOST]; MOST],
    m: usize,
    row: &[f64; MOST],
    noise: f64,
) -> ([f64; MOST], f64) {
    let mut ph = [0.0; MOST];
    let mut variance = noise;
    for i in 0..m {
        for j in 0..m {
            ph[i] += p[i][j] * row[j];
        }
        variance += row[i] * ph[i];
    }
    let variance = variance.max(1e-30);
    let mut gain = [0.0; MOST];
    for i in 0..m {
        gain[i] = ph[i] / variance;
    }
    for i in 0..m {
        for j in 0..=i {
            let value = p[i][j] - gain[i] * ph[j];
            p[i][j] = value;
            p[j][i] = value;
        }
    }
    (gain, variance)
}
