//! What an effect leaves in the balances: the base refitted to readings without random noise, the
//! residuals of the three balances, their sizes in sigma, and where they stand out.

use serde::{Deserialize, Serialize};

use crate::generate::chain::Readings;
use crate::generate::noise::Written;
use crate::generate::rig::{BrakeColumn, Rig};
use crate::generate::tyre::law;

/// The refitted base.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Base {
    pub peak_friction: f64,
    pub critical_slip: f64,
}

/// Typical random error of each balance's residual.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct BalanceSigma {
    /// N: drag, load and slip noise together, median over usable samples.
    pub tyre: f64,
    /// N m: drag and torque noise, and that of a wheel acceleration taken over 50 ms.
    pub wheel: f64,
    /// N: drag noise and that of a deceleration taken over 50 ms.
    pub vehicle: f64,
}

/// A stretch of time in which a balance is off by more than one sigma.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    pub recording: String,
    pub balance: String,
    pub start_s: f64,
    pub end_s: f64,
}

/// Whether a sample can tell of the tyre.
pub fn usable(rig: &Rig, readings: &Readings, index: usize) -> bool {
    readings.speed[index] > rig.slowest_m_s() && readings.load[index] > 0.02 * rig.mean_load_n
}

/// Slip as the rig file's radius gives it.
pub fn slip(rig: &Rig, speed: f64, wheel: f64) -> f64 {
    (speed - rig.radius_m * wheel) / speed.abs().max(1e-6)
}

/// The base's drag for a sample.
pub fn base_drag(rig: &Rig, base: Base, readings: &Readings, index: usize) -> f64 {
    readings.load[index]
        * base.peak_friction
        * law(slip(rig, readings.speed[index], readings.wheel[index]) / base.critical_slip)
}

/// Least squares of the two-parameter law, by Gauss and Newton with halved steps.
pub fn refit(rig: &Rig, runs: &[Readings]) -> Base {
    let points: Vec<(f64, f64, f64)> = runs
        .iter()
        .flat_map(|run| {
            let step = (run.time.len() / 1200).max(1);
            (0..run.time.len())
                .step_by(step)
                .filter(|&i| usable(rig, run, i))
                .map(move |i| {
                    (
                        slip(rig, run.speed[i], run.wheel[i]),
                        run.load[i],
                        run.drag[i],
                    )
                })
        })
        .collect();
    let cost = |base: Base| {
        points
            .iter()
            .map(|(s, load, drag)| {
                (drag - load * base.peak_friction * law(s / base.critical_slip)).powi(2)
            })
            .sum::<f64>()
    };
    let mut base = Base {
        peak_friction: rig.peak_friction,
        critical_slip: rig.critical_slip,
    };
    let mut best = cost(base);
    for _ in 0..40 {
        let (mut a, mut b, mut c, mut u, mut v) = (1e-12, 0.0, 1e-12, 0.0, 0.0);
        for (s, load, drag) in &points {
            let x = s / base.critical_slip;
            let shape = law(x);
            let residual = drag - load * base.peak_friction * shape;
            let first = load * shape;
            let second = -load * base.peak_friction * 2.0 * (1.0 - x * x) / (1.0 + x * x).powi(2)
                * x
                / base.critical_slip;
            a += first * first;
            b += first * second;
            c += second * second;
            u += first * residual;
            v += second * residual;
        }
        let ridge = 1e-9;
        let determinant = a * c * (1.0 + ridge) - b * b;
        let (dm, ds) = ((c * u - b * v) / determinant, (a * v - b * u) / determinant);
        let mut share = 1.0;
        let mut moved = false;
        while share > 1e-3 {
            let trial = Base {
                peak_friction: (base.peak_friction + share * dm).clamp(0.02, 5.0),
                critical_slip: (base.critical_slip + share * ds).clamp(0.005, 1.5),
            };
            let trial_cost = cost(trial);
            if trial_cost < best {
                moved = (best - trial_cost) > 1e-10 * best;
                best = trial_cost;
                base = trial;
                break;
            }
            share *= 0.5;
        }
        if !moved {
            break;
        }
    }
    base
}

/// Typical random errors of the balances.
pub fn balance_sigma(rig: &Rig, base: Base, runs: &[Readings]) -> BalanceSigma {
    let s = &rig.sigmas;
    let mut all: Vec<f64> = runs
        .iter()
        .flat_map(|run| {
            let step = (run.time.len() / 400).max(1);
            (0..run.time.len())
                .step_by(step)
                .filter(|&i| usable(rig, run, i))
                .map(move |i| {
                    let slip_now = slip(rig, run.speed[i], run.wheel[i]);
                    let x = slip_now / base.critical_slip;
                    let slope = base.peak_friction / base.critical_slip * 2.0 * (1.0 - x * x)
                        / (1.0 + x * x).powi(2);
                    let slip_sigma = (rig.radius_m * s.wheel_speed_rad_s)
                        .hypot(s.vehicle_speed_m_s * (1.0 - slip_now))
                        / run.speed[i];
                    let friction = base.peak_friction * law(x);
                    (s.drag_force_n.powi(2)
                        + (friction * s.normal_force_n).powi(2)
                        + (run.load[i] * slope * slip_sigma).powi(2))
                    .sqrt()
                })
        })
        .collect();
    all.sort_by(f64::total_cmp);
    let tyre = all.get(all.len() / 2).copied().unwrap_or(s.drag_force_n);
    let over = std::f64::consts::SQRT_2 / 0.05;
    BalanceSigma {
        tyre,
        wheel: (rig.radius_m * s.drag_force_n)
            .hypot(s.brake_torque_nm)
            .hypot(rig.inertia_kg_m2 * s.wheel_speed_rad_s * over),
        vehicle: s
            .drag_force_n
            .hypot(rig.mass_kg * s.vehicle_speed_m_s * over),
    }
}

