//! Recordings with their channels brought to the drag channel's time.

use serde::{Deserialize, Serialize};

use super::held::without_holds;
use crate::campaign::Run;
use crate::series::GAP_STEPS;
use crate::smooth::median_step;

/// By how much each channel is late against the drag channel, in s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Lateness {
    /// Wheel speed, the part that is always the same.
    pub wheel: f64,
    /// Wheel speed at `turn`, the part in inverse proportion to it (a period between teeth).
    pub wheel_by_turn: f64,
    /// Wheel speed in rad/s at which `wheel_by_turn` holds.
    pub turn: f64,
    /// Vehicle speed.
    pub vehicle: f64,
    /// Brake torque or pressure.
    pub brake: f64,
}

/// Standard deviations in s to which the channels' timing against the drag is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimingStd {
    /// Wheel speed.
    pub wheel: f64,
    /// Wheel speed, by the share of a turn that its sensor takes at the mean speed.
    pub wheel_by_turn: f64,
    /// Vehicle speed.
    pub vehicle: f64,
    /// Brake torque or pressure.
    pub brake: f64,
}

impl Default for TimingStd {
    /// Of channels of which nothing is known.
    fn default() -> Self {
        Self {
            wheel: 0.02,
            wheel_by_turn: 0.001,
            vehicle: 0.05,
            brake: 0.02,
        }
    }
}

/// Least share of `turn` at which the lateness by turn is still taken to grow.
const SLOWEST: f64 = 0.1;

impl Lateness {
    /// Whether no channel is late.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Of the wheel speed at this reading of it.
    #[must_use]
    pub fn of_wheel(&self, wheel_speed: f64) -> f64 {
        let slowest = (SLOWEST * self.turn).max(1e-9);
        self.wheel + self.wheel_by_turn * self.turn / wheel_speed.abs().max(slowest)
    }

    /// The run with every channel at the drag channel's time, and speeds that were held drawn as lines.
    #[must_use]
    pub fn corrected(&self, run: &Run) -> Run {
        if self.is_none() {
            return run.clone();
        }
        self.shifted(&without_holds(run))
    }

    /// The run with every channel at the drag channel's time. Where nothing was recorded yet, or any more, the vehicle's speed
    /// goes on along a straight line, for held there it would be a slip; of wheel and brake, which change their rate at once,
    /// the nearest reading stands: see [`Self::known`].
    #[must_use]
    pub fn shifted(&self, run: &Run) -> Run {
        let time = &run.time_s;
        let wheel = &run.wheel_speed_rad_s;
        let vehicle = &run.vehicle_speed_m_s;
        let brake = |x: &Vec<f64>| later(time, x, |_| self.brake, |_| None);
        Run {
            wheel_speed_rad_s: later(time, wheel, |k| self.of_reading(wheel[k]), |_| None),
            vehicle_speed_m_s: later(
                time,
                vehicle,
                |_| self.vehicle,
                |wanted| straight_on(time, vehicle, wanted),
            ),
            brake_torque_nm: run.brake_torque_nm.as_ref().map(brake),
            brake_pressure_pa: run.brake_pressure_pa.as_ref().map(brake),
            ..run.clone()
        }
    }

    fn of_reading(&self, wheel_speed: f64) -> f64 {
        let by = self.of_wheel(wheel_speed);
        if by.is_finite() { by } else { self.wheel }
    }

    /// Samples of a run at which every channel was recorded at the drag channel's time: none in a gap or beyond the
    /// ends, where a late channel had not yet told what happened when the recording stopped.
    #[must_use]
    pub fn known(&self, run: &Run) -> Vec<bool> {
        let time = &run.time_s;
        let n = time.len();
        if n < 2 {
            return vec![true; n];
        }
        let longest = longest_step(time);
        let brake = run.brake_torque_nm.is_some() || run.brake_pressure_pa.is_some();
        let mut at = 0;
        (0..n)
            .map(|k| {
                [
                    self.of_reading(run.wheel_speed_rad_s[k]),
                    self.vehicle,
                    if brake { self.brake } else { 0.0 },
                ]
                .into_iter()
                .all(|by| {
                    let wanted = time[k] + by;
                    bracket(time, wanted, &mut at);
                    by == 0.0
                        || (wanted >= time[at]
                            && wanted <= time[at + 1]
                            && time[at + 1] - time[at] <= longest)
                })
            })
            .collect()
    }
}

/// Longest step in s from one time to the next that is no gap.
pub(super) fn longest_step(time: &[f64]) -> f64 {
    GAP_STEPS * median_step(time)
}

/// Moves `at` to the step of time that holds `wanted`, or to the nearest.
fn bracket(time: &[f64], wanted: f64, at: &mut usize) {
    while *at + 2 < time.len() && time[*at + 1] <= wanted {
        *at += 1;
    }
    while *at > 0 && time[*at] > wanted {
        *at -= 1;
    }
}

/// Shortest stretch at an end of a run, in s, along which a vehicle's speed is drawn on beyond it: several readings of any
/// sensor, and short beside a stop.
const SHORTEST_STRETCH_S: f64 = 0.1;

