//! Findings that one channel shows by itself: steps and holds.

use super::finding::{Finding, Word};
use super::recording::{Column, Recording};
use super::steps::step_of;
use crate::campaign::Run;
use crate::smooth::{difference_sigma, median_in_place};

/// Share of a channel's noise from which a step is worth a sentence.
const STEP_SHARE: f64 = 0.5;

fn quantised(name: &str, unit: &str, channels: &[&[f64]]) -> Option<Finding> {
    let steps: Vec<(f64, f64)> = channels
        .iter()
        .filter_map(|values| step_of(values))
        .collect();
    if 2 * steps.len() <= channels.len() {
        return None;
    }
    let mut values: Vec<f64> = steps.iter().map(|s| s.0).collect();
    let step = median_in_place(&mut values);
    let mut noises: Vec<f64> = channels
        .iter()
        .map(|values| difference_sigma(values))
        .collect();
    let agree = values
        .iter()
        .filter(|s| (*s / step - 1.0).abs() < 0.05)
        .count();
    let seen = 2 * agree > channels.len() && step > STEP_SHARE * median_in_place(&mut noises);
    seen.then(|| {
        Finding::of(name, Word::Quantised, (step, 0.01 * step), unit).saying(format!(
            "The channel {name} moves in steps of {step:.4} {unit}."
        ))
    })
}

fn held<'a>(name: &str, channels: impl Iterator<Item = &'a Column>) -> Option<Finding> {
    let channels: Vec<&Column> = channels.filter(|c| !c.clean.is_empty()).collect();
    let mut periods: Vec<f64> = channels
        .iter()
        .filter_map(|c| c.hold)
        .map(|h| h.period_s)
        .collect();
    if periods.is_empty() || 2 * periods.len() <= channels.len() {
        return None;
    }
    let period = median_in_place(&mut periods);
    let spread = periods
        .iter()
        .map(|p| (p - period).abs())
        .fold(0.0, f64::max)
        / periods.len() as f64;
    (spread < 0.1 * period).then(|| {
        Finding::of(name, Word::Held, (period, spread.max(0.005 * period)), "s").saying(format!(
            "The channel {name} is renewed every {:.2} ms only and held in between.",
            1e3 * period
        ))
    })
}

/// Steps and holds of all channels.
#[must_use]
pub fn simple(runs: &[Run], recordings: &[Recording]) -> Vec<Finding> {
    type Pick = fn(&Run) -> &Vec<f64>;
    let columns: [(&str, &str, Pick); 4] = [
        ("wheel_speed_rad_s", "rad/s", |run| &run.wheel_speed_rad_s),
        ("vehicle_speed_m_s", "m/s", |run| &run.vehicle_speed_m_s),
        ("drag_force_n", "N", |run| &run.drag_force_n),
        ("normal_force_n", "N", |run| &run.normal_force_n),
    ];
    let mut out: Vec<Finding> = columns
        .into_iter()
        .filter_map(|(name, unit, pick)| {
            let values: Vec<&[f64]> = runs.iter().map(|run| pick(run).as_slice()).collect();
            quantised(name, unit, &values)
        })
        .collect();
    out.extend(held(
        "wheel_speed_rad_s",
        recordings.iter().map(|run| &run.wheel),
    ));
    out.extend(held(
        "vehicle_speed_m_s",
        recordings.iter().map(|run| &run.speed),
    ));
    out
}
