//! Rows of the tables: stops as ratios to the best there is.

use super::run::Stop;
use super::who::Who;

/// Longest time in s for which a wheel may be locked above 3 m/s.
pub const LOCK_BAR_S: f64 = 0.2;

/// Ratios of a set of stops.
#[derive(Debug, Clone, PartialEq)]
pub struct Ratios {
    /// Median.
    pub median: f64,
    /// The ninth decile: the worst tenth begins there.
    pub worst_tenth: f64,
    /// The worst.
    pub worst: f64,
    /// Mean share of the time with at least 95 % of peak friction.
    pub near_peak: f64,
    /// Mean share of the time with more than twice the peak's slip.
    pub deep: f64,
    /// Longest time in s with a locked wheel above 3 m/s.
    pub longest_lock_s: f64,
    /// How many there are.
    pub count: usize,
}

impl Ratios {
    /// Of (ratio, stop), at least one.
    pub(super) fn of(mut stops: Vec<(f64, Stop)>) -> Self {
        stops.sort_by(|a, b| a.0.total_cmp(&b.0));
        let at = |share: f64| {
            let last = stops.len().saturating_sub(1) as f64;
            stops
                .get((share * last).round() as usize)
                .map_or(f64::NAN, |stop| stop.0)
        };
        let count = stops.len();
        let mean = |of: &dyn Fn(&Stop) -> f64| {
            stops.iter().map(|stop| of(&stop.1)).sum::<f64>() / count as f64
        };
        Self {
            median: at(0.5),
            worst_tenth: at(0.9),
            worst: at(1.0),
            near_peak: mean(&|stop| stop.share_near_peak),
            deep: mean(&|stop| stop.share_deep),
            longest_lock_s: stops
                .iter()
                .map(|stop| stop.1.longest_lock_s)
                .fold(0.0, f64::max),
            count,
        }
    }
}

/// A row of a table of ratios.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The brake controller.
    pub who: Who,
    /// On what.
    pub road: &'static str,
    /// What is varied; empty in the comparison itself.
    pub variant: String,
    /// The ratios.
    pub ratios: Ratios,
    /// The bar on the median.
    pub bar: Option<f64>,
}

impl Row {
    /// Whether the median keeps to the bar, where there is one.
    pub fn keeps(&self) -> Option<bool> {
        self.bar.map(|bar| self.ratios.median <= bar)
    }

    /// Whether no wheel was locked above 3 m/s for longer than allowed; not asked of a locked wheel.
    pub fn keeps_rolling(&self) -> bool {
        self.who == Who::Locked || self.ratios.longest_lock_s <= LOCK_BAR_S
    }
}
