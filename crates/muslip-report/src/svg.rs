//! Figures as SVG.
//!
//! For documents; on a page uPlot draws the same figures. Drawn by plotters on a canvas four times finer
//! than the figure's unit, because its coordinates are whole numbers.

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::ticks;
pub use super::canvas::DrawError;
use super::canvas::{FINENESS, FONT_SIZE, ROW, WIDTH, font, text};
use super::clip::pieces_inside;
use super::figure::{Cells, Figure, Layer, Shape};
use super::legend::Legend;
use super::shade::{FRAME, GRID, PAPER, blend, ink};

/// Height of its plot alone.
const PLOT_HEIGHT: i32 = 360;
/// About how many ticks there are along and up.
const TICKS: (usize, usize) = (8, 6);
/// Width of a line, in canvas units.
const THICKNESS: u32 = 9;
/// Draws a figure as a file that stands alone, on white.
///
/// # Errors
/// [`DrawError`] if plotters refuses, which no figure is known to bring about.
pub fn stand_alone(figure: &Figure) -> Result<String, DrawError> {
    Ok(with_head(&draw(figure)?, figure))
}

/// Replaces the opening tag, so that the figure scales with its surroundings and has a name for those
/// who cannot see it.
fn with_head(svg: &str, figure: &Figure) -> String {
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
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" style=\"background:#fff\" \
         viewBox=\"{view}\" role=\"img\" aria-label=\"{name}\">{body}"
    )
}

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

fn draw(figure: &Figure) -> Result<String, DrawError> {
    let legend = Legend::lay_out(figure);
    let head = legend.height() + ROW + 4;
    let foot = 2 * ROW + 6;
    let height = head + PLOT_HEIGHT + foot;
    let mut svg = String::new();
    let pixels = ((WIDTH * FINENESS) as u32, (height * FINENESS) as u32);
    let canvas = SVGBackend::with_string(&mut svg, pixels).into_drawing_area();
    legend.draw(&canvas)?;
    text(
        &canvas,
        &figure.y.label,
        (2, legend.height() + ROW / 2 + 2),
        HPos::Left,
    )?;
    text(
        &canvas,
        &figure.x.label,
        (WIDTH / 2, height - ROW / 2),
        HPos::Center,
    )?;

    let (along, up) = figure.ranges();
    let x_ticks = ticks(figure.x.scale, along.0, along.1, TICKS.0);
    let y_ticks = ticks(figure.y.scale, up.0, up.1, TICKS.1);
    let widest = y_ticks.iter().map(|(_, label)| label.chars().count()).max();
    let label_area = (widest.unwrap_or(1) as f64 * 0.62 * FONT_SIZE) as i32 + 10;
    let mut chart = ChartBuilder::on(&canvas)
        .margin_top(head * FINENESS)
        .margin_bottom((foot - ROW) * FINENESS)
        .margin_right(2 * (FONT_SIZE as i32) * FINENESS)
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
        .bold_line_style(GRID.stroke_width(FINENESS as u32))
        .axis_style(FRAME.stroke_width(FINENESS as u32))
        .set_all_tick_mark_size(4 * FINENESS)
        .label_style(font())
        .x_label_formatter(&|position| label_of(&x_ticks, position))
        .y_label_formatter(&|position| label_of(&y_ticks, position))
        .draw()?;
    for layer in &figure.layers {
        draw_layer(&mut chart, figure, layer, along, up)?;
    }
    canvas.present()?;
    drop(chart);
    drop(canvas);
    Ok(svg)
}

fn draw_layer(
    chart: &mut Chart<'_, '_>,
    figure: &Figure,
    layer: &Layer,
    along: (f64, f64),
    up: (f64, f64),
) -> Result<(), DrawError> {
    let color = ink(layer.ink);
    let stroke = color.stroke_width(THICKNESS);
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
            let radius = match points.len() {
                ..200 => 3 * FINENESS,
                _ => 2 * FINENESS,
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
            chart.draw_series([PathElement::new(path, color.stroke_width(THICKNESS / 2))])?;
        }
        Shape::Cells(cells) => draw_cells(chart, cells)?,
        Shape::Marker(point, caption) => {
            if let Some(at) = inside(point) {
                draw_marker(chart, at, caption, color, along)?;
            }
        }
    }
    Ok(())
}

fn draw_cells(chart: &mut Chart<'_, '_>, cells: &Cells) -> Result<(), DrawError> {
    chart.draw_series(cells.cells().map(|([left, right], [low, high], value)| {
        let color = blend(value / cells.limit);
        Rectangle::new([(left, low), (right, high)], color.filled())
    }))?;
    Ok(())
}

fn draw_marker(
    chart: &mut Chart<'_, '_>,
    at: (f64, f64),
    caption: &str,
    color: RGBColor,
    along: (f64, f64),
) -> Result<(), DrawError> {
    let radius = 5 * FINENESS;
    chart.draw_series([Circle::new(at, radius, PAPER.filled())])?;
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
    let style = font().color(&color).pos(Pos::new(anchor, VPos::Bottom));
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
    use crate::axis::{Axis, Extent};
    use crate::figure::{Ink, ellipse};

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
    fn no_raw_text_is_left_in_a_drawing() {
        let figure = figure(vec![(0.0, 0.0), (0.5, 0.8), (1.0, 0.3)]);
        let svg = stand_alone(&figure).unwrap();
        assert!(svg.contains("a &amp; b") && svg.contains("caption &lt;b>"));
        assert!(svg.trim_end().ends_with("</svg>"));
        assert!(!svg.contains("NaN"));
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
            let svg = stand_alone(&figure(points)).unwrap();
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

    #[test]
    fn a_map_has_a_rectangle_for_every_cell_with_a_value() {
        let cells = Cells {
            x_edges: vec![0.0, 1.0, 2.0],
            y_edges: vec![0.0, 1.0, 2.0],
            values: vec![1.0, f64::NAN, -1.0, 0.0],
            limit: 1.0,
            unit: "N".into(),
        };
        let figure = Figure::new("", Axis::new("x"), Axis::new("y"));
        let bare = stand_alone(&figure).unwrap().matches("<rect").count();
        let map = stand_alone(&figure.with(Ink::Estimate, "", Shape::Cells(cells))).unwrap();
        assert_eq!(map.matches("<rect").count(), bare + 3);
    }
}
