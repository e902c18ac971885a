//! Pictures of the measured sets, and one of all placebos, as SVG.

use anyhow::{Result, anyhow};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use serde_json::Value;

use super::ask::Ask;
use super::curve::medians;
use super::placebo::{self, Fate};
use super::recording::{LOAD, SPEED, TIME, WHEEL};
use super::{Found, Tried, figure};
use crate::contract::{number, text};
use crate::generate::tyre::law;

/// Canvas units for each unit of the picture: its coordinates are whole numbers.
const FINE: i32 = 4;
const WIDTH: i32 = 720;
const HEIGHT: i32 = 400;
const LETTERS: f64 = 13.5;
/// plotters divides font sizes by this before it writes them.
const FONT_FACTOR: f64 = 1.24;
/// Points of one picture at most: each takes some eighty bytes.
const POINTS: usize = 400;
/// Bins of slip in which a prediction's median is drawn.
const BINS: usize = 30;

const INK: RGBColor = RGBColor(0x3c, 0x42, 0x4c);
const GRID: RGBColor = RGBColor(0xe7, 0xe9, 0xed);
const FRAME: RGBColor = RGBColor(0x9a, 0xa0, 0xaa);
const GREEN: RGBColor = RGBColor(0x00, 0x9e, 0x73);
const RED: RGBColor = RGBColor(0xc8, 0x28, 0x1e);
const BLUE: RGBColor = RGBColor(0x2f, 0x5f, 0xb3);
const BLACK: RGBColor = RGBColor(0x11, 0x14, 0x18);

/// How the values of a layer are drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Shape {
    Points,
    Line,
    Dashes,
}

/// Something drawn; layers of one name share an entry of the legend.
struct Layer {
    name: &'static str,
    colour: RGBColor,
    shape: Shape,
    values: Vec<(f64, f64)>,
}

/// A picture with two axes.
struct Picture {
    x: &'static str,
    y: &'static str,
    /// Ends of the axes.
    along: (f64, f64),
    up: (f64, f64),
    layers: Vec<Layer>,
}

impl Picture {
    fn add(&mut self, name: &'static str, colour: RGBColor, shape: Shape, values: Vec<(f64, f64)>) {
        self.layers.push(Layer {
            name,
            colour,
            shape,
            values,
        });
    }
}

/// A picture of each set and the one of all placebos: file names and texts.
pub(super) fn all(ask: &Ask, found: &[Found]) -> Result<Vec<(String, String)>> {
    let mut out = vec![("placebos.svg".to_owned(), matrix(found)?)];
    for set in found {
        let picture = match set.loaded.set.key {
            "coast-downs" => coast(set),
            "road-car" => road(set),
            "slides" => slides(set),
            "rock" => rock(set),
            _ => friction(ask, set),
        };
        out.push((format!("{}.svg", set.loaded.set.key), draw(&picture)?));
    }
    Ok(out)
}

/// What the picture of a set shows.
pub(super) fn caption(key: &str) -> &'static str {
    match key {
        "coast-downs" => {
            "Speed of six coast-downs. The base simulation knows no force but the tyre's, so the car keeps its speed; \
             with the constant force that was found it slows as measured."
        }
        "circles" | "drifts" => {
            "Friction against slip, a few of the samples. The base law is the one that the diagnosis refitted; the repaired \
             model's line is the median of what it predicts for these runs."
        }
        "circles-and-drifts" => {
            "Rubber and tape together: one law for both fits neither, and nobody has told the diagnosis why."
        }
        "road-car" => {
            "What two speeds differ by against the acceleration, means over a second. A vehicle speed that comes late lies on a \
             falling line, 0.08 s on the dashed one. The driven front wheel falls with some 0.05 s, a rear wheel with hardly any: \
             a part of what looks like a delay is drive slip."
        }
        "slides" => {
            "Twenty seconds of DS5: the wheel spins where its speed is far above the ground's, which comes from a lidar's \
             pose, late and over a window of 0.3 s."
        }
        "rock" => {
            "Friction of a rock slider about the step from 3 to 10 µm/s: good friction data, of which a simulation of a \
             wheel can say nothing."
        }
        _ => "",
    }
}

