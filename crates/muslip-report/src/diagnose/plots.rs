//! The figures of a diagnosis's report.

use muslip_analysis::diagnose::wording::short_name;
use muslip_diagnose::outcome::{Diagnosis, Trace};

use crate::axis::Axis;
use crate::figure::{Figure, Ink, Shape};

/// Recordings drawn against time.
const MOST_RUNS: usize = 3;
/// Points of a cloud.
const MOST_POINTS: usize = 800;
/// Bins of slip.
const BINS: usize = 24;
/// Usual steps of time above which a step is a gap.
const GAP: f64 = 10.0;
/// Fewest points of a bin that is drawn.
const FEWEST_IN_BIN: usize = 12;

/// The recordings worth drawing: held-out ones first, then those with the strongest mismatch.
#[must_use]
pub fn chosen(diagnosis: &Diagnosis) -> Vec<&Trace> {
    let strength = |trace: &Trace| {
        diagnosis
            .r#where
            .iter()
            .filter(|i| i.recording == trace.recording && i.balance == "tyre")
            .map(|i| i.z)
            .fold(0.0, f64::max)
    };
    let mut traces: Vec<&Trace> = diagnosis.traces.iter().collect();
    traces.retain(|trace| !trace.time_s.is_empty());
    traces.sort_by(|a, b| {
        let strongest = strength(b).total_cmp(&strength(a));
        b.holdout.cmp(&a.holdout).then(strongest)
    });
    traces.truncate(MOST_RUNS);
    traces
}

/// Drag against time: measured, the base law and the repaired model, flagged intervals shaded.
#[must_use]
pub fn drag(diagnosis: &Diagnosis, trace: &Trace) -> Figure {
    let role = if trace.holdout { "held out" } else { "fitted" };
    let caption = format!(
        "{} ({role}): drag as measured and as the two models predict it. Shaded: where they differ by \
         more than the noise.",
        short_name(&trace.recording)
    );
    let figure = Figure::new(caption, Axis::new("time (s)"), Axis::new("drag (N)"));
    let figure = shaded(figure, diagnosis, trace, &[&trace.before_n, &trace.after_n]);
    figure
        .with(
            Ink::Measured,
            "measured",
            Shape::Points(cloud(&trace.time_s, &trace.measured_n)),
        )
        .with(
            Ink::Second,
            "base law, refitted",
            Shape::Line(interrupted(line(&trace.time_s, &trace.before_n))),
        )
        .with(
            Ink::Estimate,
            "repaired model",
            Shape::Line(interrupted(line(&trace.time_s, &trace.after_n))),
        )
}

/// What each model leaves over against time, averaged over neighbours so that the noise does not hide it.
#[must_use]
pub fn remainder(diagnosis: &Diagnosis, trace: &Trace) -> Figure {
    let window = (trace.time_s.len() / 150).max(1);
    let caption = format!(
        "{}: measured minus predicted, means over {} points.",
        short_name(&trace.recording),
        2 * window + 1
    );
    let before = running_mean(&difference(&trace.measured_n, &trace.before_n), window);
    let after = running_mean(&difference(&trace.measured_n, &trace.after_n), window);
    let figure = Figure::new(caption, Axis::new("time (s)"), Axis::new("residual (N)"));
    shaded(figure, diagnosis, trace, &[&before, &after])
        .with(Ink::Reference, "", Shape::Level(0.0))
        .with(
            Ink::Second,
            "base law, refitted",
            Shape::Line(interrupted(line(&trace.time_s, &before))),
        )
        .with(
            Ink::Estimate,
            "repaired model",
            Shape::Line(interrupted(line(&trace.time_s, &after))),
        )
}

/// What each model leaves over against slip, over all recordings: the mean in each range of slip, and
/// the scatter about it.
#[must_use]
pub fn against_slip(diagnosis: &Diagnosis) -> Figure {
    let residuals = |model: fn(&Trace) -> &[f64]| -> Vec<(f64, f64)> {
        let traces = diagnosis.traces.iter();
        traces
            .flat_map(|trace| line(&trace.slip, &difference(&trace.measured_n, model(trace))))
            .collect()
    };
    let before = binned(&residuals(|trace| &trace.before_n));
    let after = binned(&residuals(|trace| &trace.after_n));
    let means = |bins: &[Bin]| bins.iter().map(|bin| (bin.at, bin.mean)).collect();
    let scatter = |bins: &[Bin]| {
        bins.iter()
            .map(|bin| (bin.at, bin.mean - bin.std, bin.mean + bin.std))
            .collect()
    };
    Figure::new(
        "Measured minus predicted against slip, all recordings: mean and 1-sigma scatter in each range of \
         slip.",
        Axis::new("slip"),
        Axis::new("residual (N)"),
    )
    .with(Ink::Second, "scatter of base law", Shape::Band(scatter(&before)))
    .with(Ink::Estimate, "of repaired model", Shape::Band(scatter(&after)))
    .with(Ink::Reference, "", Shape::Level(0.0))
    .with(Ink::Second, "base law, refitted", Shape::Line(means(&before)))
    .with(Ink::Estimate, "repaired model", Shape::Line(means(&after)))
}