/// Residuals of one balance for a run; not a number where the balance says nothing.
pub fn residual(balance: &str, rig: &Rig, base: Base, run: &Readings) -> Vec<f64> {
    let count = run.time.len();
    let rate = |values: &[f64], index: usize| -> f64 {
        let (a, b) = (index.saturating_sub(1), (index + 1).min(count - 1));
        // Not across a gap in time.
        if b == a || run.time[b] - run.time[a] > 4.0 / rig.rate_hz {
            f64::NAN
        } else {
            (values[b] - values[a]) / (run.time[b] - run.time[a])
        }
    };
    (0..count)
        .map(|i| match balance {
            "tyre" if usable(rig, run, i) => run.drag[i] - base_drag(rig, base, run, i),
            "wheel" if rig.brake != BrakeColumn::None && usable(rig, run, i) => {
                let torque = if rig.brake == BrakeColumn::Pressure {
                    run.command[i]
                } else {
                    run.torque[i]
                };
                rig.inertia_kg_m2 * rate(&run.wheel, i) - rig.radius_m * run.drag[i] + torque
            }
            "vehicle" if rig.coasting && usable(rig, run, i) => {
                rig.mass_kg * rate(&run.speed, i) + run.drag[i]
            }
            _ => f64::NAN,
        })
        .collect()
}

/// Root mean square over all samples that count.
pub fn rms<'a>(values: impl Iterator<Item = &'a f64>) -> f64 {
    let (sum, count) = values
        .filter(|value| value.is_finite())
        .fold((0.0, 0usize), |(sum, count), value| {
            (sum + value * value, count + 1)
        });
    if count == 0 {
        0.0
    } else {
        (sum / count as f64).sqrt()
    }
}

/// The maximal intervals in which a residual exceeds one sigma, as means over 50 ms.
pub fn intervals(
    recording: &str,
    balance: &str,
    rig: &Rig,
    run: &Readings,
    residual: &[f64],
    sigma: f64,
) -> Vec<Interval> {
    let half = (0.025 * rig.rate_hz).round().max(1.0) as usize;
    let count = residual.len();
    let mut found: Vec<(f64, f64)> = Vec::new();
    let mut open: Option<f64> = None;
    for i in 0..count {
        let (a, b) = (i.saturating_sub(half), (i + half + 1).min(count));
        let (mut sum, mut n) = (0.0, 0);
        for (value, time) in residual[a..b].iter().zip(&run.time[a..b]) {
            if value.is_finite() && (time - run.time[i]).abs() < 0.03 + 1.0 / rig.rate_hz {
                sum += value.abs();
                n += 1;
            }
        }
        let above = n > 0 && residual[i].is_finite() && sum / f64::from(n) > sigma;
        match (above, open) {
            (true, None) => open = Some(run.time[i]),
            (false, Some(start)) => {
                found.push((start, run.time[i.saturating_sub(1)]));
                open = None;
            }
            _ => {}
        }
    }
    if let (Some(start), Some(end)) = (open, run.time.last()) {
        found.push((start, *end));
    }
    let mut closed: Vec<(f64, f64)> = Vec::new();
    for (start, end) in found {
        match closed.last_mut() {
            Some(last) if start - last.1 < 0.1 => last.1 = end,
            _ => closed.push((start, end)),
        }
    }
    closed
        .into_iter()
        .map(|(start_s, end_s)| Interval {
            recording: recording.to_owned(),
            balance: balance.to_owned(),
            start_s,
            end_s,
        })
        .collect()
}

/// Fills missing cells by straight lines, so that a model can be driven with what was written.
pub fn filled(values: &[f64]) -> Vec<f64> {
    let mut out = values.to_vec();
    let mut last: Option<usize> = None;
    for i in 0..out.len() {
        if out[i].is_finite() {
            let from = last.map_or(0, |l| l + 1);
            for j in from..i {
                out[j] = match last {
                    Some(l) => out[l] + (out[i] - out[l]) * (j - l) as f64 / (i - l) as f64,
                    None => out[i],
                };
            }
            last = Some(i);
        }
    }
    if let Some(l) = last {
        for j in l + 1..out.len() {
            out[j] = out[l];
        }
    }
    out
}

/// Mean squared error of the base driven by what was written, against the load cell's `reading` without random noise.
pub fn base_error(
    rig: &Rig,
    base: Base,
    clean: &Readings,
    reading: &[f64],
    written: &Written,
) -> f64 {
    let (speed, wheel, load) = (
        filled(&written.speed),
        filled(&written.wheel),
        filled(&written.load),
    );
    let errors: Vec<f64> = (0..clean.time.len())
        .filter(|&i| usable(rig, clean, i))
        .map(|i| {
            reading[i]
                - load[i]
                    * base.peak_friction
                    * law(slip(rig, speed[i], wheel[i]) / base.critical_slip)
        })
        .collect();
    rms(errors.iter()).powi(2)
}
