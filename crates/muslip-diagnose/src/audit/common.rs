//! An error that wheel and vehicle speed have in common: both readings waver together while no force moves either.

use super::constants::{COMMON_LAG_S, COMMON_SHARE};
use super::finding::{Finding, Word};
use super::recording::Recording;
use super::structure::{Memory, Pair, structure};
use crate::campaign::Rig;
use crate::smooth::{difference_sigma, median_in_place};

/// Shortest step that speeds are compared at, s.
const STEP_S: f64 = 0.0024;

/// Vehicle speed without the drag's impulse, wheel speed, and the wheel's share of the drag's impulse, each at every few
/// samples of the stretches in which the vehicle moves.
struct Speeds {
    vehicle: Vec<f64>,
    wheel: Vec<f64>,
    impulse: Vec<f64>,
    /// Wheel speed without what drag and brake make of it; empty where no brake is known.
    unmoved: Vec<f64>,
    own: Vec<f64>,
}

fn speeds(rig: &Rig, runs: &[Recording], every: usize) -> Vec<Speeds> {
    let mut out = Vec::new();
    for run in runs {
        for moving in &run.moving {
            let (mut impulse, mut braked) = (0.0, 0.0);
            let mut all = Speeds {
                vehicle: Vec::new(),
                wheel: Vec::new(),
                impulse: Vec::new(),
                unmoved: Vec::new(),
                own: Vec::new(),
            };
            let (mut sums, mut count) = ([0.0; 5], 0usize);
            for k in moving.clone() {
                if k > moving.start {
                    let half = 0.5 * (run.time[k] - run.time[k - 1]);
                    impulse += half * (run.drag.clean[k] + run.drag.clean[k - 1]);
                    if let Some((_, brake)) = &run.brake {
                        braked += half * (brake.clean[k] + brake.clean[k - 1]);
                    }
                }
                let v = run.speed.clean[k];
                let free = if rig.coasting {
                    v + impulse / rig.mass_kg
                } else {
                    v
                };
                for (sum, x) in sums
                    .iter_mut()
                    .zip([free, run.wheel.clean[k], impulse, v, braked])
                {
                    *sum += x;
                }
                count += 1;
                if count == every {
                    let n = count as f64;
                    all.vehicle.push(sums[0] / n);
                    all.wheel.push(sums[1] / n);
                    let pushed = sums[2] / n * rig.radius_m / rig.wheel_inertia_kg_m2;
                    all.impulse.push(pushed);
                    if run.brake.is_some() {
                        let braked = sums[4] / n / rig.wheel_inertia_kg_m2;
                        all.unmoved.push(sums[1] / n - pushed + braked);
                    }
                    all.own.push(sums[3] / n);
                    (sums, count) = ([0.0; 5], 0);
                }
            }
            out.push(all);
        }
    }
    out
}

fn typical_step(runs: &[Recording]) -> f64 {
    let mut steps: Vec<f64> = runs.iter().map(|run| run.step).collect();
    median_in_place(&mut steps)
}

/// The relative error that both speeds share.
fn shared(rig: &Rig, runs: &[Recording]) -> Option<Memory> {
    let sample = typical_step(runs);
    if !(sample > 0.0) || !(rig.radius_m > 0.0) {
        return None;
    }
    let every = ((STEP_S / sample).round() as usize).max(1);
    let step = every as f64 * sample;
    let speeds = speeds(rig, runs, every);
    let pairs = |second: fn(&Speeds) -> &Vec<f64>| -> Vec<Pair> {
        speeds
            .iter()
            .map(|s| Pair {
                a: s.vehicle.clone(),
                b: second(s).clone(),
                // Where the wheel hardly turns it shows no relative error.
                factor: s
                    .own
                    .iter()
                    .zip(&s.wheel)
                    .map(|(v, w)| {
                        let rolls = w * rig.radius_m > 0.5 * v;
                        if rolls { 1.0 / (v * w) } else { 0.0 }
                    })
                    .collect(),
                levels: Vec::new(),
            })
            .collect()
    };
    // Means over samples that follow each other, the samples themselves taken in an instant.
    let grid = (step, step - sample);
    let range = (1, COMMON_LAG_S);
    // A held speed owes the drag nothing: the wheel's own motion may be taken out, noise of its causes and all.
    if !rig.coasting && speeds.iter().all(|s| s.unmoved.len() == s.wheel.len()) {
        let quiet = structure(&pairs(|s| &s.unmoved), grid, range).memory(false);
        let seen = structure(&pairs(|s| &s.wheel), grid, range).memory(false);
        return [quiet, seen]
            .into_iter()
            .flatten()
            .min_by(|a, b| a.std.total_cmp(&b.std))
            .filter(Memory::is_sure);
    }
    let both = structure(&pairs(|s| &s.wheel), grid, range);
    let memory = both.memory(false).filter(Memory::is_sure)?;
    // A speed that truly wavers takes the wheel along by a force.
    let forced = structure(&pairs(|s| &s.impulse), grid, range);
    let at = 2.0 * memory.time;
    (rig.coasting || forced.at(at) < 0.5 * both.at(at)).then_some(memory)
}

/// The error that both speeds share as a finding of the vehicle speed.
#[must_use]
pub fn common(rig: &Rig, runs: &[Recording]) -> Option<Finding> {
    if runs
        .iter()
        .any(|run| run.speed.is_coarse() || run.wheel.is_coarse())
    {
        return None;
    }
    let memory = shared(rig, runs)?;
    let (size, std) = memory.size();
    let mean = |pick: fn(&Recording) -> &Vec<f64>| {
        let (sum, count) = runs
            .iter()
            .flat_map(|run| run.moving.iter().flat_map(move |m| &pick(run)[m.clone()]))
            .fold((0.0, 0.0), |(s, n), x| (s + x, n + 1.0));
        sum / f64::max(count, 1.0)
    };
    let own = |pick: fn(&Recording) -> &Vec<f64>| {
        let mut all: Vec<f64> = runs.iter().map(|run| difference_sigma(pick(run))).collect();
        median_in_place(&mut all) / mean(pick).max(1e-9)
    };
    let least = own(|run| &run.speed.clean).max(own(|run| &run.wheel.clean));
    let speed = mean(|run| &run.speed.clean);
    (size > COMMON_SHARE * least).then(|| Finding {
        relative_to: "wheel_speed_rad_s".to_owned(),
        ..Finding::of(
            "vehicle_speed_m_s",
            Word::CommonNoise,
            (size * speed, std.max(0.03 * size) * speed),
            "m/s",
        )
        .saying(format!(
            "Vehicle and wheel speed err together by {:.3} % with a time constant of {:.0} ms: slip does not show it.",
            100.0 * size,
            1e3 * memory.time
        ))
    })
}
