//! What a figure shows, independent of how it is drawn.

use super::axis::{Axis, Extent};

/// What a colour stands for; the page and the drawing give it its shade.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ink {
    /// Measured data.
    Measured,
    /// What was estimated or fitted.
    Estimate,
    /// A second estimate beside the first.
    Second,
    /// What is known to be true.
    Truth,
    /// A bound, a band of acceptance, a reference.
    Reference,
}

/// One thing in a figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// Its shape.
    pub shape: Shape,
    /// Its colour.
    pub ink: Ink,
    /// Its entry in the legend; none where empty.
    pub label: String,
    /// What of a filter's run it shows, where the page's player may move it.
    pub live: Option<Live>,
}

/// What of a filter's run a layer shows.
///
/// The page computes such a layer anew, for the frame that is shown or for a run with other assumptions;
/// `templates/convergence.js` has one entry for each of these.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Live {
    /// Points up to the frame.
    Measured,
    /// The frame's curve.
    Curve,
    /// Its 1-sigma band.
    CurveBand,
    /// The frame's 1-sigma ellipse.
    Ellipse,
    /// Its centre.
    Peak,
    /// The way of the estimate up to the frame.
    Way,
    /// Peak friction of every frame.
    PeakFriction,
    /// Its 1-sigma band.
    PeakFrictionBand,
    /// Critical slip of every frame.
    CriticalSlip,
    /// Its 1-sigma band.
    CriticalSlipBand,
    /// Innovation of every frame.
    Innovation,
    /// Two sigma either side of nought.
    InnovationBand,
    /// Normalised innovation squared of every frame.
    Nis,
    /// Its mean over the run.
    NisMean,
    /// Variance of peak friction over that at the start.
    PeakFrictionVariance,
    /// Variance of critical slip over that at the start.
    CriticalSlipVariance,
    /// Correlation of the two.
    Correlation,
    /// H P H' before each update.
    SignalBefore,
    /// H P H' after it.
    SignalAfter,
    /// Noise variance of each measurement.
    Noise,
}

/// Shapes, in the coordinates of the axes.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// Separate points.
    Points(Vec<(f64, f64)>),
    /// A line through points.
    Line(Vec<(f64, f64)>),
    /// A dashed line through points.
    Dashes(Vec<(f64, f64)>),
    /// The area between a low and a high value at each x: (x, low, high).
    Band(Vec<(f64, f64, f64)>),
    /// A closed outline, filled lightly.
    Outline(Vec<(f64, f64)>),
    /// A single marker with a caption beside it (which may be empty).
    Marker((f64, f64), String),
    /// A dashed level across the figure.
    Level(f64),
    /// A map: coloured cells between edges.
    Cells(Cells),
}

/// Values over the cells of a grid, coloured from one ink over paper at nought to another.
#[derive(Debug, Clone, PartialEq)]
pub struct Cells {
    /// Edges of the columns, ascending, one more than columns.
    pub x_edges: Vec<f64>,
    /// Edges of the rows, ascending, one more than rows.
    pub y_edges: Vec<f64>,
    /// Values row by row; NaN where there is none.
    pub values: Vec<f64>,
    /// The value that has the full colour, on either side of nought.
    pub limit: f64,
    /// Unit of the values.
    pub unit: String,
}

impl Cells {
    /// Every cell with a value: its ends along, its ends up, the value.
    pub(super) fn cells(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2], f64)> + '_ {
        self.y_edges
            .windows(2)
            .enumerate()
            .flat_map(move |(row, up)| {
                let columns = self.x_edges.len().saturating_sub(1);
                let values = self.values.iter().skip(row * columns);
                self.x_edges
                    .windows(2)
                    .zip(values)
                    .filter(|(_, value)| value.is_finite())
                    .filter_map(move |(along, &value)| {
                        Some((along.try_into().ok()?, up.try_into().ok()?, value))
                    })
            })
    }
}