fn base_law(diagnosis: &Value) -> Option<(f64, f64)> {
    let value = |key: &str| diagnosis.get("base")?.get(key).map(|p| number(p, "value"));
    Some((value("peak_friction")?, value("critical_slip")?))
}

fn friction(ask: &Ask, set: &Found) -> Picture {
    let loaded = &set.loaded;
    let radius = loaded.rig_number("radius_m");
    let tape = |name: &str| name.starts_with("drift");
    let widest = if loaded.set.files.iter().any(|name| tape(name)) {
        1.0
    } else {
        0.3
    };
    let mut picture = Picture {
        x: "slip",
        y: "friction: drag / normal force",
        along: (0.0, widest),
        up: (0.0, if loaded.set.key == "drifts" { 0.5 } else { 0.9 }),
        layers: Vec::new(),
    };
    let mut repaired = (Vec::new(), Vec::new());
    let each = POINTS / loaded.runs.len();
    for (place, run) in loaded.runs.iter().enumerate() {
        let (slip, friction) = (run.slip_at(radius), run.friction());
        let step = run.len().div_ceil(each);
        let points = slip.iter().copied().zip(friction).step_by(step).collect();
        let (name, colour) = match (tape(loaded.set.files[place]), loaded.set.key) {
            (true, "circles-and-drifts") => ("on tape", BLUE),
            (false, "circles-and-drifts") => ("on rubber", GREEN),
            _ => ("measured", GREEN),
        };
        picture.add(name, colour, Shape::Points, points);
        let predicted = ask.predict(&set.whole, &loaded.rig, &loaded.paths[place], false);
        for ((f, n), s) in predicted
            .unwrap_or_default()
            .iter()
            .zip(&run.columns[LOAD])
            .zip(slip)
        {
            repaired.0.push(s);
            repaired.1.push(f / n);
        }
    }
    if let Some((peak, critical)) = base_law(&set.whole.value) {
        let curve = (0..=100)
            .map(|k| widest * f64::from(k) / 100.0)
            .map(|s| (s, peak * law(s / critical)))
            .collect();
        picture.add("base law, refitted", BLACK, Shape::Dashes, curve);
    }
    // Bins without data break the line.
    let line = medians(&repaired.0, &repaired.1, BINS, widest);
    let apart = 1.5 * widest / BINS as f64;
    for piece in line.chunk_by(|a, b| b.0 - a.0 < apart) {
        picture.add("repaired model, median", RED, Shape::Line, piece.to_vec());
    }
    picture
}

fn coast(set: &Found) -> Picture {
    let mut picture = Picture {
        x: "time, s",
        y: "vehicle speed, m/s",
        along: (0.0, 1.2),
        up: (0.0, 4.0),
        layers: Vec::new(),
    };
    let force = figure(&set.whole.value, "grade_or_drive", "force");
    let mass = set.loaded.rig_number("mass_kg");
    for run in &set.loaded.runs {
        let (time, speed) = (&run.columns[TIME], &run.columns[SPEED]);
        let (begin, end) = run.ends();
        let first = speed.first().copied().unwrap_or(0.0);
        let points = time.iter().copied().zip(speed.iter().copied()).collect();
        picture.add("measured", GREEN, Shape::Line, points);
        picture.add(
            "base: nothing slows the car",
            BLACK,
            Shape::Dashes,
            vec![(begin, first), (end, first)],
        );
        if let Some((force, _)) = force {
            let last = first - force / mass * (end - begin);
            picture.add(
                "with the constant force found",
                RED,
                Shape::Dashes,
                vec![(begin, first), (end, last)],
            );
        }
    }
    picture
}

