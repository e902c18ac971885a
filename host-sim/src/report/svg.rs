//! Figures as SVG.
//!
//! Drawn by plotters on a canvas four times finer than the figure's unit, because its coordinates are
//! whole numbers. Colours are placeholders while drawing; at the end they become CSS variables for a page
//! that knows light and dark, or plain shades for a file that stands alone.

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::ticks;
use super::clip::pieces_inside;
use super::figure::{Figure, Layer, Shape};
use super::shade::{FRAME, GRID, PAPER, SHADES, TEXT, ink};

/// Canvas units for each unit of the figure.
const FINENESS: i32 = 4;
/// plotters divides font sizes by this before it writes them.
const FONT_FACTOR: f64 = 1.24;
/// Height of a row of the legend.
const ROW: i32 = 20;

/// How large a figure is drawn; on a page this is the width at which its text has its natural size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Size {
    /// For a desk: 760 units wide.
    Wide,
    /// For a hand: 360 units wide.
    Narrow,
}

impl Size {
    fn width(self) -> i32 {
        match self {
            Self::Wide => 760,
            Self::Narrow => 360,
        }
    }

    fn plot_height(self) -> i32 {
        match self {
            Self::Wide => 360,
            Self::Narrow => 250,
        }
    }

    fn font(self) -> f64 {
        match self {
            Self::Wide => 13.5,
            Self::Narrow => 12.0,
        }
    }

    fn ticks(self) -> (usize, usize) {
        match self {
            Self::Wide => (8, 6),
            Self::Narrow => (4, 5),
        }
    }
}

/// A figure that could not be drawn.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("a figure could not be drawn: {0}")]
pub struct DrawError(String);

impl<E: std::error::Error + Send + Sync> From<DrawingAreaErrorKind<E>> for DrawError {
    fn from(error: DrawingAreaErrorKind<E>) -> Self {
        Self(error.to_string())
    }
}

/// Draws a figure for a page: colours are the page's CSS variables.
///
/// # Errors
/// [`DrawError`] if plotters refuses, which no figure is known to bring about.
pub fn for_page(figure: &Figure, size: Size) -> Result<String, DrawError> {
    let mut svg = draw(figure, size)?;
    // What says nothing is left out: a page holds thousands of points.
    svg = svg.replace(" stroke=\"none\" stroke-width=\"1\"", "");
    for shade in SHADES {
        svg = svg.replace(&shade.placeholder(), &format!("var(--{})", shade.variable));
    }
    let class = match size {
        Size::Wide => "wide",
        Size::Narrow => "narrow",
    };
    Ok(with_head(&svg, &format!("class=\"{class}\""), figure))
}

/// Draws a figure as a file that stands alone, on white.
///
/// # Errors
/// As [`for_page`].
pub fn stand_alone(figure: &Figure) -> Result<String, DrawError> {
    let mut svg = draw(figure, Size::Wide)?;
    for shade in SHADES {
        svg = svg.replace(&shade.placeholder(), shade.on_white);
    }
    let head = "xmlns=\"http://www.w3.org/2000/svg\" width=\"760\" style=\"background:#fff\"";
    Ok(with_head(&svg, head, figure))
}

/// Replaces the opening tag, so that the figure scales with its surroundings and has a name for those
/// who cannot see it.
fn with_head(svg: &str, attributes: &str, figure: &Figure) -> String {
    let (head, body) = svg.split_once('>').unwrap_or(("", svg));
    let view = head
        .split_once("viewBox=\"")
        .and_then(|(_, rest)| rest.split_once('"'))
        .map_or("", |(view, _)| view);
    let name = figure
        .caption
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('"', "&quot;");
    format!("<svg {attributes} viewBox=\"{view}\" role=\"img\" aria-label=\"{name}\">{body}")
}

type Canvas<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Ticked, Ticked>>;

/// An axis of positions from a low to a high end, ticked where it is told.
struct Ticked {
    low: f64,
    high: f64,
    ticks: Vec<f64>,
}

impl Ticked {
    fn new((low, high): (f64, f64), ticks: &[(f64, String)]) -> Self {
        Self {
            low,
            high,
            ticks: ticks.iter().map(|tick| tick.0).collect(),
        }
    }
}

impl Ranged for Ticked {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let share = (value - self.low) / (self.high - self.low);
        limit.0 + (share * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _hint: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.low..self.high
    }
}

