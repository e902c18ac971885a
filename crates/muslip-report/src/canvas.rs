//! What a drawing and its legend are drawn on: sizes, letters, and what plotters refuses.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::shade::TEXT;

/// Canvas units for each unit of the figure.
pub(super) const FINENESS: i32 = 4;
/// Width of a figure.
pub(super) const WIDTH: i32 = 760;
/// Height of its letters.
pub(super) const FONT_SIZE: f64 = 13.5;
/// plotters divides font sizes by this before it writes them.
const FONT_FACTOR: f64 = 1.24;
/// Height of a row of the legend.
pub(super) const ROW: i32 = 20;

/// A figure that could not be drawn.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("a figure could not be drawn: {0}")]
pub struct DrawError(String);

impl<E: std::error::Error + Send + Sync> From<DrawingAreaErrorKind<E>> for DrawError {
    fn from(error: DrawingAreaErrorKind<E>) -> Self {
        Self(error.to_string())
    }
}

/// What is drawn on.
pub(super) type Canvas<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

/// The letters of a drawing.
pub(super) fn font() -> TextStyle<'static> {
    ("sans-serif", FONT_SIZE * FONT_FACTOR * f64::from(FINENESS))
        .into_font()
        .color(&TEXT)
}

/// Draws words beside or around a point, in units of the figure.
pub(super) fn text(
    canvas: &Canvas<'_>,
    words: &str,
    at: (i32, i32),
    anchor: HPos,
) -> Result<(), DrawError> {
    let style = font().pos(Pos::new(anchor, VPos::Center));
    let at = (at.0 * FINENESS, at.1 * FINENESS);
    Ok(canvas.draw(&Text::new(words.to_owned(), at, style))?)
}