/// Both speeds of a run between two times.
fn speeds(set: &Found, run: &str, radius: f64, along: (f64, f64), up: (f64, f64)) -> Picture {
    let mut picture = Picture {
        x: "time, s",
        y: "speed, m/s",
        along,
        up,
        layers: Vec::new(),
    };
    let place = set.loaded.set.files.iter().position(|name| *name == run);
    let run = &set.loaded.runs[place.unwrap_or(0)];
    let rows = (0..run.len()).filter(|k| (along.0..=along.1).contains(&run.columns[TIME][*k]));
    let wheel = rows
        .clone()
        .map(|k| (run.columns[TIME][k], radius * run.columns[WHEEL][k]))
        .collect();
    let vehicle = rows
        .map(|k| (run.columns[TIME][k], run.columns[SPEED][k]))
        .filter(|point| point.1.is_finite())
        .collect();
    picture.add("wheel speed times radius", GREEN, Shape::Line, wheel);
    picture.add("vehicle speed as recorded", BLUE, Shape::Line, vehicle);
    picture
}

/// What the speeds of a road car differ by, against its acceleration: a delay is a slope. Of the driven front wheel
/// and of a rear one, since drive slip has a slope too.
fn road(set: &Found) -> Picture {
    const LATE: f64 = 0.08;
    const HALF: f64 = 0.5;
    let mut picture = Picture {
        x: "acceleration, m/s²",
        y: "vehicle speed less wheel speed times radius, m/s",
        along: (-2.0, 2.0),
        up: (-0.2, 0.2),
        layers: Vec::new(),
    };
    let run = &set.loaded.runs[0];
    let rear = run.others.iter().find(|other| other.0 == "wheel_rl_rad_s");
    let wheels = [
        (
            "front wheel, driven",
            GREEN,
            0.3528,
            Some(&run.columns[WHEEL]),
        ),
        ("rear wheel", BLUE, 0.3534, rear.map(|other| &other.1)),
    ];
    let (time, speed) = (&run.columns[TIME], &run.columns[SPEED]);
    for (name, colour, radius, wheel) in wheels {
        let Some(wheel) = wheel else { continue };
        let (begin, end) = run.ends();
        let points = (0..POINTS / 2)
            .map(|k| (k as f64 + 0.5) / (POINTS / 2) as f64)
            .map(|share| begin + HALF + share * (end - begin - 2.0 * HALF))
            .filter_map(|middle| {
                let low = time.partition_point(|t| *t < middle - HALF);
                let high = time.partition_point(|t| *t <= middle + HALF);
                let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
                let (t, w) = (&time[low..high], &wheel[low..high]);
                let (mt, mw) = (mean(t), mean(w));
                let pairs = || t.iter().zip(w);
                let slope = pairs().map(|(t, w)| (t - mt) * (w - mw)).sum::<f64>()
                    / pairs().map(|(t, _)| (t - mt).powi(2)).sum::<f64>();
                let point = (radius * slope, mean(&speed[low..high]) - radius * mw);
                (point.0.is_finite() && point.1.is_finite()).then_some(point)
            })
            .collect();
        picture.add(name, colour, Shape::Points, points);
    }
    let line = vec![(-2.0, 2.0 * LATE), (2.0, -2.0 * LATE)];
    picture.add("vehicle speed late by 0.08 s", RED, Shape::Dashes, line);
    picture
}

fn slides(set: &Found) -> Picture {
    let radius = set.loaded.rig_number("radius_m");
    speeds(set, "DS5", radius, (64.0, 84.0), (-0.5, 4.0))
}

fn rock(set: &Found) -> Picture {
    let run = &set.loaded.runs[0];
    let (time, friction) = (&run.columns[TIME], run.friction());
    let (begin, end) = (60.0, 80.0);
    let points: Vec<(f64, f64)> = time
        .iter()
        .copied()
        .zip(friction)
        .filter(|(t, _)| (begin..=end).contains(t))
        .collect();
    let mut picture = Picture {
        x: "time, s",
        y: "friction: shear / normal stress",
        along: (begin, end),
        up: (0.600, 0.625),
        layers: Vec::new(),
    };
    let step = points.len().div_ceil(2 * POINTS).max(1);
    let line = points.into_iter().step_by(step).collect();
    picture.add("measured", GREEN, Shape::Line, line);
    picture
}

