//! The candidates; exactly one feature chooses one.
//!
//! Each has a memory, a start, an update marked for the trace, and an answer in (mup, sp) or what stands
//! for it.

#[cfg_attr(feature = "article", path = "article.rs")]
#[cfg_attr(feature = "article_checked", path = "article_checked.rs")]
#[cfg_attr(feature = "article_report", path = "article_report.rs")]
#[cfg_attr(feature = "efficient", path = "efficient.rs")]
#[cfg_attr(feature = "slip_friction", path = "slip_friction.rs")]
#[cfg_attr(feature = "quarter_car", path = "quarter_car.rs")]
#[cfg_attr(feature = "innovations", path = "innovations.rs")]
#[cfg_attr(feature = "nalgebra", path = "by_nalgebra.rs")]
#[cfg_attr(feature = "minikalman", path = "by_minikalman.rs")]
#[cfg_attr(feature = "adskalman", path = "by_adskalman.rs")]
#[cfg_attr(feature = "kfilter", path = "by_kfilter.rs")]
mod chosen;

#[cfg(any(
    feature = "nalgebra",
    feature = "minikalman",
    feature = "adskalman",
    feature = "kfilter"
))]
mod peers_law;

#[cfg(any(feature = "nalgebra", feature = "minikalman", feature = "adskalman"))]
use nalgebra::Matrix2;
#[cfg(feature = "kfilter")]
use nalgebra_034::Matrix2;

pub use chosen::{Memory, answer, start, update};
