//! The article's figures, drawn from one stream.

use muslip::filter::PeakEstimate;
use muslip::filter::mu_slip::{Estimate, Range, State};
use muslip_analysis::estimate::{ConsistencyTest, EstimatorKind, Frame, Sample, Update};
use muslip_analysis::fit::Curve;
use muslip_report::{Axis, Convergence, CurveLabel, Extent, Figure, Ink, Shape, ellipse};

use super::exact::{equal_sensitivity_slips, slip_of_extremum};
use super::pass::{PassError, Step, first_start, traced};
use super::stream::{FRICTION_STD, TRUTH, frictions, slips};

/// A figure with the name of its file, without ending, and the heading that it stands under.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedFigure {
    /// Such as `curve-family`.
    pub name: String,
    /// The part of the report that it belongs to.
    pub part: Part,
    /// The figure.
    pub figure: Figure,
}

/// Parts of the report.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The curve and the points measured.
    Curve,
    /// What the filter holds and does along the points.
    Filter,
    /// The estimate after some of the points.
    Convergence,
}

/// Measurements after which the article shows the estimate, counted from 0 at free rolling.
const STILLS: [usize; 6] = [1, 7, 13, 19, 30, 40];

/// All figures but the animation, of the stream of this seed.
///
/// # Errors
/// [`PassError`] if the filter refuses the stream, which none is known to bring about.
pub fn figures(seed: u64) -> Result<Vec<NamedFigure>, PassError> {
    let steps = traced(first_start(Range::Aircraft), &frictions(TRUTH, seed))?;
    let named = |name: &str, part, figure| NamedFigure {
        name: name.to_owned(),
        part,
        figure,
    };
    let mut all = vec![
        named("curve-family", Part::Curve, curve_family()),
        named("noisy-data", Part::Curve, noisy_data(seed)),
        named("observation-matrix", Part::Curve, observation_matrix()),
        named("figure-1-variances", Part::Filter, variances(&steps)),
        named(
            "figure-2-signal-and-noise",
            Part::Filter,
            signal_and_noise(&steps),
        ),
        named("gain", Part::Filter, gain(&steps)),
        named("correlation-ellipses", Part::Filter, ellipses(&steps)),
        named(
            "correlation-ellipses-late",
            Part::Filter,
            late_ellipses(&steps),
        ),
    ];
    all.push(named("result", Part::Convergence, result(&steps)));
    all.extend(STILLS.iter().map(|&index| {
        let name = format!("convergence-{index:02}");
        named(&name, Part::Convergence, still(index, &steps))
    }));
    Ok(all)
}

/// The run over the stream of this seed, with a frame for each measurement.
///
/// # Errors
/// As for [`figures`].
pub fn convergence(seed: u64) -> Result<Convergence, PassError> {
    let start = first_start(Range::Aircraft);
    let steps = traced(start, &frictions(TRUTH, seed))?;
    let peak_of = |estimate: &Estimate<f64>| {
        let (peak_friction_std, critical_slip_std) = estimate.covariance.std();
        PeakEstimate {
            peak_friction: estimate.state.peak_friction,
            peak_friction_std,
            critical_slip: estimate.state.critical_slip,
            critical_slip_std,
            correlation: estimate.covariance.correlation(),
        }
    };
    let mut frames = vec![Frame {
        sample: 0,
        peak: peak_of(&start),
        update: None,
    }];
    let mut test = ConsistencyTest::default();
    for (step, sample) in steps.iter().zip(1..) {
        let fusion = &step.fusion;
        test.add(fusion.innovation / fusion.innovation_variance.sqrt());
        frames.push(Frame {
            sample,
            peak: peak_of(&step.estimate),
            update: Some(Update::new(f64::NAN, fusion)),
        });
    }
    Ok(Convergence {
        used: steps.len() as u64,
        samples: along(&steps, |step| step.fusion.measured_friction)
            .into_iter()
            .map(|(slip, friction)| Sample {
                slip,
                friction,
                friction_std: FRICTION_STD,
            })
            .collect(),
        stride: 1,
        frames,
        consistency: test.outcome().ok_or(PassError::Empty)?,
        truth: Some(CurveLabel {
            name: "true curve".into(),
            points: points_of(TRUTH),
        }),
        again: Some(EstimatorKind::Article),
        about_what_if: "Change what the filter assumes and it runs again over the same points, here in the page."
            .into(),
    })
}

