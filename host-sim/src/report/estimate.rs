//! The report of one estimate.

use std::path::Path;

use super::axis::{Axis, Extent};
use super::figure::{Figure, Ink, Shape, ellipse};
use super::page::{Block, KeyFigure, Report, Section, Tone};
use crate::estimate::{EstimateResult, Verdict, range_word};
use crate::fit::Curve;
use crate::wording::{
    consistency_sentence, estimate_sentence, model_sentences, noise_sentence, plus_minus,
};

/// A curve to draw beside the estimate, under its name in the legend.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveLabel {
    /// Name in the legend.
    pub name: String,
    /// Points (slip, friction) of the curve.
    pub points: Vec<(f64, f64)>,
}

/// The report of an estimate: the curve, how the estimate settled, whether to believe it.
///
/// `beside` is drawn with the curve where it is known what is true. `command` is what made the page.
pub fn of_estimate(
    recording: &Path,
    result: &EstimateResult,
    beside: Option<&CurveLabel>,
    command: &str,
) -> Report {
    let peak = &result.peak;
    let consistency = &result.consistency;
    let tone = match consistency.verdict {
        Verdict::Overconfident => Tone::Warning,
        Verdict::Consistent => Tone::Good,
        Verdict::Conservative => Tone::Neutral,
    };
    let skipped: Vec<Vec<String>> = result
        .skipped
        .reasons()
        .iter()
        .filter(|(_, count)| *count > 0)
        .map(|(reason, count)| vec![format!("skipped: {reason}"), count.to_string()])
        .collect();
    let mut samples = vec![vec!["used".to_owned(), result.used.to_string()]];
    samples.extend(skipped);
    let mut curve: Vec<Block> = result
        .model
        .iter()
        .flat_map(model_sentences)
        .map(Block::Paragraph)
        .collect();
    curve.push(Block::Figure(curve_figure(result, beside)));
    curve.push(Block::Figure(peak_figure(result)));
    Report {
        title: "Peak friction estimate".into(),
        subject: format!(
            "{}, estimator {}, range {}",
            recording.display(),
            result.estimator.word(),
            range_word(result.options.range)
        ),
        verdict: estimate_sentence(result),
        tone,
        key_figures: vec![
            KeyFigure {
                name: "Peak friction".into(),
                value: plus_minus(peak.peak_friction, peak.peak_friction_std),
                remark: "1-sigma".into(),
            },
            KeyFigure {
                name: "Critical slip (slip of the peak)".into(),
                value: plus_minus(peak.critical_slip, peak.critical_slip_std),
                remark: format!("1-sigma; correlation {:.2}", peak.correlation),
            },
            KeyFigure {
                name: "Consistency".into(),
                value: consistency.verdict.word().into(),
                remark: format!("mean NIS {:.3}", consistency.mean_nis),
            },
        ],
        sections: vec![
            Section {
                heading: "The curve".into(),
                blocks: curve,
            },
            Section {
                heading: "How the estimate settled".into(),
                blocks: settling_figures(result).map(Block::Figure).into(),
            },
            Section {
                heading: "Is the filter consistent?".into(),
                blocks: vec![
                    Block::Paragraph(consistency_sentence(consistency, result.estimator)),
                    Block::Figure(nis_figure(result)),
                ],
            },
            Section {
                heading: "Samples".into(),
                blocks: vec![
                    Block::Paragraph(noise_sentence(&result.survey)),
                    Block::Table {
                        head: vec!["samples".into(), "count".into()],
                        rows: samples,
                    },
                ],
            },
        ],
        command: command.to_owned(),
    }
}

/// Slips at which a curve is drawn: dense where it bends.
fn drawn_slips(largest: f64) -> impl Iterator<Item = f64> {
    const STEPS: u32 = 160;
    (0..=STEPS).map(move |step| largest * (f64::from(step) / f64::from(STEPS)).powi(2))
}

fn largest_slip(result: &EstimateResult) -> f64 {
    let largest = result
        .points
        .iter()
        .map(|point| point.0)
        .fold(0.0, f64::max);
    // At least to a little beyond the peak, at most to the locked wheel and its noise.
    largest
        .max(1.5 * result.peak.critical_slip)
        .clamp(0.05, 1.05)
}

/// Points (x, y) of a line.
type LinePoints = Vec<(f64, f64)>;
/// Points (x, low, high) of a band.
type BandPoints = Vec<(f64, f64, f64)>;

/// The curve of the estimate and the 1-sigma of its friction, sqrt(H P H'), at each slip.
fn curve_and_band(result: &EstimateResult) -> (LinePoints, BandPoints) {
    let peak = &result.peak;
    let curve = Curve {
        peak_friction: peak.peak_friction,
        critical_slip: peak.critical_slip,
    };
    let (sigma_peak, sigma_slip) = (peak.peak_friction_std, peak.critical_slip_std);
    drawn_slips(largest_slip(result))
        .map(|slip| {
            let friction = curve.friction(slip);
            let (by_peak, by_slip) = curve.gradient(slip);
            let (a, b) = (by_peak * sigma_peak, by_slip * sigma_slip);
            let sigma = (a * a + 2.0 * peak.correlation * a * b + b * b)
                .max(0.0)
                .sqrt();
            ((slip, friction), (slip, friction - sigma, friction + sigma))
        })
        .unzip()
}

