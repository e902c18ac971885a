//! Filters: a channel that is not only later than the others but slower.

use super::constants::{FILTER_SIGMAS, LEAST_FILTER_S, POLE_SQUARES, TOLD_SIGMAS};
use super::finding::{Finding, Word};
use super::recording::Recording;
use super::timing::Timings;

fn passed(channel: &str, value: f64, std: f64) -> Finding {
    Finding::of(channel, Word::LowPassed, (value, std), "s").saying(format!(
        "The channel {channel} passes a low-pass filter whose time constants add up to {:.1} ms.",
        1e3 * value
    ))
}

/// A filter of the vehicle speed: its second moment is that of the filter. Where the whole delay is what such a filter
/// has, the delay tells the time constant better.
fn of_vehicle(timings: &Timings) -> Option<Finding> {
    let (moment, std) = timings.vehicle_moment?;
    let time = moment.max(0.0).sqrt();
    if !(moment > FILTER_SIGMAS * std && time > LEAST_FILTER_S) {
        return None;
    }
    let late = timings.vehicle;
    if late.std.is_finite() && (late.value - time).abs() < 0.2 * time + 2.0 * late.std {
        return Some(passed("vehicle_speed_m_s", late.value, late.std));
    }
    Some(passed(
        "vehicle_speed_m_s",
        time,
        (0.5 * std / time).max(0.1 * time),
    ))
}

/// A filter of the drag: behind a pole the law explains it much better than late by a delay, or following over a way.
fn of_drag(timings: &Timings) -> Option<Finding> {
    let pole = timings.drag_pole.as_ref()?;
    let (time, std) = pole.time;
    let told = time > LEAST_FILTER_S.max(TOLD_SIGMAS * std)
        && pole.better.iter().all(|squares| *squares > POLE_SQUARES);
    told.then(|| passed("drag_force_n", time, std.max(0.05 * time)))
}

/// Filters of the vehicle speed and of the drag.
#[must_use]
pub fn filters(timings: &Timings, runs: &[Recording]) -> Vec<Finding> {
    // A hold is a kernel of its own.
    let held = runs.iter().any(|run| run.speed.is_coarse());
    of_vehicle(timings)
        .filter(|_| !held)
        .into_iter()
        .chain(of_drag(timings))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::finding::Timing;
    use super::super::law::Pole;
    use super::*;

    #[test]
    fn a_filter_is_told_by_its_second_moment() {
        let late = |value: f64| Timing { value, std: 1e-3 };
        let mut timings = Timings {
            vehicle: late(0.05),
            vehicle_moment: Some((2.4e-3, 1e-4)),
            ..Timings::default()
        };
        assert!((filters(&timings, &[])[0].value - 0.05).abs() < 1e-9);
        timings.vehicle_moment = Some((1e-4, 1e-4));
        assert!(filters(&timings, &[]).is_empty());
        let pole = |better: [f64; 2]| Timings {
            drag_pole: Some(Pole {
                time: (0.02, 1e-3),
                better,
            }),
            ..Timings::default()
        };
        let found = filters(&pole([900.0, 400.0]), &[]);
        assert!(found[0].channel == "drag_force_n" && (found[0].value - 0.02).abs() < 1e-9);
        // A delay, or a tyre, explains it as well.
        assert!(filters(&pole([1.0, 400.0]), &[]).is_empty());
        assert!(filters(&pole([900.0, -30.0]), &[]).is_empty());
    }
}
