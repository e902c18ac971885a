//! Noise with a memory, read off what a balance leaves.

use super::constants::{COLOURED_SHARE, LASTING_SHARE, LONGEST_COLOUR_S, OWN_LAG_S};
use super::finding::{Finding, Word};
use super::line;
use super::recording::Recording;
use super::structure::{Memory, Pair, Structure, structure};
use super::tyre::Stretch;
use crate::smooth::median_in_place;

/// Noise that forgets exponentially.
#[derive(Clone, Copy, Debug)]
pub struct Colour {
    /// Standard deviation, in the channel's unit.
    pub std: f64,
    /// Time constant in s.
    pub time: f64,
}

/// The part of residuals that lasts longer than two steps, where it is most of them.
#[must_use]
pub fn coloured(residual: &[Vec<f64>], step: f64) -> Option<Colour> {
    let most = (0.25 / step) as usize;
    let covariance = |lag: usize| -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for block in residual.iter().filter(|b| b.len() > 2 * most) {
            sum += block
                .iter()
                .zip(&block[lag..])
                .map(|(a, b)| a * b)
                .sum::<f64>();
            count += (block.len() - lag) as f64;
        }
        sum / f64::max(count, 1.0)
    };
    let whole = covariance(0);
    let (near, far) = (covariance(2), covariance(6));
    if !(near > 0.0 && far > 0.0 && far < near && whole > 0.0) {
        return None;
    }
    // An exponential through two lags.
    let time = 4.0 * step / (near / far).ln();
    let variance = near * (2.0 * step / time).exp();
    (variance > COLOURED_SHARE * whole && time < LONGEST_COLOUR_S && time > 4.0 * step).then(|| {
        Colour {
            std: variance.min(whole).sqrt(),
            time,
        }
    })
}

/// The vehicle speed's coloured noise, and what is said of it.
#[must_use]
pub fn of_vehicle(residual: &[Vec<f64>], step: f64, white: f64) -> Option<(Finding, Colour)> {
    let colour = coloured(residual, step)?;
    let Colour { std, time } = colour;
    let blocks = residual.iter().map(|b| b.len() as f64 * step).sum::<f64>() / time;
    (std > white && blocks > 40.0).then(|| {
        let finding = Finding::of("vehicle_speed_m_s", Word::ColouredNoise, (std, std / (0.5 * blocks).sqrt()), "m/s").saying(format!(
            "The noise of the vehicle speed has a slow part of {std:.4} m/s with a time constant of {time:.2} s."
        ));
        (finding, colour)
    })
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

fn lasting(memory: Memory) -> Option<Memory> {
    (memory.is_sure()
        && memory.variance.sqrt() > LASTING_SHARE * memory.white.max(0.0).sqrt()
        && memory.time < LONGEST_COLOUR_S)
        .then_some(memory)
}

/// Slow noise of a vehicle speed that a rig holds: whatever of it does not run straight.
#[must_use]
pub fn of_held(runs: &[Recording]) -> Option<(Finding, Colour)> {
    let mut steps: Vec<f64> = runs.iter().map(|run| run.step).collect();
    let step = SPEED_STEP_S.max(median_in_place(&mut steps));
    let mut pairs = Vec::new();
    for run in runs {
        for moving in &run.moving {
            let span = run.time[moving.end - 1] - run.time[moving.start];
            let count = (span / step) as usize;
            let speed = run
                .speed
                .signal
                .means(run.time[moving.start] + 0.5 * step, step, count);
            pairs.push(Pair {
                b: speed.clone(),
                factor: vec![1.0; count],
                levels: Vec::new(),
                a: speed,
            });
        }
    }
    let memory = lasting(structure(&pairs, step, (SHORTEST_LAG, OWN_LAG_S)).memory(true)?)?;
    let colour = Colour {
        std: memory.size().0,
        time: memory.time,
    };
    let finding = sentence("vehicle_speed_m_s", "vehicle speed", "m/s", &memory);
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
    let all = structure(&pairs, step, (SHORTEST_LAG, OWN_LAG_S));
    let memory = lasting(all.memory(true)?)?;
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

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(keep: f64) -> Vec<f64> {
        let (mut state, mut x) = (7u64, 0.0);
        (0..20_000)
            .map(|_| {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                x = keep * x + ((state >> 11) as f64 / (1u64 << 53) as f64 - 0.5);
                x
            })
            .collect()
    }

    #[test]
    fn coloured_noise_has_its_size_and_time_and_white_noise_none() {
        assert!(coloured(&[noise(0.0)], 0.01).is_none());
        let keep = (-0.1f64).exp();
        let Colour { std, time } = coloured(&[noise(keep)], 0.01).unwrap();
        let expected = (1.0 / 12.0 / (1.0 - keep * keep)).sqrt();
        assert!(
            (std / expected - 1.0).abs() < 0.1 && (time - 0.1).abs() < 0.02,
            "{std} {time}"
        );
        assert!(coloured(&[], 0.01).is_none());
    }
}
