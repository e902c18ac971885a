//! A recorded channel as a function of time, with its integral, so that it can be shifted and averaged exactly.

use super::constants::{KNOT_S, MOST_KNOTS};

/// Width over which a channel is averaged on either side for its slope, s.
const CURVATURE_S: f64 = 0.03;

/// A channel by its integral at even knots; between readings it is a straight line, beyond its ends constant.
#[derive(Clone, Debug, Default)]
pub struct Signal {
    start: f64,
    step: f64,
    /// Knots a second.
    rate: f64,
    integral: Vec<f64>,
    /// First and last reading.
    ends: (f64, f64),
}

impl Signal {
    /// Of the readings that are numbers.
    #[must_use]
    pub fn new(time: &[f64], value: &[f64]) -> Self {
        let mut readings: Vec<(f64, f64)> = Vec::with_capacity(time.len());
        for (&t, &x) in time.iter().zip(value) {
            if x.is_finite() && t.is_finite() && readings.last().is_none_or(|last| t > last.0) {
                readings.push((t, x));
            }
        }
        let (Some(first), Some(last)) = (readings.first().copied(), readings.last().copied())
        else {
            return Self::default();
        };
        let span = last.0 - first.0;
        let step = KNOT_S.max(span / MOST_KNOTS as f64);
        let mut out = Self {
            start: first.0,
            step,
            rate: step.recip(),
            integral: vec![0.0],
            ends: (first.1, last.1),
        };
        let count = (span / step).floor() as usize;
        let (mut place, mut done) = (0, 0.0);
        for knot in 1..=count {
            let until = first.0 + knot as f64 * step;
            while place + 1 < readings.len() && readings[place + 1].0 <= until {
                let (a, b) = (readings[place], readings[place + 1]);
                done += 0.5 * (a.1 + b.1) * (b.0 - a.0);
                place += 1;
            }
            let a = readings[place];
            let slope = readings
                .get(place + 1)
                .map_or(0.0, |b| (b.1 - a.1) / (b.0 - a.0));
            let ahead = until - a.0;
            out.integral
                .push(done + ahead * (a.1 + 0.5 * slope * ahead));
        }
        out
    }

    /// Whether there is nothing in it.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.integral.is_empty()
    }

    /// Integral up to a time.
    #[inline]
    fn integral_at(&self, time: f64) -> f64 {
        let place = (time - self.start) * self.rate;
        let last = self.integral.len() - 1;
        if !(place > 0.0) {
            return self.ends.0 * (time - self.start);
        }
        if place >= last as f64 {
            return self.integral[last] + self.ends.1 * (place - last as f64) * self.step;
        }
        let k = place as usize;
        let share = place - k as f64;
        self.integral[k] + share * (self.integral[k + 1] - self.integral[k])
    }

    /// Means over `count` steps of width `step` around start, start + step, ...; zeros where there is no reading.
    #[must_use]
    pub fn means(&self, start: f64, step: f64, count: usize) -> Vec<f64> {
        if self.is_empty() {
            return vec![0.0; count];
        }
        let mut before = self.integral_at(start - 0.5 * step);
        (0..count)
            .map(|k| {
                let now = self.integral_at(start + (k as f64 + 0.5) * step);
                let mean = (now - before) / step;
                before = now;
                mean
            })
            .collect()
    }

    /// Means over a width around such steps.
    #[must_use]
    pub fn averages(&self, start: f64, step: f64, count: usize, width: f64) -> Vec<f64> {
        if self.is_empty() {
            return vec![0.0; count];
        }
        (0..count)
            .map(|k| {
                let here = start + k as f64 * step;
                (self.integral_at(here + 0.5 * width) - self.integral_at(here - 0.5 * width))
                    / width
            })
            .collect()
    }

    /// Means of the integral over such steps, by Simpson's rule.
    #[must_use]
    pub fn levels(&self, start: f64, step: f64, count: usize) -> Vec<f64> {
        if self.is_empty() {
            return vec![0.0; count];
        }
        let mut before = self.integral_at(start - 0.5 * step);
        (0..count)
            .map(|k| {
                let here = start + k as f64 * step;
                let middle = self.integral_at(here);
                let now = self.integral_at(here + 0.5 * step);
                let mean = (before + 4.0 * middle + now) / 6.0;
                before = now;
                mean
            })
            .collect()
    }

    /// Means of the integral on a grid (start, step, number), later by a mean delay in s and wider by a second moment in s²:
    /// through a pole, whose own delay is part of that; sharpened where the moment is negative.
    #[must_use]
    pub fn levels_later(
        &self,
        (start, step, count): (f64, f64, usize),
        delay: f64,
        moment: f64,
    ) -> Vec<f64> {
        let slower = moment.max(0.0).sqrt();
        let from = start - delay + slower;
        let mut levels = self.levels(from, step, count);
        if moment >= 0.0 {
            return low_pass(&levels, step, slower);
        }
        let ahead = self.averages(from + 0.5 * CURVATURE_S, step, count, CURVATURE_S);
        let behind = self.averages(from - 0.5 * CURVATURE_S, step, count, CURVATURE_S);
        for ((level, a), b) in levels.iter_mut().zip(ahead).zip(behind) {
            *level += 0.5 * moment * (a - b) / CURVATURE_S;
        }
        levels
    }
}

/// First-order low-pass of a time constant in s, started in the steady state of its first slope; its mean delay is the time constant exactly.
#[must_use]
pub fn low_pass(values: &[f64], step: f64, time_constant: f64) -> Vec<f64> {
    if !(time_constant > 1e-6) {
        return values.to_vec();
    }
    let share = step / (time_constant + step);
    let slope = match values {
        [a, b, ..] => (b - a) / step,
        _ => 0.0,
    };
    let mut state = values.first().copied().unwrap_or(0.0) - slope * time_constant;
    values
        .iter()
        .map(|value| {
            state += share * (value - state);
            state
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_is_shifted_exactly() {
        let time: Vec<f64> = (0..100).map(|k| f64::from(k) * 0.01).collect();
        let value: Vec<f64> = time.iter().map(|t| 3.0 * t).collect();
        let signal = Signal::new(&time, &value);
        for (k, mean) in signal.means(0.2 + 0.003, 0.02, 20).iter().enumerate() {
            assert!((mean - 3.0 * (0.203 + 0.02 * k as f64)).abs() < 1e-4);
        }
        for (k, level) in signal.levels(0.2, 0.02, 20).iter().enumerate() {
            let t = 0.2 + 0.02 * k as f64;
            // Mean of 1.5 t² over a step: 1.5 (t² + h²/12).
            assert!((level - 1.5 * (t * t + 0.02f64.powi(2) / 12.0)).abs() < 1e-5);
        }
    }

    #[test]
    fn a_ramp_leaves_a_filter_later_by_its_time_constant() {
        let ramp: Vec<f64> = (0..200).map(|k| f64::from(k) * 0.01).collect();
        let late = low_pass(&ramp, 0.01, 0.05);
        assert!((ramp[150] - late[150] - 0.05).abs() < 1e-9);
        assert!((ramp[0] - late[0] - 0.05).abs() < 1e-2);
    }
}
