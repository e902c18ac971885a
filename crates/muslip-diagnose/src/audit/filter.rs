//! Filters: a channel that is not only later than the others but slower.

use super::constants::{FILTER_SIGMAS, LEAST_FILTER_S};
use super::finding::{Finding, Timing, Word};
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

/// A filter of the drag: everything else is early by the same, and the vehicle speed, where it shows, the quicker by
/// what a filter of that delay makes.
fn of_drag(timings: &Timings) -> Option<Finding> {
    let early: Vec<Timing> = [timings.wheel, timings.vehicle, timings.brake]
        .into_iter()
        .filter(|t| t.std.is_finite())
        .collect();
    let sure = |t: &&Timing| -t.value > LEAST_FILTER_S.max(3.0 * t.std);
    if early.len() < 2 || early.iter().filter(sure).count() < early.len() {
        return None;
    }
    let all = early.iter().copied().fold(Timing::UNKNOWN, Timing::with);
    let apart = early
        .iter()
        .any(|t| (t.value - all.value).abs() > 2.0 * t.std + 0.1 * all.value.abs());
    let quicker = timings
        .vehicle_moment
        .is_none_or(|(moment, std)| moment < -FILTER_SIGMAS * std);
    (!apart && quicker).then(|| {
        passed(
            "drag_force_n",
            -all.value,
            all.std.max(0.05 * all.value.abs()),
        )
    })
}

/// Filters of the vehicle speed and of the drag.
#[must_use]
pub fn filters(timings: &Timings, runs: &[Recording]) -> Vec<Finding> {
    // A hold is a kernel of its own.
    let held = runs.iter().any(|run| run.speed.hold.is_some());
    of_vehicle(timings)
        .filter(|_| !held)
        .into_iter()
        .chain(of_drag(timings))
        .collect()
}

#[cfg(test)]
mod tests {
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
        timings = Timings {
            wheel: late(-0.02),
            brake: late(-0.0205),
            ..Timings::default()
        };
        let found = filters(&timings, &[]);
        assert!(found[0].channel == "drag_force_n" && (found[0].value - 0.02).abs() < 1e-3);
    }
}
