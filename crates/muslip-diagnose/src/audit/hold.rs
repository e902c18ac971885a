//! Sample and hold: a channel that is renewed more slowly than it is recorded.

use super::constants::{HELD_COHERENCE, HELD_REPEATS, HELD_STEPS};

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
    let moments: Vec<f64> = renewals(value).iter().map(|&k| time[k]).collect();
    let mut gaps: Vec<f64> = moments.windows(2).map(|w| w[1] - w[0]).collect();
    if gaps.len() < HELD_STEPS {
        return None;
    }
    let step = crate::smooth::median_step(time);
    let there = value.iter().filter(|x| x.is_finite()).count();
    if moments.len() as f64 > (1.0 - HELD_REPEATS) * there as f64 {
        return None;
    }
    gaps.sort_by(f64::total_cmp);
    // Single periods: from the shortest usual gap on, one step of the sampler wide.
    let shortest = gaps[gaps.len() / 10];
    let single: Vec<f64> = gaps
        .iter()
        .copied()
        .filter(|g| *g > 0.5 * shortest && *g <= shortest + 1.2 * step)
        .collect();
    let first = single.iter().sum::<f64>() / single.len() as f64;
    let mut period = first;
    let mut coherent = 0.0;
    for (share, reach) in [(40, 0.2), (150, 0.02), (usize::MAX, 0.004)] {
        let moments = &moments[..moments.len().min(share)];
        (period, coherent) = sharpest(moments, period, reach);
    }
    let expected = sinc(step / period);
    // Renewals within one sampling step of a comb, and no period that the sampler itself has.
    (period >= 1.6 * step && coherent >= HELD_COHERENCE.max(0.8 * expected)).then_some(Hold {
        period_s: period,
        std_s: (step / moments.len() as f64).max(1e-6),
    })
}

fn sinc(x: f64) -> f64 {
    let angle = core::f64::consts::PI * x;
    if angle.abs() < 1e-9 {
        1.0
    } else {
        (angle.sin() / angle).abs()
    }
}

/// The period near a given one with which the moments are most coherent, and how coherent.
fn sharpest(moments: &[f64], near: f64, reach: f64) -> (f64, f64) {
    let span = (moments[moments.len() - 1] - moments[0]).max(near);
    let share = (0.2 * near / span).clamp(1e-6, 0.5 * reach);
    let trials = (reach / share).ceil().min(400.0) as i32;
    let thin = moments.len().div_ceil(400);
    (-trials..=trials)
        .map(|trial| {
            let period = near * (1.0 + reach * f64::from(trial) / f64::from(trials));
            let (mut cos, mut sin, mut count) = (0.0, 0.0, 0.0);
            for moment in moments.iter().step_by(thin) {
                let (s, c) = (core::f64::consts::TAU * (moment - moments[0]) / period).sin_cos();
                cos += c;
                sin += s;
                count += 1.0;
            }
            (period, f64::hypot(cos, sin) / count)
        })
        .fold(
            (near, 0.0),
            |best, trial| if trial.1 > best.1 { trial } else { best },
        )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_ramp_shows_its_period_and_a_smooth_one_none() {
        let time: Vec<f64> = (0..2000).map(|k| f64::from(k) * 0.004).collect();
        let held: Vec<f64> = time
            .iter()
            .map(|t| 30.0 - 2.0 * (t / 0.05).floor() * 0.05)
            .collect();
        let found = hold(&time, &held).unwrap();
        assert!((found.period_s - 0.05).abs() < 1e-3, "{found:?}");
        let plain: Vec<f64> = time.iter().map(|t| 30.0 - 2.0 * t).collect();
        assert!(hold(&time, &plain).is_none());
        assert!(hold(&time, &vec![1.0; 2000]).is_none());
        assert!(hold(&[], &[]).is_none());
    }
}