fn slip_axis() -> Axis {
    Axis::new("slip").over(Extent::Fixed(-0.015, 1.015))
}

/// Slips at which a curve is drawn: dense where it bends.
fn drawn_slips() -> impl Iterator<Item = f64> {
    (0..=160).map(|step| (f64::from(step) / 160.0).powi(2))
}

fn points_of(curve: Curve) -> Vec<(f64, f64)> {
    drawn_slips()
        .map(|slip| (slip, curve.friction(slip)))
        .collect()
}

fn along(steps: &[Step], value: impl Fn(&Step) -> f64) -> Vec<(f64, f64)> {
    steps
        .iter()
        .map(|step| (step.fusion.slip_ratio, value(step)))
        .collect()
}

fn curve_family() -> Figure {
    let mut figure = Figure::new(
        "The two-parameter law over the range of aircraft tyres and, at the top, of car tyres: peak \
         friction 0.1, 0.35, 0.6 and 1.0, each at three critical slips.",
        slip_axis(),
        Axis::new("friction").over(Extent::Including(0.0)),
    );
    for (critical_slip, ink) in [
        (0.10, Ink::Estimate),
        (0.15, Ink::Measured),
        (0.20, Ink::Truth),
    ] {
        for peak_friction in [0.1, 0.35, 0.6, 1.0] {
            let label = if peak_friction < 0.2 {
                format!("peak at slip {critical_slip:.2}")
            } else {
                String::new()
            };
            let curve = Curve {
                peak_friction,
                critical_slip,
            };
            figure = figure.with(ink, label, Shape::Line(points_of(curve)));
        }
    }
    figure
}

fn noisy_data(seed: u64) -> Figure {
    let points = slips().into_iter().zip(frictions(TRUTH, seed)).collect();
    Figure::new(
        format!(
            "The stream of seed {seed}: 41 points at the slips (i/40)², noise of standard deviation 0.04."
        ),
        slip_axis(),
        Axis::new("friction"),
    )
    .with(Ink::Truth, "true curve", Shape::Line(points_of(TRUTH)))
    .with(Ink::Measured, "measured", Shape::Points(points))
}

fn observation_matrix() -> Figure {
    let of = |value: fn((f64, f64)) -> f64| {
        drawn_slips()
            .map(|slip| (slip, value(TRUTH.gradient(slip))))
            .collect::<Vec<_>>()
    };
    let mut figure = Figure::new(
        "The observation matrix H at the true curve: at the peak it is (1, 0), on either side of it the \
         two are equally large, and ∂mu/∂sp is at its most negative at (√2 - 1) sp.",
        slip_axis(),
        Axis::new("derivative"),
    )
    .with(Ink::Reference, "", Shape::Level(0.0))
    .with(Ink::Estimate, "∂mu/∂mup", Shape::Line(of(|h| h.0)))
    .with(Ink::Measured, "∂mu/∂sp", Shape::Line(of(|h| h.1)))
    .with(Ink::Measured, "|∂mu/∂sp|", Shape::Dashes(of(|h| h.1.abs())))
    .with(
        Ink::Truth,
        "",
        Shape::Marker((TRUTH.critical_slip, 1.0), "peak: (1, 0)".into()),
    );
    if let Some((below, above)) = equal_sensitivity_slips(TRUTH) {
        for slip in [below, above] {
            let at = (slip, TRUTH.gradient(slip).0);
            figure = figure.with(Ink::Reference, "", Shape::Marker(at, String::new()));
        }
    }
    let dip = slip_of_extremum(TRUTH);
    let at = (dip, TRUTH.gradient(dip).1);
    figure.with(Ink::Truth, "", Shape::Marker(at, String::new()))
}

fn variances(steps: &[Step]) -> Figure {
    let start = Range::Aircraft.initial_covariance::<f64>();
    Figure::new(
        "The article's Figure 1: variances after each measurement over those at the start, and the \
         correlation of the two states.",
        slip_axis(),
        Axis::new("variance over that at the start; correlation"),
    )
    .with(Ink::Reference, "", Shape::Level(0.0))
    .with(
        Ink::Estimate,
        "variance of peak friction",
        Shape::Line(along(steps, |step| {
            step.estimate.covariance.p00 / start.p00
        })),
    )
    .with(
        Ink::Measured,
        "variance of critical slip",
        Shape::Line(along(steps, |step| {
            step.estimate.covariance.p11 / start.p11
        })),
    )
    .with(
        Ink::Truth,
        "correlation",
        Shape::Line(along(steps, |step| step.estimate.covariance.correlation())),
    )
}

