//! Figures of the calibration as SVG: reliability of confidence, power, p-values of the null.
//!
//! Drawn on a canvas four times finer than the figure's unit, because the library's coordinates are whole numbers. The
//! legend stands above the frame, where it covers nothing.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, anyhow};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::judge::calibration::bins;
use crate::judge::case::Case;
use crate::judge::family::Family;
use crate::judge::power::{SIZES, curves};
use crate::judge::uniform::families;

const FINENESS: i32 = 4;
const WIDTH: i32 = 720;
const PLOT_HEIGHT: i32 = 380;
/// Height of a row of text, and of its letters.
const ROW: i32 = 21;
const LETTERS: f64 = 13.5;
/// The library divides font sizes by this before it writes them.
const FONT_FACTOR: f64 = 1.24;
/// Room for the labels up the left side, and beyond the right end of the frame.
const SIDES: (i32, i32) = (52, 26);

const TEXT: RGBColor = RGBColor(45, 50, 58);
const FRAME: RGBColor = RGBColor(140, 146, 155);
const GRID: RGBColor = RGBColor(228, 230, 234);
const IDEAL: RGBColor = RGBColor(0, 90, 181);
const CHAINS: RGBColor = RGBColor(205, 70, 0);
/// Inks of the single pairs of sensors: told apart by the colour-blind too, with the dashes' help.
const OTHERS: [RGBColor; 6] = [
    RGBColor(0, 140, 110),
    RGBColor(190, 90, 160),
    RGBColor(150, 120, 0),
    RGBColor(60, 170, 220),
    RGBColor(110, 80, 200),
    RGBColor(120, 125, 130),
];

/// A point with its interval: along, low, value, high.
type Spread = (f64, f64, f64, f64);

enum Shape {
    Line(Vec<(f64, f64)>),
    Dashes(Vec<(f64, f64)>),
    Area(Vec<(f64, f64)>),
    Spreads(Vec<Spread>),
}

struct Layer {
    /// Empty where the legend has no word for it.
    words: String,
    ink: RGBColor,
    /// Of a line, in quarters of the figure's unit.
    thickness: u32,
    shape: Shape,
}

struct Figure {
    /// For those who cannot see it.
    caption: String,
    along: &'static str,
    up: &'static str,
    /// Positions along, with what is written there.
    ticks: Vec<(f64, String)>,
    /// Positions up, from 0 to 1.
    up_ticks: Vec<(f64, String)>,
    ends: (f64, f64),
    layers: Vec<Layer>,
}

fn family_ink(family: Family) -> RGBColor {
    if family == Family::Chains {
        CHAINS
    } else {
        IDEAL
    }
}

fn family_words(family: Family) -> &'static str {
    if family == Family::Chains {
        "real measuring chains"
    } else {
        "ideal sensors"
    }
}

fn fifths() -> Vec<(f64, String)> {
    (0..=5)
        .map(|fifth| f64::from(fifth) / 5.0)
        .map(|value| (value, format!("{value:.1}")))
        .collect()
}

fn percents() -> Vec<(f64, String)> {
    fifths()
        .into_iter()
        .map(|(value, _)| (value, format!("{:.0} %", 100.0 * value)))
        .collect()
}

/// Where a probability stands on an axis that is stretched towards 1, where most calls are made.
fn stretched(probability: f64) -> f64 {
    (1.0 - 0.95 * probability).ln() / 0.05f64.ln()
}

fn diagonal(words: &str) -> Layer {
    Layer {
        words: words.to_owned(),
        ink: FRAME,
        thickness: 6,
        shape: Shape::Dashes(vec![(0.0, 0.0), (1.0, 1.0)]),
    }
}

