//! One figure of the trial with its interval: what the tables show beside a bar, and what the ratchet holds.

use serde::Serialize;

use crate::share::{Share, mean, percent, quantile};

/// Which way a figure is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Better {
    Higher,
    Lower,
}

/// How a figure is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Unit {
    Percent,
    Number,
    Seconds,
}

/// One figure with its 95 % interval.
#[derive(Clone, Debug, Serialize)]
pub struct Headline {
    /// Stable name for the ratchet and for programs: lower case, dots between its parts.
    pub key: String,
    /// What a reader calls it.
    pub what: String,
    pub unit: Unit,
    pub better: Better,
    /// Not a number where nothing was counted.
    pub value: f64,
    pub low: f64,
    pub high: f64,
    /// Hits of so many, or just of so many.
    pub hits: Option<usize>,
    pub of: usize,
    /// What it is to reach; none where it is only watched.
    pub bar: Option<f64>,
    /// What one case may change of a number that is not a count of hits.
    pub step: f64,
    /// Of a distance from a nominal share, what a table shows in its place: the share with its interval.
    pub shown: Option<Shown>,
}

/// A share beside the one that it should be.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Shown {
    pub nominal: f64,
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

/// Nothing is known of a share of nothing.
fn interval(share: Share) -> (f64, f64) {
    if share.of == 0 {
        (f64::NAN, f64::NAN)
    } else {
        share.interval()
    }
}

impl Headline {
    /// A share of counted cases.
    pub fn share(
        key: &str,
        what: &str,
        better: Better,
        bar: Option<f64>,
        share: Share,
    ) -> Headline {
        let (low, high) = interval(share);
        Headline {
            key: key.to_owned(),
            what: what.to_owned(),
            unit: Unit::Percent,
            better,
            value: share.value(),
            low,
            high,
            hits: Some(share.hits),
            of: share.of,
            bar,
            step: 0.0,
            shown: None,
        }
    }

    /// A mean with its normal interval.
    pub fn mean(
        key: &str,
        what: &str,
        better: Better,
        bar: Option<f64>,
        values: &[f64],
    ) -> Headline {
        let (value, error) = mean(values);
        Headline::number(
            key,
            what,
            better,
            bar,
            (value, value - 1.96 * error, value + 1.96 * error),
            values.len(),
        )
    }

    /// A quantile with the interval of its order statistics.
    pub fn quantile(
        key: &str,
        what: &str,
        better: Better,
        bar: Option<f64>,
        values: &[f64],
        at: f64,
    ) -> Headline {
        let half = 1.96 * (at * (1.0 - at) / (values.len() as f64).max(1.0)).sqrt();
        let spread = (
            quantile(values, at),
            quantile(values, (at - half).max(0.0)),
            quantile(values, (at + half).min(1.0)),
        );
        Headline::number(key, what, better, bar, spread, values.len())
    }

    /// A number with an interval from elsewhere: value, low, high.
    pub fn number(
        key: &str,
        what: &str,
        better: Better,
        bar: Option<f64>,
        (value, low, high): (f64, f64, f64),
        of: usize,
    ) -> Headline {
        Headline {
            key: key.to_owned(),
            what: what.to_owned(),
            unit: Unit::Number,
            better,
            value,
            low,
            high,
            hits: None,
            of,
            bar,
            step: 0.0,
            shown: None,
        }
    }

    /// The distance of a share from what it should be: too many is as wrong as too few. The bar is how far it may be off.
    pub fn off_nominal(
        key: &str,
        what: &str,
        bar: Option<f64>,
        shown: Shown,
        of: usize,
    ) -> Headline {
        let off = |share: f64| (share - shown.nominal).abs();
        let (nearest, furthest) = if (shown.low..=shown.high).contains(&shown.nominal) {
            (0.0, off(shown.low).max(off(shown.high)))
        } else {
            let ends = (off(shown.low), off(shown.high));
            (ends.0.min(ends.1), ends.0.max(ends.1))
        };
        Headline {
            unit: Unit::Percent,
            step: 1.0 / of.max(1) as f64,
            shown: Some(shown),
            ..Headline::number(
                key,
                what,
                Better::Lower,
                bar,
                (off(shown.value), nearest, furthest),
                of,
            )
        }
    }

