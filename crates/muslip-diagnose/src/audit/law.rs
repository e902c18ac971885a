//! The tyre's law as a clock: the drag follows the slip, so the delay of the speeds shows wherever slip moves.

use super::constants::{
    FEWEST_BLOCKS, HELD_WIDTH_S, MOMENT_S2, MOST_ROWS, SPEED_WIDTH_S, WHEEL_RANGE_S, WHEEL_STEP_S,
};
use super::finding::Timing;
use super::recording::{Block, Recording, blocks, spans};
use super::signal::{Signal, low_pass};
use super::squares::{Balance, Solution, recoloured, refine};
use super::vehicle::{constants_of, impulse_like, powers};
use crate::campaign::Rig;

/// Places of the unknowns.
pub const PEAK: usize = 0;
/// Logarithm of the critical slip.
pub const CRITICAL: usize = 1;
/// Constant error of the slip.
pub const OFFSET: usize = 2;
/// Delay of the wheel speed, s.
pub const WHEEL: usize = 3;
/// Delay of the vehicle speed, s.
pub const VEHICLE: usize = 4;
/// Second moment by which the speeds are slower than the drag, s².
pub const MOMENT: usize = 5;

struct Law<'a> {
    runs: &'a [Recording],
    blocks: Vec<Block>,
    rig: &'a Rig,
    step: f64,
    scale: f64,
    vehicle: Timing,
    /// Vehicle speed of each run, smoothed and, where its delay is known, in step with the drag.
    speeds: Vec<Signal>,
    /// Whether everything is averaged over the instruments' width, drag too: coarse, but proof against noisy inputs.
    smooth: bool,
}

/// Seconds read ahead of a block.
const RUN_UP_S: f64 = 0.15;
/// Width over which speeds and load are averaged for the instruments, s.
const INSTRUMENT_S: f64 = 0.06;
/// What is known of the vehicle speed's delay where no balance tells it, s.
const VEHICLE_PRIOR_S: f64 = 0.04;
/// Step of the grid of the coarse scan, s.
const COARSE_S: f64 = 0.015;
/// Farthest that the refinement may take the wheel speed's delay from the coarse scan's, s.
const ASTRAY_S: f64 = 0.025;

impl Law<'_> {
    /// Drag by the law and drag as read, on the block's grid; inputs are means over a width in s.
    fn series(&self, block: &Block, x: &[f64], width: f64) -> (Vec<f64>, Vec<f64>) {
        let (slower, faster) = constants_of(x[MOMENT]);
        let shift = faster - slower;
        let run = &self.runs[block.run];
        let ahead = (RUN_UP_S / self.step) as usize;
        let start = block.start - ahead as f64 * self.step;
        let count = block.count + ahead;
        let omega = run
            .wheel
            .signal
            .averages(start + x[WHEEL] + shift, self.step, count, width);
        let speed = self.speeds[block.run].averages(
            start + x[VEHICLE] + shift - self.vehicle.value,
            self.step,
            count,
            if width > self.step && !self.vehicle.std.is_finite() {
                HELD_WIDTH_S
            } else {
                width
            },
        );
        let load = run
            .load
            .signal
            .averages(start + shift, self.step, count, width);
        let critical = x[CRITICAL].exp();
        let law: Vec<f64> = (0..count)
            .map(|k| {
                let v = speed[k].max(1e-3);
                let s = 1.0 - self.rig.radius_m * omega[k] / v - x[OFFSET];
                let u = s / critical;
                load[k] * x[PEAK] * 2.0 * u / (1.0 + u * u)
            })
            .collect();
        let law = low_pass(&law, self.step, faster);
        let own = if self.smooth { INSTRUMENT_S } else { self.step };
        let drag = low_pass(
            &run.drag.signal.averages(start, self.step, count, own),
            self.step,
            slower,
        );
        (law[ahead..].to_vec(), drag[ahead..].to_vec())
    }
}

impl Balance for Law<'_> {
    fn residual(&self, x: &[f64]) -> Vec<Vec<f64>> {
        self.blocks
            .iter()
            .map(|block| {
                let width = if self.smooth { INSTRUMENT_S } else { self.step };
                let (law, drag) = self.series(block, x, width);
                drag.iter()
                    .zip(&law)
                    .map(|(d, l)| (d - l) / self.scale)
                    .collect()
            })
            .collect()
    }

    fn instrument(&self, _: &[f64], x: &[f64]) -> Option<Vec<Vec<f64>>> {
        if self.smooth {
            return None;
        }
        Some(
            self.blocks
                .iter()
                .map(|block| {
                    let (law, _) = self.series(block, x, INSTRUMENT_S.max(self.step));
                    law.iter().map(|l| -l / self.scale).collect()
                })
                .collect(),
        )
    }

    fn own(&self, x: &[f64]) -> Vec<Vec<Vec<f64>>> {
        self.blocks
            .iter()
            .map(|block| {
                let mut columns = powers(block.count, 2);
                columns.push(self.series(block, x, INSTRUMENT_S).0);
                columns
            })
            .collect()
    }

    fn steps(&self) -> Vec<f64> {
        vec![1e-3, 1e-3, 1e-4, 5e-4, 1e-3, 2.5e-5]
    }

    fn prior(&self) -> Vec<(f64, f64)> {
        let vehicle = if self.vehicle.std.is_finite() {
            (self.vehicle.value, self.vehicle.std)
        } else {
            (0.0, VEHICLE_PRIOR_S)
        };
        vec![
            (self.rig.peak_friction, 0.3 * self.rig.peak_friction),
            (self.rig.critical_slip.ln(), 0.4),
            (0.0, 0.005),
            (0.0, 0.1),
            vehicle,
            (0.0, MOMENT_S2),
        ]
    }
}