type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// What went wrong in the drawing, which nothing is known to bring about.
fn refused<E: std::error::Error + Send + Sync>(why: DrawingAreaErrorKind<E>) -> anyhow::Error {
    anyhow!("a picture could not be drawn: {why}")
}

/// An axis that is ticked at round numbers.
struct Ticked {
    ends: (f64, f64),
    ticks: Vec<f64>,
}

impl Ticked {
    fn new(ends: (f64, f64)) -> Ticked {
        let rough = (ends.1 - ends.0) / 7.0;
        let power = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0]
            .into_iter()
            .map(|s| s * power)
            .find(|s| *s >= rough)
            .unwrap_or(rough);
        let first = (ends.0 / step - 1e-9).ceil() as i64;
        let last = (ends.1 / step + 1e-9).floor() as i64;
        Ticked {
            ends,
            ticks: (first..=last).map(|k| k as f64 * step).collect(),
        }
    }

    /// Decimals that tell its ticks apart.
    fn decimals(&self) -> usize {
        let step = match self.ticks.as_slice() {
            [first, second, ..] => second - first,
            _ => 1.0,
        };
        (-(step.log10() + 1e-9).floor()).clamp(0.0, 6.0) as usize
    }
}

impl Ranged for Ticked {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let share = (value - self.ends.0) / (self.ends.1 - self.ends.0);
        limit.0 + (share * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _hint: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.ends.0..self.ends.1
    }
}

fn font(colour: RGBColor) -> TextStyle<'static> {
    ("sans-serif", LETTERS * FONT_FACTOR * f64::from(FINE))
        .into_font()
        .color(&colour)
}

fn words(
    canvas: &Canvas,
    said: &str,
    at: (i32, i32),
    anchor: HPos,
    colour: RGBColor,
) -> Result<()> {
    let style = font(colour).pos(Pos::new(anchor, VPos::Center));
    let place = (at.0 * FINE, at.1 * FINE);
    canvas
        .draw(&Text::new(said.to_owned(), place, style))
        .map_err(refused)
}

/// Gives the picture a width, so that it scales with the page.
fn framed(svg: &str, width: i32) -> String {
    let (head, body) = svg.split_once('>').unwrap_or(("", svg));
    let view = head
        .split_once("viewBox=\"")
        .and_then(|(_, rest)| rest.split_once('"'))
        .map_or("", |(view, _)| view);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" \
         viewBox=\"{view}\" role=\"img\">{body}"
    )
}

