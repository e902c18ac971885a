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
    // What the brake is known to do to the wheel, and the drag, may be taken out, noise of them and all: what the drag's adds
    // to a coasting vehicle it takes from the wheel, which looks like no shared error.
    if speeds.iter().all(|s| s.unmoved.len() == s.wheel.len()) {
        let of = |wheel: fn(&Speeds) -> &Vec<f64>| structure(&pairs(wheel), grid, range);
        // A torque that is read wrongly, or noisily, moves more than it takes out.
        let (unmoved, seen) = (of(|s| &s.unmoved), of(|s| &s.wheel));
        let lag = COMMON_LAG_S / 3.0;
        let quiet = if unmoved.size_at(lag) < seen.size_at(lag) {
            unmoved
        } else {
            seen
        };
        return quiet.memory(false).filter(Memory::is_sure);
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

#[cfg(test)]
mod tests {
    use super::super::recording::recording;
    use super::super::toy::white;
    use super::*;
    use crate::campaign::Run;

    const INERTIA: f64 = 1.2;

    /// A coasting vehicle whose wheel is braked by an antiskid, both speeds read with an error that they share.
    fn run(common: f64, with_brake: bool, phase: f64) -> Run {
        let (dt, count, mass, radius) = (2e-3, 5000, 420.0, 0.31);
        let mut white = white(5);
        let mut normal = move || -> f64 { white.by_ref().take(4).map(|x| 3f64.sqrt() * x).sum() };
        let kept = (-dt / 0.05f64).exp();
        let (mut v, mut error) = (30.0, 0.0);
        let (mut before, mut brake) = (f64::NAN, Vec::new());
        let mut run = Run::default();
        for k in 0..count {
            let t = f64::from(k) * dt;
            let slip = 0.2 * (1.0 - (2.3 * t + phase).cos()) * (0.5 + 0.5 * (35.0 * t).sin());
            let u = slip / 0.12;
            let force = 1000.0 * 2.0 * u / (1.0 + u * u);
            let wheel = v * (1.0 - slip) / radius;
            error = kept * error + (1.0 - kept * kept).sqrt() * normal();
            let read = 1.0 + common * error;
            run.time_s.push(t);
            run.vehicle_speed_m_s.push(v * read + 0.01 * normal());
            run.wheel_speed_rad_s.push(wheel * read + 0.05 * normal());
            run.drag_force_n.push(force + 20.0 * normal());
            run.normal_force_n.push(1200.0);
            let change = if k > 0 { (wheel - before) / dt } else { 0.0 };
            brake.push(radius * force - INERTIA * change);
            before = wheel;
            v -= dt * force / mass;
        }
        run.brake_torque_nm = with_brake.then_some(brake);
        run
    }

    #[test]
    fn what_both_speeds_err_by_is_told_while_the_wheel_is_braked() {
        let rig = Rig {
            radius_m: 0.31,
            wheel_inertia_kg_m2: INERTIA,
            mass_kg: 420.0,
            coasting: true,
            ..Rig::default()
        };
        let found = |common: f64, with_brake: bool| {
            let runs = [0.0, 1.0, 2.0].map(|phase| run(common, with_brake, phase));
            let all: Vec<Recording> = runs.iter().map(|own| recording(&rig, own)).collect();
            shared(&rig, &all).map(|memory| memory.size())
        };
        for with_brake in [true, false] {
            let (size, std) = found(0.004, with_brake).unwrap();
            assert!((size / 0.004 - 1.0).abs() < 0.1, "{size} {std}");
            assert_eq!(found(0.0, with_brake), None);
        }
    }
}
