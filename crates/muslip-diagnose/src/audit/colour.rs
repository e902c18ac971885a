//! Noise with a memory, read off what a balance leaves.

use super::constants::{LASTING_SHARE, LONGEST_COLOUR_S, OWN_LAG_S};
use super::finding::{Finding, Word};
use super::line;
use super::recording::Recording;
use super::structure::{Memory, Pair, Structure, structure};
use super::timing::Timings;
use super::tyre::Stretch;
use super::vehicle;
use crate::campaign::Rig;
use crate::smooth::median_in_place;

/// Noise that forgets exponentially.
#[derive(Clone, Copy, Debug)]
pub struct Colour {
    /// Standard deviation, in the channel's unit.
    pub std: f64,
    /// Time constant in s.
    pub time: f64,
}

/// Shortest lag of a channel's own memory, in steps of the grid: means over steps share readings with their neighbours.
const SHORTEST_LAG: usize = 2;
/// Step of the grid on which a held vehicle's speed is looked at, s.
const SPEED_STEP_S: f64 = 0.01;
/// Share of a run's blocks that are its calm ones.
const CALM_SHARE: f64 = 0.4;
/// How far around a moment has to be calm, s.
const CALM_S: f64 = 0.2;
/// Time on either side over which the drag's change is taken, s.
const CHANGE_S: f64 = 0.015;
/// Least share of the noise that calm blocks must have; as much more they may have.
const CALM_RATIO: f64 = 0.5;
/// Share of the noise's variance that may turn with the wheel.
const LOCKED_SHARE: f64 = 0.2;

fn sentence(channel: &str, of: &str, unit: &str, memory: &Memory) -> Finding {
    let (size, std) = memory.size();
    Finding::of(
        channel,
        Word::ColouredNoise,
        (size, std.max(0.03 * size)),
        unit,
    )
    .saying(format!(
        "The noise of the {of} has a slow part of {size:.4} {unit} with a time constant of {:.2} s.",
        memory.time
    ))
}

/// Whether what lasts is large enough beside the white noise to be worth a sentence.
fn lasts(memory: &Memory) -> bool {
    memory.is_sure()
        && memory.variance.sqrt() > LASTING_SHARE * memory.white.max(0.0).sqrt()
        && memory.time < LONGEST_COLOUR_S
}

/// Slow noise of the vehicle speed: whatever of it does not run straight, the drag's impulse taken out where it coasts;
/// what is said of it where it is worth a sentence, and the noise itself.
#[must_use]
pub fn of_speed(
    rig: &Rig,
    runs: &[Recording],
    timings: &Timings,
) -> Option<(Option<Finding>, Colour)> {
    let mut steps: Vec<f64> = runs.iter().map(|run| run.step).collect();
    let step = SPEED_STEP_S.max(median_in_place(&mut steps));
    let free = if rig.coasting {
        vehicle::free(runs, rig.mass_kg, timings.estimates[0].as_ref()?, step)
    } else {
        vehicle::speeds(runs, step)
    };
    let pairs: Vec<Pair> = free
        .into_iter()
        .map(|speed| Pair {
            b: speed.clone(),
            factor: vec![1.0; speed.len()],
            levels: Vec::new(),
            a: speed,
        })
        .collect();
    let memory = structure(&pairs, (step, step), (SHORTEST_LAG, OWN_LAG_S)).memory(true)?;
    if !(memory.is_sure() && memory.time < LONGEST_COLOUR_S) {
        return None;
    }
    let colour = Colour {
        std: memory.size().0,
        time: memory.time,
    };
    let finding =
        lasts(&memory).then(|| sentence("vehicle_speed_m_s", "vehicle speed", "m/s", &memory));
    Some((finding, colour))
}

/// Slow noise of the drag: what it leaves beside the law and beside the wheel's balance alike; where no brake is known, what it
/// leaves beside the law as much while there is little force as while there is much.
#[must_use]
pub fn of_drag(left: &[Stretch], step: f64) -> Option<Finding> {
    let both = !left.is_empty() && left.iter().all(|s| !s.wheel.is_empty());
    let reach = (CALM_S / step) as usize;
    let pairs: Vec<Pair> = left
        .iter()
        .map(|s| {
            let force: Vec<f64> = s.drag.iter().map(|f| f.abs()).collect();
            let beside = (CHANGE_S / step).ceil() as usize;
            let change: Vec<f64> = (0..s.drag.len())
                .map(|k| {
                    let at =
                        |k: usize| s.drag[k.min(s.drag.len() - 1)] - s.law[k.min(s.drag.len() - 1)];
                    (at(k + beside) - at(k.saturating_sub(beside))).abs()
                })
                .collect();
            Pair {
                a: s.law.clone(),
                b: if both { s.wheel.clone() } else { s.law.clone() },
                factor: vec![1.0; s.law.len()],
                levels: vec![highest(&force, reach), highest(&change, reach)],
            }
        })
        .collect();
    let all = structure(&pairs, (step, step), (SHORTEST_LAG, OWN_LAG_S));
    let memory = all.memory(true).filter(lasts)?;
    // What is smoother than noise is a motion; what turns with the wheel is its run-out.
    if !(memory.white > 0.0) || line::locked(left, step) > LOCKED_SHARE * memory.variance {
        return None;
    }
    // Physics grows with the force, a lag with its change.
    let at = memory.time.clamp(2.0 * step, CALM_S);
    let size = |s: &Structure| s.at(at) - 3.0 * memory.white;
    let whole = size(&all);
    let same = |ranking: usize| {
        let share = size(&all.calmest(ranking, CALM_SHARE)) / whole;
        (CALM_RATIO..1.0 / CALM_RATIO).contains(&share)
    };
    (same(0) && same(1)).then(|| sentence("drag_force_n", "drag", "N", &memory))
}

/// Highest of the values within so many on either side.
fn highest(values: &[f64], reach: usize) -> Vec<f64> {
    (0..values.len())
        .map(|k| {
            values[k.saturating_sub(reach)..(k + reach + 1).min(values.len())]
                .iter()
                .copied()
                .fold(0.0, f64::max)
        })
        .collect()
}
