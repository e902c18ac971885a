//! What a reader may compare with: three textbook ways to look for what a simulation lacks, on the
//! same files.
//!
//! - *White-noise BIC*: linear signatures of every mechanism, forward selection by BIC with every
//!   sample counted as independent.
//! - *Best single*: the one signature that lowers the training error most, always named.
//! - *Whiteness*: Ljung and Box's test of the base's residual, which names nothing.

use std::path::Path;

use anyhow::Result;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::generate::campaign::Truth;
use crate::generate::chain::Readings;
use crate::generate::files::read_column;
use crate::generate::measure::{Base, filled, refit, slip};
use crate::generate::rig::{BrakeColumn, Rig};
use crate::generate::sim::derivative;
use crate::generate::tyre::law;

/// What the baselines say of one campaign.
#[derive(Clone, Debug)]
pub struct Verdicts {
    /// Mechanisms that BIC selected, strongest first.
    pub selected: Vec<&'static str>,
    pub best_single: &'static str,
    /// The residual of the base is white at the 5 % level.
    pub white: bool,
}

/// A candidate: a mechanism and the columns that stand for it.
type Candidate = (&'static str, Vec<Vec<f64>>);

/// Applies the baselines to the recordings of a campaign.
pub fn verdicts(campaigns: &Path, truth: &Truth) -> Result<Verdicts> {
    let rig = &truth.rig;
    let mut runs = Vec::new();
    for number in 1.. {
        let path = campaigns
            .join(&truth.campaign)
            .join(format!("run{number:02}.csv"));
        if !path.exists() {
            break;
        }
        runs.push(read(&path, rig)?);
    }
    let base = refit(rig, &runs);
    let (residual, given, candidates) = tyre(rig, base, &runs);
    let mut found = select(&residual, &given, &candidates);
    let mut best = found.best;
    if rig.brake != BrakeColumn::None {
        let (residual, candidates) = wheel(rig, &runs);
        let wheel = select(&residual, &[], &candidates);
        found.chosen.extend(wheel.chosen);
        if wheel.best.1 > best.1 {
            best = wheel.best;
        }
    }
    if rig.coasting {
        let (residual, candidates) = vehicle(rig, &runs);
        let vehicle = select(&residual, &[], &candidates);
        found.chosen.extend(vehicle.chosen);
        if vehicle.best.1 > best.1 {
            best = vehicle.best;
        }
    }
    found.chosen.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut selected: Vec<&'static str> = Vec::new();
    for (id, _) in found.chosen {
        if !selected.contains(&id) {
            selected.push(id);
        }
    }
    Ok(Verdicts {
        selected,
        best_single: best.0,
        white: ljung_box(&residual, 20) > 0.05,
    })
}

fn read(path: &Path, rig: &Rig) -> Result<Readings> {
    let column = |header: &str| read_column(path, header).map(|values| filled(&values));
    let time = column("time_s")?;
    let torque = match rig.brake {
        BrakeColumn::None => vec![0.0; time.len()],
        BrakeColumn::Torque => column("brake_torque_nm")?,
        BrakeColumn::Pressure => column("brake_pressure_pa")?
            .iter()
            .map(|p| p * rig.torque_per_pressure)
            .collect(),
    };
    let (wheel, speed) = (column("wheel_speed_rad_s")?, column("vehicle_speed_m_s")?);
    let running = |rate: &[f64]| -> Vec<f64> {
        let mut sum = 0.0;
        (0..time.len())
            .map(|i| {
                if i > 0 {
                    sum += 0.5
                        * (rate[i] + rate[i - 1])
                        * (time[i] - time[i - 1]).min(4.0 / rig.rate_hz);
                }
                sum
            })
            .collect()
    };
    Ok(Readings {
        angle: running(&wheel),
        distance: running(&speed),
        drag: column("drag_force_n")?,
        load: column("normal_force_n")?,
        command: torque.clone(),
        torque,
        column: vec![],
        time,
        wheel,
        speed,
    })
}

fn smoothed(values: &[f64], half: usize) -> Vec<f64> {
    (0..values.len())
        .map(|i| {
            let window = &values[i.saturating_sub(half)..(i + half + 1).min(values.len())];
            window.iter().sum::<f64>() / window.len() as f64
        })
        .collect()
}

/// Residual of the tyre balance, its derivatives by the base's two parameters, and the candidates.
fn tyre(rig: &Rig, base: Base, runs: &[Readings]) -> (Vec<f64>, Vec<Vec<f64>>, Vec<Candidate>) {
    const IDS: [&str; 23] = [
        "curve_shape",
        "load_sensitivity",
        "speed_sensitivity",
        "speed_sensitivity",
        "thermal_fade",
        "thermal_fade",
        "relaxation_length",
        "rolling_resistance",
        "effective_radius",
        "wear_drift",
        "wear_drift",
        "slip_hysteresis",
        "force_delay",
        "force_lag",
        "structural_resonance",
        "inertial_reaction",
        "load_crosstalk",
        "zero_drift",
        "zero_drift",
        "force_saturation",
        "force_saturation",
        "run_out",
        "encoder_ripple",
    ];
    const PATCH_CELLS: usize = 12;
    let mut residual = Vec::new();
    let mut given = vec![Vec::new(); 2];
    let mut candidates: Vec<Candidate> = IDS
        .iter()
        .map(|id| {
            (
                *id,
                vec![
                    Vec::new();
                    if matches!(*id, "run_out" | "encoder_ripple") {
                        2
                    } else {
                        1
                    }
                ],
            )
        })
        .collect();
    candidates.push(("surface_patch", vec![Vec::new(); PATCH_CELLS]));
    let period = 1.0 / rig.rate_hz;
    let half = (0.01 * rig.rate_hz).ceil() as usize;
    let reach = runs
        .iter()
        .filter_map(|run| run.distance.last())
        .fold(0.0f64, |a, b| a.max(*b))
        .max(1e-6);
    let mut energy = 0.0;
    for (index, run) in runs.iter().enumerate() {
        let slips: Vec<f64> = (0..run.time.len())
            .map(|i| slip(rig, run.speed[i], run.wheel[i]))
            .collect();
        let moving = |i: usize| run.speed[i] > rig.slowest_m_s();
        let drag: Vec<f64> = (0..run.time.len())
            .map(|i| {
                if moving(i) {
                    run.load[i] * base.peak_friction * law(slips[i] / base.critical_slip)
                } else {
                    0.0
                }
            })
            .collect();
        let calm = smoothed(&drag, half);
        let rate = derivative(&calm, period);
        let second = derivative(&smoothed(&rate, half), period);
        let slip_rate = derivative(&smoothed(&slips, half), period);
        let spin = derivative(&smoothed(&run.wheel, half), period);
        let mut lagged = drag.first().copied().unwrap_or(0.0);
        let mut heat = [0.0, 0.0];
        for i in 0..run.time.len() {
            let (x, f, v) = (slips[i] / base.critical_slip, drag[i], run.speed[i]);
            let sliding = (v - rig.radius_m * run.wheel[i]).abs();
            lagged += (period / 0.02).min(1.0) * (f - lagged);
            let power = (f * sliding).max(0.0)
                / (rig.peak_drag_n() * 1.5 * rig.critical_slip * rig.mean_speed_m_s);
            energy += power * period;
            for (state, constant) in heat.iter_mut().zip([0.5, 3.0]) {
                *state += period / constant * (power - *state);
            }
            let standing = run.speed[i].abs() < 0.1 && run.wheel[i].abs() * rig.radius_m < 0.3;
            if !(moving(i) && run.load[i] > 0.02 * rig.mean_load_n || standing) {
                continue;
            }
            let slope = if standing {
                0.0
            } else {
                run.load[i] * base.peak_friction / base.critical_slip * 2.0 * (1.0 - x * x)
                    / (1.0 + x * x).powi(2)
            };
            residual.push(run.drag[i] - f);
            given[0].push(f);
            given[1].push(-slope * x);
            let peak = rig.peak_drag_n();
            let rolling = if standing { 0.0 } else { run.load[i] };
            let singles = [
                f * (x * x / (1.0 + x * x)).powi(3),
                f * (run.load[i] / rig.mean_load_n - 1.0),
                f * sliding,
                f * (v / rig.mean_speed_m_s - 1.0),
                f * heat[0],
                f * heat[1],
                -rate[i] / v.max(0.5),
                rolling,
                slope * (1.0 - slips[i]),
                f * index as f64,
                f * energy,
                f * (slip_rate[i] / (2.0 * base.critical_slip)).tanh(),
                -rate[i],
                lagged - f,
                second[i],
                spin[i],
                run.load[i],
                run.time[i],
                1.0 - (-run.time[i] / 2.0).exp(),
                -(f - 0.65 * peak).max(0.0),
                -(f - 0.85 * peak).max(0.0),
            ];
            for (candidate, value) in candidates.iter_mut().zip(singles) {
                candidate.1[0].push(value);
            }
            let (cosine, sine) = (run.angle[i].cos(), run.angle[i].sin());
            for (place, factor) in [(21, f), (22, slope * (1.0 - slips[i]))] {
                candidates[place].1[0].push(factor * cosine);
                candidates[place].1[1].push(factor * sine);
            }
            let cell =
                ((run.distance[i] / reach * PATCH_CELLS as f64) as usize).min(PATCH_CELLS - 1);
            for (index, column) in candidates[23].1.iter_mut().enumerate() {
                column.push(if index == cell { f } else { 0.0 });
            }
        }
    }
    (residual, given, candidates)
}

/// Means over 50 ms, with the difference quotient of one channel across each.
fn blocks(
    rig: &Rig,
    run: &Readings,
    rate_of: &[f64],
    mut use_block: impl FnMut(f64, &dyn Fn(&[f64]) -> f64),
) {
    let width = (0.05 * rig.rate_hz).round().max(2.0) as usize;
    for start in (0..run.time.len().saturating_sub(width)).step_by(width) {
        let end = start + width;
        let span = run.time[end] - run.time[start];
        if span > 1.5 * width as f64 / rig.rate_hz || run.speed[start] < rig.slowest_m_s() {
            continue;
        }
        let mean = |values: &[f64]| values[start..end].iter().sum::<f64>() / width as f64;
        use_block((rate_of[end] - rate_of[start]) / span, &mean);
    }
}

fn wheel(rig: &Rig, runs: &[Readings]) -> (Vec<f64>, Vec<Candidate>) {
    let mut residual = Vec::new();
    let mut candidates: Vec<Candidate> = [
        "wheel_inertia",
        "bearing_drag",
        "bearing_drag",
        "brake_fade",
        "force_gain",
        "brake_lag",
    ]
    .iter()
    .map(|id| (*id, vec![Vec::new()]))
    .collect();
    for run in runs {
        let torque_rate = derivative(
            &smoothed(&run.torque, (0.01 * rig.rate_hz).ceil() as usize),
            1.0 / rig.rate_hz,
        );
        let mut heat = 0.0;
        blocks(rig, run, &run.wheel, |rate, mean| {
            let torque = mean(&run.torque);
            heat += torque * mean(&run.wheel);
            residual.push(rig.inertia_kg_m2 * rate - rig.radius_m * mean(&run.drag) + torque);
            let values = [
                rate,
                1.0,
                mean(&run.wheel),
                torque * heat,
                mean(&run.drag),
                mean(&torque_rate),
            ];
            for (candidate, value) in candidates.iter_mut().zip(values) {
                candidate.1[0].push(value);
            }
        });
    }
    (residual, candidates)
}

fn vehicle(rig: &Rig, runs: &[Readings]) -> (Vec<f64>, Vec<Candidate>) {
    let mut residual = Vec::new();
    let mut candidates: Vec<Candidate> = [
        "grade_or_drive",
        "aero_drag",
        "vehicle_inertia",
        "force_gain",
    ]
    .iter()
    .map(|id| (*id, vec![Vec::new()]))
    .collect();
    for run in runs {
        blocks(rig, run, &run.speed, |rate, mean| {
            residual.push(rig.mass_kg * rate + mean(&run.drag));
            for (candidate, value) in
                candidates
                    .iter_mut()
                    .zip([1.0, mean(&run.speed).powi(2), rate, mean(&run.drag)])
            {
                candidate.1[0].push(value);
            }
        });
    }
    (residual, candidates)
}

struct Selection {
    chosen: Vec<(&'static str, f64)>,
    best: (&'static str, f64),
}

/// Forward selection by BIC, every sample counted as independent.
fn select(residual: &[f64], given: &[Vec<f64>], candidates: &[Candidate]) -> Selection {
    let count = residual.len();
    let n = count as f64;
    let mut columns: Vec<&[f64]> = given.iter().map(Vec::as_slice).collect();
    let mut places = Vec::new();
    for (_, group) in candidates {
        places.push((columns.len(), columns.len() + group.len()));
        columns.extend(group.iter().map(Vec::as_slice));
    }
    columns.push(residual);
    let size = columns.len();
    let scales: Vec<f64> = columns
        .iter()
        .map(|c| {
            (c.iter().map(|v| v * v).sum::<f64>() / n.max(1.0))
                .sqrt()
                .max(1e-300)
        })
        .collect();
    let mut gram = vec![vec![0.0; size]; size];
    for a in 0..size {
        for b in 0..=a {
            let sum: f64 = columns[a]
                .iter()
                .zip(columns[b])
                .map(|(x, y)| x * y)
                .sum::<f64>()
                / (n.max(1.0) * scales[a] * scales[b]);
            gram[a][b] = sum;
            gram[b][a] = sum;
        }
    }
    for place in 0..given.len() {
        sweep(&mut gram, place);
    }
    let last = size - 1;
    let mut chosen: Vec<(&'static str, f64)> = Vec::new();
    let mut taken = vec![false; candidates.len()];
    let mut best = ("", f64::NEG_INFINITY);
    loop {
        let error = gram[last][last].max(1e-300);
        let mut step: Option<(usize, f64)> = None;
        for (index, (start, end)) in places.iter().enumerate() {
            if taken[index] {
                continue;
            }
            let mut trial = gram.clone();
            let mut used = 0.0;
            for place in *start..*end {
                if trial[place][place] > 1e-6 {
                    sweep(&mut trial, place);
                    used += 1.0;
                }
            }
            let gain = n * (error / trial[last][last].max(1e-300)).ln() - used * n.ln();
            if step.is_none_or(|step| gain > step.1) {
                step = Some((index, gain));
            }
        }
        let Some((index, gain)) = step else { break };
        if chosen.is_empty() && best.0.is_empty() {
            best = (candidates[index].0, gain);
        }
        if gain <= 0.0 || chosen.len() >= 12 {
            break;
        }
        taken[index] = true;
        for place in places[index].0..places[index].1 {
            if gram[place][place] > 1e-6 {
                sweep(&mut gram, place);
            }
        }
        chosen.push((candidates[index].0, gain));
    }
    Selection { chosen, best }
}

/// Goodnight's sweep: takes one column into the regression.
fn sweep(matrix: &mut [Vec<f64>], pivot: usize) {
    let d = matrix[pivot][pivot];
    let row = matrix[pivot].clone();
    for (index, line) in matrix.iter_mut().enumerate() {
        if index == pivot {
            continue;
        }
        let factor = line[pivot] / d;
        for (value, above) in line.iter_mut().zip(&row) {
            *value -= factor * above;
        }
        line[pivot] = -factor;
    }
    for value in &mut matrix[pivot] {
        *value /= d;
    }
    matrix[pivot][pivot] = 1.0 / d;
}

/// P value of Ljung and Box's statistic.
fn ljung_box(values: &[f64], lags: usize) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    let statistic: f64 = (1..=lags)
        .map(|lag| {
            let r: f64 = values
                .iter()
                .zip(&values[lag..])
                .map(|(a, b)| (a - mean) * (b - mean))
                .sum::<f64>()
                / variance;
            r * r / (n - lag as f64)
        })
        .sum::<f64>()
        * n
        * (n + 2.0);
    ChiSquared::new(lags as f64).map_or(f64::NAN, |chi| 1.0 - chi.cdf(statistic))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::Draw;

    #[test]
    fn selection_takes_what_the_residual_is_made_of_and_nothing_else() {
        let mut draw = Draw::new(1, &[]);
        let mut noise = || (0..2000).map(|_| draw.normal()).collect::<Vec<f64>>();
        let (a, b, c, e) = (noise(), noise(), noise(), noise());
        let residual: Vec<f64> = (0..2000).map(|i| 0.5 * a[i] + 3.0 * b[i] + e[i]).collect();
        let found = select(
            &residual,
            std::slice::from_ref(&c),
            &[
                ("aero_drag", vec![a]),
                ("run_out", vec![b]),
                ("zero_drift", vec![noise()]),
            ],
        );
        let names: Vec<&str> = found.chosen.iter().map(|chosen| chosen.0).collect();
        assert_eq!(names, ["run_out", "aero_drag"]);
        assert_eq!(found.best.0, "run_out");
    }

    #[test]
    fn whiteness_is_kept_by_white_noise_and_broken_by_colour() {
        let mut draw = Draw::new(2, &[]);
        let white: Vec<f64> = (0..3000).map(|_| draw.normal()).collect();
        assert!(ljung_box(&white, 20) > 0.01);
        let mut state = 0.0;
        let coloured: Vec<f64> = white
            .iter()
            .map(|w| {
                state = 0.3 * state + w;
                state
            })
            .collect();
        assert!(ljung_box(&coloured, 20) < 1e-6);
    }
}