fn signal_and_noise(steps: &[Step]) -> Figure {
    Figure::new(
        "The article's Figure 2: the signal H P Hᵀ before and after each measurement, and the noise R, \
         inflated measurement and pseudonoise together.",
        slip_axis(),
        Axis::new("variance of friction").over(Extent::Including(0.0)),
    )
    .with(
        Ink::Measured,
        "signal before",
        Shape::Line(along(steps, |step| step.fusion.signal_before)),
    )
    .with(
        Ink::Second,
        "signal after",
        Shape::Line(along(steps, |step| step.fusion.signal_after)),
    )
    .with(
        Ink::Estimate,
        "noise R",
        Shape::Line(along(steps, |step| step.fusion.noise_variance)),
    )
    .with(
        Ink::Estimate,
        "pseudonoise alone",
        Shape::Dashes(along(steps, |step| step.fusion.pseudonoise_variance)),
    )
}

fn gain(steps: &[Step]) -> Figure {
    let curve = (0..=120)
        .map(|step| 10f64.powf(-3.0 + 5.0 * f64::from(step) / 120.0))
        .map(|snr| (snr, snr / (1.0 + snr)))
        .collect();
    let points = steps
        .iter()
        .map(|step| {
            let it = &step.fusion;
            let snr = it.signal_before / it.noise_variance;
            (snr, it.signal_before / it.innovation_variance)
        })
        .collect();
    Figure::new(
        "Gain against signal-to-noise ratio, H P Hᵀ over R: SNR/(1 + SNR). The points are H K of the \
         measurements of the stream.",
        Axis::new("signal-to-noise ratio")
            .logarithmic()
            .over(Extent::Fixed(1e-3, 1e2)),
        Axis::new("gain").over(Extent::Fixed(0.0, 1.04)),
    )
    .with(Ink::Estimate, "SNR/(1 + SNR)", Shape::Line(curve))
    .with(Ink::Measured, "measurements", Shape::Points(points))
}

fn ellipses(steps: &[Step]) -> Figure {
    let figure = Figure::new(
        "One-sigma ellipses of the states after measurements 1, 7, 13, 19, 30 and 40. Far below the \
         peak a point tells the slope of the curve, twice peak friction over critical slip: they lean to \
         the right.",
        Axis::new("critical slip"),
        Axis::new("peak friction"),
    );
    with_ellipses(figure, steps, &STILLS, &[1, 7, 13, 19])
}

fn late_ellipses(steps: &[Step]) -> Figure {
    let figure = Figure::new(
        "The last three of them, larger. Far beyond the peak a point tells the product of peak friction \
         and critical slip: they lean to the left.",
        Axis::new("critical slip"),
        Axis::new("peak friction"),
    );
    let late = &STILLS[3..];
    with_ellipses(figure, steps, late, late)
}

/// Adds the ellipses after some measurements, with their numbers where `named`.
fn with_ellipses(figure: Figure, steps: &[Step], shown: &[usize], named: &[usize]) -> Figure {
    let last = steps.len().saturating_sub(1);
    let mut figure = figure;
    for &index in shown {
        let Some(step) = steps.get(index) else {
            continue;
        };
        let state = step.estimate.state;
        let ink = if index == last {
            Ink::Estimate
        } else {
            Ink::Measured
        };
        let label = if index == last {
            "after the last"
        } else if Some(&index) == shown.first() {
            "before the last"
        } else {
            ""
        };
        let number = if named.contains(&index) {
            index.to_string()
        } else {
            String::new()
        };
        let centre = (state.critical_slip, state.peak_friction);
        figure = figure.with(ink, label, Shape::Outline(outline(step))).with(
            ink,
            "",
            Shape::Marker(centre, number),
        );
    }
    figure.with(
        Ink::Truth,
        "true",
        Shape::Marker((TRUTH.critical_slip, TRUTH.peak_friction), String::new()),
    )
}