/// A figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Name of its file where it is written for a document; empty where it has none of its own.
    pub name: String,
    /// What the figure is, for the reader of the page and for those who cannot see it.
    pub caption: String,
    /// Along.
    pub x: Axis,
    /// Up.
    pub y: Axis,
    /// From the back to the front.
    pub layers: Vec<Layer>,
}

impl Figure {
    /// An empty figure.
    pub fn new(caption: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self {
            name: String::new(),
            caption: caption.into(),
            x,
            y,
            layers: Vec::new(),
        }
    }

    /// The same figure with a name for its file.
    pub fn named(self, name: impl Into<String>) -> Self {
        let name = name.into();
        Self { name, ..self }
    }

    /// The same figure with one layer more, in front of the others.
    pub fn with(mut self, ink: Ink, label: impl Into<String>, shape: Shape) -> Self {
        self.layers.push(Layer {
            shape,
            ink,
            label: label.into(),
            live: None,
        });
        self
    }

    /// As [`Figure::with`], for a layer that the page's player may move.
    pub fn with_live(self, live: Live, ink: Ink, label: impl Into<String>, shape: Shape) -> Self {
        let mut figure = self.with(ink, label, shape);
        if let Some(layer) = figure.layers.last_mut() {
            layer.live = Some(live);
        }
        figure
    }

    /// The ranges of both axes in their own units, never empty.
    pub(super) fn extents(&self) -> ((f64, f64), (f64, f64)) {
        let (along, up) = self.ranges();
        (self.x.values(along), self.y.values(up))
    }

    /// Ranges of both axes as positions (logarithms where the axis is logarithmic), never empty.
    pub(super) fn ranges(&self) -> ((f64, f64), (f64, f64)) {
        let mut along = Spread::default();
        let mut up = Spread::default();
        for layer in &self.layers {
            layer.shape.spread(&mut along, &mut up);
        }
        // A dot at the end of an axis shows as a whole; a line ends where the axis does.
        let is_dots = |layer: &Layer| matches!(layer.shape, Shape::Points(_) | Shape::Marker(..));
        let dots = self.layers.iter().any(is_dots);
        let margin = if dots { 0.015 } else { 0.0 };
        let along = along.range(&self.x, margin, !dots);
        (along, up.range(&self.y, 0.06, true))
    }
}

/// Values that an axis should cover.
#[derive(Default)]
struct Spread {
    /// Of points, which may have outliers.
    points: Vec<f64>,
    /// Of everything else.
    drawn: Vec<f64>,
}

impl Shape {
    fn spread(&self, along: &mut Spread, up: &mut Spread) {
        match self {
            Self::Points(points) => {
                along.points.extend(points.iter().map(|point| point.0));
                up.points.extend(points.iter().map(|point| point.1));
            }
            Self::Line(points) | Self::Dashes(points) | Self::Outline(points) => {
                along.drawn.extend(points.iter().map(|point| point.0));
                up.drawn.extend(points.iter().map(|point| point.1));
            }
            Self::Band(points) => {
                along.drawn.extend(points.iter().map(|point| point.0));
                up.drawn
                    .extend(points.iter().flat_map(|point| [point.1, point.2]));
            }
            Self::Marker(point, _) => {
                along.drawn.push(point.0);
                up.drawn.push(point.1);
            }
            Self::Level(level) => up.drawn.push(*level),
            Self::Cells(cells) => {
                along.drawn.extend(&cells.x_edges);
                up.drawn.extend(&cells.y_edges);
            }
        }
    }
}

