//! A filter's run for the page's player, and what the page needs to run the filter again.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use muslip::filter::PeakEstimate;
use muslip_analysis::estimate::{Consistency, EstimatorKind, Frame, Sample, Update};
use muslip_analysis::fit::Curve;
use serde_json::{Value, json};

use super::axis::{Axis, Extent};
use super::figure::{Figure, Ink, Live, Shape, ellipse};
use super::spec::rounded;

/// The core as WebAssembly: `cargo xtask what-if`.
const CORE: &[u8] = include_bytes!("../what-if/muslip_wasm.wasm");

/// A run.
#[derive(Debug, Clone, PartialEq)]
pub struct Convergence {
    /// The start and a selection of the measurements, the last among them.
    pub frames: Vec<Frame>,
    /// The measurements, or every so many-th of them.
    pub samples: Vec<Sample>,
    /// One of how many measurements is in `samples`; the first always is.
    pub stride: u64,
    /// How many measurements the filter used.
    pub used: u64,
    /// What the innovations say of the filter.
    pub consistency: Consistency,
    /// A curve to draw beside the estimate, known to be true.
    pub truth: Option<CurveLabel>,
    /// Which filter ran; `None` where the page cannot run it again.
    pub again: Option<EstimatorKind>,
    /// What the reader is told about running it again, or about why not.
    pub about_what_if: String,
}

/// A curve to draw beside the estimate, under its name in the legend.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveLabel {
    /// Name in the legend.
    pub name: String,
    /// Points (slip, friction) of the curve.
    pub points: Vec<(f64, f64)>,
}

/// Slips at which a curve is drawn: dense where it bends.
pub fn drawn_slips(largest: f64) -> impl Iterator<Item = f64> {
    const STEPS: u32 = 160;
    (0..=STEPS).map(move |step| largest * (f64::from(step) / f64::from(STEPS)).powi(2))
}

/// Points (x, y) of a line.
type LinePoints = Vec<(f64, f64)>;
/// Points (x, low, high) of a band.
type BandPoints = Vec<(f64, f64, f64)>;

/// The curve of an estimate and the 1-sigma of its friction, sqrt(H P H'), at each slip.
fn curve_and_band(peak: &PeakEstimate<f64>, largest: f64) -> (LinePoints, BandPoints) {
    let curve = Curve {
        peak_friction: peak.peak_friction,
        critical_slip: peak.critical_slip,
    };
    drawn_slips(largest)
        .map(|slip| {
            let friction = curve.friction(slip);
            let (by_peak, by_slip) = curve.gradient(slip);
            let (a, b) = (
                by_peak * peak.peak_friction_std,
                by_slip * peak.critical_slip_std,
            );
            let sigma = (a * a + 2.0 * peak.correlation * a * b + b * b)
                .max(0.0)
                .sqrt();
            ((slip, friction), (slip, friction - sigma, friction + sigma))
        })
        .unzip()
}

impl Convergence {
    /// The last frame's estimate.
    fn last(&self) -> PeakEstimate<f64> {
        self.frames.last().map_or(
            PeakEstimate {
                peak_friction: f64::NAN,
                peak_friction_std: f64::NAN,
                critical_slip: f64::NAN,
                critical_slip_std: f64::NAN,
                correlation: f64::NAN,
            },
            |frame| frame.peak,
        )
    }

    /// The largest slip that is drawn: a little beyond the peak at least, the locked wheel and its noise at
    /// most.
    fn largest_slip(&self) -> f64 {
        let samples = self.samples.iter().map(|sample| sample.slip);
        samples
            .fold(1.5 * self.last().critical_slip, f64::max)
            .clamp(0.05, 1.05)
    }

    /// The figures that the player moves: the curve over the points, and the ellipse close up.
    pub fn figures(&self) -> [Figure; 2] {
        [self.curve(), self.close_up()]
    }

    fn curve(&self) -> Figure {
        let peak = self.last();
        let (curve, band) = curve_and_band(&peak, self.largest_slip());
        let stride = self.samples.len().div_ceil(3000).max(1);
        let points = self
            .samples
            .iter()
            .step_by(stride)
            .map(|sample| (sample.slip, sample.friction))
            .collect();
        let start = self.frames.first().map_or(peak, |frame| frame.peak);
        let (start, _) = curve_and_band(&start, self.largest_slip());
        let mut figure = Figure::new(
            "Measured friction against slip, the estimated curve with its 1-sigma band, and the peak with its \
             1-sigma ellipse.",
            Axis::new("slip").over(Extent::Including(0.0)),
            Axis::new("friction coefficient").over(Extent::Including(0.0)),
        )
        .named("curve")
        .with(Ink::Reference, "start of the filter", Shape::Dashes(start))
        .with_live(Live::Measured, Ink::Measured, "measured", Shape::Points(points))
        .with_live(Live::CurveBand, Ink::Estimate, "1-sigma", Shape::Band(band));
        if let Some(truth) = &self.truth {
            let line = Shape::Line(truth.points.clone());
            figure = figure.with(Ink::Truth, &truth.name, line);
        }
        figure
            .with_live(Live::Curve, Ink::Estimate, "estimate", Shape::Line(curve))
            .with_live(
                Live::Ellipse,
                Ink::Estimate,
                "1-sigma of the peak",
                Shape::Outline(outline(&peak)),
            )
            .with_live(Live::Peak, Ink::Estimate, "", marker(&peak))
    }

