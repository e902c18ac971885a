//! Sample and hold: a channel that is renewed more slowly than it is recorded.

use super::constants::{HELD_REGULAR, HELD_REPEATS, HELD_STEPS};

/// How a channel is renewed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hold {
    /// Period in s.
    pub period_s: f64,
    /// Its standard deviation in s.
    pub std_s: f64,
}

/// Places at which the value changes.
#[must_use]
pub fn renewals(value: &[f64]) -> Vec<usize> {
    let mut last = f64::NAN;
    let mut out = Vec::new();
    for (k, &x) in value.iter().enumerate() {
        if x.is_finite() {
            if x != last && last.is_finite() {
                out.push(k);
            }
            last = x;
        }
    }
    out
}

/// The period of a held channel; none where it is renewed with every sample or without order.
#[must_use]
pub fn hold(time: &[f64], value: &[f64]) -> Option<Hold> {
    let changes = renewals(value);
    let moments: Vec<f64> = changes.iter().map(|&k| time[k]).collect();
    let mut gaps: Vec<f64> = moments.windows(2).map(|w| w[1] - w[0]).collect();
    let mut steps: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
    if gaps.len() < HELD_STEPS {
        return None;
    }
    let step = crate::smooth::median_in_place(&mut steps);
    let repeats = 1.0 - changes.len() as f64 / value.iter().filter(|x| x.is_finite()).count() as f64;
    if repeats < HELD_REPEATS {
        return None;
    }
    let typical = crate::smooth::median_in_place(&mut gaps);
    // Mean of those gaps that are single ones, then of all by their number of periods.
    let single: Vec<f64> = gaps.iter().copied().filter(|g| (g - typical).abs() <= 1.1 * step).collect();
    let mut period = single.iter().sum::<f64>() / single.len() as f64;
    let regular = |period: f64| {
        gaps.iter().filter(|&&g| {
            let count = (g / period).round();
            (1.0..=3.0).contains(&count) && (g - count * period).abs() <= 1.1 * step
        }).count() as f64 / gaps.len() as f64
    };
    if regular(period) < HELD_REGULAR || (single.len() as f64) < HELD_REGULAR * 0.8 * gaps.len() as f64 {
        return None;
    }
    let (mut whole, mut count) = (0.0, 0.0);
    for gap in &gaps {
        let periods = (gap / period).round();
        if (1.0..=3.0).contains(&periods) {
            whole += gap;
            count += periods;
        }
    }
    if count > 0.0 {
        period = whole / count;
    }
    (period >= 1.6 * step).then_some(Hold {
        period_s: period,
        std_s: (step / count.max(1.0)).max(1e-6),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_ramp_shows_its_period_and_a_smooth_one_none() {
        let time: Vec<f64> = (0..2000).map(|k| f64::from(k) * 0.004).collect();
        let held: Vec<f64> = time.iter().map(|t| 30.0 - 2.0 * (t / 0.05).floor() * 0.05).collect();
        let found = hold(&time, &held).unwrap();
        assert!((found.period_s - 0.05).abs() < 1e-3, "{found:?}");
        let plain: Vec<f64> = time.iter().map(|t| 30.0 - 2.0 * t).collect();
        assert!(hold(&time, &plain).is_none());
        assert!(hold(&time, &vec![1.0; 2000]).is_none());
        assert!(hold(&[], &[]).is_none());
    }
}
