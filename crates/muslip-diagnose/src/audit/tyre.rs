//! What the drag leaves beside the tyre's law and beside the wheel's balance, each with an error of its own only: what both
//! show is the drag channel's.

use nalgebra::{SMatrix, SVector};

use super::constants::MOST_ROWS;
use super::recording::Recording;
use super::timing::Timings;
use crate::campaign::Rig;
use crate::slip::slip;

/// Step of the grid of the fit, s.
const STEP_S: f64 = 0.005;
/// Width over which inputs are averaged for the instruments, s.
const SMOOTH_S: f64 = 0.06;
/// Peak friction, logarithm of the critical slip, error of the slip, zero of the drag in N.
const UNKNOWNS: usize = 4;
/// Pieces whose spread the uncertainty is judged by.
const PIECES: usize = 14;

/// The law as fitted, with the drag's zero.
#[derive(Clone, Copy, Debug)]
pub struct Fitted {
    /// Peak friction, logarithm of the critical slip, error of the slip, zero of the drag in N.
    pub unknowns: [f64; UNKNOWNS],
    /// Their standard deviations.
    pub std: [f64; UNKNOWNS],
    /// Delays of wheel and vehicle speed, s.
    late: (f64, f64),
    radius: f64,
    share: f64,
}

/// A stretch of a run on an even grid.
#[derive(Clone, Debug, Default)]
pub struct Stretch {
    /// Drag beside the law, its zero left in, N.
    pub law: Vec<f64>,
    /// Drag beside the wheel's balance, N; empty where no brake torque is known.
    pub wheel: Vec<f64>,
    /// Drag, N.
    pub drag: Vec<f64>,
    /// Change of the law's drag with the logarithm of the wheel speed, N.
    pub slope: Vec<f64>,
    /// The wheel's angle, rad.
    pub angle: Vec<f64>,
    /// Its speed as read, rad/s; two readings more than the rest.
    pub omega: Vec<f64>,
    /// Mean turns a second.
    pub hz: f64,
}

struct Row {
    drag: f64,
    load: f64,
    slip: f64,
    smooth: (f64, f64),
}

fn law(load: f64, slip: f64, x: &[f64; UNKNOWNS]) -> f64 {
    let u = (slip - x[2]) / x[1].exp();
    load * x[0] * 2.0 * u / (1.0 + u * u)
}

/// Slopes of the law in its unknowns.
fn slopes(load: f64, slip: f64, x: &[f64; UNKNOWNS]) -> [f64; UNKNOWNS] {
    let critical = x[1].exp();
    let u = (slip - x[2]) / critical;
    let bottom = 1.0 + u * u;
    let steep = load * x[0] * 2.0 * (1.0 - u * u) / (bottom * bottom);
    [load * 2.0 * u / bottom, -steep * u, -steep / critical, 1.0]
}

fn grid(run: &Recording, from: usize, to: usize, step: f64) -> (f64, usize) {
    let (start, end) = (run.time[from] + 0.05, run.time[to - 1] - 0.1);
    (start, (((end - start) / step).floor().max(0.0)) as usize)
}

/// Delays that are beyond their doubt.
fn delays(timings: &Timings) -> (f64, f64) {
    let known = |t: super::finding::Timing| {
        if t.std.is_finite() && t.value.abs() > 3.0 * t.std {
            t.value
        } else {
            0.0
        }
    };
    (known(timings.wheel), known(timings.vehicle))
}

impl Fitted {
    fn rows(&self, runs: &[Recording], step: f64) -> Vec<Vec<Row>> {
        let mut out = Vec::new();
        for run in runs {
            for moving in &run.moving {
                let (start, count) = grid(run, moving.start, moving.end, step);
                let (w, v) = self.late;
                let omega = run.wheel.signal.means(start + w, step, count);
                let speed = run.speed.signal.means(start + v, step, count);
                let drag = run.drag.signal.means(start, step, count);
                let load = run.load.signal.means(start, step, count);
                let slow = |s: &super::signal::Signal, late: f64| {
                    s.averages(start + late, step, count, SMOOTH_S)
                };
                let (omega_s, speed_s) = (slow(&run.wheel.signal, w), slow(&run.speed.signal, v));
                let load_s = slow(&run.load.signal, 0.0);
                let slip = |omega: f64, speed: f64| slip(self.radius, omega, speed.max(1e-3));
                out.push(
                    (0..count)
                        .map(|k| Row {
                            drag: drag[k],
                            load: load[k],
                            slip: slip(omega[k], speed[k]),
                            smooth: (load_s[k], slip(omega_s[k], speed_s[k])),
                        })
                        .collect(),
                );
            }
        }
        out
    }