fn draw(picture: &Picture) -> Result<String> {
    let mut svg = String::new();
    let size = ((WIDTH * FINE) as u32, (HEIGHT * FINE) as u32);
    {
        let canvas = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        canvas.fill(&WHITE).map_err(refused)?;
        // The legend has a row of its own above the plot, where it covers nothing.
        let mut from = 12;
        let mut named: Vec<&str> = Vec::new();
        for layer in picture.layers.iter().filter(|l| !l.values.is_empty()) {
            if named.contains(&layer.name) {
                continue;
            }
            named.push(layer.name);
            let (left, right) = ((from * FINE, 14 * FINE), ((from + 22) * FINE, 14 * FINE));
            let stroke = layer.colour.stroke_width(9);
            match layer.shape {
                Shape::Points => canvas.draw(&Circle::new(
                    ((from + 11) * FINE, 14 * FINE),
                    4 * FINE,
                    layer.colour.filled(),
                )),
                Shape::Line => canvas.draw(&PathElement::new(vec![left, right], stroke)),
                Shape::Dashes => canvas
                    .draw(&PathElement::new(
                        vec![left, ((from + 9) * FINE, 14 * FINE)],
                        stroke,
                    ))
                    .and_then(|()| {
                        canvas.draw(&PathElement::new(
                            vec![((from + 13) * FINE, 14 * FINE), right],
                            stroke,
                        ))
                    }),
            }
            .map_err(refused)?;
            words(&canvas, layer.name, (from + 28, 14), HPos::Left, INK)?;
            from += 50 + (layer.name.chars().count() as f64 * 0.55 * LETTERS) as i32;
        }
        words(&canvas, picture.y, (12, 38), HPos::Left, INK)?;
        words(
            &canvas,
            picture.x,
            (WIDTH / 2, HEIGHT - 10),
            HPos::Center,
            INK,
        )?;
        let (x, y) = (Ticked::new(picture.along), Ticked::new(picture.up));
        let (x_digits, y_digits) = (x.decimals(), y.decimals());
        let mut chart = ChartBuilder::on(&canvas)
            .margin_top(52 * FINE)
            .margin_bottom(22 * FINE)
            .margin_right(26 * FINE)
            .x_label_area_size(22 * FINE)
            .y_label_area_size(54 * FINE)
            .build_cartesian_2d(x, y)
            .map_err(refused)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID.stroke_width(FINE as u32))
            .axis_style(FRAME.stroke_width(FINE as u32))
            .set_all_tick_mark_size(4 * FINE)
            .label_style(font(INK))
            .x_label_formatter(&|v| format!("{v:.x_digits$}"))
            .y_label_formatter(&|v| format!("{v:.y_digits$}"))
            .draw()
            .map_err(refused)?;
        let inside = |p: &(f64, f64)| {
            (picture.along.0..=picture.along.1).contains(&p.0)
                && (picture.up.0..=picture.up.1).contains(&p.1)
        };
        for layer in &picture.layers {
            let values = layer.values.iter().copied().filter(inside);
            let stroke = layer.colour.stroke_width(8);
            match layer.shape {
                Shape::Points => {
                    let style = layer.colour.mix(0.45).filled();
                    chart
                        .draw_series(values.map(|p| Circle::new(p, 9, style)))
                        .map_err(refused)?;
                }
                Shape::Line => {
                    chart
                        .draw_series(LineSeries::new(values, stroke))
                        .map_err(refused)?;
                }
                Shape::Dashes => {
                    chart
                        .draw_series(DashedLineSeries::new(values, 7 * FINE, 5 * FINE, stroke))
                        .map_err(refused)?;
                }
            }
        }
        canvas.present().map_err(refused)?;
    }
    Ok(framed(&svg, WIDTH))
}

/// Colour and words of a cell.
fn cell(tried: &Tried) -> (RGBColor, Vec<String>) {
    const BAD: RGBColor = RGBColor(0xf4, 0xb9, 0xb3);
    const POOR: RGBColor = RGBColor(0xfb, 0xe3, 0xb0);
    const GOOD: RGBColor = RGBColor(0xcd, 0xea, 0xdd);
    const NONE: RGBColor = RGBColor(0xf1, 0xf2, 0xf4);
    if tried.senseless.is_some() {
        return (NONE, vec!["-".to_owned()]);
    }
    let count = |fate| tried.names(fate).len();
    let (survive, arise, used) = (count(Fate::Survives), count(Fate::Arises), tried.used.len());
    let copy = tried.placebo == placebo::Placebo::CopiedDrag;
    let mut said = Vec::new();
    if survive > 0 {
        said.push(format!(
            "{survive} survive{}",
            if survive == 1 { "s" } else { "" }
        ));
    }
    if arise > 0 {
        said.push(format!(
            "{arise} arise{}",
            if arise == 1 { "s" } else { "" }
        ));
    }
    if used > 0 {
        said.push("column used".to_owned());
    }
    if copy {
        said.push(if tried.copy_told { "told" } else { "not told" }.to_owned());
    }
    if said.is_empty() {
        said.push("clean".to_owned());
    }
    let colour = if survive + used > 0 {
        BAD
    } else if arise > 0 || (copy && !tried.copy_told) {
        POOR
    } else {
        GOOD
    };
    (colour, said)
}

