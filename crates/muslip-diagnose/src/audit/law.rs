//! The tyre's law as a clock: the drag follows the slip, so the delay of the speeds shows wherever slip moves.

use rayon::prelude::*;

use super::constants::{
    FEWEST_BLOCKS, HELD_WIDTH_S, LEAST_FILTER_S, MOST_ROWS, SPEED_WIDTH_S, TOLD_SIGMAS,
    WHEEL_RANGE_S, WHEEL_STEP_S,
};
use super::finding::Timing;
use super::recording::{Block, Recording, blocks, spans};
use super::signal::Signal;
use super::squares::{Balance, Solution, recoloured, refine};
use super::vehicle::powers;
use crate::campaign::Rig;
use crate::slip::slip;

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
/// How long the drag's memory is, s or, of a tyre that follows over a length, m.
pub const LAG: usize = 5;
/// Number of the unknowns.
const UNKNOWNS: usize = 6;

/// What keeps the drag back behind the law's force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lag {
    /// Nothing but what its delay against the wheel's speed does.
    None,
    /// A pole: a filter.
    Pole,
    /// The way rolled: a tyre.
    Length,
    /// A mean over a time around: no memory, but it takes the noise of slip away as memories do.
    Mean,
}

/// A block with what no unknown moves.
struct Stretch {
    block: Block,
    /// The drag as read.
    drag: Vec<f64>,
    /// Load at each step from the run-up on.
    load: Vec<f64>,
    /// The same, averaged for the instruments.
    smooth_load: Vec<f64>,
}

struct Law<'a> {
    runs: &'a [Recording],
    stretches: Vec<Stretch>,
    rig: &'a Rig,
    step: f64,
    scale: f64,
    vehicle: Timing,
    /// Vehicle speed of each run, smoothed and, where its delay is known, in step with the drag.
    speeds: Vec<Signal>,
    lag: Lag,
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
/// Speed at which the search for a tyre's length begins, m/s.
const SPEED_M_S: f64 = 15.0;
/// Farthest that the refinement may take the wheel speed's delay from the coarse scan's, s.
const ASTRAY_S: f64 = 0.025;

impl Law<'_> {
    /// Takes these stretches of runs, in steps of this width.
    fn divided(&mut self, stretches: &[(usize, f64, f64)], step: f64) {
        self.step = step;
        let width = self.width();
        let smooth = INSTRUMENT_S.max(step);
        self.stretches = blocks(stretches, step, (0.05, 0.15), (FEWEST_BLOCKS, 12.0, 0.8))
            .into_par_iter()
            .map(|block| {
                let run = &self.runs[block.run];
                let (start, count) = self.with_run_up(&block);
                let load = |width: f64| run.load.signal.averages(start, step, count, width);
                Stretch {
                    drag: (run.drag.signal).averages(block.start, step, block.count, width),
                    load: load(width),
                    smooth_load: load(smooth),
                    block,
                }
            })
            .collect();
    }

    /// Width over which inputs and drag are averaged, s.
    fn width(&self) -> f64 {
        if self.smooth { INSTRUMENT_S } else { self.step }
    }

    /// Samples of the run-up.
    fn ahead(&self) -> usize {
        (RUN_UP_S / self.step) as usize
    }

    /// Where a block's run-up begins, and how many steps there are from there on.
    fn with_run_up(&self, block: &Block) -> (f64, usize) {
        let ahead = self.ahead();
        (block.start - ahead as f64 * self.step, block.count + ahead)
    }

    /// Drag by the law on a stretch's grid; speeds are means over a width in s, as the load given.
    fn drag(&self, stretch: &Stretch, x: &[f64], width: f64, load: &[f64]) -> Vec<f64> {
        let block = &stretch.block;
        let run = &self.runs[block.run];
        let (start, count) = self.with_run_up(block);
        let omega = run
            .wheel
            .signal
            .averages(start + x[WHEEL], self.step, count, width);
        let speed = self.speeds[block.run].averages(
            start + x[VEHICLE] - self.vehicle.value,
            self.step,
            count,
            if width > self.step && !self.vehicle.std.is_finite() {
                HELD_WIDTH_S
            } else {
                width
            },
        );
        let critical = x[CRITICAL].exp();
        let law: Vec<f64> = (0..count)
            .map(|k| {
                let v = speed[k].max(1e-3);
                let s = slip(self.rig.radius_m, omega[k], v) - x[OFFSET];
                let u = s / critical;
                load[k] * x[PEAK] * 2.0 * u / (1.0 + u * u)
            })
            .collect();
        let mut law = match self.lag {
            Lag::None => law,
            Lag::Pole => following(&law, self.step, |_| x[LAG]),
            Lag::Length => following(&law, self.step, |k| x[LAG] / speed[k].max(1e-3)),
            Lag::Mean => around(&law, self.step, x[LAG]),
        };
        law.drain(..self.ahead());
        law
    }

    /// The same of inputs averaged for the instruments.
    fn smooth_drag(&self, stretch: &Stretch, x: &[f64]) -> Vec<f64> {
        self.drag(
            stretch,
            x,
            INSTRUMENT_S.max(self.step),
            &stretch.smooth_load,
        )
    }
}

