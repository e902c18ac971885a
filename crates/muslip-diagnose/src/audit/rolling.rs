//! A wheel that rolls as a clock and a ruler: where nothing brakes its speed is the vehicle's but for the radius, and which of
//! the two comes later shows wherever they change.

use core::ops::Range;

use super::constants::{
    FEWEST_BLOCKS, LEAST_DELAY_S, LEAST_SCALE, LONGEST_ROLLING_S, MOST_ROWS, ROLLING_EXPLAINED,
    ROLLING_NEAR, SHORTEST_BLOCK_S, SPREAD_FACTOR, TOLD_SIGMAS, UNKNOWN_DELAY_S, WHEEL_STEP_S,
};
use super::finding::{Finding, Timing, Word};
use super::recording::{Block, Recording, blocks};
use super::squares::{Balance, best_vehicle_delay, colour_of, recoloured, refine, rest};
use crate::campaign::Rig;
use crate::cleaning::stretches;
use crate::number::mean_and_std;
use crate::smooth::median_in_place;

/// What wheels that roll say.
#[derive(Clone, Debug, PartialEq)]
pub struct Rolling {
    /// By how much the vehicle speed is later than the wheel speed.
    pub vehicle_late: Timing,
    /// By run: vehicle speed over radius times wheel speed, with its standard deviation; none where too little of it moves.
    pub ratios: Vec<Option<Value>>,
}

/// A value and its standard deviation.
type Value = (f64, f64);

/// Pieces of a run that the uncertainty of its radius is judged by.
const PIECES: usize = 6;

/// Unknown: by how much the vehicle speed is later, s. Each stretch has a radius of its own.
struct Speeds<'a> {
    runs: &'a [Recording],
    blocks: Vec<Block>,
    step: f64,
}

impl Speeds<'_> {
    fn of_wheel(&self, block: &Block) -> Vec<f64> {
        let wheel = &self.runs[block.run].wheel.signal;
        wheel.means(block.start, self.step, block.count)
    }

    fn of_vehicle(&self, block: &Block, late: f64) -> Vec<f64> {
        let speed = &self.runs[block.run].speed.signal;
        speed.means(block.start + late, self.step, block.count)
    }

    /// Share of the squares of what moves in the vehicle speed that the wheel's explains.
    fn explained(&self, late: f64) -> f64 {
        let left: f64 = rest(self, &[late]).iter().flatten().map(|r| r * r).sum();
        let moved = |block: &Block| {
            let speed = self.of_vehicle(block, late);
            let mean = speed.iter().sum::<f64>() / speed.len() as f64;
            speed.iter().map(|v| (v - mean).powi(2)).sum::<f64>()
        };
        1.0 - left / self.blocks.iter().map(moved).sum::<f64>()
    }
}

impl Balance for Speeds<'_> {
    fn residual(&self, unknowns: &[f64]) -> Vec<Vec<f64>> {
        let blocks = self.blocks.iter();
        blocks
            .map(|block| self.of_vehicle(block, unknowns[0]))
            .collect()
    }

    fn instrument(&self, _: &[f64], _: &[f64]) -> Option<Vec<Vec<f64>>> {
        None
    }

    fn own(&self, _: &[f64]) -> Vec<Vec<Vec<f64>>> {
        let blocks = self.blocks.iter();
        blocks.map(|block| vec![self.of_wheel(block)]).collect()
    }

    fn steps(&self) -> Vec<f64> {
        vec![1e-3]
    }

    fn prior(&self) -> Vec<(f64, f64)> {
        vec![(0.0, f64::INFINITY)]
    }
}

/// Where a run's wheel rolls: where the ratio of its speeds is near its median.
fn rolls(run: &Recording) -> Vec<Range<usize>> {
    let ratio = |k: usize| run.speed.clean[k] / run.wheel.clean[k];
    let moving = || run.moving.iter().flat_map(Clone::clone);
    let mut ratios: Vec<f64> = moving().map(ratio).filter(|r| r.is_finite()).collect();
    if ratios.is_empty() {
        return Vec::new();
    }
    let median = median_in_place(&mut ratios);
    let mut near = vec![false; run.time.len()];
    for k in moving() {
        near[k] = (ratio(k) / median - 1.0).abs() < ROLLING_NEAR;
    }
    let starts = run.moving.iter().map(|m| m.start);
    let mut breaks = vec![false; run.time.len()];
    starts.for_each(|start| breaks[start] = true);
    stretches(|k| near[k], &breaks, 20)
}

/// By how much a run's vehicle speed is later. Slip that a driving wheel has goes slowly, noise quickly: both are weighed by
/// what the difference of the speeds looks like where it is least.
fn late(speeds: &Speeds<'_>) -> Option<Value> {
    let one = |delay: f64| vec![delay];
    let plain = best_vehicle_delay(speeds, one, &[])?;
    let colour = colour_of(speeds, &[plain]);
    let best = best_vehicle_delay(speeds, one, &colour)?;
    let at = refine(speeds, &[best], &colour, 4, &[false])?;
    let estimate = recoloured(speeds, at, &[false])?;
    let (value, std) = (estimate.unknowns[0], SPREAD_FACTOR * estimate.std[0]);
    (std < UNKNOWN_DELAY_S && speeds.explained(value) > ROLLING_EXPLAINED).then_some((value, std))
}