fn draw(figure: &Figure, size: Size) -> Result<String, DrawError> {
    let legend = Legend::lay_out(figure, size);
    let head = legend.height() + ROW + 4;
    let foot = 2 * ROW + 6;
    let height = head + size.plot_height() + foot;
    let mut svg = String::new();
    let pixels = ((size.width() * FINENESS) as u32, (height * FINENESS) as u32);
    let canvas = SVGBackend::with_string(&mut svg, pixels).into_drawing_area();
    legend.draw(&canvas, size)?;
    text(
        &canvas,
        &figure.y.label,
        (2, legend.height() + ROW / 2 + 2),
        HPos::Left,
        size,
    )?;
    text(
        &canvas,
        &figure.x.label,
        (size.width() / 2, height - ROW / 2),
        HPos::Center,
        size,
    )?;

    let (along, up) = figure.ranges();
    let (x_count, y_count) = size.ticks();
    let x_ticks = ticks(figure.x.scale, along.0, along.1, x_count);
    let y_ticks = ticks(figure.y.scale, up.0, up.1, y_count);
    let widest = y_ticks.iter().map(|(_, label)| label.chars().count()).max();
    let label_area = (widest.unwrap_or(1) as f64 * 0.62 * size.font()) as i32 + 10;
    let mut chart = ChartBuilder::on(&canvas)
        .margin_top(head * FINENESS)
        .margin_bottom((foot - ROW) * FINENESS)
        .margin_right(2 * (size.font() as i32) * FINENESS)
        .x_label_area_size(ROW * FINENESS)
        .y_label_area_size(label_area * FINENESS)
        .build_cartesian_2d(Ticked::new(along, &x_ticks), Ticked::new(up, &y_ticks))?;
    let label_of = |ticks: &[(f64, String)], position: &f64| {
        ticks
            .iter()
            .find(|tick| tick.0 == *position)
            .map_or_else(String::new, |tick| tick.1.clone())
    };
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID.color().stroke_width(FINENESS as u32))
        .axis_style(FRAME.color().stroke_width(FINENESS as u32))
        .set_all_tick_mark_size(4 * FINENESS)
        .label_style(font(size))
        .x_label_formatter(&|position| label_of(&x_ticks, position))
        .y_label_formatter(&|position| label_of(&y_ticks, position))
        .draw()?;
    for layer in &figure.layers {
        draw_layer(&mut chart, figure, layer, along, up, size)?;
    }
    canvas.present()?;
    drop(chart);
    drop(canvas);
    Ok(svg)
}

fn font(size: Size) -> TextStyle<'static> {
    (
        "sans-serif",
        size.font() * FONT_FACTOR * f64::from(FINENESS),
    )
        .into_font()
        .color(&TEXT.color())
}

fn text(
    canvas: &Canvas<'_>,
    words: &str,
    at: (i32, i32),
    anchor: HPos,
    size: Size,
) -> Result<(), DrawError> {
    let style = font(size).pos(Pos::new(anchor, VPos::Center));
    let at = (at.0 * FINENESS, at.1 * FINENESS);
    Ok(canvas.draw(&Text::new(words.to_owned(), at, style))?)
}

/// Width of a text, near enough to lay out a legend: an average character is 0.6 of the font's height.
fn width_of(words: &str, size: Size) -> i32 {
    (words.chars().count() as f64 * 0.6 * size.font()).ceil() as i32
}

/// The entries of a figure's legend, in rows from the left.
struct Legend<'a> {
    entries: Vec<(&'a Layer, (i32, i32))>,
    rows: i32,
}

impl<'a> Legend<'a> {
    const SWATCH: i32 = 22;
    const GAP: i32 = 18;

    fn lay_out(figure: &'a Figure, size: Size) -> Self {
        let mut entries = Vec::new();
        let (mut x, mut row) = (2, 0);
        for layer in figure.layers.iter().filter(|layer| !layer.label.is_empty()) {
            let width = Self::SWATCH + 6 + width_of(&layer.label, size);
            if x > 2 && x + width > size.width() {
                x = 2;
                row += 1;
            }
            entries.push((layer, (x, row * ROW + ROW / 2)));
            x += width + Self::GAP;
        }
        let rows = if entries.is_empty() { 0 } else { row + 1 };
        Self { entries, rows }
    }

    fn height(&self) -> i32 {
        self.rows * ROW
    }