/// Reliability diagram of confidence.
///
/// # Errors
/// Where the file cannot be written.
pub fn reliability(cases: &[Case], path: &Path) -> Result<()> {
    let mut layers = vec![diagonal("as often right as said")];
    for family in [Family::Ideal, Family::Chains] {
        let bins = bins(cases, family);
        let count: usize = bins.iter().map(|bin| bin.right.of).sum();
        if count == 0 {
            continue;
        }
        // A little apart, so that neither family's interval hides the other's.
        let shift = if family == Family::Chains {
            0.004
        } else {
            -0.004
        };
        let spreads: Vec<Spread> = bins
            .iter()
            .map(|bin| {
                let (low, high) = bin.right.interval();
                (
                    (stretched(bin.said) + shift).clamp(0.0, 1.0),
                    stretched(low),
                    stretched(bin.right.value()),
                    stretched(high),
                )
            })
            .collect();
        layers.push(Layer {
            words: String::new(),
            ink: family_ink(family),
            thickness: 5,
            shape: Shape::Line(spreads.iter().map(|spread| (spread.0, spread.2)).collect()),
        });
        layers.push(Layer {
            words: format!("{}, {count} calls", family_words(family)),
            ink: family_ink(family),
            thickness: 7,
            shape: Shape::Spreads(spreads),
        });
    }
    let ticks = || {
        [0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0]
            .map(|edge| (stretched(edge), format!("{edge}")))
            .to_vec()
    };
    draw(
        &Figure {
            caption: "Share of names that were right against the confidence stated".to_owned(),
            along: "confidence stated, mean of the bin (both axes stretched towards 1)",
            up: "share right, with 95 % interval",
            ticks: ticks(),
            up_ticks: ticks(),
            ends: (0.0, 1.0),
            layers,
        },
        path,
    )
}

/// Power against the size of an effect.
///
/// # Errors
/// Where the file cannot be written.
pub fn power(cases: &[Case], path: &Path) -> Result<()> {
    let mut layers = Vec::new();
    let curves = curves(cases);
    for curve in &curves {
        let low = curve.points.iter().map(|p| (p.size.ln(), p.interval.0));
        let high = curve.points.iter().map(|p| (p.size.ln(), p.interval.1));
        layers.push(Layer {
            words: String::new(),
            ink: family_ink(curve.family),
            thickness: 0,
            shape: Shape::Area(low.chain(high.rev()).collect()),
        });
    }
    for curve in &curves {
        let points = || curve.points.iter();
        let count: usize = points().map(|point| point.found.of).sum();
        layers.push(Layer {
            words: String::new(),
            ink: family_ink(curve.family),
            thickness: 9,
            shape: Shape::Line(points().map(|p| (p.size.ln(), p.found.value())).collect()),
        });
        layers.push(Layer {
            words: format!(
                "{}: {count} effects, {} nulls",
                family_words(curve.family),
                curve.alarms.of
            ),
            ink: family_ink(curve.family),
            thickness: 7,
            shape: Shape::Spreads(
                points()
                    .map(|p| {
                        let value = p.found.value();
                        (p.size.ln(), value, value, value)
                    })
                    .collect(),
            ),
        });
    }
    draw(
        &Figure {
            caption: "Share of effects named first above the threshold, against their size"
                .to_owned(),
            along: "size of the effect, sigma after the refit",
            up: "named first, at 5 % of false alarms (band: 95 %)",
            ticks: SIZES
                .iter()
                .map(|size| (size.ln(), format!("{size}")))
                .collect(),
            up_ticks: percents(),
            ends: ((0.28f64).ln(), (4.3f64).ln()),
            layers,
        },
        path,
    )
}

