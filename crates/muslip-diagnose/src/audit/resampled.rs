//! Channels that were measured at other times than the recording's, as whoever read them says: the readings in between are drawn, not measured.

use core::f64::consts::TAU;

use super::finding::{Finding, Word};
use crate::campaign::{How, Resampled, Run};

/// Two recordings' intervals within this share of each other are one statement.
const SAME_SHARE: f64 = 0.05;

/// What the reading of the recordings says of their channels: one entry for all of them where it is the same in all.
#[must_use]
pub fn findings(runs: &[Run]) -> Vec<Finding> {
    let mut columns: Vec<&str> = Vec::new();
    for one in runs.iter().flat_map(|run| &run.resampled) {
        if !columns.contains(&one.column.as_str()) {
            columns.push(&one.column);
        }
    }
    columns
        .into_iter()
        .flat_map(|column| of_column(column, runs))
        .collect()
}

fn of_column(column: &str, runs: &[Run]) -> Vec<Finding> {
    let in_run = |run: &'_ Run| {
        run.resampled
            .iter()
            .find(|one| one.column == column)
            .cloned()
    };
    let all: Option<Vec<Resampled>> = runs.iter().map(in_run).collect();
    if let Some((first, others)) = all.as_deref().and_then(<[Resampled]>::split_first) {
        let alike = |one: &Resampled| {
            one.how == first.how && (one.interval_s / first.interval_s - 1.0).abs() < SAME_SHARE
        };
        if others.iter().all(alike) {
            return vec![finding(first)];
        }
    }
    runs.iter()
        .filter_map(|run| {
            Some(Finding {
                recording: run.name.clone(),
                ..finding(&in_run(run)?)
            })
        })
        .collect()
}

/// Three digits behind the point at most.
fn rounded(value: f64) -> f64 {
    (1e3 * value).round() / 1e3
}

fn finding(one: &Resampled) -> Finding {
    let Resampled {
        column, interval_s, ..
    } = one;
    let ms = rounded(1e3 * interval_s);
    let (word, value, statement) = match one.how {
        How::Interpolated => (
            Word::Held,
            *interval_s,
            format!(
                "The channel {column} was measured every {ms} ms only; what stands between its readings are straight lines, no measurements."
            ),
        ),
        How::Held => (
            Word::Held,
            *interval_s,
            format!(
                "The channel {column} was measured every {ms} ms only; its last reading is held in between."
            ),
        ),
        How::Decimated { edge_hz } => (
            Word::LowPassed,
            1.0 / (TAU * edge_hz),
            format!(
                "The channel {column} was measured every {ms} ms and low-passed at {} Hz, without delay, before it was thinned to the recording's times.",
                rounded(edge_hz)
            ),
        ),
    };
    Finding::of(column, word, (value, 0.0), "s").saying(statement)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(name: &str, resampled: &[(&str, f64, How)]) -> Run {
        let one = |&(column, interval_s, how): &(&str, f64, How)| Resampled {
            column: column.to_owned(),
            interval_s,
            how,
        };
        Run {
            name: name.to_owned(),
            resampled: resampled.iter().map(one).collect(),
            ..Run::default()
        }
    }

    #[test]
    fn what_is_the_same_in_all_recordings_is_said_once() {
        let slow = ("vehicle_speed_m_s", 0.1, How::Interpolated);
        let fast = ("drag_force_n", 1e-4, How::Decimated { edge_hz: 40.0 });
        let found = findings(&[run("a", &[slow]), run("b", &[slow, fast])]);
        let told: Vec<(&str, &str, Word)> = found
            .iter()
            .map(|f| (f.recording.as_str(), f.channel.as_str(), f.finding))
            .collect();
        assert_eq!(
            told,
            [
                ("*", "vehicle_speed_m_s", Word::Held),
                ("b", "drag_force_n", Word::LowPassed)
            ]
        );
        assert_eq!(found[0].value, 0.1);
        assert!((found[1].value - 1.0 / (TAU * 40.0)).abs() < 1e-12);
        let other = ("vehicle_speed_m_s", 0.2, How::Interpolated);
        assert_eq!(findings(&[run("a", &[slow]), run("b", &[other])]).len(), 2);
        assert!(findings(&[run("a", &[])]).is_empty());
    }
}
