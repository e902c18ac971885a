//! What the drag channel reads while nothing moves: its zero.

use super::constants::TOLD_SIGMAS;
use super::finding::{Finding, Word};
use super::recording::Recording;

/// Fewest samples at a standstill.
const STILL_SAMPLES: usize = 20;

/// Mean drag of a run at a standstill, N, and its standard deviation.
fn zero_of(run: &Recording) -> Option<(f64, f64)> {
    let top = run
        .speed
        .clean
        .iter()
        .copied()
        .filter(|v| v.is_finite())
        .fold(0.0, f64::max);
    let turning = run
        .wheel
        .clean
        .iter()
        .copied()
        .filter(|v| v.is_finite())
        .fold(0.0, f64::max);
    let still: Vec<f64> = (0..run.time.len())
        .filter(|&k| {
            let calm = |c: &[f64], most: f64| c.get(k).is_some_and(|x| x.abs() < 0.01 * most);
            calm(&run.speed.clean, top) && calm(&run.wheel.clean, turning)
        })
        .filter_map(|k| run.drag.clean.get(k).copied().filter(|f| f.is_finite()))
        .collect();
    if still.len() < STILL_SAMPLES {
        return None;
    }
    let count = still.len() as f64;
    let mean = still.iter().sum::<f64>() / count;
    // Ten pieces, so that a colour of the noise counts.
    let pieces: Vec<f64> = still
        .chunks(still.len().div_ceil(10))
        .map(|c| c.iter().sum::<f64>() / c.len() as f64)
        .collect();
    let spread = pieces.iter().map(|p| (p - mean).powi(2)).sum::<f64>()
        / (pieces.len() as f64 - 1.0).max(1.0);
    Some((mean, (spread / pieces.len() as f64).sqrt()))
}

/// The drag channel's zero, where it is off.
#[must_use]
pub fn zero(runs: &[Recording]) -> Option<Finding> {
    let zeros: Vec<(f64, f64)> = runs.iter().filter_map(zero_of).collect();
    if zeros.is_empty() {
        return None;
    }
    let count = zeros.len() as f64;
    let mean = zeros.iter().map(|z| z.0).sum::<f64>() / count;
    let within = zeros.iter().map(|z| z.1 * z.1).sum::<f64>() / count / count;
    let between =
        zeros.iter().map(|z| (z.0 - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0) / count;
    let std = within.max(between).sqrt();
    (mean.abs() > TOLD_SIGMAS * std && std > 0.0).then(|| {
        Finding::of("drag_force_n", Word::Zero, (mean, std), "N").saying(format!(
            "The drag channel reads {mean:.2} N at a standstill."
        ))
    })
}
