//! What the report of a diagnosis shows of the recordings themselves, and the figures of it.
//!
//! The engine's outcome holds models and thinned traces; the recordings are given up to it. What a page needs
//! of them beyond that is kept here, bounded: a selection of the speeds, for the map over slip and speed, and
//! short recordings, to run the repaired model with and without each mechanism.

use std::collections::BTreeMap;

use muslip_diagnose::campaign::Run;
use muslip_diagnose::outcome::{Diagnosis, Trace};

use super::effects::{Effect, effects};
use crate::axis::Axis;
use crate::figure::{Cells, Figure, Ink, Shape};

/// Rows of all recordings together that are kept for pictures of effects.
const MOST_ROWS: usize = 300_000;
/// Speeds that are kept of a recording.
const MOST_SPEEDS: usize = 4000;
/// Columns and rows of the map over slip and speed.
const MAP: (usize, usize) = (16, 10);
/// Columns of the map over time.
const TIMES: usize = 60;
/// Most recordings of the map over time.
const MOST_RECORDINGS: usize = 60;
/// Fewest points of a cell that is coloured.
const FEWEST: usize = 5;

/// What is kept of the recordings while the engine works on them.
#[derive(Debug, Clone, Default)]
pub struct Kept {
    /// Times in s and vehicle speeds in m/s, a selection, by recording.
    speeds: BTreeMap<String, Vec<(f64, f64)>>,
    /// Recordings, as many as are short enough.
    runs: Vec<Run>,
}

impl Kept {
    /// Keeps what a page may need.
    #[must_use]
    pub fn of(runs: &[Run]) -> Self {
        let mut room = MOST_ROWS;
        let mut kept = Self::default();
        for run in runs {
            let stride = run.len().div_ceil(MOST_SPEEDS).max(1);
            let speeds = run.time_s.iter().zip(&run.vehicle_speed_m_s);
            let speeds = speeds.step_by(stride).map(|(time, speed)| (*time, *speed));
            kept.speeds.insert(run.name.clone(), speeds.collect());
            if let Some(left) = room.checked_sub(run.len()) {
                room = left;
                kept.runs.push(run.clone());
            }
        }
        kept
    }
}

/// What is shown of the recordings.
#[derive(Debug, Clone, Default)]
pub struct Views {
    /// Vehicle speed in m/s at the times of each trace, by recording.
    speeds: BTreeMap<String, Vec<f64>>,
    /// Pictures of effects, by the mechanism's id.
    effects: Vec<Effect>,
}

impl Views {
    /// What the page of this diagnosis shows of its recordings.
    #[must_use]
    pub fn of(diagnosis: &Diagnosis, kept: &Kept) -> Self {
        let speeds = diagnosis
            .traces
            .iter()
            .filter_map(|trace| {
                let speeds = kept.speeds.get(&trace.recording)?;
                let speeds = trace.time_s.iter().map(|time| speed_at(speeds, *time));
                Some((trace.recording.clone(), speeds.collect()))
            })
            .collect();
        let effects = effects(diagnosis, &kept.runs);
        Self { speeds, effects }
    }

    /// The pictures of a mechanism's effect, where there are any.
    #[must_use]
    pub fn effect(&self, id: &str) -> &[Figure] {
        let effect = self.effects.iter().find(|effect| effect.id == id);
        effect.map_or(&[], |effect| &effect.figures)
    }

    /// Mean residuals over slip and speed, before and after the repair, in the same colours.
    #[must_use]
    pub fn over_slip_and_speed(&self, diagnosis: &Diagnosis) -> Vec<Figure> {
        let points: Vec<Point> = diagnosis
            .traces
            .iter()
            .filter_map(|trace| Some((trace, self.speeds.get(&trace.recording)?)))
            .flat_map(|(trace, speeds)| {
                residuals(trace).zip(trace.slip.iter().zip(speeds)).map(
                    |((before, after), (&slip, &speed))| Point {
                        at: (slip, speed),
                        before,
                        after,
                    },
                )
            })
            .collect();
        let Some((along, up)) = edges(points.iter().map(|p| p.at.0), MAP.0)
            .zip(edges(points.iter().map(|p| p.at.1), MAP.1))
        else {
            return Vec::new();
        };
        maps(
            &points,
            along,
            up,
            "over slip and vehicle speed",
            [Axis::new("slip"), Axis::new("vehicle speed (m/s)")],
            "slip-and-speed",
        )
    }

