//! Colours of drawings: placeholders while drawing, in the end CSS variables or shades on white.

use plotters::style::RGBColor;

use super::figure::Ink;

/// One colour: its placeholder in the drawing, its CSS variable, its shade on white.
pub(super) struct Shade {
    code: u8,
    pub(super) variable: &'static str,
    pub(super) on_white: &'static str,
}

impl Shade {
    const fn new(code: u8, variable: &'static str, on_white: &'static str) -> Self {
        Self {
            code,
            variable,
            on_white,
        }
    }

    pub(super) fn placeholder(&self) -> String {
        format!("#FE{:02X}FE", self.code)
    }

    pub(super) fn color(&self) -> RGBColor {
        RGBColor(0xfe, self.code, 0xfe)
    }
}

pub(super) const TEXT: Shade = Shade::new(1, "muted", "#5c6370");
pub(super) const GRID: Shade = Shade::new(2, "grid", "#e4e6ea");
pub(super) const FRAME: Shade = Shade::new(3, "frame", "#9aa0aa");
const MEASURED: Shade = Shade::new(4, "measured", "#3f6fa3");
const ESTIMATE: Shade = Shade::new(5, "estimate", "#c8472b");
const SECOND: Shade = Shade::new(6, "second", "#7a4fa3");
const TRUTH: Shade = Shade::new(7, "truth", "#1d7f5f");
const REFERENCE: Shade = Shade::new(8, "reference", "#8a8f98");
pub(super) const PAPER: Shade = Shade::new(9, "paper", "#ffffff");
/// All shades.
pub(super) const SHADES: [Shade; 9] = [
    TEXT, GRID, FRAME, MEASURED, ESTIMATE, SECOND, TRUTH, REFERENCE, PAPER,
];

/// The colour of an ink.
pub(super) fn ink(ink: Ink) -> RGBColor {
    match ink {
        Ink::Measured => MEASURED,
        Ink::Estimate => ESTIMATE,
        Ink::Second => SECOND,
        Ink::Truth => TRUTH,
        Ink::Reference => REFERENCE,
    }
    .color()
}