fn curve_figure(result: &EstimateResult, beside: Option<&CurveLabel>) -> Figure {
    let peak = &result.peak;
    let (curve, band) = curve_and_band(result);
    let thinned = if (result.points.len() as u64) < result.used {
        format!(" ({} of {} shown)", result.points.len(), result.used)
    } else {
        String::new()
    };
    let mut figure = Figure::new(
        format!("Measured friction against slip{thinned}, and the estimated curve with its 1-sigma band."),
        Axis::new("slip").over(Extent::Including(0.0)),
        Axis::new("friction coefficient").over(Extent::Including(0.0)),
    )
    .with(Ink::Measured, "measured", Shape::Points(result.points.clone()))
    .with(Ink::Estimate, "1-sigma", Shape::Band(band));
    if let Some(beside) = beside {
        figure = figure.with(
            Ink::Truth,
            &beside.name,
            Shape::Dashes(beside.points.clone()),
        );
    }
    figure
        .with(Ink::Estimate, "estimated curve", Shape::Line(curve))
        .with(
            Ink::Estimate,
            "peak",
            Shape::Marker((peak.critical_slip, peak.peak_friction), String::new()),
        )
}

fn peak_figure(result: &EstimateResult) -> Figure {
    let peak = &result.peak;
    let outline = ellipse(
        (peak.critical_slip, peak.peak_friction),
        (peak.critical_slip_std, peak.peak_friction_std),
        peak.correlation,
    );
    // Three sigma around, and round it the last steps of the estimate's way there.
    let around = |value: f64, std: f64| Extent::Fixed(value - 3.2 * std, value + 3.2 * std);
    let way = result
        .steps
        .iter()
        .map(|step| (step.peak.critical_slip, step.peak.peak_friction))
        .collect();
    Figure::new(
        "The peak with its 1-sigma ellipse, and the way the estimate took to it.",
        Axis::new("critical slip").over(around(peak.critical_slip, peak.critical_slip_std)),
        Axis::new("peak friction").over(around(peak.peak_friction, peak.peak_friction_std)),
    )
    .with(Ink::Estimate, "1-sigma ellipse", Shape::Outline(outline))
    .with(Ink::Reference, "way of the estimate", Shape::Line(way))
    .with(
        Ink::Estimate,
        "final estimate",
        Shape::Marker((peak.critical_slip, peak.peak_friction), String::new()),
    )
}

fn settling_figures(result: &EstimateResult) -> [Figure; 2] {
    let figure = |caption: &str, label: &str, of: fn(&crate::estimate::Step) -> (f64, f64)| {
        let last = result.steps.last().map_or((0.0, 0.0), of);
        let band = result
            .steps
            .iter()
            .map(|step| {
                let (value, std) = of(step);
                (step.sample as f64, value - std, value + std)
            })
            .collect();
        let line = result
            .steps
            .iter()
            .map(|step| (step.sample as f64, of(step).0))
            .collect();
        Figure::new(
            caption,
            Axis::new("samples used").logarithmic(),
            Axis::new(label),
        )
        .with(Ink::Estimate, "1-sigma", Shape::Band(band))
        .with(Ink::Estimate, "estimate", Shape::Line(line))
        .with(Ink::Reference, "final value", Shape::Level(last.0))
    };
    [
        figure(
            "Peak friction after each sample.",
            "peak friction",
            |step| (step.peak.peak_friction, step.peak.peak_friction_std),
        ),
        figure(
            "Critical slip after each sample.",
            "critical slip",
            |step| (step.peak.critical_slip, step.peak.critical_slip_std),
        ),
    ]
}

fn nis_figure(result: &EstimateResult) -> Figure {
    let points = result
        .steps
        .iter()
        .map(|step| (step.sample as f64, step.nis))
        .collect();
    let consistency = &result.consistency;
    let ends = [
        1.0,
        result.steps.last().map_or(1.0, |step| step.sample as f64),
    ];
    let band = ends
        .map(|sample| (sample, consistency.nis_low, consistency.nis_high))
        .into();
    Figure::new(
        "Normalised innovation squared of each sample. A consistent filter's mean lies in the band.",
        Axis::new("samples used"),
        Axis::new("innovation squared / its variance").over(Extent::Including(0.0)),
    )
    .with(Ink::Reference, "95 % band of the mean", Shape::Band(band))
    .with(Ink::Measured, "each sample", Shape::Points(points))
    .with(Ink::Estimate, "mean", Shape::Level(consistency.mean_nis))
}