    /// Mean residuals over time, a row a recording, before and after the repair.
    #[must_use]
    pub fn over_time(diagnosis: &Diagnosis) -> Vec<Figure> {
        let traces = diagnosis
            .traces
            .iter()
            .filter(|trace| !trace.time_s.is_empty());
        let traces: Vec<&Trace> = traces.take(MOST_RECORDINGS).collect();
        if traces.len() < 2 {
            return Vec::new();
        }
        let points: Vec<Point> = traces
            .iter()
            .zip(1u32..)
            .flat_map(|(trace, number)| {
                let start = trace.time_s.first().copied().unwrap_or(0.0);
                residuals(trace)
                    .zip(&trace.time_s)
                    .map(move |((before, after), &time)| Point {
                        at: (time - start, f64::from(number)),
                        before,
                        after,
                    })
            })
            .collect();
        let Some(along) = edges(points.iter().map(|p| p.at.0), TIMES) else {
            return Vec::new();
        };
        let up = (0..=traces.len()).map(|row| row as f64 + 0.5).collect();
        maps(
            &points,
            along,
            up,
            "over time, a row a recording in the order of the list below",
            [
                Axis::new("time since the recording's start (s)"),
                Axis::new("recording"),
            ],
            "time",
        )
    }
}

/// Vehicle speed at a time, of the sample kept before it.
fn speed_at(speeds: &[(f64, f64)], time_s: f64) -> f64 {
    let after = speeds.partition_point(|(time, _)| *time <= time_s);
    let at = after.saturating_sub(1);
    speeds.get(at).map_or(f64::NAN, |(_, speed)| *speed)
}

/// Residuals before and after the repair along a trace.
fn residuals(trace: &Trace) -> impl Iterator<Item = (f64, f64)> + '_ {
    let models = trace.before_n.iter().zip(&trace.after_n);
    trace
        .measured_n
        .iter()
        .zip(models)
        .map(|(measured, (before, after))| (measured - before, measured - after))
}

/// A residual in N and where it stands on a map.
struct Point {
    at: (f64, f64),
    before: f64,
    after: f64,
}

/// Edges of evenly wide ranges over all values; `None` where they span nothing.
fn edges(values: impl Iterator<Item = f64>, count: usize) -> Option<Vec<f64>> {
    let finite = values.filter(|value| value.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    (low < high).then(|| {
        let edge = |index: usize| low + (high - low) * index as f64 / count as f64;
        (0..=count).map(edge).collect()
    })
}

/// Two maps of mean residuals with one scale of colours.
fn maps(
    points: &[Point],
    along: Vec<f64>,
    up: Vec<f64>,
    where_to: &str,
    axes: [Axis; 2],
    name: &str,
) -> Vec<Figure> {
    let before = means(points, &along, &up, |point| point.before);
    let after = means(points, &along, &up, |point| point.after);
    let limit = before
        .iter()
        .chain(&after)
        .filter(|mean| mean.is_finite())
        .fold(0.0_f64, |limit, mean| limit.max(mean.abs()));
    if limit <= 0.0 {
        return Vec::new();
    }
    let [x, y] = axes;
    [
        ("base law, refitted", "before", before),
        ("repaired model", "after", after),
    ]
    .map(|(model, when, values)| {
        Figure::new(
            format!("Measured minus predicted {where_to}: {model}, means in N."),
            x.clone(),
            y.clone(),
        )
        .named(format!("residual-over-{name}-{when}"))
        .with(
            Ink::Estimate,
            "mean residual (N)",
            Shape::Cells(Cells {
                x_edges: along.clone(),
                y_edges: up.clone(),
                values,
                limit,
                unit: "N".into(),
            }),
        )
    })
    .into()
}

/// Means of the points in each cell, row by row; NaN where there are too few.
fn means(points: &[Point], along: &[f64], up: &[f64], of: impl Fn(&Point) -> f64) -> Vec<f64> {
    let columns = along.len().saturating_sub(1);
    let rows = up.len().saturating_sub(1);
    let mut sums = vec![(0.0, 0usize); columns * rows];
    let cell = |edges: &[f64], value: f64| {
        let past = edges.partition_point(|edge| *edge <= value);
        (value.is_finite() && past > 0).then(|| (past - 1).min(edges.len().saturating_sub(2)))
    };
    for point in points {
        let (Some(column), Some(row)) = (cell(along, point.at.0), cell(up, point.at.1)) else {
            continue;
        };
        let value = of(point);
        if let Some(sum) = sums.get_mut(row * columns + column)
            && value.is_finite()
        {
            *sum = (sum.0 + value, sum.1 + 1);
        }
    }
    sums.into_iter()
        .map(|(sum, count)| {
            if count < FEWEST {
                f64::NAN
            } else {
                sum / count as f64
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_holds_the_mean_of_what_falls_into_it() {
        let points: Vec<Point> = (0..40)
            .map(|index| Point {
                at: (f64::from(index % 4), f64::from(index / 20)),
                before: f64::from(index % 4),
                after: f64::NAN,
            })
            .collect();
        let (along, up) = (
            edges((0..4).map(f64::from), 2).unwrap(),
            vec![0.0, 1.0, 2.0],
        );
        assert_eq!(along, [0.0, 1.5, 3.0]);
        let before = means(&points, &along, &up, |point| point.before);
        assert_eq!(before, [0.5, 2.5, 0.5, 2.5]);
        assert!(
            means(&points, &along, &up, |point| point.after)
                .iter()
                .all(|mean| mean.is_nan())
        );
        assert!(edges([1.0, 1.0, f64::NAN].into_iter(), 3).is_none());
    }
}