fn matrix(found: &[Found]) -> Result<String> {
    const LEFT: i32 = 270;
    const CELL: (i32, i32) = (124, 46);
    const TOP: i32 = 44;
    let width = LEFT + CELL.0 * placebo::ALL.len() as i32 + 8;
    let height = TOP + CELL.1 * found.len() as i32 + 34;
    let mut svg = String::new();
    let size = ((width * FINE) as u32, (height * FINE) as u32);
    {
        let canvas = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        canvas.fill(&WHITE).map_err(refused)?;
        words(&canvas, "set and verdict", (10, 22), HPos::Left, INK)?;
        for (column, placebo) in placebo::ALL.iter().enumerate() {
            let x = LEFT + CELL.0 * column as i32 + CELL.0 / 2;
            // Long names take two lines.
            let lines: Vec<&str> = match placebo.name() {
                "runs in another order" => vec!["runs in", "another order"],
                "other random columns" => vec!["other random", "columns"],
                name => vec![name],
            };
            for (k, line) in lines.iter().enumerate() {
                let y = 22 + 17 * k as i32 - 8 * (lines.len() as i32 - 1);
                words(&canvas, line, (x, y), HPos::Center, INK)?;
            }
        }
        for (row, set) in found.iter().enumerate() {
            let top = TOP + CELL.1 * row as i32;
            let middle = top + CELL.1 / 2;
            words(&canvas, set.loaded.set.name, (10, middle), HPos::Left, INK)?;
            let verdict: String = text(&set.whole.value, "verdict").chars().take(18).collect();
            let verdict = verdict.replace('_', " ");
            words(&canvas, &verdict, (LEFT - 8, middle), HPos::Right, FRAME)?;
            for (column, placebo) in placebo::ALL.iter().enumerate() {
                let Some(tried) = set.tried.iter().find(|t| t.placebo == *placebo) else {
                    continue;
                };
                let (colour, said) = cell(tried);
                let left = LEFT + CELL.0 * column as i32;
                let corners = [
                    ((left + 2) * FINE, (top + 2) * FINE),
                    ((left + CELL.0 - 2) * FINE, (top + CELL.1 - 2) * FINE),
                ];
                canvas
                    .draw(&Rectangle::new(corners, colour.filled()))
                    .map_err(refused)?;
                for (k, line) in said.iter().enumerate() {
                    let y = middle + 17 * k as i32 - 8 * (said.len() as i32 - 1);
                    let x = left + CELL.0 / 2;
                    words(&canvas, line, (x, y), HPos::Center, BLACK)?;
                }
            }
        }
        let note = "red: a failure; yellow: a name that the original had not, or a copy not told; grey: makes no sense";
        words(&canvas, note, (10, height - 14), HPos::Left, INK)?;
        canvas.present().map_err(refused)?;
    }
    Ok(framed(&svg, width))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_has_axes_with_round_ticks_and_a_legend_entry_a_name() {
        let mut picture = Picture {
            x: "time, s",
            y: "speed, m/s",
            along: (0.0, 1.2),
            up: (0.600, 0.625),
            layers: vec![],
        };
        let line = vec![(0.0, 0.61), (0.5, f64::NAN), (1.0, 0.62), (9.0, 0.61)];
        picture.add("one <name>", GREEN, Shape::Line, line.clone());
        picture.add("one <name>", GREEN, Shape::Dashes, line.clone());
        picture.add("points", RED, Shape::Points, line);
        let svg = draw(&picture).unwrap();
        assert_eq!(svg.matches("one &lt;name&gt;").count(), 1);
        assert!(svg.contains("0.620") && svg.contains("speed, m/s") && !svg.contains("NaN"));
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    }
}
