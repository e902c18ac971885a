//! Pages and plots: figures described without a backend, drawn by uPlot on one self-contained HTML page, by plotters as a
//! document's SVG, and from that as PNG ([`write_figures`]). It depends on the whole analysis, whose results it draws.
//!
//! [`Figure`] says what is to be seen, [`Report`] puts text, tables and figures on a page that needs no
//! network, [`svg`] draws the same figures for a document, [`text`] breaks words and tables for a terminal. The
//! pages of this project's own results stand beside that: [`of_estimate`], [`campaign`], [`diagnose`], [`fleet`], [`guide`].
//!
//! ```
//! use muslip_report::{Axis, Block, Figure, Ink, Report, Section, Shape, Tone};
//!
//! let curve = Figure::new("Friction against slip.", Axis::new("slip"), Axis::new("friction")).with(
//!     Ink::Measured,
//!     "measured",
//!     Shape::Points(vec![(0.05, 0.6), (0.1, 0.85), (0.2, 0.8)]),
//! );
//! let page = Report {
//!     title: "A wheel".into(),
//!     subject: "run.csv".into(),
//!     verdict: "Friction peaks near a slip of 0.1.".into(),
//!     tone: Tone::Neutral,
//!     key_figures: Vec::new(),
//!     sections: vec![Section { heading: "Measured".into(), blocks: vec![Block::Figure(curve)] }],
//!     command: "my-program run.csv".into(),
//! };
//! assert!(page.to_html()?.ends_with("</html>"));
//! # Ok::<(), muslip_report::ReportError>(())
//! ```
//!
//! Feature `clap`: [`FigureFormat`] as an argument of a command.
#![forbid(unsafe_code)]

mod axis;
mod bitmap;
pub mod campaign;
mod canvas;
mod clip;
mod convergence;
pub mod diagnose;
mod estimate;
mod export;
mod figure;
pub mod fleet;
pub mod guide;
mod legend;
mod page;
mod shade;
mod spec;
pub mod svg;
mod table;
pub mod text;

pub use axis::{Axis, Extent, Scale};
pub use convergence::{Convergence, CurveLabel, drawn_slips};
pub use estimate::of_estimate;
pub use export::{ExportError, FigureFormat, write_figures};
pub use figure::{Cells, Figure, Ink, Layer, Live, Shape, ellipse};
pub use page::{Block, KeyFigure, Report, ReportError, Section, Tone};
pub use table::{Cell, Row, Table};