/// Shades the flagged intervals of the tyre balance over the height of what is drawn.
fn shaded(mut figure: Figure, diagnosis: &Diagnosis, trace: &Trace, drawn: &[&[f64]]) -> Figure {
    let finite = drawn
        .iter()
        .flat_map(|values| values.iter())
        .filter(|v| v.is_finite());
    let low = finite.clone().copied().fold(f64::INFINITY, f64::min);
    let high = finite.copied().fold(f64::NEG_INFINITY, f64::max);
    if low >= high {
        return figure;
    }
    let mut label = "flagged";
    for interval in &diagnosis.r#where {
        if interval.recording == trace.recording && interval.balance == "tyre" {
            let ends = [interval.start_s, interval.end_s];
            let band = Shape::Band(ends.map(|t| (t, low, high)).into());
            figure = figure.with(Ink::Reference, label, band);
            label = "";
        }
    }
    figure
}

fn line(x: &[f64], y: &[f64]) -> Vec<(f64, f64)> {
    x.iter()
        .zip(y)
        .map(|(&x, &y)| (x, y))
        .filter(|(x, y)| x.is_finite() && y.is_finite())
        .collect()
}

/// A line over time, interrupted where nothing was recorded.
pub(super) fn interrupted(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let step = |pair: &[(f64, f64)]| match pair {
        [before, after] => after.0 - before.0,
        _ => 0.0,
    };
    let mut steps: Vec<f64> = points.windows(2).map(step).collect();
    steps.sort_by(f64::total_cmp);
    let usual = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    let mut parts = Vec::with_capacity(points.len());
    for (index, point) in points.iter().enumerate() {
        parts.push(*point);
        let after = points.get(index..index + 2).unwrap_or_default();
        if step(after) > GAP * usual {
            parts.push((point.0, f64::NAN));
        }
    }
    parts
}

fn cloud(x: &[f64], y: &[f64]) -> Vec<(f64, f64)> {
    thinned(line(x, y))
}

/// Every n-th point, as few as needed.
fn thinned(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let stride = points.len().div_ceil(MOST_POINTS).max(1);
    points.into_iter().step_by(stride).collect()
}

fn difference(measured: &[f64], model: &[f64]) -> Vec<f64> {
    measured.iter().zip(model).map(|(a, b)| a - b).collect()
}

/// Means over `window` neighbours on either side, of those that are numbers.
fn running_mean(values: &[f64], window: usize) -> Vec<f64> {
    (0..values.len())
        .map(|k| {
            let from = k.saturating_sub(window);
            let to = (k + window + 1).min(values.len());
            let near = values.get(from..to).unwrap_or_default();
            mean(near.iter().copied().filter(|v| v.is_finite()))
        })
        .collect()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0u32), |(sum, count), v| (sum + v, count + 1));
    sum / f64::from(count)
}

/// Points in a range of slip.
struct Bin {
    /// Mean slip.
    at: f64,
    /// Mean residual.
    mean: f64,
    /// Scatter about it.
    std: f64,
}

/// Ranges of equal width; those with hardly any point are left out.
fn binned(points: &[(f64, f64)]) -> Vec<Bin> {
    let low = points.iter().map(|p| p.0).fold(f64::INFINITY, f64::min);
    let high = points.iter().map(|p| p.0).fold(f64::NEG_INFINITY, f64::max);
    let mut bins: Vec<Vec<(f64, f64)>> = vec![Vec::new(); BINS];
    for point in points {
        // A share that is no number goes to the first bin.
        let share = (point.0 - low) / (high - low);
        let index = ((share * BINS as f64) as usize).min(BINS - 1);
        bins[index].push(*point);
    }
    bins.iter()
        .filter(|bin| bin.len() >= FEWEST_IN_BIN)
        .map(|bin| {
            let mean_residual = mean(bin.iter().map(|p| p.1));
            Bin {
                at: mean(bin.iter().map(|p| p.0)),
                mean: mean_residual,
                std: mean(bin.iter().map(|p| (p.1 - mean_residual).powi(2))).sqrt(),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_stops_where_nothing_was_recorded() {
        let recorded = (0..20).chain(100..120).map(|k| (f64::from(k), 1.0));
        let line = interrupted(recorded.collect());
        let gaps: Vec<usize> = (0..line.len()).filter(|k| line[*k].1.is_nan()).collect();
        assert_eq!((line.len(), gaps), (41, vec![20]));
        assert!(interrupted(Vec::new()).is_empty());
    }

    #[test]
    fn a_bin_has_the_mean_and_scatter_of_its_points() {
        let points: Vec<(f64, f64)> = (0..480)
            .map(|i| {
                (
                    f64::from(i % 24),
                    f64::from(i % 24) * 2.0 + f64::from(i / 240),
                )
            })
            .collect();
        let bins = binned(&points);
        assert_eq!(bins.len(), 24);
        for bin in bins {
            assert!((bin.mean - 2.0 * bin.at - 0.5).abs() < 1e-12);
            assert!((bin.std - 0.5).abs() < 1e-12);
        }
        assert!(binned(&points[..5]).is_empty());
    }

    #[test]
    fn missing_values_are_left_out_of_a_mean() {
        let mean = running_mean(&[1.0, f64::NAN, 3.0, f64::NAN, f64::NAN, f64::NAN], 1);
        assert_eq!(&mean[..4], [1.0, 2.0, 3.0, 3.0]);
        assert!(mean[4].is_nan());
    }
}
