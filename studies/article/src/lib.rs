//! The article reproduced: R. Rudd, "Estimating the Mu Slip Curve via Extended Kalman Filtering", The
//! Mathematica Journal 11 (2011).
//!
//! Its data came from a stream of random numbers that nobody else has. What it says of one stream is
//! therefore held against thousands of streams, what it says of the equations is held against the
//! filter of the core crate itself, and each statement gets a verdict. Beside that stands a yardstick
//! for other estimators: errors over a grid of curves against the Cramér-Rao bound.
//!
//! The same options give the same figures, whatever the number of threads. `cargo run -p study-article --release`
//! writes them all; a test of the same equations takes what it wants of them:
//!
//! ```
//! use study_article::{PaperOptions, article_streams, statements};
//!
//! let streams = article_streams(PaperOptions { seed: 1, streams: 20 });
//! assert!(statements(&streams).len() > 10);
//! ```
#![forbid(unsafe_code)]

mod bound;
mod exact;
mod figures;
mod monte_carlo;
mod pages;
mod pass;
mod reproduce;
mod statement;
mod statistics;
mod stream;
mod table;
mod yardstick;

pub use bound::Bound;
pub use exact::{
    DirectMeasurement, direct_measurement, equal_sensitivity_slips, gradient, slip_of_extremum,
};
pub use figures::{NamedFigure, Part, convergence, figures};
pub use monte_carlo::{ArticleStream, Course, Regression, SecondStart};
pub use pages::{CONVERGENCE_PAGE, article_markdown, convergence_page, report_page};
pub use pass::{PassError, Step, first_start, second_start, traced};
pub use reproduce::{Paper, PaperOptions, article_streams, reproduce, statements, work};
pub use statement::{Ours, Reproduction, Statement};
pub use statistics::Band;
pub use stream::{FRICTION_STD, POINTS, TRUTH, frictions, slips};
pub use yardstick::{Accuracy, Cell, Contender, Errors};