/// Distribution of the null's p-values, by family.
///
/// # Errors
/// Where the file cannot be written.
pub fn uniformity(cases: &[Case], path: &Path) -> Result<()> {
    let families = families(cases);
    let pooled = |name: &str| matches!(name, "ideal" | "chains");
    let mut layers = Vec::new();
    if let Some(count) = families
        .iter()
        .filter(|family| pooled(&family.family))
        .map(|family| family.values.len())
        .max()
    {
        // Kolmogorov's 5 % limit with Stephens' correction.
        let root = (count as f64).sqrt();
        let half = 1.358 / (root + 0.12 + 0.11 / root);
        let along = || (0..=40).map(|step| f64::from(step) / 40.0);
        let low = along().map(|x| (x, (x - half).max(0.0)));
        let high = along().map(|x| (x, (x + half).min(1.0)));
        layers.push(Layer {
            words: format!("where 95 % of uniform samples of {count} stay"),
            ink: FRAME,
            thickness: 0,
            shape: Shape::Area(low.chain(high.rev()).collect()),
        });
    }
    layers.push(diagonal("uniform"));
    let mut others = OTHERS.iter().cycle();
    for family in families.iter().rev() {
        let count = family.values.len();
        let (ink, thickness, words) = match family.family.as_str() {
            "ideal" => (IDEAL, 11, family_words(Family::Ideal)),
            "chains" => (CHAINS, 11, family_words(Family::Chains)),
            // The distribution of a handful says nothing to the eye.
            _ if count < 8 => continue,
            name => (others.next().copied().unwrap_or(FRAME), 5, name),
        };
        let mut steps = vec![(0.0, 0.0)];
        for (index, value) in family.values.iter().enumerate() {
            steps.push((*value, index as f64 / count as f64));
            steps.push((*value, (index + 1) as f64 / count as f64));
        }
        steps.push((1.0, 1.0));
        layers.push(Layer {
            words: format!("{}, n = {count}", words.replace('_', " ")),
            ink,
            thickness,
            shape: Shape::Line(steps),
        });
    }
    draw(
        &Figure {
            caption: "Distribution of the p-values of whiteness on null campaigns".to_owned(),
            along: "p-value of the residuals' whiteness, null campaigns",
            up: "share of campaigns at or below",
            ticks: fifths(),
            up_ticks: percents(),
            ends: (0.0, 1.0),
            layers,
        },
        path,
    )
}

type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;

fn failed(error: impl std::fmt::Display) -> anyhow::Error {
    anyhow!("a figure could not be drawn: {error}")
}

fn font() -> TextStyle<'static> {
    ("sans-serif", LETTERS * FONT_FACTOR * f64::from(FINENESS))
        .into_font()
        .color(&TEXT)
}

fn text(canvas: &Canvas<'_>, words: &str, at: (i32, i32), anchor: HPos) -> Result<()> {
    let style = font().pos(Pos::new(anchor, VPos::Center));
    canvas
        .draw(&Text::new(
            words.to_owned(),
            (at.0 * FINENESS, at.1 * FINENESS),
            style,
        ))
        .map_err(failed)
}

/// Where the legend's entries stand, in rows from the left, and its height.
fn lay_out(layers: &[Layer]) -> (Vec<(&Layer, i32, i32)>, i32) {
    let mut entries = Vec::new();
    let (mut x, mut row) = (4, 0);
    for layer in layers.iter().filter(|layer| !layer.words.is_empty()) {
        // An average letter is 0.54 of the font's height wide.
        let width = 34 + (layer.words.chars().count() as f64 * 0.54 * LETTERS) as i32;
        if x > 4 && x + width > WIDTH {
            (x, row) = (4, row + 1);
        }
        entries.push((layer, x, row * ROW + ROW / 2 + 4));
        x += width + 16;
    }
    (entries, (row + 1) * ROW + 4)
}

fn legend(canvas: &Canvas<'_>, entries: &[(&Layer, i32, i32)]) -> Result<()> {
    for (layer, x, y) in entries {
        let (left, right, middle) = (x * FINENESS, (x + 24) * FINENESS, y * FINENESS);
        let stroke = layer.ink.stroke_width(layer.thickness);
        match &layer.shape {
            Shape::Line(_) => canvas
                .draw(&PathElement::new(
                    vec![(left, middle), (right, middle)],
                    stroke,
                ))
                .map_err(failed)?,
            Shape::Dashes(_) => {
                for (from, to) in [(0, 10), (14, 24)] {
                    let ends = [from, to].map(|end| (left + end * FINENESS, middle));
                    canvas
                        .draw(&PathElement::new(ends.to_vec(), stroke))
                        .map_err(failed)?;
                }
            }
            Shape::Area(_) => canvas
                .draw(&Rectangle::new(
                    [
                        (left, middle - 5 * FINENESS),
                        (right, middle + 5 * FINENESS),
                    ],
                    layer.ink.mix(0.18).filled(),
                ))
                .map_err(failed)?,
            Shape::Spreads(_) => canvas
                .draw(&Circle::new(
                    ((left + right) / 2, middle),
                    4 * FINENESS,
                    layer.ink.filled(),
                ))
                .map_err(failed)?,
        }
        text(canvas, &layer.words, (x + 30, *y), HPos::Left)?;
    }
    Ok(())
}

