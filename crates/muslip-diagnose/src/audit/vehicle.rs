//! The vehicle's balance in level form: v(t) against the drag's impulse, and what it says of the vehicle speed's delay.

use super::constants::{FEWEST_BLOCKS, MOST_ROWS, SHORTEST_BLOCK_S, VEHICLE_STEP_S};
use super::recording::{Block, Recording, blocks, spans};
use super::squares::{Balance, Solution, best_vehicle_delay, recoloured, refine};

/// Unknowns: scale of the drag's impulse, delay in s, and second moment by which v is slower, s². The speed itself is never
/// filtered: that would only take its noise away.
struct Vehicle<'a> {
    runs: &'a [Recording],
    blocks: Vec<Block>,
    mass: f64,
    step: f64,
}

/// Seconds read ahead of a block, in which filters forget where they started.
const RUN_UP_S: f64 = 0.4;

impl Vehicle<'_> {
    fn series(&self, block: &Block, delay: f64, moment: f64) -> (Vec<f64>, Vec<f64>) {
        let run = &self.runs[block.run];
        let ahead = (RUN_UP_S / self.step) as usize;
        let start = block.start - ahead as f64 * self.step;
        let count = block.count + ahead;
        let impulse = run
            .drag
            .signal
            .levels_later((start, self.step, count), delay, moment);
        let speed = run.speed.signal.means(start, self.step, count);
        (speed[ahead..].to_vec(), impulse[ahead..].to_vec())
    }
}

impl Balance for Vehicle<'_> {
    fn residual(&self, unknowns: &[f64]) -> Vec<Vec<f64>> {
        let scale = unknowns[0] / self.mass;
        self.blocks
            .iter()
            .map(|block| {
                let (speed, impulse) = self.series(block, unknowns[1], unknowns[2]);
                let zero = impulse.first().copied().unwrap_or(0.0);
                speed
                    .iter()
                    .zip(&impulse)
                    .map(|(v, i)| v + scale * (i - zero))
                    .collect()
            })
            .collect()
    }

    fn instrument(&self, _: &[f64], _: &[f64]) -> Option<Vec<Vec<f64>>> {
        None
    }

    fn own(&self, _: &[f64]) -> Vec<Vec<Vec<f64>>> {
        parabolas(&self.blocks)
    }

    fn steps(&self) -> Vec<f64> {
        vec![1e-3, 1e-3, 1e-4]
    }

    fn prior(&self) -> Vec<(f64, f64)> {
        vec![(1.0, 1.0), (0.0, f64::INFINITY), (0.0, 0.02)]
    }
}

/// A parabola over each block, as columns.
pub(super) fn parabolas(blocks: &[Block]) -> Vec<Vec<Vec<f64>>> {
    blocks.iter().map(|block| powers(block.count, 3)).collect()
}

/// Powers 0, 1, ... of time over a block, scaled to -1..1.
pub(super) fn powers(count: usize, how_many: i32) -> Vec<Vec<f64>> {
    let half = 0.5 * count.max(2) as f64;
    (0..how_many)
        .map(|power| {
            (0..count)
                .map(|k| ((k as f64 - half) / half).powi(power))
                .collect()
        })
        .collect()
}

/// Speeds of all stretches in which the vehicle moves, as means over steps of an even grid.
#[must_use]
pub fn speeds(runs: &[Recording], step: f64) -> Vec<Vec<f64>> {
    grids(runs, step)
        .map(|(run, (start, step, count))| run.speed.signal.means(start, step, count))
        .collect()
}

/// The same without the drag's impulse as the balance found it: what is left runs straight but for forces that are not the
/// drag's, and noise.
#[must_use]
pub fn free(runs: &[Recording], mass: f64, found: &Solution, step: f64) -> Vec<Vec<f64>> {
    let x = &found.unknowns;
    let scale = x[0] / mass;
    grids(runs, step)
        .zip(speeds(runs, step))
        .map(|((run, grid), speed)| {
            let impulse = run.drag.signal.levels_later(grid, x[1], x[2]);
            let both = speed.iter().zip(&impulse);
            both.map(|(v, i)| v + scale * i).collect()
        })
        .collect()
}

/// Even grids over the stretches in which the vehicle moves: the run, and start, step and number.
fn grids(runs: &[Recording], step: f64) -> impl Iterator<Item = (&Recording, (f64, f64, usize))> {
    let stretches = spans(runs).into_iter();
    stretches.map(move |(run, from, to)| {
        let count = ((to - from) / step) as usize;
        (&runs[run], (from + 0.5 * step, step, count))
    })
}

/// What the balance says: delay of v against the drag, and by what filter it is slower.
#[must_use]
pub fn vehicle(runs: &[Recording], mass: f64) -> Option<Solution> {
    let stretches = spans(runs);
    let whole: f64 = stretches.iter().map(|(_, a, b)| b - a).sum();
    let step = VEHICLE_STEP_S.max(whole / MOST_ROWS as f64);
    let balance = Vehicle {
        runs,
        blocks: blocks(
            &stretches,
            step,
            (0.05, 0.05),
            (FEWEST_BLOCKS, 5.0, SHORTEST_BLOCK_S),
        ),
        mass,
        step,
    };
    if balance.blocks.is_empty() || !(mass > 0.0) {
        return None;
    }
    // Coarsely: differences, and the scale as it comes.
    let from = |delay: f64| vec![1.0, delay, 0.0];
    let start = from(best_vehicle_delay(&balance, from, &[0.95])?);
    let at = refine(&balance, &start, &[0.95], 4, &[false, false, true])?;
    recoloured(&balance, at, &[false; 3])
}