/// Vehicle speed over radius times wheel speed: the median of a run, and its standard deviation by those of its pieces.
fn ratio(rig: &Rig, run: &Recording) -> Option<Value> {
    let of = |k: usize| run.speed.clean[k] / (rig.radius_m * run.wheel.clean[k]);
    let moving = run.moving.iter().flat_map(Clone::clone);
    let mut ratios: Vec<f64> = moving.map(of).filter(|r| r.is_finite()).collect();
    if ratios.len() < 10 * PIECES {
        return None;
    }
    let pieces = ratios.chunks(ratios.len().div_ceil(PIECES));
    let medians: Vec<f64> = pieces
        .map(|piece| median_in_place(&mut piece.to_vec()))
        .collect();
    let std = SPREAD_FACTOR * mean_and_std(&medians).1 / (medians.len() as f64).sqrt();
    Some((median_in_place(&mut ratios), std))
}

/// Runs' figures as one, where each may have its own about a mean of all (DerSimonian and Laird 1986, Control. Clin. Trials 7).
fn together(runs: &[Value]) -> Option<Value> {
    let weighed = |between: f64| {
        let weight = |run: &Value| (run.1 * run.1 + between).max(1e-18).recip();
        let sum: f64 = runs.iter().map(weight).sum();
        let mean = runs.iter().map(|run| weight(run) * run.0).sum::<f64>() / sum;
        let squares: f64 = runs.iter().map(weight).map(|w| w * w).sum();
        let spread: f64 = runs
            .iter()
            .map(|run| weight(run) * (run.0 - mean).powi(2))
            .sum();
        (mean, sum, squares, spread)
    };
    let (_, sum, squares, spread) = weighed(0.0);
    let more = runs.len() as f64 - 1.0;
    let between = if more > 0.0 {
        ((spread - more) / (sum - squares / sum)).max(0.0)
    } else {
        0.0
    };
    let (mean, sum, ..) = weighed(between);
    (!runs.is_empty() && mean.is_finite()).then(|| (mean, sum.powf(-0.5)))
}

/// What the speeds say of recordings in which nothing brakes.
#[must_use]
pub fn rolling(rig: &Rig, runs: &[Recording]) -> Rolling {
    let spans: Vec<Vec<(usize, f64, f64)>> = (runs.iter().enumerate())
        .map(|(r, run)| {
            let rolls = rolls(run).into_iter();
            rolls
                .map(|m| (r, run.time[m.start], run.time[m.end - 1]))
                .collect()
        })
        .collect();
    let whole: f64 = spans.iter().flatten().map(|(_, a, b)| b - a).sum();
    let step = WHEEL_STEP_S.max(whole / MOST_ROWS as f64);
    let cut = (FEWEST_BLOCKS, LONGEST_ROLLING_S, SHORTEST_BLOCK_S);
    let clocks = spans.iter().filter_map(|own| {
        let blocks = blocks(own, step, (0.05, 0.05), cut);
        late(&Speeds { runs, blocks, step })
    });
    let late = together(&clocks.collect::<Vec<_>>());
    let late = late.filter(|(_, std)| *std < UNKNOWN_DELAY_S);
    Rolling {
        vehicle_late: late.map_or(Timing::UNKNOWN, |(value, std)| Timing { value, std }),
        ratios: runs.iter().map(|run| ratio(rig, run)).collect(),
    }
}

const VEHICLE: &str = "vehicle_speed_m_s";

fn of_vehicle(word: Word, value: Value, unit: &str) -> Finding {
    Finding {
        relative_to: "wheel_speed_rad_s".to_owned(),
        ..Finding::of(VEHICLE, word, value, unit)
    }
}

fn scale(rig: &Rig, ratio: Value) -> Finding {
    of_vehicle(Word::Scale, ratio, "1").saying(format!(
        "The channel {VEHICLE} reads {:.4} times the wheel's speed by the rig file's radius: the wheel rolls on {:.4} m instead \
         of {:.4} m, or one of the speeds is off by that factor.",
        ratio.0,
        ratio.0 * rig.radius_m,
        rig.radius_m
    ))
}