fn draw(figure: &Figure, path: &Path) -> Result<()> {
    let (entries, legend_height) = lay_out(&figure.layers);
    let head = legend_height + ROW + 12;
    let height = head + PLOT_HEIGHT + 2 * ROW + 8;
    let mut svg = String::new();
    {
        let size = ((WIDTH * FINENESS) as u32, (height * FINENESS) as u32);
        let canvas = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        canvas.fill(&WHITE).map_err(failed)?;
        legend(&canvas, &entries)?;
        text(&canvas, figure.up, (4, head - ROW / 2 - 10), HPos::Left)?;
        text(
            &canvas,
            figure.along,
            ((SIDES.0 + WIDTH - SIDES.1) / 2, height - ROW / 2 - 2),
            HPos::Center,
        )?;
        frame(&canvas, figure, head)?;
        canvas.present().map_err(failed)?;
    }
    // In place of the library's head: a figure that scales with the page, on white, with a name.
    let body = svg.split_once('>').map_or("", |(_, body)| body);
    let svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">{body}",
        WIDTH * FINENESS,
        height * FINENESS,
        figure.caption,
    );
    fs::write(path, svg).with_context(|| format!("cannot write {}", path.display()))
}

/// Frame, grid, ticks and layers, the axes mapped by hand: the library ticks where it likes.
fn frame(canvas: &Canvas<'_>, figure: &Figure, head: i32) -> Result<()> {
    let (left, right) = (SIDES.0, WIDTH - SIDES.1);
    let (top, bottom) = (head, head + PLOT_HEIGHT);
    let (first, last) = figure.ends;
    let across = |x: f64| {
        let share = (x - first) / (last - first);
        (f64::from(FINENESS) * (f64::from(left) + share * f64::from(right - left))).round() as i32
    };
    let upward = |y: f64| {
        (f64::from(FINENESS) * (f64::from(bottom) - y * f64::from(bottom - top))).round() as i32
    };
    let line = |points: Vec<(i32, i32)>, style: ShapeStyle| {
        canvas
            .draw(&PathElement::new(points, style))
            .map_err(failed)
    };
    let thin = |ink: RGBColor| ink.stroke_width(FINENESS as u32);
    for (x, words) in &figure.ticks {
        line(
            vec![(across(*x), upward(0.0)), (across(*x), upward(1.0))],
            thin(GRID),
        )?;
        text(
            canvas,
            words,
            (across(*x) / FINENESS, bottom + ROW / 2 + 2),
            HPos::Center,
        )?;
    }
    for (y, words) in &figure.up_ticks {
        line(
            vec![(across(first), upward(*y)), (across(last), upward(*y))],
            thin(GRID),
        )?;
        text(
            canvas,
            words,
            (left - 6, upward(*y) / FINENESS),
            HPos::Right,
        )?;
    }
    let corners = [
        (first, 0.0),
        (last, 0.0),
        (last, 1.0),
        (first, 1.0),
        (first, 0.0),
    ];
    let placed = |points: &[(f64, f64)]| -> Vec<(i32, i32)> {
        points
            .iter()
            .map(|point| (across(point.0), upward(point.1)))
            .collect()
    };
    for layer in &figure.layers {
        let stroke = layer.ink.stroke_width(layer.thickness);
        match &layer.shape {
            Shape::Line(points) => line(placed(points), stroke)?,
            Shape::Dashes(points) => {
                for pair in points.windows(2) {
                    dashes(canvas, (pair[0], pair[1]), placed, stroke)?;
                }
            }
            Shape::Area(points) => canvas
                .draw(&Polygon::new(placed(points), layer.ink.mix(0.18).filled()))
                .map_err(failed)?,
            Shape::Spreads(spreads) => {
                for (x, low, value, high) in spreads {
                    if high > low {
                        line(placed(&[(*x, *low), (*x, *high)]), stroke)?;
                        for end in [*low, *high] {
                            let (x, y) = (across(*x), upward(end));
                            line(vec![(x - 3 * FINENESS, y), (x + 3 * FINENESS, y)], stroke)?;
                        }
                    }
                    canvas
                        .draw(&Circle::new(
                            (across(*x), upward(*value)),
                            4 * FINENESS,
                            layer.ink.filled(),
                        ))
                        .map_err(failed)?;
                }
            }
        }
    }
    line(placed(&corners), thin(FRAME))
}