impl Spread {
    /// `snaps`: whether a range that must include a value ends there, where nothing lies beyond.
    fn range(self, axis: &Axis, margin: f64, snaps: bool) -> (f64, f64) {
        if let Extent::Fixed(low, high) = axis.extent
            && let (Some(low), Some(high)) = (axis.position(low), axis.position(high))
            && low < high
        {
            return (low, high);
        }
        let mut drawn: Vec<f64> = self
            .drawn
            .iter()
            .filter_map(|&v| axis.position(v))
            .collect();
        let mut points: Vec<f64> = self
            .points
            .iter()
            .filter_map(|&v| axis.position(v))
            .collect();
        drawn.extend(without_outliers(&mut points).into_iter().flatten());
        if let Extent::Including(value) = axis.extent {
            drawn.extend(axis.position(value));
        }
        let low = drawn.iter().copied().fold(f64::INFINITY, f64::min);
        let high = drawn.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if low > high {
            return (0.0, 1.0);
        }
        let around = if high > low {
            margin * (high - low)
        } else {
            0.5 * high.abs().max(1.0)
        };
        let ends_at = |end: f64| snaps && axis.extent == Extent::Including(end);
        (
            if ends_at(low) && high > low {
                low
            } else {
                low - around
            },
            if ends_at(high) && high > low {
                high
            } else {
                high + around
            },
        )
    }
}

/// The smallest and the largest of the values, less what lies further from the middle 90 % than that is
/// wide.
fn without_outliers(values: &mut [f64]) -> Option<[f64; 2]> {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let last = values.len().checked_sub(1)?;
        values.get((share * last as f64).round() as usize).copied()
    };
    let (low, high) = (at(0.05)?, at(0.95)?);
    let reach = (high - low).max(1e-12 * high.abs());
    let inside = |value: &f64| (low - reach..=high + reach).contains(value);
    let first = values.iter().copied().find(inside)?;
    let last = values.iter().copied().rev().find(inside)?;
    Some([first, last])
}

/// The 1-sigma ellipse of two quantities: the points at a Mahalanobis distance of 1 from their means.
///
/// It holds 39 % of the probability; its shadow on either axis is that quantity's 1-sigma interval.
pub fn ellipse(means: (f64, f64), stds: (f64, f64), correlation: f64) -> Vec<(f64, f64)> {
    const STEPS: u32 = 120;
    let correlation = correlation.clamp(-1.0, 1.0);
    // Cholesky: x = sx u, y = sy (r u + sqrt(1 - r^2) v) for (u, v) on the unit circle.
    let rest = (1.0 - correlation * correlation).sqrt();
    (0..=STEPS)
        .map(|step| {
            let angle = std::f64::consts::TAU * f64::from(step) / f64::from(STEPS);
            let (v, u) = angle.sin_cos();
            (
                means.0 + stds.0 * u,
                means.1 + stds.1 * (correlation * u + rest * v),
            )
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_of_the_ellipse_is_one_sigma_away() {
        let (sx, sy, r) = (0.02, 0.005, -0.6);
        let outline = ellipse((0.35, 0.15), (sx, sy), r);
        let mut widest: f64 = 0.0;
        for (x, y) in outline {
            let (u, v) = ((x - 0.35) / sx, (y - 0.15) / sy);
            let distance = (u * u - 2.0 * r * u * v + v * v) / (1.0 - r * r);
            assert!((distance - 1.0).abs() < 1e-9);
            widest = widest.max(u.abs());
        }
        assert!((widest - 1.0).abs() < 1e-9);
    }

    #[test]
    fn an_outlier_does_not_flatten_the_figure() {
        let mut points: Vec<(f64, f64)> = (0..100)
            .map(|i| (f64::from(i), f64::from(i % 10)))
            .collect();
        points.push((50.0, 1e300));
        points.push((51.0, f64::NAN));
        let figure = Figure::new("", Axis::new(""), Axis::new("")).with(
            Ink::Measured,
            "",
            Shape::Points(points),
        );
        let (_, (low, high)) = figure.ranges();
        assert!(low > -2.0 && high < 12.0, "{low} {high}");
    }

    #[test]
    fn a_figure_of_nothing_has_a_range_all_the_same() {
        for points in [
            vec![],
            vec![(f64::NAN, f64::NAN)],
            vec![(1.0, 1.0)],
            vec![(0.0, 0.0); 3],
        ] {
            let figure = Figure::new("", Axis::new(""), Axis::new("")).with(
                Ink::Measured,
                "",
                Shape::Line(points),
            );
            let ((x0, x1), (y0, y1)) = figure.ranges();
            assert!(x0 < x1 && y0 < y1);
        }
    }
}