    /// What is left of the drag on a grid of a step in s.
    #[must_use]
    pub fn left(&self, runs: &[Recording], step: f64) -> Vec<Stretch> {
        let mut without = self.unknowns;
        without[3] = 0.0;
        let mut rows = self.rows(runs, step).into_iter();
        let mut out = Vec::new();
        for run in runs {
            for moving in &run.moving {
                let rows = rows.next().unwrap_or_default();
                let count = rows.len();
                if count < 20 {
                    continue;
                }
                let (start, _) = grid(run, moving.start, moving.end, step);
                let omega = run.wheel.signal.means(start + self.late.0, step, count + 2);
                let before = run
                    .wheel
                    .signal
                    .means(start + self.late.0 - step, step, count);
                let mut angle = 0.0;
                let share = self.share / (2.0 * step);
                let wheel = run.brake.as_ref().map_or_else(Vec::new, |(_, brake)| {
                    let torque = brake.signal.means(start, step, count);
                    (0..count)
                        .map(|k| {
                            rows[k].drag
                                - torque[k] / self.radius
                                - share * (omega[k + 1] - before[k])
                        })
                        .collect()
                });
                out.push(Stretch {
                    law: rows
                        .iter()
                        .map(|r| r.drag - law(r.load, r.slip, &without))
                        .collect(),
                    wheel,
                    drag: rows.iter().map(|r| r.drag).collect(),
                    slope: rows
                        .iter()
                        .map(|r| {
                            let (load, slip) = r.smooth;
                            slopes(load, slip, &without)[2] * (1.0 - slip)
                        })
                        .collect(),
                    angle: (0..count)
                        .map(|k| {
                            angle += step * omega[k];
                            angle
                        })
                        .collect(),
                    hz: omega.iter().sum::<f64>() / omega.len() as f64 / core::f64::consts::TAU,
                    omega,
                });
            }
        }
        out
    }
}

/// Fits law and zero to all stretches in which the vehicle moves.
#[must_use]
pub fn fitted(rig: &Rig, runs: &[Recording], timings: &Timings) -> Option<Fitted> {
    if !(rig.radius_m > 0.0 && rig.peak_friction > 0.0 && rig.critical_slip > 0.0) {
        return None;
    }
    let mut out = Fitted {
        unknowns: [rig.peak_friction, rig.critical_slip.ln(), 0.0, 0.0],
        std: [f64::INFINITY; UNKNOWNS],
        late: delays(timings),
        radius: rig.radius_m,
        share: rig.wheel_inertia_kg_m2 / rig.radius_m,
    };
    let whole: f64 = runs
        .iter()
        .flat_map(|run| {
            run.moving
                .iter()
                .map(|m| run.time[m.end - 1] - run.time[m.start])
        })
        .sum();
    let rows: Vec<Row> = out
        .rows(runs, STEP_S.max(whole / MOST_ROWS as f64))
        .into_iter()
        .flatten()
        .collect();
    if rows.len() < 50 * UNKNOWNS {
        return None;
    }
    type Matrix = SMatrix<f64, UNKNOWNS, UNKNOWNS>;
    type Vector = SVector<f64, UNKNOWNS>;
    let start = out.unknowns;
    // What is known beforehand: a tyre's friction and stiffness roughly, an error of the slip of half a percent.
    let scale = rows.iter().map(|r| r.drag.abs()).sum::<f64>() / rows.len() as f64;
    let prior = [0.5 * start[0], 0.7, 0.005, f64::INFINITY];
    let each = rows.len().div_ceil(PIECES);
    for pass in 0..8 {
        let x = out.unknowns;
        let (mut matrix, mut pull) = (Matrix::zeros(), Vector::zeros());
        let (mut pulls, mut sum) = (Vec::new(), 0.0);
        for piece in rows.chunks(each) {
            let mut own = Vector::zeros();
            for row in piece {
                let residual = row.drag - law(row.load, row.slip, &x) - x[3];
                let weights = Vector::from(slopes(row.smooth.0, row.smooth.1, &x));
                matrix += weights * Vector::from(slopes(row.load, row.slip, &x)).transpose();
                own += weights * residual;
                sum += residual * residual;
            }
            pull += own;
            pulls.push(own);
        }
        let variance = (sum / rows.len() as f64)
            .max(1e-12 * scale * scale)
            .max(1e-300);
        for i in 0..UNKNOWNS {
            if prior[i].is_finite() {
                // A long residual is no white one: what is known counts as ten rows' worth of it would.
                let weight = variance / (prior[i] * prior[i]);
                matrix[(i, i)] += weight;
                pull[i] -= weight * (x[i] - start[i]);
            }
        }
        let inverse = matrix.try_inverse()?;
        let step = inverse * pull;
        if pass < 7 {
            let most = [0.2 * start[0], 0.3, 0.005, f64::INFINITY];
            for i in 0..UNKNOWNS {
                out.unknowns[i] += step[i].clamp(-most[i], most[i]);
            }
            if !out.unknowns.iter().all(|u| u.is_finite())
                || (out.unknowns[1] - start[1]).abs() > 1.5
                || !(out.unknowns[0] > 0.0)
            {
                return None;
            }
            continue;
        }
        let mean = pulls.iter().sum::<Vector>() / pulls.len() as f64;
        let mut spread = Matrix::zeros();
        for own in &pulls {
            spread += (own - mean) * (own - mean).transpose();
        }
        let covariance = inverse * spread * inverse.transpose();
        let white = inverse * variance;
        for i in 0..UNKNOWNS {
            out.std[i] = covariance[(i, i)].max(white[(i, i)]).max(0.0).sqrt();
        }
    }
    Some(out)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    #[test]
    fn slopes_are_those_of_the_law() {
        let x = [0.9, -2.0f64, 0.003, 0.0];
        for slip in [-0.05, 0.0, 0.1, 0.4] {
            let told = slopes(3000.0, slip, &x);
            for i in 0..3 {
                let mut moved = x;
                moved[i] += 1e-6;
                let slope = (law(3000.0, slip, &moved) - law(3000.0, slip, &x)) / 1e-6;
                assert!(
                    (slope - told[i]).abs() < 1e-2 * slope.abs().max(1.0),
                    "{i} {slope} {told:?}"
                );
            }
        }
    }
}
