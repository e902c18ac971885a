//! The wheel's balance in level form: J ω(t) against the impulses of drag and brake.

use rayon::prelude::*;

use super::constants::{
    BRAKE_MOMENT_S2, COARSE_STEP_S, FEWEST_BLOCKS, MOST_ROWS, WHEEL_RANGE_S, WHEEL_STEP_S,
};
use super::finding::Timing;
use super::recording::{Block, Recording, blocks};
use super::squares::{Balance, Solution, recoloured, refine, scan_value};
use super::vehicle::parabolas;
use crate::campaign::Rig;

/// Unknowns: scale of both impulses, the brake's against the drag's, delays of ω and of the brake column in s, second moment in
/// s² by which the brake column is slower than its torque (negative where the brake lags). The wheel speed is never filtered:
/// what is left would only look smaller.
struct Wheel<'a> {
    runs: &'a [Recording],
    blocks: Vec<Block>,
    rig: &'a Rig,
    step: f64,
}

/// Delays of the brake that the refinement starts from, s: a rack's either way, and what a brake's lag makes its reading
/// early by.
const BRAKES_S: [f64; 7] = [0.0, -0.02, -0.01, 0.01, 0.02, -0.05, -0.1];
/// Seconds read ahead of a block.
const RUN_UP_S: f64 = 0.15;
/// Width over which the wheel speed is averaged for the instruments, s.
const INSTRUMENT_S: f64 = 0.04;

impl Wheel<'_> {
    fn each(&self, of: impl Fn(&Recording, &Block) -> Vec<f64>) -> Vec<Vec<f64>> {
        self.blocks
            .iter()
            .map(|block| of(&self.runs[block.run], block))
            .collect()
    }

    /// Wheel speed less both impulses; given the unknowns to start from, the drag's impulse is what wheel speed (smoothed)
    /// and brake make of it, so that the drag's noise is not in it.
    fn imbalance(
        &self,
        run: &Recording,
        block: &Block,
        x: &[f64],
        smoothed: Option<&[f64]>,
    ) -> Vec<f64> {
        let ahead = (RUN_UP_S / self.step) as usize;
        let start = block.start - ahead as f64 * self.step;
        let count = block.count + ahead;
        let inertia = self.rig.wheel_inertia_kg_m2;
        let brake_at = |late: f64, moment: f64| -> Vec<f64> {
            let Some((_, brake)) = &run.brake else {
                return vec![0.0; count];
            };
            let grid = (start - x[2], self.step, count);
            let level = brake.signal.levels_later(grid, -late, -moment);
            level.iter().map(|l| (l - level[0]) / inertia).collect()
        };
        let brake = brake_at(x[3], x[4]);
        let drag: Vec<f64> = if let Some(base) = smoothed {
            let wheel =
                run.wheel
                    .signal
                    .averages(start - x[2] + base[2], self.step, count, INSTRUMENT_S);
            let kept = brake_at(base[3], base[4]);
            let both = wheel.iter().zip(&kept);
            both.map(|(wheel, kept)| wheel + base[1] * kept).collect()
        } else {
            let drag = run.drag.signal.levels(start - x[2], self.step, count);
            let share = self.rig.radius_m / inertia;
            drag.iter().map(|d| share * (d - drag[0])).collect()
        };
        let omega = run.wheel.signal.means(start, self.step, count);
        (ahead..count)
            .map(|k| omega[k] - x[0] * (drag[k] - x[1] * brake[k]))
            .collect()
    }
}

impl Balance for Wheel<'_> {
    fn residual(&self, x: &[f64]) -> Vec<Vec<f64>> {
        self.each(|run, block| self.imbalance(run, block, x, None))
    }

    fn instrument(&self, base: &[f64], x: &[f64]) -> Option<Vec<Vec<f64>>> {
        Some(self.each(|run, block| self.imbalance(run, block, x, Some(base))))
    }

    fn own(&self, _: &[f64]) -> Vec<Vec<Vec<f64>>> {
        parabolas(&self.blocks)
    }

    fn steps(&self) -> Vec<f64> {
        vec![1e-3, 1e-3, 5e-4, 5e-4, 2.5e-5]
    }

    fn prior(&self) -> Vec<(f64, f64)> {
        vec![
            (1.0, 0.05),
            (1.0, 0.3),
            (0.0, f64::INFINITY),
            (0.0, f64::INFINITY),
            (0.0, BRAKE_MOMENT_S2),
        ]
    }
}

/// Stretches in which the wheel turns and moves freely of its stop, in s.
fn turning(rig: &Rig, runs: &[Recording]) -> Vec<(usize, f64, f64)> {
    let mut out = Vec::new();
    for (r, run) in runs
        .iter()
        .enumerate()
        .filter(|(_, run)| run.brake.is_some())
    {
        for moving in &run.moving {
            let mut from = None;
            for k in moving.clone() {
                let free = run.wheel.clean[k] * rig.radius_m > 0.05 * run.speed.clean[k];
                if free && from.is_none() {
                    from = Some(k);
                }
                if let Some(start) = from
                    && (!free || k + 1 == moving.end)
                {
                    out.push((r, run.time[start], run.time[k]));
                    from = None;
                }
            }
        }
    }
    out
}