/// The vehicle's speed smoothed. Where it coasts its quick changes are the drag's impulse: only the rest is smoothed.
fn speed(rig: &Rig, run: &Recording, vehicle: Timing, moment: f64) -> Signal {
    let count = run.time.len();
    let (Some(first), Some(last)) = (run.time.first(), run.time.last()) else {
        return Signal::default();
    };
    let step = ((last - first) / count.max(2) as f64).max(1e-4);
    let times: Vec<f64> = (0..count).map(|k| first + k as f64 * step).collect();
    if !vehicle.std.is_finite() {
        return Signal::new(
            &times,
            &run.speed
                .signal
                .averages(*first, step, count, SPEED_WIDTH_S),
        );
    }
    // In the vehicle channel's own time, the impulse as late and as slow as that channel.
    let grid = (*first, step, count);
    let scale = 1.0 / rig.mass_kg;
    let impulse = |late: f64, moment: f64| -> Vec<f64> {
        impulse_like(run, grid, late, moment)
            .iter()
            .map(|i| i * scale)
            .collect()
    };
    let late = impulse(vehicle.value, moment);
    let speed = run.speed.signal.means(*first, step, count);
    let rest: Vec<f64> = speed.iter().zip(&late).map(|(v, i)| v + i).collect();
    let impulse = impulse(0.0, 0.0);
    let rest = Signal::new(&times, &rest).averages(*first, step, count, SPEED_WIDTH_S);
    let rebuilt: Vec<f64> = rest.iter().zip(&impulse).map(|(v, i)| v - i).collect();
    Signal::new(&times, &rebuilt)
}

/// What the law says, given what is known of the vehicle speed: its delay, and by what second moment it is slower, s².
#[must_use]
pub fn law(rig: &Rig, runs: &[Recording], vehicle: Timing, moment: f64) -> Option<Solution> {
    if !(rig.radius_m > 0.0 && rig.peak_friction > 0.0 && rig.critical_slip > 0.0) {
        return None;
    }
    let stretches = spans(runs);
    let whole: f64 = stretches.iter().map(|(_, a, b)| b - a).sum();
    let step = WHEEL_STEP_S.max(whole / MOST_ROWS as f64);
    let (mut sum, mut count) = (0.0, 0.0);
    for run in runs {
        for k in run.moving.iter().flat_map(Clone::clone) {
            sum += run.load.clean[k].abs();
            count += 1.0;
        }
    }
    let even = |step: f64| blocks(&stretches, step, (0.05, 0.15), (FEWEST_BLOCKS, 12.0, 0.8));
    let mut balance = Law {
        runs,
        blocks: even(step),
        rig,
        step,
        scale: sum / f64::max(count, 1.0),
        vehicle,
        smooth: true,
        speeds: runs
            .iter()
            .map(|run| speed(rig, run, vehicle, moment))
            .collect(),
    };
    if balance.blocks.is_empty() || !(balance.scale > 0.0) {
        return None;
    }
    balance.step = COARSE_S.max(step);
    balance.blocks = even(balance.step);
    let start = coarse(&balance)?;
    balance.smooth = false;
    balance.step = step;
    balance.blocks = even(step);
    let begun = start[WHEEL];
    let known = vehicle.std.is_finite();
    let fixed = [false, false, false, false, known, true];
    let at = refine(&balance, &start, &[0.6], 3, &fixed)?;
    let at = recoloured(&balance, at, &fixed)?;
    ((at.unknowns[WHEEL] - begun).abs() < ASTRAY_S).then_some(at)
}

/// The best of a scan over the wheel speed's delay, the law refitted at each.
fn coarse(balance: &Law) -> Option<Vec<f64>> {
    let prior = balance.prior();
    let step = 0.02;
    let count = ((WHEEL_RANGE_S.1 - WHEEL_RANGE_S.0) / step).round() as usize;
    (0..=count)
        .filter_map(|k| {
            let mut x: Vec<f64> = prior.iter().map(|p| p.0).collect();
            x[WHEEL] = WHEEL_RANGE_S.0 + k as f64 * step;
            let fixed = [false, false, true, false, true, true];
            refine(balance, &x, &[0.6], 3, &fixed)
        })
        .min_by(|a, b| a.sum.total_cmp(&b.sum))
        .map(|estimate| estimate.unknowns)
}