/// What is worth a sentence: a delay, a scale of all runs, and those of runs that differ from the others.
#[must_use]
pub fn findings(rig: &Rig, runs: &[Recording], rolling: &Rolling) -> Vec<Finding> {
    let mut out = Vec::new();
    let Timing { value, std } = rolling.vehicle_late;
    if std.is_finite() && value.abs() > LEAST_DELAY_S.max(TOLD_SIGMAS * std) {
        let how = if value > 0.0 { "later" } else { "earlier" };
        out.push(of_vehicle(Word::Late, (value, std), "s").saying(format!(
            "The channel {VEHICLE} is {:.0} ms {how} than the wheel's speed; the slip of a wheel that drives looks the same \
             and is in it.",
            1e3 * value.abs()
        )));
    }
    let mut known: Vec<f64> = rolling.ratios.iter().flatten().map(|r| r.0).collect();
    if known.is_empty() {
        return out;
    }
    let middle = median_in_place(&mut known);
    let off =
        |ratio: &Value, from: f64| (ratio.0 - from).abs() > LEAST_SCALE.max(TOLD_SIGMAS * ratio.1);
    let alike: Vec<Value> = (rolling.ratios.iter().flatten().copied())
        .filter(|ratio| !off(ratio, middle))
        .collect();
    let common = together(&alike).filter(|ratio| off(ratio, 1.0));
    out.extend(common.map(|ratio| scale(rig, ratio)));
    for (run, ratio) in runs.iter().zip(&rolling.ratios) {
        let own = ratio.filter(|ratio| off(ratio, middle));
        out.extend(own.map(|ratio| Finding {
            recording: run.name.clone(),
            ..scale(rig, ratio)
        }));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::recording::recording;
    use super::super::toy::white;
    use super::*;
    use crate::campaign::Run;

    const RADIUS: f64 = 0.35;

    fn rig() -> Rig {
        Rig {
            radius_m: RADIUS,
            wheel_inertia_kg_m2: 1.2,
            mass_kg: 1700.0,
            peak_friction: 1.0,
            critical_slip: 0.1,
            ..Rig::default()
        }
    }

    /// A vehicle that is driven about, its speed read late by so many s and so many times too much.
    fn drive(phase: f64, late: f64, scale: f64) -> Run {
        let mut white = white(7);
        let time: Vec<f64> = (0..6000).map(|k| f64::from(k) * 0.01).collect();
        let speed = |t: f64| 15.0 + 3.0 * (0.31 * t + phase).sin() + 0.8 * (1.7 * t).cos();
        let mut noise = |size: f64| size * white.next().unwrap();
        Run {
            name: format!("drive {phase}"),
            wheel_speed_rad_s: time
                .iter()
                .map(|t| speed(*t) / RADIUS + noise(0.03))
                .collect(),
            vehicle_speed_m_s: time
                .iter()
                .map(|t| scale * speed(t - late) + noise(0.03))
                .collect(),
            drag_force_n: time.iter().map(|_| noise(100.0)).collect(),
            normal_force_n: time.iter().map(|_| 16_677.0).collect(),
            time_s: time,
            ..Run::default()
        }
    }

    fn said(runs: &[Run]) -> (Rolling, Vec<Finding>) {
        let recordings: Vec<Recording> = runs.iter().map(|run| recording(&rig(), run)).collect();
        let rolling = rolling(&rig(), &recordings);
        let findings = findings(&rig(), &recordings, &rolling);
        (rolling, findings)
    }

    #[test]
    fn a_late_vehicle_speed_and_another_radius_are_found_where_nothing_brakes() {
        let (rolling, findings) = said(&[drive(0.0, 0.08, 1.008)]);
        let Timing { value, std } = rolling.vehicle_late;
        assert!((value - 0.08).abs() < 0.003 && std < 0.003, "{rolling:?}");
        let words: Vec<Word> = findings.iter().map(|f| f.finding).collect();
        assert_eq!(words, [Word::Late, Word::Scale]);
        assert!((findings[1].value - 1.008).abs() < 1e-3, "{findings:?}");
    }

    #[test]
    fn speeds_in_step_and_a_right_radius_say_nothing() {
        let (_, findings) = said(&[drive(0.0, 0.0, 1.0), drive(1.0, 0.0, 1.002)]);
        assert!(findings.is_empty(), "{findings:?}");
    }

    #[test]
    fn a_run_whose_speeds_disagree_is_told_by_itself() {
        let runs = [0.0, 1.0, 2.0, 3.0]
            .map(|phase| drive(phase, 0.0, if phase > 2.5 { 0.75 } else { 1.0 }));
        let (_, findings) = said(&runs);
        assert_eq!(findings.len(), 1, "{findings:?}");
        assert_eq!(findings[0].recording, "drive 3");
        assert!((findings[0].value - 0.75).abs() < 1e-3);
    }

    #[test]
    fn runs_of_equal_uncertainty_weigh_alike_and_their_spread_counts() {
        let equal = |values: &[f64]| {
            let runs: Vec<Value> = values.iter().map(|v| (*v, 0.001)).collect();
            together(&runs).unwrap()
        };
        let (mean, std) = equal(&[0.05, 0.05, 0.05]);
        assert!((mean - 0.05).abs() < 1e-12 && (std - 0.001 / 3f64.sqrt()).abs() < 1e-12);
        // The sample's own standard deviation over the root of three.
        let (mean, std) = equal(&[0.04, 0.05, 0.06]);
        assert!(
            (mean - 0.05).abs() < 1e-12 && (std - 0.01 / 3f64.sqrt()).abs() < 1e-12,
            "{std}"
        );
        assert_eq!(together(&[]), None);
    }
}