/// What the balance says, given what the law says of the wheel speed before any hold.
#[must_use]
pub fn wheel(rig: &Rig, runs: &[Recording], known: Timing) -> Option<Solution> {
    if !(rig.wheel_inertia_kg_m2 > 0.0 && rig.radius_m > 0.0) {
        return None;
    }
    let stretches = turning(rig, runs);
    let whole: f64 = stretches.iter().map(|(_, a, b)| b - a).sum();
    let step = WHEEL_STEP_S.max(whole / MOST_ROWS as f64);
    let balance = Wheel {
        runs,
        blocks: blocks(&stretches, step, (0.08, 0.08), (FEWEST_BLOCKS, 2.0, 0.3)),
        rig,
        step,
    };
    if balance.blocks.is_empty() {
        return None;
    }
    // Where the law knows the delay, from there; else from a scan. The brake's may be any of a rack's.
    let near: Vec<f64> = if known.std.is_finite() {
        vec![known.value]
    } else {
        let count = ((WHEEL_RANGE_S.1 - WHEEL_RANGE_S.0) / COARSE_STEP_S).round() as usize;
        (0..=count)
            .map(|k| WHEEL_RANGE_S.0 + k as f64 * COARSE_STEP_S)
            .collect()
    };
    let scanned: Vec<(f64, f64, f64)> = near
        .par_iter()
        .flat_map_iter(|&wheel| BRAKES_S.map(|brake| (wheel, brake)))
        .filter_map(|(wheel, brake)| {
            let value = scan_value(&balance, &[1.0, 1.0, wheel, brake, 0.0], &[0.98]);
            value.is_finite().then_some((value, wheel, brake))
        })
        .collect();
    let best = scanned.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let start = [1.0, 1.0, best.1, best.2, 0.0];
    let at = refine(
        &balance,
        &start,
        &[0.98],
        4,
        &[false, false, false, false, true],
    )?;
    recoloured(&balance, at, &[false; 5])
}

#[cfg(test)]
mod tests {
    use super::super::recording::recording;
    use super::super::toy::white;
    use super::*;
    use crate::campaign::Run;

    fn rig() -> Rig {
        Rig {
            radius_m: 0.31,
            wheel_inertia_kg_m2: 1.2,
            ..Rig::default()
        }
    }

    /// A torque of three sines through a pole of a time constant and later by a delay, in s: in closed form.
    fn torque(t: f64, phase: f64, (pole, late): (f64, f64)) -> f64 {
        [(1.7, 1.0, 120.0), (11.0, 2.0, 80.0), (47.0, 3.0, 60.0)]
            .iter()
            .map(|(omega, share, size)| {
                let gain = 1.0 / (omega * pole).hypot(1.0);
                gain * size * (omega * (t - late) + share * phase - (omega * pole).atan()).sin()
            })
            .sum::<f64>()
            + 400.0
    }

    /// A wheel braked by one torque, its column another: each through a pole and late, as (pole, delay) in s.
    fn run(rig: &Rig, phase: f64, acts: (f64, f64), reads: (f64, f64)) -> Run {
        let time_s: Vec<f64> = (0..6000).map(|k| f64::from(k) * 1e-3).collect();
        let mut white = white(7 + (10.0 * phase) as u64);
        let mut with_noise = |size: f64, of: &dyn Fn(f64) -> f64| -> Vec<f64> {
            let times = time_s.iter();
            times
                .map(|t| of(*t) + size * white.next().unwrap())
                .collect()
        };
        let rate = |t: f64| 40.0 * (9.0 * t + phase).sin() + 30.0 * (23.0 * t).cos();
        let omega =
            |t: f64| 90.0 - 40.0 / 9.0 * (9.0 * t + phase).cos() + 30.0 / 23.0 * (23.0 * t).sin();
        let drag =
            |t: f64| (torque(t, phase, acts) + rig.wheel_inertia_kg_m2 * rate(t)) / rig.radius_m;
        Run {
            name: "run".to_owned(),
            wheel_speed_rad_s: with_noise(0.1, &omega),
            drag_force_n: with_noise(60.0, &drag),
            brake_torque_nm: Some(with_noise(8.0, &|t| torque(t, phase, reads))),
            vehicle_speed_m_s: vec![30.0; time_s.len()],
            normal_force_n: vec![3500.0; time_s.len()],
            time_s,
            ..Run::default()
        }
    }

    #[test]
    fn a_lag_and_a_delay_of_brake_or_column_are_told_apart_and_leave_the_scales() {
        let none = (0.0, 0.0);
        for (acts, reads) in [
            (none, none),
            ((0.0, 0.016), none),
            ((0.016, 0.0), none),
            ((0.06, 0.0), none),
            (none, (0.008, 0.0)),
        ] {
            let runs =
                [0.0, 1.0, 2.0].map(|phase| recording(&rig(), &run(&rig(), phase, acts, reads)));
            let x = wheel(&rig(), &runs, Timing::UNKNOWN).unwrap().unknowns;
            let late = reads.0 + reads.1 - acts.0 - acts.1;
            let moment = reads.0 * reads.0 - acts.0 * acts.0;
            assert!(
                (x[0] - 1.0).abs() < 0.01 && (x[1] - 1.0).abs() < 0.01,
                "{x:?}"
            );
            assert!(x[2].abs() < 5e-4 && (x[3] - late).abs() < 1e-3, "{x:?}");
            // A pole on a grid of 6 ms has a second moment larger by its time constant times that.
            assert!((x[4] - moment).abs() < 3e-5 + 0.4 * moment.abs(), "{x:?}");
        }
    }
}