/// A straight line in dashes.
fn dashes(
    canvas: &Canvas<'_>,
    (from, to): ((f64, f64), (f64, f64)),
    placed: impl Fn(&[(f64, f64)]) -> Vec<(i32, i32)>,
    stroke: ShapeStyle,
) -> Result<()> {
    const DASHES: i32 = 45;
    let at = |share: f64| {
        (
            from.0 + share * (to.0 - from.0),
            from.1 + share * (to.1 - from.1),
        )
    };
    for dash in 0..DASHES {
        let start = f64::from(dash) / f64::from(DASHES);
        canvas
            .draw(&PathElement::new(
                placed(&[at(start), at(start + 0.6 / f64::from(DASHES))]),
                stroke,
            ))
            .map_err(failed)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::Draw;
    use crate::judge::family::toy;

    type Plot = fn(&[Case], &Path) -> Result<()>;

    /// Campaigns of a tool that is about as good as it says, half of them through chains.
    fn campaigns() -> Vec<Case> {
        let mut draw = Draw::new(6, &[]);
        let mut cases = Vec::new();
        for index in 0..800 {
            let real = index % 2 == 1;
            let null = draw.chance(0.4);
            let mut case = toy::case(if null { "null" } else { "single" }, real);
            if real {
                case.wheel_sensor = draw.one_of(&["tone_ring", "encoder"]).into();
                case.vehicle_sensor = draw.one_of(&["gps", "fifth_wheel", "optical"]).into();
            }
            if null {
                let p = draw.between(0.0, 1.0);
                case.whiteness_p = Some(if real { p.powf(1.4) } else { p });
                if draw.chance(0.04) {
                    case.named = vec![toy::named(0.7, draw.between(0.0, 30.0), false)];
                }
            } else {
                let size = draw.one_of(&SIZES);
                case.strength = vec![size];
                let score = 20.0 * size * draw.between(0.2, 1.8);
                let said = 1.0 - 0.5 * draw.between(0.0, 1.0).powi(3);
                case.first_right = draw.chance(said);
                case.named = vec![toy::named(said, score, case.first_right)];
            }
            cases.push(case);
        }
        cases
    }

    #[test]
    fn figures_are_whole_small_and_drawn_even_of_nothing() {
        let directory = tempfile::tempdir().unwrap();
        let kept = std::env::var_os("TRIAL_PLOTS").map(std::path::PathBuf::from);
        let directory = kept.as_deref().unwrap_or(directory.path());
        let plots: [(&str, Plot); 3] = [
            ("reliability.svg", reliability),
            ("power.svg", power),
            ("uniformity.svg", uniformity),
        ];
        for (name, plot) in plots {
            let path = directory.join(name);
            plot(&[], &path).unwrap();
            plot(&campaigns(), &path).unwrap();
            let svg = fs::read_to_string(path).unwrap();
            assert!(svg.trim_end().ends_with("</svg>"), "{name}");
            assert!(svg.len() < 60_000, "{name}: {}", svg.len());
            for words in ["ideal sensors", "real measuring chains"] {
                assert!(svg.contains(words), "{name}: {words}");
            }
        }
    }
}