impl Balance for Law<'_> {
    fn residual(&self, x: &[f64]) -> Vec<Vec<f64>> {
        self.stretches
            .par_iter()
            .map(|stretch| {
                let law = self.drag(stretch, x, self.width(), &stretch.load);
                let both = stretch.drag.iter().zip(&law);
                both.map(|(d, l)| (d - l) / self.scale).collect()
            })
            .collect()
    }

    fn instrument(&self, _: &[f64], x: &[f64]) -> Option<Vec<Vec<f64>>> {
        if self.smooth {
            return None;
        }
        let instrument = |stretch: &Stretch| {
            let law = self.smooth_drag(stretch, x);
            law.iter().map(|l| -l / self.scale).collect()
        };
        Some(self.stretches.par_iter().map(instrument).collect())
    }

    fn own(&self, x: &[f64]) -> Vec<Vec<Vec<f64>>> {
        self.stretches
            .par_iter()
            .map(|stretch| {
                let mut columns = powers(stretch.block.count, 2);
                columns.push(self.smooth_drag(stretch, x));
                columns
            })
            .collect()
    }

    fn steps(&self) -> Vec<f64> {
        vec![1e-3, 1e-3, 1e-4, 5e-4, 1e-3, 5e-4]
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
            (0.0, f64::INFINITY),
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
        run.drag
            .signal
            .levels_later(grid, late, moment)
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

/// A force that follows with a time constant in s at each step; the trapezoidal rule, which keeps a pole where it is.
fn following(force: &[f64], step: f64, time: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut state = force.first().copied().unwrap_or(0.0);
    let mut before = state;
    (0..force.len())
        .map(|k| {
            let twice = 2.0 * time(k).max(0.0);
            state += ((force[k] + before) - 2.0 * state) * step / (twice + step);
            before = force[k];
            state
        })
        .collect()
}

/// Means over a time around each step, at least one step.
fn around(force: &[f64], step: f64, time: f64) -> Vec<f64> {
    let times: Vec<f64> = (0..force.len()).map(|k| k as f64 * step).collect();
    Signal::new(&times, force).averages(0.0, step, force.len(), time.max(step))
}

/// What the law says of the drag's memory.
#[derive(Clone, Debug)]
pub struct Pole {
    /// Time constant of the filter, s, and its standard deviation.
    pub time: (f64, f64),
    /// By how many whitened squares the filter explains the drag better than a delay, and than a tyre's length.
    pub better: [f64; 2],
}

/// What the law says.
#[derive(Clone, Debug)]
pub struct Told {
    /// The unknowns, the drag only delayed.
    pub estimate: Solution,
    /// A filter of the drag, where it is later than the wheel's speed.
    pub pole: Option<Pole>,
}

/// What the law says, given what is known of the vehicle speed: its delay, and by what second moment it is slower, s².
#[must_use]
pub fn law(rig: &Rig, runs: &[Recording], vehicle: Timing, moment: f64) -> Option<Told> {
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
    let mut balance = Law {
        runs,
        stretches: Vec::new(),
        rig,
        step,
        scale: sum / f64::max(count, 1.0),
        vehicle,
        lag: Lag::None,
        smooth: true,
        speeds: runs
            .par_iter()
            .map(|run| speed(rig, run, vehicle, moment))
            .collect(),
    };
    balance.divided(&stretches, COARSE_S.max(step));
    if balance.stretches.is_empty() || !(balance.scale > 0.0) {
        return None;
    }
    let start = coarse(&balance)?;
    balance.smooth = false;
    balance.divided(&stretches, step);
    let begun = start[WHEEL];
    let known = vehicle.std.is_finite();
    let fixed = [false, false, false, false, known, true];
    let at = refine(&balance, &start, &[0.6], 3, &fixed)?;
    let estimate = recoloured(&balance, at, &fixed)?;
    if (estimate.unknowns[WHEEL] - begun).abs() > ASTRAY_S {
        return None;
    }
    let pole = pole(&mut balance, &estimate, &fixed);
    Some(Told { estimate, pole })
}

/// The drag's memory as a filter, where it is later than the wheel's speed by what a filter worth a sentence would do: each
/// form refitted with the wheel's own delay free beside it.
fn pole(balance: &mut Law, delayed: &Solution, fixed: &[bool; UNKNOWNS]) -> Option<Pole> {
    let late = -delayed.unknowns[WHEEL];
    if !(late > LEAST_FILTER_S.max(TOLD_SIGMAS * delayed.std[WHEEL])) {
        return None;
    }
    let mut fitted = |lag: Lag, size: f64, late: f64| {
        balance.lag = lag;
        let mut fixed = *fixed;
        fixed[LAG] = lag == Lag::Mean;
        let mut start = delayed.unknowns.clone();
        // Where a memory keeps the drag back, both speeds are early by as much.
        start[LAG] = size;
        start[WHEEL] += late;
        start[VEHICLE] += late;
        let at = refine(balance, &start, &[0.6], 4, &fixed)?;
        recoloured(balance, at, &fixed)
    };
    let pole = fitted(Lag::Pole, late, late)?;
    let length = fitted(Lag::Length, late * SPEED_M_S, late);
    // A pole takes noise of the slip away, and would win by that alone: a delay has a mean that takes as much.
    let mean = fitted(Lag::Mean, 2.0 * pole.unknowns[LAG], 0.0)?;
    let better = |other: &Solution| squares(other) - squares(&pole);
    Some(Pole {
        time: (pole.unknowns[LAG], pole.std[LAG]),
        better: [better(&mean), length.as_ref().map_or(f64::INFINITY, better)],
    })
}

/// Minus twice the log likelihood of innovations of unknown size.
fn squares(found: &Solution) -> f64 {
    let rows = found.rows as f64;
    rows * (found.sum / rows).max(1e-300).ln()
}

/// The best of a scan over the wheel speed's delay, the law refitted at each.
fn coarse(balance: &Law) -> Option<Vec<f64>> {
    let prior = balance.prior();
    let step = 0.02;
    let count = ((WHEEL_RANGE_S.1 - WHEEL_RANGE_S.0) / step).round() as usize;
    let refined: Vec<Solution> = (0..=count)
        .into_par_iter()
        .filter_map(|k| {
            let mut x: Vec<f64> = prior.iter().map(|p| p.0).collect();
            x[WHEEL] = WHEEL_RANGE_S.0 + k as f64 * step;
            let fixed = [false, false, true, false, true, true];
            refine(balance, &x, &[0.6], 3, &fixed)
        })
        .collect();
    let best = (refined.into_iter()).min_by(|a, b| a.sum.total_cmp(&b.sum));
    best.map(|estimate| estimate.unknowns)
}