/// A vehicle's speed at a time beyond an end of its recording: on the straight line through its last readings, or its first,
/// over twice as long a stretch as it lies beyond, a tenth of a second at least. It comes to rest, and does not turn round.
pub(super) fn straight_on(time: &[f64], x: &[f64], wanted: f64) -> Option<f64> {
    let (first, last) = (*time.first()?, *time.last()?);
    let from = wanted.clamp(first, last);
    let stretch = (2.0 * (wanted - from).abs()).max(SHORTEST_STRETCH_S);
    let begin = time.partition_point(|t| *t < from - stretch);
    let end = time.partition_point(|t| *t <= from + stretch);
    let near = time[begin..end].iter().zip(&x[begin..end]);
    let near = near.filter(|(_, x)| x.is_finite());
    let (mut n, mut sums) = (0.0, [0.0; 4]);
    let mut least = f64::INFINITY;
    for (t, x) in near {
        let t = t - from;
        n += 1.0;
        for (sum, own) in sums.iter_mut().zip([t, *x, t * t, t * x]) {
            *sum += own;
        }
        least = least.min(*x);
    }
    let [t, x, tt, tx] = sums;
    let slope = (n * tx - t * x) / (n * tt - t * t);
    let value = (x - slope * t) / n + slope * (wanted - from);
    let value = if least >= 0.0 { value.max(0.0) } else { value };
    value.is_finite().then_some(value)
}

/// A channel read later by so many seconds at every sample: a straight line between the readings about that time, and what is
/// `beyond` an end of the recording, where that is known, else the nearest reading.
fn later(
    time: &[f64],
    x: &[f64],
    by: impl Fn(usize) -> f64,
    beyond: impl Fn(f64) -> Option<f64>,
) -> Vec<f64> {
    let n = x.len();
    if n < 2 {
        return x.to_vec();
    }
    let mut at = 0;
    (0..n)
        .map(|k| {
            let shift = by(k);
            if shift == 0.0 {
                return x[k];
            }
            let wanted = time[k] + shift;
            let outside = wanted < time[0] || wanted > time[n - 1];
            if let Some(told) = outside.then(|| beyond(wanted)).flatten() {
                return told;
            }
            bracket(time, wanted, &mut at);
            let share = ((wanted - time[at]) / (time[at + 1] - time[at])).clamp(0.0, 1.0);
            x[at] * (1.0 - share) + x[at + 1] * share
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_channel_is_brought_back_to_when_it_was() {
        let time: Vec<f64> = (0..200).map(|k| 0.01 * f64::from(k)).collect();
        let run = Run {
            wheel_speed_rad_s: time.iter().map(|t| 50.0 + 3.0 * (t - 0.035)).collect(),
            vehicle_speed_m_s: time.iter().map(|t| 20.0 - 2.0 * (t - 0.02)).collect(),
            time_s: time.clone(),
            ..Run::default()
        };
        let late = Lateness {
            wheel: 0.035,
            vehicle: 0.02,
            ..Lateness::default()
        };
        let corrected = late.corrected(&run);
        for (k, t) in time.iter().enumerate().skip(10) {
            let wheel = corrected.wheel_speed_rad_s[k] - 50.0 - 3.0 * t;
            assert!(wheel.abs() < 1e-9 || k >= 196);
            // What it had not told when the recording stopped, too.
            assert!((corrected.vehicle_speed_m_s[k] - 20.0 + 2.0 * t).abs() < 1e-9);
        }
    }

    #[test]
    fn a_vehicle_goes_on_beyond_its_recording_until_it_comes_to_rest_and_a_brake_does_not() {
        let time: Vec<f64> = (0..200).map(|k| 0.01 * f64::from(k)).collect();
        let run = Run {
            // 0.1 m/s are left where the recording ends.
            vehicle_speed_m_s: time.iter().map(|t| 2.09 - t).collect(),
            wheel_speed_rad_s: vec![5.0; 200],
            brake_torque_nm: Some(time.iter().map(|t| 100.0 * t).collect()),
            time_s: time.clone(),
            ..Run::default()
        };
        let late = Lateness {
            vehicle: 0.15,
            brake: 0.15,
            wheel: 0.01,
            ..Lateness::default()
        };
        let corrected = late.corrected(&run);
        let speed = &corrected.vehicle_speed_m_s;
        assert!((speed[190] - 0.04).abs() < 1e-9, "{}", speed[190]);
        assert_eq!(speed[199], 0.0);
        assert!((corrected.brake_torque_nm.unwrap()[199] - 199.0).abs() < 1e-9);
        // A channel that is early has a beginning that nothing told.
        let early = Lateness {
            vehicle: -0.05,
            ..Lateness::default()
        };
        let begins = early.corrected(&run).vehicle_speed_m_s[0];
        assert!((begins - 2.14).abs() < 1e-9, "{begins}");
    }

    #[test]
    fn nothing_is_known_of_a_late_channel_beyond_the_ends_and_beside_a_gap() {
        let time: Vec<f64> = (0..100)
            .map(|k| 0.01 * f64::from(k) + if k < 50 { 0.0 } else { 2.0 })
            .collect();
        let run = Run {
            wheel_speed_rad_s: vec![50.0; 100],
            vehicle_speed_m_s: vec![20.0; 100],
            time_s: time,
            ..Run::default()
        };
        let late = Lateness {
            vehicle: 0.035,
            ..Lateness::default()
        };
        let known = late.known(&run);
        let unknown: Vec<usize> = (0..100).filter(|k| !known[*k]).collect();
        assert_eq!(unknown, [46, 47, 48, 49, 96, 97, 98, 99]);
    }
}
