//! What the drag channel reads while nothing moves: its zero.

use super::constants::{TOLD_SIGMAS, ZERO_ALONE_SIGMAS, ZERO_LAW_FACTOR, ZERO_SHARE};
use super::finding::{Finding, Word};
use super::recording::Recording;
use super::tyre::{Fitted, Stretch};

/// Fewest samples at a standstill.
const STILL_SAMPLES: usize = 20;

/// Mean drag of a run at a standstill, N, and its standard deviation.
fn zero_of(run: &Recording) -> Option<(f64, f64)> {
    let largest = |values: &[f64]| {
        let known = values.iter().copied().filter(|v| v.is_finite());
        known.fold(0.0, f64::max)
    };
    let (top, turning) = (largest(&run.speed.clean), largest(&run.wheel.clean));
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

/// Mean of what the drag leaves beside the wheel's balance, the brake's share taken out, with its standard deviation.
fn intercept(left: &[Stretch]) -> Option<(f64, f64)> {
    if left.is_empty() || left.iter().any(|s| s.wheel.is_empty()) {
        return None;
    }
    // Each stretch for itself: intercept of a straight line over the drag.
    let mut zeros: Vec<f64> = Vec::new();
    for stretch in left {
        for (drag, rest) in stretch
            .drag
            .chunks(stretch.drag.len().div_ceil(3))
            .zip(stretch.wheel.chunks(stretch.drag.len().div_ceil(3)))
        {
            if drag.len() >= STILL_SAMPLES {
                zeros.push(rest.iter().sum::<f64>() / rest.len() as f64);
            }
        }
    }
    let count = zeros.len() as f64;
    let mean = zeros.iter().sum::<f64>() / count;
    let spread = zeros.iter().map(|z| (z - mean).powi(2)).sum::<f64>();
    (count > 3.0).then(|| (mean, (spread / (count - 1.0) / count).sqrt()))
}

/// The drag channel's zero without a standstill: the law's symmetry and the wheel's balance have to tell the same one.
#[must_use]
pub fn zero_of_law(fitted: &Fitted, left: &[Stretch]) -> Option<Finding> {
    let (law, law_std) = (fitted.unknowns[3], ZERO_LAW_FACTOR * fitted.std[3]);
    let (value, std) = if let Some((wheel, wheel_std)) = intercept(left) {
        let agree = (law - wheel).abs() < ZERO_SHARE * law.abs().max(wheel.abs());
        let (a, b) = (law_std.powi(-2), wheel_std.powi(-2));
        let sure = law.abs() > TOLD_SIGMAS * law_std && wheel.abs() > TOLD_SIGMAS * wheel_std;
        if !(agree && sure) {
            return None;
        }
        (
            (a * law + b * wheel) / (a + b),
            (a + b).powf(-0.5).max(0.5 * (law - wheel).abs()),
        )
    } else if law.abs() > ZERO_ALONE_SIGMAS * law_std {
        (law, law_std)
    } else {
        return None;
    };
    (std > 0.0).then(|| {
        Finding::of("drag_force_n", Word::Zero, (value, std), "N").saying(format!(
            "The drag channel reads {value:.2} N where tyre and wheel have none."
        ))
    })
}
