//! What a sample of numbers says.

/// Median and the 5 and 95 % points of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    /// The 5 % point.
    pub low: f64,
    /// The middle.
    pub median: f64,
    /// The 95 % point.
    pub high: f64,
}

impl Band {
    /// Of a sample; not a number where it is empty.
    pub fn of(sample: impl IntoIterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = sample.into_iter().collect();
        sorted.sort_by(f64::total_cmp);
        Self {
            low: quantile(&sorted, 0.05),
            median: quantile(&sorted, 0.5),
            high: quantile(&sorted, 0.95),
        }
    }

    /// True where a value is within.
    pub fn holds(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}

/// A quantile of a sorted sample, linear between its members (Hyndman and Fan's type 7).
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else {
        return f64::NAN;
    };
    let at = share * last as f64;
    let below = at.floor() as usize;
    let (Some(low), Some(high)) = (sorted.get(below), sorted.get(last.min(below + 1))) else {
        return f64::NAN;
    };
    low + (at - at.floor()) * (high - low)
}

/// Share of a sample below a value; not a number where the sample is empty.
pub(super) fn share_below(sample: impl IntoIterator<Item = f64>, value: f64) -> f64 {
    share(sample.into_iter().map(|member| member < value))
}

/// Share of those that are true; not a number where there are none.
pub(super) fn share(sample: impl IntoIterator<Item = bool>) -> f64 {
    let (mut holding, mut count) = (0_u64, 0_u64);
    for holds in sample {
        holding += u64::from(holds);
        count += 1;
    }
    holding as f64 / count as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_band_of_even_numbers_is_where_it_must_be() {
        let band = Band::of((0..=100).rev().map(f64::from));
        assert_eq!((band.low, band.median, band.high), (5.0, 50.0, 95.0));
        assert_eq!(Band::of([1.0, 2.0]).median, 1.5);
        assert!(Band::of([]).median.is_nan());
        assert!(band.holds(5.0) && !band.holds(95.1));
    }

    #[test]
    fn shares_count() {
        assert_eq!(share_below((0..100).map(f64::from), 25.0), 0.25);
        assert_eq!(share([true, false, true, true]), 0.75);
    }
}
