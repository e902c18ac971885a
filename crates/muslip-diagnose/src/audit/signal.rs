//! A recorded channel as a function of time, with its integral, so that it can be shifted and averaged exactly.

/// Straight lines between readings, and their integral.
#[derive(Clone, Debug, Default)]
pub struct Signal {
    time: Vec<f64>,
    value: Vec<f64>,
    integral: Vec<f64>,
}

impl Signal {
    /// Of the readings that are numbers.
    #[must_use]
    pub fn new(time: &[f64], value: &[f64]) -> Self {
        let (mut t, mut x, mut sum) = (Vec::new(), Vec::new(), Vec::new());
        let mut total = 0.0;
        for (&time, &value) in time.iter().zip(value) {
            if !(value.is_finite() && time.is_finite()) {
                continue;
            }
            if let (Some(&before), Some(&old)) = (t.last(), x.last()) {
                let (before, old): (f64, f64) = (before, old);
                if !(time > before) {
                    continue;
                }
                total += 0.5 * (value + old) * (time - before);
            }
            t.push(time);
            x.push(value);
            sum.push(total);
        }
        Self {
            time: t,
            value: x,
            integral: sum,
        }
    }

    /// Whether there is nothing in it.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.time.is_empty()
    }

    /// Integral up to a time; beyond the ends the channel is constant. `near` is where to look first.
    fn integral_at(&self, time: f64, near: &mut usize) -> f64 {
        let last = self.time.len() - 1;
        while *near > 0 && self.time[*near] > time {
            *near -= 1;
        }
        while *near < last && self.time[*near + 1] <= time {
            *near += 1;
        }
        let k = *near;
        let ahead = time - self.time[k];
        let slope = if ahead > 0.0 && k < last {
            (self.value[k + 1] - self.value[k]) / (self.time[k + 1] - self.time[k])
        } else {
            0.0
        };
        self.integral[k] + ahead * (self.value[k] + 0.5 * slope * ahead)
    }

    /// Means over `count` steps of width `step` around start, start + step, ...; zeros where there is no reading.
    #[must_use]
    pub fn means(&self, start: f64, step: f64, count: usize) -> Vec<f64> {
        if self.is_empty() {
            return vec![0.0; count];
        }
        let mut near = 0;
        let mut before = self.integral_at(start - 0.5 * step, &mut near);
        (0..count)
            .map(|k| {
                let now = self.integral_at(start + (k as f64 + 0.5) * step, &mut near);
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
        let (mut first, mut second) = (0, 0);
        (0..count)
            .map(|k| {
                let here = start + k as f64 * step;
                let before = self.integral_at(here - 0.5 * width, &mut first);
                (self.integral_at(here + 0.5 * width, &mut second) - before) / width
            })
            .collect()
    }

    /// Means of the integral over such steps, by Simpson's rule.
    #[must_use]
    pub fn levels(&self, start: f64, step: f64, count: usize) -> Vec<f64> {
        if self.is_empty() {
            return vec![0.0; count];
        }
        let mut near = 0;
        let mut before = self.integral_at(start - 0.5 * step, &mut near);
        (0..count)
            .map(|k| {
                let here = start + k as f64 * step;
                let middle = self.integral_at(here, &mut near);
                let now = self.integral_at(here + 0.5 * step, &mut near);
                let mean = (before + 4.0 * middle + now) / 6.0;
                before = now;
                mean
            })
            .collect()
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
            assert!((mean - 3.0 * (0.203 + 0.02 * k as f64)).abs() < 1e-12);
        }
        for (k, level) in signal.levels(0.2, 0.02, 20).iter().enumerate() {
            let t = 0.2 + 0.02 * k as f64;
            // Mean of 1.5 t² over a step: 1.5 (t² + h²/12).
            assert!((level - 1.5 * (t * t + 0.02f64.powi(2) / 12.0)).abs() < 1e-12);
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
