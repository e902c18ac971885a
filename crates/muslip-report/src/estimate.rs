//! The report of one estimate.

use std::path::Path;

use muslip_analysis::estimate::{EstimateResult, Frame, Update, Verdict, range_word};
use muslip_analysis::wording::{
    consistency_sentence, estimate_sentence, model_sentences, noise_sentence, plus_minus,
};

use super::axis::{Axis, Extent};
use super::convergence::{Convergence, CurveLabel};
use super::figure::{Figure, Ink, Live, Shape};
use super::page::{Block, KeyFigure, Report, Section, Tone};
use super::table::Table;

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
    let run = convergence(result, beside);
    let (head, rows) = run.table();
    curve.push(Block::Convergence(Box::new(run)));
    curve.push(Block::Folded {
        summary: "The frames of the animation as a table".into(),
        table: Table::new(head, rows),
    });
    Report {
        title: "Peak friction estimate".into(),
        subject: format!(
            "{}, estimator {}, range {}",
            recording.display(),
            result.estimator.word(),
            range_word(result.range)
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
                heading: "The estimate, measurement by measurement".into(),
                blocks: curve,
            },
            Section {
                heading: "Convergence".into(),
                blocks: settling_figures(result).map(Block::Figure).into(),
            },
            Section {
                heading: "Is the filter consistent?".into(),
                blocks: [Block::Paragraph(consistency_sentence(
                    consistency,
                    result.estimator,
                ))]
                .into_iter()
                .chain(consistency_figures(result).map(Block::Figure))
                .collect(),
            },
            Section {
                heading: "Samples".into(),
                blocks: vec![
                    Block::Paragraph(noise_sentence(&result.survey)),
                    Block::Table(Table::new(["samples", "count"], samples)),
                ],
            },
        ],
        command: command.to_owned(),
    }
}

/// The run for the player.
fn convergence(result: &EstimateResult, beside: Option<&CurveLabel>) -> Convergence {
    let record = &result.record;
    let thinned = if record.stride > 1 {
        format!(
            " The page contains one in {} of {} measurements, so that its results differ slightly from the \
             command's.",
            record.stride, result.used
        )
    } else {
        String::new()
    };
    Convergence {
        frames: record.frames.clone(),
        samples: record.samples.clone(),
        stride: record.stride,
        used: result.used,
        consistency: result.consistency,
        truth: beside.cloned(),
        // What a compensated reading is expected to be depends on the filter's state, sample by sample.
        again: result.model.is_none().then_some(result.estimator),
        about_what_if: match result.model {
            None => format!(
                "Change an assumption and the filter runs again in this page, with the code that runs on the \
                 rig.{thinned}"
            ),
            Some(_) => "No what-if on this page: with a repaired model each reading is compensated by the \
                        filter's state at that sample, which needs the recording. Run the command again with \
                        another --range or --estimator."
                .to_owned(),
        },
    }
}

/// Layers along the frames.
struct Along<'a>(&'a [Frame]);

impl Along<'_> {
    fn line(&self, of: impl Fn(&Frame) -> f64) -> Shape {
        Shape::Line(self.points(of))
    }

    fn points(&self, of: impl Fn(&Frame) -> f64) -> Vec<(f64, f64)> {
        self.0
            .iter()
            .map(|frame| (frame.sample as f64, of(frame)))
            .collect()
    }

    fn of_update(&self, of: impl Fn(&Update) -> f64) -> Vec<(f64, f64)> {
        self.points(|frame| frame.update.as_ref().map_or(f64::NAN, &of))
    }

    fn band(&self, of: impl Fn(&Frame) -> (f64, f64)) -> Shape {
        let band = self.0.iter().map(|frame| {
            let (value, std) = of(frame);
            (frame.sample as f64, value - std, value + std)
        });
        Shape::Band(band.collect())
    }
}

fn measurements() -> Axis {
    Axis::new("measurement")
}

