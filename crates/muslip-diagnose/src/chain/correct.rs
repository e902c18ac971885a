//! Recordings with their channels brought to the drag channel's time.

use serde::{Deserialize, Serialize};

use crate::campaign::Run;

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

    /// The run with every channel at the drag channel's time. Where nothing was recorded yet, or any more, the
    /// nearest reading stands.
    #[must_use]
    pub fn corrected(&self, run: &Run) -> Run {
        let time = &run.time_s;
        let wheel = &run.wheel_speed_rad_s;
        let brake = |x: &Vec<f64>| later(time, x, |_| self.brake);
        Run {
            wheel_speed_rad_s: later(time, wheel, |k| {
                let by = self.of_wheel(wheel[k]);
                if by.is_finite() { by } else { self.wheel }
            }),
            vehicle_speed_m_s: later(time, &run.vehicle_speed_m_s, |_| self.vehicle),
            brake_torque_nm: run.brake_torque_nm.as_ref().map(brake),
            brake_pressure_pa: run.brake_pressure_pa.as_ref().map(brake),
            ..run.clone()
        }
    }
}

/// A channel read later by so many seconds at every sample: a straight line between the readings about that time.
fn later(time: &[f64], x: &[f64], by: impl Fn(usize) -> f64) -> Vec<f64> {
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
            while at + 2 < n && time[at + 1] <= wanted {
                at += 1;
            }
            while at > 0 && time[at] > wanted {
                at -= 1;
            }
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
        for (k, t) in time.iter().enumerate().take(180).skip(10) {
            assert!((corrected.wheel_speed_rad_s[k] - 50.0 - 3.0 * t).abs() < 1e-9);
            assert!((corrected.vehicle_speed_m_s[k] - 20.0 + 2.0 * t).abs() < 1e-9);
        }
    }
}
