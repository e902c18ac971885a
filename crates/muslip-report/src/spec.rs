//! Figures as the page's data: what `templates/figures.js` draws, and what is said to those who cannot see it.

use serde_json::{Value, json};

use super::axis::{Axis, Scale};
use super::figure::{Figure, Ink, Shape};

/// Most layers that a text alternative names.
const MOST_NAMED: usize = 8;

/// A figure's description for the page, with the id of its element.
pub(super) fn of_figure(figure: &Figure, id: &str) -> Value {
    let (along, up) = figure.extents();
    let layers: Vec<Value> = figure
        .layers
        .iter()
        .map(|layer| {
            let mut value = of_shape(&layer.shape);
            if let Some(object) = value.as_object_mut() {
                object.insert("shape".into(), shape_word(&layer.shape).into());
                object.insert("ink".into(), ink_word(layer.ink).into());
                object.insert("label".into(), layer.label.clone().into());
                if let Some(live) = layer.live {
                    object.insert("live".into(), json!(live));
                }
            }
            value
        })
        .collect();
    json!({
        "id": id,
        "x": of_axis(&figure.x, along),
        "y": of_axis(&figure.y, up),
        "layers": layers,
    })
}

fn of_axis(axis: &Axis, (low, high): (f64, f64)) -> Value {
    json!({
        "label": axis.label,
        "low": rounded(low),
        "high": rounded(high),
        "log": axis.scale == Scale::Logarithmic,
    })
}

fn of_shape(shape: &Shape) -> Value {
    match shape {
        Shape::Points(points)
        | Shape::Line(points)
        | Shape::Dashes(points)
        | Shape::Outline(points) => json!({
            "x": column(points.iter().map(|point| point.0)),
            "y": column(points.iter().map(|point| point.1)),
        }),
        Shape::Band(points) => json!({
            "x": column(points.iter().map(|point| point.0)),
            "low": column(points.iter().map(|point| point.1)),
            "high": column(points.iter().map(|point| point.2)),
        }),
        Shape::Marker((x, y), caption) => json!({
            "x": column([*x]), "y": column([*y]), "caption": caption,
        }),
        // Along, a level has no place of its own.
        Shape::Level(level) => json!({"x": [0], "y": column([*level])}),
        Shape::Cells(cells) => json!({
            "x": column(cells.x_edges.iter().copied()),
            "y": column(cells.y_edges.iter().copied()),
            "value": column(cells.values.iter().copied()),
            "limit": rounded(cells.limit),
        }),
    }
}

fn column(values: impl IntoIterator<Item = f64>) -> Vec<Value> {
    values.into_iter().map(rounded).collect()
}

/// A number with the six digits that a drawing can show; nothing where it is none.
pub(super) fn rounded(value: f64) -> Value {
    format!("{value:.5e}")
        .parse::<f64>()
        .ok()
        .and_then(serde_json::Number::from_f64)
        .map_or(Value::Null, Value::Number)
}

/// The word for a shape in the page's data and classes.
pub(super) fn shape_word(shape: &Shape) -> &'static str {
    match shape {
        Shape::Points(_) => "points",
        Shape::Line(_) => "line",
        Shape::Dashes(_) => "dashes",
        Shape::Band(_) => "band",
        Shape::Outline(_) => "outline",
        Shape::Marker(..) => "marker",
        Shape::Level(_) => "level",
        Shape::Cells(_) => "cells",
    }
}

/// The word for an ink in the page's data, classes and variables.
pub(super) fn ink_word(ink: Ink) -> &'static str {
    match ink {
        Ink::Measured => "measured",
        Ink::Estimate => "estimate",
        Ink::Second => "second",
        Ink::Truth => "truth",
        Ink::Reference => "reference",
    }
}

/// What the figure shows, in words.
pub(super) fn alternative(figure: &Figure) -> String {
    let (along, up) = figure.extents();
    let named: Vec<String> = figure
        .layers
        .iter()
        .filter(|layer| !layer.label.is_empty())
        .map(|layer| format!("{} ({})", layer.label, in_words(&layer.shape)))
        .collect();
    let shown = match named.len() {
        0 => String::new(),
        1..=MOST_NAMED => format!(" Shown: {}.", named.join("; ")),
        many => format!(
            " Shown: {}; and {} more.",
            named[..MOST_NAMED].join("; "),
            many - MOST_NAMED
        ),
    };
    format!(
        "{} Along: {}, {} to {}. Up: {}, {} to {}.{shown}",
        figure.caption,
        figure.x.label,
        short(along.0),
        short(along.1),
        figure.y.label,
        short(up.0),
        short(up.1)
    )
}

fn in_words(shape: &Shape) -> String {
    let ends = |points: &[(f64, f64)]| {
        let sound = |point: &&(f64, f64)| point.0.is_finite() && point.1.is_finite();
        let first = points.iter().find(sound);
        let last = points.iter().rev().find(sound);
        match first.zip(last) {
            Some((from, to)) => format!(
                "from {} at {} to {} at {}",
                short(from.1),
                short(from.0),
                short(to.1),
                short(to.0)
            ),
            None => "nothing".to_owned(),
        }
    };
    match shape {
        Shape::Points(points) => format!("{} points", points.len()),
        Shape::Line(points) => format!("line {}", ends(points)),
        Shape::Dashes(points) => format!("dashed line {}", ends(points)),
        Shape::Band(_) => "band".to_owned(),
        Shape::Outline(_) => "ellipse".to_owned(),
        Shape::Marker((x, y), _) => format!("{} at {}", short(*y), short(*x)),
        Shape::Level(level) => format!("level {}", short(*level)),
        Shape::Cells(cells) => {
            let values: Vec<f64> = cells.cells().map(|cell| cell.2).collect();
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            format!(
                "{} cells, {} to {} {}",
                values.len(),
                short(low),
                short(high),
                cells.unit
            )
        }
    }
}

/// A number with three digits.
pub(super) fn short(value: f64) -> String {
    let digits = format!("{value:.2e}").parse::<f64>().unwrap_or(value);
    format!("{digits}").replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_gets_ranges_in_units_and_no_number_that_is_none() {
        let figure = Figure::new("c", Axis::new("n").logarithmic(), Axis::new("y")).with(
            Ink::Measured,
            "m",
            Shape::Points(vec![(1.0, f64::NAN), (100.0, 1.0 / 3.0), (1e300, 2.0)]),
        );
        let spec = of_figure(&figure, "f");
        assert_eq!(spec["x"]["log"], true);
        let low = spec["x"]["low"].as_f64().unwrap();
        assert!(low > 0.0 && low < 1.0, "{low}");
        assert_eq!(spec["layers"][0]["y"][0], Value::Null);
        assert_eq!(spec["layers"][0]["y"][1].to_string(), "0.333333");
    }

    #[test]
    fn words_say_what_the_plot_shows() {
        let figure = Figure::new("The curve.", Axis::new("slip"), Axis::new("friction"))
            .with(
                Ink::Measured,
                "measured",
                Shape::Points(vec![(0.0, 0.5); 7]),
            )
            .with(
                Ink::Estimate,
                "curve",
                Shape::Line(vec![(0.0, 0.0), (1.0, 0.8123)]),
            );
        let words = alternative(&figure);
        assert!(
            words.starts_with("The curve. Along: slip, \u{2212}0.015 to 1.01. Up: friction, "),
            "{words}"
        );
        assert!(
            words.ends_with("Shown: measured (7 points); curve (line from 0 at 0 to 0.812 at 1)."),
            "{words}"
        );
    }
}
