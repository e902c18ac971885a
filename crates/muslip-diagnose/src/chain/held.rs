//! Channels that hold their last reading, drawn as straight lines between the readings.

use crate::campaign::Run;
use crate::constants::LEAST_REPEATED;

/// A held channel with every reading at the middle of the time for which it stands, and straight lines in between:
/// as late on average as the staircase, without its steps. Any other channel as it is.
fn unheld(time: &[f64], x: &[f64]) -> Vec<f64> {
    let moves = |k: usize| x[k] != x[k - 1];
    let n = x.len();
    // Where it moves at all: a standstill repeats without being held.
    let mut stands: Vec<(usize, usize)> = Vec::new();
    let mut from = 0;
    for k in 1..n {
        if moves(k) {
            stands.push((from, k));
            from = k;
        }
    }
    stands.push((from, n));
    let typical = {
        let mut lengths: Vec<f64> = stands.iter().map(|(a, b)| (b - a) as f64).collect();
        crate::smooth::median_in_place(&mut lengths)
    };
    let short = |(a, b): (usize, usize)| ((b - a) as f64) <= 3.0 * typical;
    let (mut repeated, mut moving) = (0.0, 0.0);
    for &stand in stands.iter().filter(|s| short(**s)) {
        repeated += (stand.1 - stand.0 - 1) as f64;
        moving += (stand.1 - stand.0) as f64;
    }
    if !(repeated > LEAST_REPEATED * moving) || stands.len() < 20 {
        return x.to_vec();
    }
    let middle = |(a, b): (usize, usize)| 0.5 * (time[a] + time[b - 1]);
    let mut out = x.to_vec();
    for pair in stands.windows(2) {
        if !short(pair[0]) || !short(pair[1]) {
            continue;
        }
        let (a, b) = (middle(pair[0]), middle(pair[1]));
        let (from, to) = (x[pair[0].0], x[pair[1].0]);
        if !(b > a) || !from.is_finite() || !to.is_finite() {
            continue;
        }
        for k in pair[0].0..pair[1].1 {
            if time[k] >= a && time[k] <= b {
                out[k] = from + (to - from) * (time[k] - a) / (b - a);
            }
        }
    }
    out
}

/// A run whose speeds are lines where they were held.
#[must_use]
pub fn without_holds(run: &Run) -> Run {
    Run {
        wheel_speed_rad_s: unheld(&run.time_s, &run.wheel_speed_rad_s),
        vehicle_speed_m_s: unheld(&run.time_s, &run.vehicle_speed_m_s),
        ..run.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_staircase_becomes_the_line_it_was_read_from() {
        let time: Vec<f64> = (0..300).map(|k| 0.004 * f64::from(k)).collect();
        let held: Vec<f64> = (0..300)
            .map(|k| 20.0 - 3.0 * 0.004 * f64::from(5 * (k / 5)))
            .collect();
        let line = unheld(&time, &held);
        for k in 10..290 {
            assert!((line[k] - (20.0 - 3.0 * (time[k] - 0.008))).abs() < 1e-9);
        }
        assert_eq!(unheld(&time, &line)[10..290], line[10..290]);
    }
}