fn settling_figures(result: &EstimateResult) -> [Figure; 4] {
    let frames = &result.record.frames;
    let along = Along(frames);
    let figure = |caption: &str, label: &str| {
        Figure::new(caption, measurements().logarithmic(), Axis::new(label))
    };
    let settled = |figure: Figure, live: [Live; 2], of: fn(&Frame) -> (f64, f64)| {
        let last = frames.last().map_or(f64::NAN, |frame| of(frame).0);
        figure
            .with_live(live[0], Ink::Estimate, "1-sigma", along.band(of))
            .with_live(
                live[1],
                Ink::Estimate,
                "estimate",
                along.line(|frame| of(frame).0),
            )
            .with(
                Ink::Reference,
                "final value of the command",
                Shape::Level(last),
            )
    };
    let peak = settled(
        figure("Peak friction after each measurement.", "peak friction").named("peak-friction"),
        [Live::PeakFrictionBand, Live::PeakFriction],
        |frame| (frame.peak.peak_friction, frame.peak.peak_friction_std),
    );
    let slip = settled(
        figure("Critical slip after each measurement.", "critical slip").named("critical-slip"),
        [Live::CriticalSlipBand, Live::CriticalSlip],
        |frame| (frame.peak.critical_slip, frame.peak.critical_slip_std),
    );
    let start = frames.first().map(|frame| frame.peak);
    let share = |std: fn(&Frame) -> f64| {
        let at_start = frames.first().map_or(f64::NAN, std);
        along.line(move |frame| (std(frame) / at_start).powi(2))
    };
    let mut variances = figure(
        "Variances after each measurement over those at the start, and the correlation of the two (the \
         article's Figure 1).",
        "share of the start; correlation",
    )
    .named("figure-1-variances")
    .with(Ink::Reference, "", Shape::Level(0.0));
    if start.is_some_and(|start| start.peak_friction_std.is_finite()) {
        variances = variances
            .with_live(
                Live::PeakFrictionVariance,
                Ink::Estimate,
                "variance of peak friction",
                share(|frame| frame.peak.peak_friction_std),
            )
            .with_live(
                Live::CriticalSlipVariance,
                Ink::Measured,
                "variance of critical slip",
                share(|frame| frame.peak.critical_slip_std),
            );
    }
    let variances = variances.with_live(
        Live::Correlation,
        Ink::Truth,
        "correlation",
        along.line(|frame| frame.peak.correlation),
    );
    let line = |of: fn(&Update) -> f64| Shape::Line(along.of_update(of));
    let signal = Figure::new(
        "Signal of each measurement, H P H' before and after the update, and the variance of its noise (the \
         article's Figure 2).",
        measurements().logarithmic(),
        Axis::new("variance of friction").logarithmic(),
    )
    .named("figure-2-signal-and-noise")
    .with_live(
        Live::SignalBefore,
        Ink::Estimate,
        "signal before",
        line(|update| update.signal_before),
    )
    .with_live(
        Live::SignalAfter,
        Ink::Second,
        "signal after",
        line(|update| update.signal_after),
    )
    .with_live(
        Live::Noise,
        Ink::Measured,
        "noise",
        line(|update| update.noise_variance),
    );
    [peak, slip, variances, signal]
}

fn consistency_figures(result: &EstimateResult) -> [Figure; 2] {
    /// 95 % of squares of standard normal numbers lie below this.
    const BELOW: f64 = 3.841;
    let frames = &result.record.frames;
    let along = Along(frames);
    let band = along.band(|frame| {
        let variance = frame.update.map_or(f64::NAN, |u| u.innovation_variance);
        (0.0, 2.0 * variance.sqrt())
    });
    let innovations = Figure::new(
        "Innovations, measured minus predicted friction. Of a consistent filter's, 95 % lie in the band, in no \
         order.",
        measurements(),
        Axis::new("innovation (friction)"),
    )
    .named("innovations")
    .with_live(Live::InnovationBand, Ink::Reference, "2-sigma", band)
    .with(Ink::Reference, "", Shape::Level(0.0))
    .with_live(
        Live::Innovation,
        Ink::Measured,
        "innovation",
        Shape::Points(along.of_update(|update| update.innovation)),
    );
    let consistency = &result.consistency;
    let ends = [0.0, frames.last().map_or(1.0, |frame| frame.sample as f64)];
    let band = ends.map(|sample| (sample, consistency.nis_low, consistency.nis_high));
    let nis = Figure::new(
        "Normalised innovation squared of each measurement. A consistent filter's mean lies in the band.",
        measurements(),
        Axis::new("innovation\u{b2} / its variance").over(Extent::Including(0.0)),
    )
    .named("normalised-innovations")
    .with(
        Ink::Reference,
        "95 % band of the mean",
        Shape::Band(band.into()),
    )
    .with(
        Ink::Reference,
        "95 % of them lie below",
        Shape::Level(BELOW),
    )
    .with_live(
        Live::Nis,
        Ink::Measured,
        "each",
        Shape::Points(along.of_update(|update| update.nis)),
    )
    .with_live(
        Live::NisMean,
        Ink::Estimate,
        "mean",
        Shape::Level(consistency.mean_nis),
    );
    [innovations, nis]
}