/// The one-sigma ellipse in the plane of the curve: its peak lies at (critical slip, peak friction).
fn outline(step: &Step) -> Vec<(f64, f64)> {
    let state = step.estimate.state;
    let covariance = step.estimate.covariance;
    let (peak_std, slip_std) = covariance.std();
    ellipse(
        (state.critical_slip, state.peak_friction),
        (slip_std, peak_std),
        covariance.correlation(),
    )
}

fn result(steps: &[Step]) -> Figure {
    let start = curve_of(Range::Aircraft.initial_state());
    let measured = along(steps, |step| step.fusion.measured_friction);
    let mut figure = Figure::new(
        "Start and end: the curve that the filter starts from, the points, what it makes of them, and the \
         truth.",
        slip_axis(),
        Axis::new("friction"),
    )
    .with(
        Ink::Reference,
        "start of the filter",
        Shape::Dashes(points_of(start)),
    )
    .with(Ink::Truth, "true curve", Shape::Line(points_of(TRUTH)))
    .with(Ink::Measured, "measured", Shape::Points(measured));
    if let Some(step) = steps.last() {
        let curve = curve_of(step.estimate.state);
        let (peak_std, slip_std) = step.estimate.covariance.std();
        let words = format!(
            "{:.3} \u{b1} {peak_std:.3} at slip {:.3} \u{b1} {slip_std:.3}",
            curve.peak_friction, curve.critical_slip
        );
        figure = with_estimate(figure, step);
        figure.caption = format!("{} Peak friction {words}.", figure.caption);
    }
    figure
}

/// The curve of a filter's state.
fn curve_of(state: State<f64>) -> Curve {
    Curve {
        peak_friction: state.peak_friction,
        critical_slip: state.critical_slip,
    }
}

/// Adds the curve of an estimate, its peak and that peak's 1-sigma ellipse.
fn with_estimate(figure: Figure, step: &Step) -> Figure {
    let curve = curve_of(step.estimate.state);
    figure
        .with(
            Ink::Estimate,
            "1-sigma of the peak",
            Shape::Outline(outline(step)),
        )
        .with(Ink::Estimate, "estimate", Shape::Line(points_of(curve)))
        .with(
            Ink::Estimate,
            "",
            Shape::Marker((curve.critical_slip, curve.peak_friction), String::new()),
        )
}

fn still(index: usize, steps: &[Step]) -> Figure {
    let measured = |range: &[Step]| {
        range
            .iter()
            .map(|step| (step.fusion.slip_ratio, step.fusion.measured_friction))
            .collect::<Vec<_>>()
    };
    let (so_far, to_come) = steps.split_at(steps.len().min(index + 1));
    let last = steps.len().saturating_sub(1);
    let mut figure = Figure::new(
        format!("After measurement {index} of {last}."),
        slip_axis(),
        Axis::new("friction").over(Extent::Fixed(-0.1, 1.25)),
    )
    .with(Ink::Reference, "to come", Shape::Points(measured(to_come)))
    .with(Ink::Truth, "true curve", Shape::Line(points_of(TRUTH)))
    .with(Ink::Measured, "measured", Shape::Points(measured(so_far)));
    if let Some(step) = so_far.last() {
        let state = step.estimate.state;
        let covariance = step.estimate.covariance;
        let (peak_std, slip_std) = covariance.std();
        figure.caption = format!(
            "After measurement {index} of {last}, slip {:.4}: peak friction {:.3}\u{a0}±\u{a0}{:.3}, critical \
             slip {:.3}\u{a0}±\u{a0}{:.3}, correlation {:.2}.",
            step.fusion.slip_ratio,
            state.peak_friction,
            peak_std,
            state.critical_slip,
            slip_std,
            covariance.correlation()
        );
        figure = with_estimate(figure, step);
    }
    figure
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_figure_of_the_article_is_there_once() {
        let figures = figures(1).unwrap();
        let mut names: Vec<_> = figures.iter().map(|figure| figure.name.clone()).collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), figures.len());
        assert_eq!(figures.len(), 9 + STILLS.len());
    }

    #[test]
    fn the_animation_has_a_frame_a_measurement_after_the_start() {
        let run = convergence(1).unwrap();
        assert_eq!(run.samples.len(), 41);
        let numbers: Vec<u64> = run.frames.iter().map(|frame| frame.sample).collect();
        assert_eq!(numbers, (0..=41).collect::<Vec<_>>());
        let start = run.frames[0].peak;
        assert_eq!((start.peak_friction, start.critical_slip_std), (0.6, 0.2));
    }
}