    /// The same of a counted share.
    pub fn share_off_nominal(
        key: &str,
        what: &str,
        bar: Option<f64>,
        nominal: f64,
        share: Share,
    ) -> Headline {
        let (low, high) = interval(share);
        let shown = Shown {
            nominal,
            value: share.value(),
            low,
            high,
        };
        Headline::off_nominal(key, what, bar, shown, share.of)
    }

    fn print(&self, value: f64) -> String {
        match self.unit {
            _ if value.is_nan() => "-".to_owned(),
            Unit::Percent => percent(value),
            Unit::Number => format!("{value:.3}"),
            Unit::Seconds => format!("{value:.2} s"),
        }
    }

    /// Whether the bar is met, and whether the interval leaves no doubt of it.
    pub fn verdict(&self) -> &'static str {
        let Some(bar) = self.bar else { return "" };
        if self.value.is_nan() {
            return "-";
        }
        let at_least = self.better == Better::Higher;
        let met = (self.value - bar).abs() < 1e-12 || (self.value >= bar) == at_least;
        // A figure without an interval (a peak of memory) is sure. Met and at least: the whole interval above; missed and at least: the whole interval below; and the reverse.
        let sure = if met == at_least {
            self.low.is_nan() || self.low >= bar
        } else {
            self.high.is_nan() || self.high <= bar
        };
        match (met, sure) {
            (true, true) => "met",
            (true, false) => "met, interval spans the bar",
            (false, true) => "**missed**",
            (false, false) => "**missed**, interval spans the bar",
        }
    }

    /// Cells of a row: what, bar, measured, interval, n, verdict.
    pub fn cells(&self) -> [String; 6] {
        let bar = self.bar.map_or_else(String::new, |bar| {
            if let Some(shown) = self.shown {
                return format!("{} ± {}", self.print(shown.nominal), self.print(bar));
            }
            let sign = if self.better == Better::Higher {
                "≥"
            } else {
                "≤"
            };
            format!("{sign} {}", self.print(bar))
        });
        let (value, low, high) = self
            .shown
            .map_or((self.value, self.low, self.high), |shown| {
                (shown.value, shown.low, shown.high)
            });
        let interval = if low.is_finite() && high.is_finite() {
            format!("{}..{}", self.print(low), self.print(high))
        } else {
            "-".to_owned()
        };
        let n = match self.hits {
            Some(hits) => format!("{hits}/{}", self.of),
            None => self.of.to_string(),
        };
        [
            self.what.clone(),
            bar,
            self.print(value),
            interval,
            n,
            self.verdict().to_owned(),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_is_met_missed_or_undecided_by_its_interval() {
        let share = |hits, of| {
            Headline::share("k", "k", Better::Higher, Some(0.9), Share { hits, of }).verdict()
        };
        assert_eq!(share(200, 200), "met");
        assert_eq!(share(10, 10), "met, interval spans the bar");
        assert_eq!(share(8, 10), "**missed**, interval spans the bar");
        assert_eq!(share(10, 100), "**missed**");
        let alone = Headline {
            value: 1.5,
            low: f64::NAN,
            high: f64::NAN,
            ..Headline::share("k", "k", Better::Lower, Some(1.0), Share { hits: 0, of: 1 })
        };
        assert_eq!(alone.verdict(), "**missed**");
        let most = |hits| {
            Headline::share("k", "k", Better::Lower, Some(0.05), Share { hits, of: 100 }).verdict()
        };
        assert_eq!(most(0), "met");
        assert_eq!(most(30), "**missed**");
    }

    #[test]
    fn too_many_is_as_wrong_as_too_few() {
        let off = |hits| {
            let share = Share { hits, of: 1000 };
            Headline::share_off_nominal("k", "k", Some(0.08), 0.6827, share)
        };
        assert_eq!(off(683).verdict(), "met");
        assert_eq!(off(560).verdict(), "**missed**");
        assert_eq!(off(820).verdict(), "**missed**");
        assert_eq!(off(610).verdict(), "met, interval spans the bar");
        assert!((off(610).value - 0.0727).abs() < 1e-12 && off(683).low == 0.0);
        assert_eq!(off(820).better, Better::Lower);
        let cells = off(820).cells();
        assert_eq!([&cells[1], &cells[2]], ["68.3 % ± 8.0 %", "82.0 %"]);
        assert!(cells[3].starts_with("79."), "{}", cells[3]);
    }
}
