//! The times that rows are written at.

use super::sink::StreamError;
use super::track::Track;
use crate::raster::Done;

/// Most rows that the sink gets at a time, and about as many readings of a channel that is faster.
pub(super) const MOST_ROWS: usize = 1 << 16;

/// What the rows were written at.
pub(super) struct Raster {
    /// The file's first sample: it becomes 0.
    pub(super) start_s: f64,
    pub(super) rate_hz: Option<f64>,
    pub(super) words: String,
    /// Of each column.
    pub(super) done: Vec<Done>,
}

/// Where the raster's times come from.
pub(super) enum Grid {
    /// The times of the chosen group.
    Times,
    /// A rate, from a time on.
    Even {
        first_s: f64,
        rate_hz: f64,
        next: usize,
        rows: usize,
    },
}

/// Some times of the raster, and the readings that the chosen group has there where its times are the raster's.
pub(super) struct Next {
    pub(super) times: Vec<f64>,
    pub(super) kept: Vec<Vec<f64>>,
}

impl Grid {
    /// The next times within a span; `None` at the end.
    pub(super) fn next(
        &mut self,
        chosen: &mut Track<'_>,
        span_s: f64,
    ) -> Result<Option<Next>, StreamError> {
        match self {
            Self::Times => {
                while chosen.times.is_empty() {
                    if !chosen.next()? {
                        return Ok(None);
                    }
                }
                let first = chosen.times.first().copied().unwrap_or(0.0);
                let rows = chosen.times.partition_point(|time| time - first <= span_s);
                let rows = rows.clamp(1, MOST_ROWS.min(chosen.times.len()));
                let times = chosen.times.drain(..rows).collect();
                let columns = chosen.columns.iter_mut();
                let kept = columns.map(|values| values.drain(..rows).collect());
                Ok(Some(Next {
                    times,
                    kept: kept.collect(),
                }))
            }
            Self::Even {
                first_s,
                rate_hz,
                next,
                rows,
            } => {
                let left = rows.saturating_sub(*next);
                let count = ((span_s * *rate_hz) as usize).clamp(1, MOST_ROWS).min(left);
                let from = *next;
                *next += count;
                let times = (from..*next).map(|k| *first_s + k as f64 / *rate_hz);
                Ok((count > 0).then(|| Next {
                    times: times.collect(),
                    kept: Vec::new(),
                }))
            }
        }
    }
}