    fn close_up(&self) -> Figure {
        let peak = self.last();
        // Three sigma around, and round it the last steps of the estimate's way there.
        let around = |value: f64, std: f64| Extent::Fixed(value - 3.2 * std, value + 3.2 * std);
        let way = self
            .frames
            .iter()
            .map(|frame| (frame.peak.critical_slip, frame.peak.peak_friction))
            .collect();
        let mut figure = Figure::new(
            "The peak with its 1-sigma ellipse, close up, and the path of the estimate.",
            Axis::new("critical slip").over(around(peak.critical_slip, peak.critical_slip_std)),
            Axis::new("peak friction").over(around(peak.peak_friction, peak.peak_friction_std)),
        )
        .named("ellipse")
        .with_live(
            Live::Way,
            Ink::Reference,
            "path of the estimate",
            Shape::Line(way),
        )
        .with_live(
            Live::Ellipse,
            Ink::Estimate,
            "1-sigma ellipse",
            Shape::Outline(outline(&peak)),
        );
        if let Some(truth) = &self.truth
            && let Some(&at) = truth.points.iter().max_by(|a, b| a.1.total_cmp(&b.1))
        {
            figure = figure.with(Ink::Truth, "true peak", Shape::Marker(at, String::new()));
        }
        figure.with_live(Live::Peak, Ink::Estimate, "estimate", marker(&peak))
    }

    /// The table of the frames: head and rows.
    pub fn table(&self) -> (Vec<String>, Vec<Vec<String>>) {
        let head = [
            "measurement",
            "time (s)",
            "slip",
            "friction",
            "peak friction",
            "1-sigma",
            "critical slip",
            "1-sigma",
            "correlation",
            "innovation",
            "NIS",
        ];
        let rows = self.frames.iter().map(|frame| {
            let Frame { sample, peak, .. } = frame;
            let of = |decimals: usize, value: fn(&Update) -> f64| {
                let value = frame.update.as_ref().map(value);
                let value = value.filter(|value| value.is_finite());
                value.map_or(String::new(), |value| minus(format!("{value:.decimals$}")))
            };
            vec![
                sample.to_string(),
                of(4, |update| update.time_s),
                of(4, |update| update.slip),
                of(4, |update| update.friction),
                minus(format!("{:.4}", peak.peak_friction)),
                format!("{:.4}", peak.peak_friction_std),
                minus(format!("{:.4}", peak.critical_slip)),
                format!("{:.4}", peak.critical_slip_std),
                minus(format!("{:.2}", peak.correlation)),
                of(4, |update| update.innovation),
                of(2, |update| update.nis),
            ]
        });
        (head.map(str::to_owned).into(), rows.collect())
    }

    /// The core to run again with, where the page can.
    pub(super) fn core(&self) -> Option<&'static [u8]> {
        self.again.is_some().then_some(CORE)
    }

    /// What to say where the page cannot run the filter again.
    pub(super) fn without_what_if(&self) -> Option<&str> {
        self.again.is_none().then_some(&self.about_what_if)
    }

    /// The page's data.
    pub(super) fn data(&self) -> Value {
        let of = |value: &dyn Fn(&Frame) -> f64| -> Vec<Value> {
            self.frames
                .iter()
                .map(|frame| rounded(value(frame)))
                .collect()
        };
        let update = |value: fn(&Update) -> f64| {
            of(&move |frame: &Frame| frame.update.as_ref().map_or(f64::NAN, value))
        };
        let samples = |value: fn(&Sample) -> f64| {
            let bytes: Vec<u8> = self
                .samples
                .iter()
                .flat_map(|sample| value(sample).to_le_bytes())
                .collect();
            BASE64.encode(bytes)
        };
        let start = self.frames.first().map(|frame| frame.peak);
        let numbers: Vec<u64> = self.frames.iter().map(|frame| frame.sample).collect();
        json!({
            "frames": {
                "sample": numbers,
                "time": update(|u| u.time_s),
                "slip": update(|u| u.slip),
                "friction": update(|u| u.friction),
                "peak": of(&|f| f.peak.peak_friction),
                "peakStd": of(&|f| f.peak.peak_friction_std),
                "criticalSlip": of(&|f| f.peak.critical_slip),
                "criticalSlipStd": of(&|f| f.peak.critical_slip_std),
                "correlation": of(&|f| f.peak.correlation),
                "innovation": update(|u| u.innovation),
                "innovationStd": update(|u| u.innovation_variance.sqrt()),
                "nis": update(|u| u.nis),
                "noise": update(|u| u.noise_variance),
                "before": update(|u| u.signal_before),
                "after": update(|u| u.signal_after),
            },
            "samples": {
                "slip": samples(|s| s.slip),
                "friction": samples(|s| s.friction),
                "std": samples(|s| s.friction_std),
                "stride": self.stride,
            },
            "used": self.used,
            "largestSlip": self.largest_slip(),
            "meanNis": rounded(self.consistency.mean_nis),
            "nisLow": self.consistency.nis_low,
            "nisHigh": self.consistency.nis_high,
            "whatIf": {
                "efficient": self.again == Some(EstimatorKind::Efficient),
                "peak": start.map(|peak| peak.peak_friction),
                "slip": start.map(|peak| peak.critical_slip),
            },
        })
    }
}

fn outline(peak: &PeakEstimate<f64>) -> LinePoints {
    ellipse(
        (peak.critical_slip, peak.peak_friction),
        (peak.critical_slip_std, peak.peak_friction_std),
        peak.correlation,
    )
}

fn marker(peak: &PeakEstimate<f64>) -> Shape {
    Shape::Marker((peak.critical_slip, peak.peak_friction), String::new())
}

/// With the minus sign of print.
fn minus(number: String) -> String {
    number.replace('-', "\u{2212}")
}
