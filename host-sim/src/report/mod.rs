//! Reports: figures described without a backend, drawn by uPlot on one self-contained HTML page or as a
//! document's SVG or PNG.
//!
//! [`Figure`] says what is to be seen, [`Report`] puts text, tables and figures on a page that needs no
//! network, [`svg`] draws the same figures for a document. A job that wants a report builds these; nothing
//! here knows what a filter is, except [`Convergence`] and [`of_estimate`].

mod axis;
mod clip;
mod convergence;
mod estimate;
mod export;
mod figure;
mod legend;
mod page;
mod shade;
mod spec;
pub mod svg;
mod table;

pub use axis::{Axis, Extent, Scale};
pub use convergence::{Convergence, CurveLabel, drawn_slips};
pub use estimate::of_estimate;
pub use export::{ExportError, FigureFormat, write_figures};
pub use figure::{Cells, Figure, Ink, Layer, Live, Shape, ellipse};
pub use page::{Block, KeyFigure, Report, ReportError, Section, Tone};
pub use table::{Cell, Row, Table};
