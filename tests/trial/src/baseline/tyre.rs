//! The tyre balance: residual of the base, and a linear signature of everything that acts through the force.

use crate::baseline::record::Record;
use crate::baseline::select::Problem;
use crate::generate::measure::{Base, slip};
use crate::generate::rig::Rig;
use crate::generate::tyre::law;

/// Cells that the track is cut into.
const PATCH_CELLS: usize = 12;

/// Residual of the tyre balance, its derivatives by the base's two parameters, and the candidates.
pub fn problem(rig: &Rig, base: Base, runs: &[Record]) -> Problem {
    let mut problem = Problem::default();
    let reach = runs
        .iter()
        .filter_map(|run| run.readings.distance.last())
        .fold(0.0f64, |a, b| a.max(*b))
        .max(1e-6);
    let mut energy = 0.0;
    for (index, record) in runs.iter().enumerate() {
        let (run, period) = (&record.readings, record.period);
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
        let rate = record.rate(&record.smoothed(&drag));
        let second = record.rate(&record.smoothed(&rate));
        let slip_rate = record.rate(&record.smoothed(&slips));
        let spin = record.rate(&record.smoothed(&run.wheel));
        let acceleration = record.rate(&record.smoothed(&run.speed));
        let mut lagged = drag.first().copied().unwrap_or(0.0);
        let mut heat = [0.0, 0.0];
        for i in 0..run.time.len() {
            let (x, f, v) = (slips[i] / base.critical_slip, drag[i], run.speed[i]);
            let sliding = (v - rig.radius_m * run.wheel[i]).abs();
            // A sample without a reading must not spoil the states for good.
            if f.is_finite() && sliding.is_finite() {
                lagged += (period / 0.02).min(1.0) * (f - lagged);
                let power = (f * sliding).max(0.0)
                    / (rig.peak_drag_n() * 1.5 * rig.critical_slip * rig.mean_speed_m_s);
                energy += power * period;
                for (state, constant) in heat.iter_mut().zip([0.5, 3.0]) {
                    *state += period / constant * (power - *state);
                }
            }
            let standing = run.speed[i].abs() < 0.1 && run.wheel[i].abs() * rig.radius_m < 0.3;
            if !(moving(i) && run.load[i] > 0.02 * rig.mean_load_n || standing) {
                continue;
            }
            let (slope, rolling) = if standing {
                (0.0, 0.0)
            } else {
                let steepness = 2.0 * (1.0 - x * x) / (1.0 + x * x).powi(2);
                (
                    run.load[i] * base.peak_friction / base.critical_slip * steepness,
                    run.load[i],
                )
            };
            let peak = rig.peak_drag_n();
            // Change of slip, hence of the law's force, with the readings of the two speeds.
            let by_radius = slope * (1.0 - slips[i]);
            let (by_speed, by_wheel) = (by_radius / v.max(0.5), -slope * rig.radius_m / v.max(0.5));
            let (cosine, sine) = (run.angle[i].cos(), run.angle[i].sin());
            let mut patch = [0.0; PATCH_CELLS];
            let cell =
                ((run.distance[i] / reach * PATCH_CELLS as f64) as usize).min(PATCH_CELLS - 1);
            patch[cell] = f;
            problem.push(
                run.drag[i] - f,
                &[f, -slope * x],
                &[
                    ("curve_shape", &[f * (x * x / (1.0 + x * x)).powi(3)]),
                    (
                        "load_sensitivity",
                        &[f * (run.load[i] / rig.mean_load_n - 1.0)],
                    ),
                    ("speed_sensitivity", &[f * sliding]),
                    ("speed_sensitivity", &[f * (v / rig.mean_speed_m_s - 1.0)]),
                    ("thermal_fade", &[f * heat[0]]),
                    ("thermal_fade", &[f * heat[1]]),
                    ("relaxation_length", &[-rate[i] / v.max(0.5)]),
                    ("rolling_resistance", &[rolling]),
                    ("effective_radius", &[by_radius]),
                    ("wear_drift", &[f * index as f64]),
                    ("wear_drift", &[f * energy]),
                    (
                        "slip_hysteresis",
                        &[f * (slip_rate[i] / (2.0 * base.critical_slip)).tanh()],
                    ),
                    ("force_delay", &[-rate[i]]),
                    ("force_lag", &[lagged - f]),
                    ("structural_resonance", &[second[i]]),
                    ("inertial_reaction", &[spin[i]]),
                    ("load_crosstalk", &[run.load[i]]),
                    ("zero_drift", &[run.time[i]]),
                    ("zero_drift", &[1.0 - (-run.time[i] / 2.0).exp()]),
                    ("force_saturation", &[-(f - 0.65 * peak).max(0.0)]),
                    ("force_saturation", &[-(f - 0.85 * peak).max(0.0)]),
                    ("run_out", &[f * cosine, f * sine]),
                    ("encoder_ripple", &[by_radius * cosine, by_radius * sine]),
                    ("surface_patch", &patch),
                    // The law sees readings that are late by some time, so the truth is ahead by that much of the rate.
                    ("vehicle_speed_delay", &[by_speed * acceleration[i]]),
                    ("wheel_speed_delay", &[by_wheel * spin[i]]),
                ],
            );
        }
    }
    problem
}
