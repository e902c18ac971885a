//! The legend of a drawing.

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::canvas::{Canvas, DrawError, FINENESS, FONT_SIZE, ROW, WIDTH, text};
use super::figure::{Figure, Layer, Shape};
use super::shade::{blend, ink};

/// Width of a text, near enough to lay out a legend: an average character is 0.6 of the font's height.
fn width_of(words: &str) -> i32 {
    (words.chars().count() as f64 * 0.6 * FONT_SIZE).ceil() as i32
}

/// The entries of a figure's legend, in rows from the left.
pub(super) struct Legend<'a> {
    entries: Vec<(&'a Layer, (i32, i32))>,
    rows: i32,
}

impl<'a> Legend<'a> {
    const SWATCH: i32 = 22;
    const GAP: i32 = 18;

    pub(super) fn lay_out(figure: &'a Figure) -> Self {
        let mut entries = Vec::new();
        let (mut x, mut row) = (2, 0);
        for layer in figure.layers.iter().filter(|layer| !layer.label.is_empty()) {
            let width = Self::SWATCH + 6 + width_of(&layer.label);
            if x > 2 && x + width > WIDTH {
                x = 2;
                row += 1;
            }
            entries.push((layer, (x, row * ROW + ROW / 2)));
            x += width + Self::GAP;
        }
        let rows = if entries.is_empty() { 0 } else { row + 1 };
        Self { entries, rows }
    }

    pub(super) fn height(&self) -> i32 {
        self.rows * ROW
    }

    pub(super) fn draw(&self, canvas: &Canvas<'_>) -> Result<(), DrawError> {
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
                Shape::Cells(_) => {
                    let half = [(left, top), ((left + right) / 2, bottom)];
                    canvas.draw(&Rectangle::new(half, blend(-0.6).filled()))?;
                    let half = [((left + right) / 2, top), (right, bottom)];
                    canvas.draw(&Rectangle::new(half, blend(0.6).filled()))?;
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
            text(canvas, &layer.label, (x + Self::SWATCH + 6, *y), HPos::Left)?;
        }
        Ok(())
    }
}