    fn draw(&self, canvas: &Canvas<'_>, size: Size) -> Result<(), DrawError> {
        for (layer, (x, y)) in &self.entries {
            let color = ink(layer.ink);
            let stroke = color.stroke_width(2 * FINENESS as u32);
            let (left, right) = (x * FINENESS, (x + Self::SWATCH) * FINENESS);
            let (top, middle, bottom) = ((y - 5) * FINENESS, y * FINENESS, (y + 5) * FINENESS);
            let centre = ((left + right) / 2, middle);
            match &layer.shape {
                Shape::Points(_) => {
                    canvas.draw(&Circle::new(centre, 3 * FINENESS, color.filled()))?
                }
                Shape::Marker(..) => canvas.draw(&Circle::new(centre, 5 * FINENESS, stroke))?,
                Shape::Band(_) => {
                    canvas.draw(&Rectangle::new(
                        [(left, top), (right, bottom)],
                        color.mix(0.22).filled(),
                    ))?;
                }
                Shape::Outline(_) => {
                    canvas.draw(&Rectangle::new(
                        [(left, top), (right, bottom)],
                        color.mix(0.18).filled(),
                    ))?;
                    canvas.draw(&Rectangle::new([(left, top), (right, bottom)], stroke))?;
                }
                Shape::Line(_) => {
                    canvas.draw(&PathElement::new([(left, middle), (right, middle)], stroke))?
                }
                Shape::Dashes(_) | Shape::Level(_) => {
                    for part in 0..3 {
                        let from = left + part * 8 * FINENESS;
                        let to = from + 5 * FINENESS;
                        canvas.draw(&PathElement::new([(from, middle), (to, middle)], stroke))?;
                    }
                }
            }
            text(
                canvas,
                &layer.label,
                (x + Self::SWATCH + 6, *y),
                HPos::Left,
                size,
            )?;
        }
        Ok(())
    }
}

fn draw_layer(
    chart: &mut Chart<'_, '_>,
    figure: &Figure,
    layer: &Layer,
    along: (f64, f64),
    up: (f64, f64),
    size: Size,
) -> Result<(), DrawError> {
    let color = ink(layer.ink);
    let thickness = match size {
        Size::Wide => 9,
        Size::Narrow => 7,
    };
    let stroke = color.stroke_width(thickness);
    // Areas are held within the frame, so that nothing is drawn over the labels.
    let held = |point: (f64, f64)| -> Option<(f64, f64)> {
        let x = figure.x.position(point.0)?;
        let y = figure.y.position(point.1)?;
        (along.0..=along.1)
            .contains(&x)
            .then(|| (x, y.clamp(up.0, up.1)))
    };
    let inside = |point: &(f64, f64)| -> Option<(f64, f64)> {
        held(*point).filter(|held| Some(held.1) == figure.y.position(point.1))
    };
    match &layer.shape {
        Shape::Points(points) => {
            let radius = match (size, points.len()) {
                (Size::Wide, ..200) => 3 * FINENESS,
                (Size::Wide, _) => 2 * FINENESS,
                (Size::Narrow, ..200) => 2 * FINENESS,
                (Size::Narrow, _) => 3 * FINENESS / 2,
            };
            let opacity = if points.len() > 200 { 0.4 } else { 0.7 };
            let style = color.mix(opacity).filled();
            chart.draw_series(
                points
                    .iter()
                    .filter_map(inside)
                    .map(|point| Circle::new(point, radius, style)),
            )?;
        }
        Shape::Line(points) => {
            for piece in pieces_inside(figure, points, along, up) {
                chart.draw_series([PathElement::new(piece, stroke)])?;
            }
        }
        Shape::Dashes(points) => {
            for piece in pieces_inside(figure, points, along, up) {
                dashes(chart, piece, stroke)?;
            }
        }
        Shape::Level(level) => {
            if let Some(y) = figure.y.position(*level)
                && (up.0..=up.1).contains(&y)
            {
                dashes(chart, vec![(along.0, y), (along.1, y)], stroke)?;
            }
        }
        Shape::Band(points) => {
            let low = points.iter().filter_map(|&(x, low, _)| held((x, low)));
            let high = points
                .iter()
                .rev()
                .filter_map(|&(x, _, high)| held((x, high)));
            let outline: Vec<_> = low.chain(high).collect();
            chart.draw_series([Polygon::new(outline, color.mix(0.18).filled())])?;
        }
        Shape::Outline(points) => {
            let path: Vec<_> = points.iter().filter_map(|&point| held(point)).collect();
            chart.draw_series([Polygon::new(path.clone(), color.mix(0.18).filled())])?;
            chart.draw_series([PathElement::new(path, color.stroke_width(thickness / 2))])?;
        }
        Shape::Marker(point, caption) => {
            if let Some(at) = inside(point) {
                draw_marker(chart, at, caption, color, along, size)?;
            }
        }
    }
    Ok(())
}

