//! Shares, quantiles and means with their confidence.

use statrs::distribution::{Beta, ContinuousCDF};

/// So many of so many.
#[derive(Clone, Copy, Debug, Default)]
pub struct Share {
    pub hits: usize,
    pub of: usize,
}

impl Share {
    /// Counts those of which the condition holds.
    pub fn count<T>(items: impl IntoIterator<Item = T>, condition: impl Fn(&T) -> bool) -> Share {
        items
            .into_iter()
            .fold(Share::default(), |share, item| Share {
                hits: share.hits + usize::from(condition(&item)),
                of: share.of + 1,
            })
    }

    /// The share itself.
    pub fn value(self) -> f64 {
        self.hits as f64 / self.of as f64
    }

    /// Clopper and Pearson's exact 95 % interval.
    pub fn interval(self) -> (f64, f64) {
        let (k, n) = (self.hits as f64, self.of as f64);
        let quantile =
            |a: f64, b: f64, p: f64| Beta::new(a, b).map_or(f64::NAN, |beta| beta.inverse_cdf(p));
        let low = if self.hits == 0 {
            0.0
        } else {
            quantile(k, n - k + 1.0, 0.025)
        };
        let high = if self.hits == self.of {
            1.0
        } else {
            quantile(k + 1.0, n - k, 0.975)
        };
        (low, high)
    }

    pub fn cells(self) -> [String; 3] {
        if self.of == 0 {
            return ["-".into(), "-".into(), "0".into()];
        }
        let (low, high) = self.interval();
        [
            percent(self.value()),
            format!("{}..{}", percent(low), percent(high)),
            format!("{}/{}", self.hits, self.of),
        ]
    }
}

pub fn percent(value: f64) -> String {
    format!("{:.1} %", 100.0 * value)
}

/// A quantile of numbers, linear between them.
pub fn quantile(values: &[f64], at: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    if sorted.is_empty() {
        f64::NAN
    } else {
        crate::generate::chain::at(&sorted, at * (sorted.len() - 1) as f64)
    }
}

pub fn mean(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values
        .iter()
        .map(|value| (value - mean).powi(2))
        .sum::<f64>()
        / (n - 1.0);
    (mean, (variance / n).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_interval_agrees_with_published_values() {
        // Clopper and Pearson for 0 of 10 and 5 of 10, as tabulated in any textbook.
        let (low, high) = Share { hits: 0, of: 10 }.interval();
        assert!(low == 0.0 && (high - 0.3085).abs() < 1e-3);
        let (low, high) = Share { hits: 5, of: 10 }.interval();
        assert!((low - 0.1871).abs() < 1e-3 && (high - 0.8129).abs() < 1e-3);
    }

    #[test]
    fn quantiles_lie_between_neighbours() {
        assert!((quantile(&[3.0, 1.0, 2.0], 0.5) - 2.0).abs() < 1e-12);
        assert!((quantile(&[0.0, 10.0], 0.1) - 1.0).abs() < 1e-12);
        assert!(quantile(&[], 0.5).is_nan());
    }
}
