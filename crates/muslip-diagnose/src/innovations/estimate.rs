//! Sizes of the noise's parts by restricted maximum likelihood.

use super::gram::{Columns, grams, solve, total};
use super::noise::BalanceParts;
use crate::data::Data;

/// Prior standard deviation of a part's log size about where it starts: wide, so that a part that the data say
/// nothing of stays plausible.
const PRIOR: f64 = 3.0;
/// First step along a log size.
const STEP: f64 = 0.7;
/// Smallest log size below the start that is tried.
const LEAST: f64 = -7.0;
const MOST: f64 = 7.0;

/// Negative restricted log likelihood of the balance under these parts, all but the first column fitted.
#[must_use]
pub fn loss(
    data: &Data,
    parts: &BalanceParts,
    columns: &[Columns],
    precision: &dyn Fn(usize) -> f64,
    stride: usize,
) -> f64 {
    let sum = total(&grams(data, parts, columns, stride));
    if sum.count == 0 {
        return 0.0;
    }
    let chosen: Vec<usize> = (1..sum.products.nrows()).collect();
    match solve(&sum.products, &chosen, precision) {
        Some(solved) => 0.5 * (sum.log_variance + solved.rss + solved.log_det),
        None => f64::INFINITY,
    }
}

/// Minus the logarithm of the prior of the parts' sizes.
#[must_use]
pub fn penalty(parts: &BalanceParts) -> f64 {
    parts
        .sources
        .iter()
        .map(|s| 0.5 * ((s.log_std - s.log_start) / PRIOR).powi(2))
        .sum()
}

/// Fits the log sizes of all parts, one after the other by parabolas, `sweeps` times.
pub fn fit(
    data: &Data,
    parts: &mut BalanceParts,
    columns: &[Columns],
    precision: &dyn Fn(usize) -> f64,
    stride: usize,
    sweeps: usize,
) -> f64 {
    let start: Vec<f64> = parts.sources.iter().map(|s| s.log_start).collect();
    let value =
        |parts: &BalanceParts| loss(data, parts, columns, precision, stride) + penalty(parts);
    let mut best = value(parts);
    let mut step = vec![STEP; start.len()];
    for _ in 0..sweeps {
        let before = best;
        for i in 0..start.len() {
            if step[i] < 0.08 {
                continue;
            }
            let here = parts.sources[i].log_std;
            let mut at = |x: f64| {
                parts.sources[i].log_std = x.clamp(start[i] + LEAST, start[i] + MOST);
                value(parts)
            };
            let (h, up, down) = (step[i], at(here + step[i]), at(here - step[i]));
            let curvature = up + down - 2.0 * best;
            let move_by = if curvature > 1e-9 {
                (0.5 * h * (down - up) / curvature).clamp(-5.0 * h, 5.0 * h)
            } else if up < down {
                2.0 * h
            } else {
                -2.0 * h
            };
            let there = at(here + move_by);
            let (value, x) = [
                (best, here),
                (up, here + h),
                (down, here - h),
                (there, here + move_by),
            ]
            .into_iter()
            .fold((f64::INFINITY, here), |a, b| if b.0 < a.0 { b } else { a });
            parts.sources[i].log_std = x.clamp(start[i] + LEAST, start[i] + MOST);
            best = value;
            step[i] = if (x - here).abs() < 0.3 * h {
                0.4 * h
            } else {
                h
            };
        }
        if before - best < 0.5 {
            break;
        }
    }
    best
}