fn draw_marker(
    chart: &mut Chart<'_, '_>,
    at: (f64, f64),
    caption: &str,
    color: RGBColor,
    along: (f64, f64),
    size: Size,
) -> Result<(), DrawError> {
    let radius = 5 * FINENESS;
    chart.draw_series([Circle::new(at, radius, PAPER.color().filled())])?;
    chart.draw_series([Circle::new(at, radius, color.stroke_width(9))])?;
    if caption.is_empty() {
        return Ok(());
    }
    // The caption goes to the side with room.
    let to_the_right = at.0 < 0.5 * (along.0 + along.1);
    let (anchor, shift) = if to_the_right {
        (HPos::Left, 12 * FINENESS)
    } else {
        (HPos::Right, -12 * FINENESS)
    };
    let style = font(size).color(&color).pos(Pos::new(anchor, VPos::Bottom));
    let caption = caption.to_owned();
    chart
        .draw_series([EmptyElement::at(at) + Text::new(caption, (shift, -8 * FINENESS), style)])?;
    Ok(())
}

fn dashes(
    chart: &mut Chart<'_, '_>,
    path: Vec<(f64, f64)>,
    stroke: ShapeStyle,
) -> Result<(), DrawError> {
    chart.draw_series(DashedLineSeries::new(
        path,
        7 * FINENESS,
        5 * FINENESS,
        stroke,
    ))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Axis, Extent, Ink, ellipse};

    fn figure(points: Vec<(f64, f64)>) -> Figure {
        let level = Shape::Level(0.5);
        Figure::new(
            "caption <b>",
            Axis::new("slip"),
            Axis::new("friction").over(Extent::Including(0.0)),
        )
        .with(Ink::Measured, "a & b", Shape::Points(points.clone()))
        .with(Ink::Estimate, "line", Shape::Line(points.clone()))
        .with(Ink::Second, "dashed", Shape::Dashes(points.clone()))
        .with(Ink::Reference, "level", level)
        .with(
            Ink::Estimate,
            "band",
            Shape::Band(points.iter().map(|&(x, y)| (x, y - 0.1, y + 0.1)).collect()),
        )
        .with(
            Ink::Truth,
            "ellipse",
            Shape::Outline(ellipse((0.5, 0.5), (0.1, 0.1), 0.3)),
        )
        .with(
            Ink::Estimate,
            "peak",
            Shape::Marker((0.5, 0.5), "here".into()),
        )
    }

    #[test]
    fn no_placeholder_and_no_raw_text_is_left_in_a_drawing() {
        let figure = figure(vec![(0.0, 0.0), (0.5, 0.8), (1.0, 0.3)]);
        for svg in [
            for_page(&figure, Size::Wide).unwrap(),
            for_page(&figure, Size::Narrow).unwrap(),
            stand_alone(&figure).unwrap(),
        ] {
            assert!(!svg.contains("#FE"), "a placeholder is left");
            assert!(svg.contains("a &amp; b") && svg.contains("caption &lt;b>"));
            assert!(svg.trim_end().ends_with("</svg>"));
            assert!(!svg.contains("NaN"));
        }
        assert!(
            for_page(&figure, Size::Wide)
                .unwrap()
                .contains("var(--measured)")
        );
    }

    #[test]
    fn points_without_sense_are_left_out_and_break_nothing() {
        let wild = vec![
            (f64::NAN, 0.1),
            (0.1, f64::INFINITY),
            (0.2, 1e308),
            (0.3, -1e308),
            (1e308, 0.1),
            (0.4, 0.4),
        ];
        for points in [wild, vec![], vec![(0.0, 0.0)]] {
            let svg = for_page(&figure(points), Size::Narrow).unwrap();
            assert!(!svg.contains("NaN") && !svg.contains("inf"));
        }
    }

    #[test]
    fn a_logarithmic_axis_leaves_out_what_has_no_logarithm() {
        let mut figure = figure(vec![(0.0, 0.1), (1.0, 0.2), (100.0, 0.3)]);
        figure.x = figure.x.logarithmic();
        let svg = stand_alone(&figure).unwrap();
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }
}
