//! Reports: figures described without a backend, drawn as SVG, on one self-contained HTML page.
//!
//! [`Figure`] says what is to be seen, [`svg`] draws it, [`Report`] puts text, tables and figures on a
//! page that needs no network and runs no script but the player of an animation. A job that wants a report builds these three; nothing
//! here knows what a filter is, except [`of_estimate`].

mod axis;
mod clip;
mod estimate;
mod figure;
mod page;
mod shade;
pub mod svg;

pub use axis::{Axis, Extent, Scale};
pub use estimate::{CurveLabel, of_estimate};
pub use figure::{Figure, Ink, Layer, Shape, ellipse};
pub use page::{AnimationFrame, Block, KeyFigure, Report, ReportError, Section, Tone};
