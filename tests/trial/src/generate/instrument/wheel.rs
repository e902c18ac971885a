//! Wheel speed: from the period of a ring's teeth, from counts in a window, from a tachometer.

use serde::{Deserialize, Serialize};

use super::Seen;
use super::colour::Colour;
use crate::draw::Draw;
use crate::generate::chain::{at, low_pass};
use crate::generate::rig::{Rig, RigKind};

/// How the wheel's speed is measured.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WheelSensor {
    /// The speed itself, with noise.
    Ideal,
    /// The time that the last so many teeth took, by a timer.
    ToneRing {
        /// Where each tooth's edge is off, in pitches; one value a tooth.
        pitch_errors: Vec<f64>,
        /// Teeth over which the period is taken.
        averaged: usize,
        timer_s: f64,
    },
    /// Lines counted in a window, sliding with the samples or renewed when it ends.
    Counts {
        lines: f64,
        window_s: f64,
        held: bool,
    },
    /// A tachometer behind its filter.
    Tacho {
        pole_s: f64,
        poles: usize,
        noise: Colour,
        /// Ripple of its commutator: relative amplitude, periods a revolution.
        ripple: f64,
        order: f64,
    },
}

/// Longest that a tooth may be awaited before the wheel is said to stand, s.
const STANDING_S: f64 = 0.5;

impl WheelSensor {
    /// A sensor of a rig.
    pub fn draw(rig: &Rig, draw: &mut Draw) -> WheelSensor {
        let spin = rig.mean_speed_m_s / rig.radius_m;
        match draw.whole(0, 2) {
            0 => {
                let teeth = draw.whole(24, 100);
                let (machining, eccentric) =
                    (draw.log_between(2e-4, 4e-3), draw.log_between(2e-4, 4e-3));
                let phase = draw.between(0.0, std::f64::consts::TAU);
                WheelSensor::ToneRing {
                    pitch_errors: (0..teeth)
                        .map(|tooth| {
                            let angle = std::f64::consts::TAU * tooth as f64 / teeth as f64;
                            // An eccentricity of so many pitches at the ring's edge.
                            machining * draw.normal()
                                + eccentric * teeth as f64 / std::f64::consts::TAU
                                    * (angle + phase).sin()
                        })
                        .collect(),
                    averaged: draw.one_of(&[1, 1, 2, 4]),
                    timer_s: draw.one_of(&[1e-7, 1e-6]),
                }
            }
            1 => {
                let window_s = (1.0 / rig.rate_hz).max(draw.log_between(0.002, 0.03));
                // So many lines that a window counts between some 60 and 600 of them.
                let wanted =
                    draw.log_between(60.0, 600.0) / (spin * window_s) * std::f64::consts::TAU;
                WheelSensor::Counts {
                    lines: [
                        100.0, 250.0, 500.0, 1000.0, 2500.0, 5000.0, 10000.0, 20000.0,
                    ]
                    .into_iter()
                    .min_by(|a: &f64, b: &f64| {
                        (a / wanted).ln().abs().total_cmp(&(b / wanted).ln().abs())
                    })
                    .unwrap_or(1000.0),
                    window_s,
                    held: draw.chance(0.4),
                }
            }
            _ => {
                let fast = if rig.kind == RigKind::ScaleCar {
                    0.5
                } else {
                    1.0
                };
                WheelSensor::Tacho {
                    pole_s: fast * draw.log_between(0.002, 0.02),
                    poles: draw.whole(1, 2),
                    noise: Colour {
                        std: rig.sigmas.wheel_speed_rad_s,
                        slow: draw.between(0.0, 0.5),
                        time_constant_s: draw.log_between(0.01, 0.2),
                        flicker: 0.0,
                    },
                    ripple: if draw.chance(0.5) {
                        draw.log_between(3e-4, 3e-3)
                    } else {
                        0.0
                    },
                    order: draw.one_of(&[1.0, 2.0, 7.0, 11.0]),
                }
            }
        }
    }

    /// The sensor's word.
    pub fn word(&self) -> &'static str {
        match self {
            WheelSensor::Ideal => "ideal",
            WheelSensor::ToneRing { .. } => "tone_ring",
            WheelSensor::Counts { .. } => "counts",
            WheelSensor::Tacho { .. } => "tacho",
        }
    }

    /// Readings at the recorder's times; without `errors` as from teeth and lines without end.
    pub fn read(&self, seen: &Seen, times: &[f64], errors: bool) -> Vec<f64> {
        let plain = |time: f64| at(&seen.wheel, seen.place(time));
        match self {
            WheelSensor::Ideal => times.iter().map(|time| plain(*time)).collect(),
            WheelSensor::ToneRing {
                pitch_errors,
                averaged,
                timer_s,
            } => {
                let edges = edges(seen, pitch_errors, errors);
                let pitch = std::f64::consts::TAU / pitch_errors.len() as f64;
                times
                    .iter()
                    .map(|&time| {
                        let next = edges.partition_point(|edge| *edge <= time);
                        let (Some(last), Some(before)) = (
                            next.checked_sub(1).and_then(|i| edges.get(i)),
                            next.checked_sub(1 + averaged).and_then(|i| edges.get(i)),
                        ) else {
                            return plain(time);
                        };
                        let count = *averaged as f64;
                        let mut period = (last - before) / count;
                        if errors {
                            period = ((period * count / timer_s).round() * timer_s / count)
                                .max(*timer_s);
                        }
                        // A tooth that is overdue says that the wheel has become slower.
                        let waited = time - last;
                        if waited > STANDING_S {
                            0.0
                        } else {
                            pitch / period.max(waited)
                        }
                    })
                    .collect()
            }
            WheelSensor::Counts {
                lines,
                window_s,
                held,
            } => windowed(
                &seen.angle,
                seen,
                times,
                (std::f64::consts::TAU / lines, *window_s, *held),
                errors,
            ),
            WheelSensor::Tacho {
                pole_s,
                poles,
                ripple,
                order,
                ..
            } => {
                let mut signal = seen.wheel.clone();
                if errors && *ripple > 0.0 {
                    for (value, angle) in signal.iter_mut().zip(&seen.angle) {
                        *value *= 1.0 + ripple * (order * angle).sin();
                    }
                }
                for _ in 0..*poles {
                    signal = low_pass(&signal, seen.dt, *pole_s);
                }
                times
                    .iter()
                    .map(|time| at(&signal, seen.place(*time)))
                    .collect()
            }
        }
    }

    /// Values of the recorder's times as the sensor passes them on: renewed only when its reading is.
    pub fn hold(&self, seen: &Seen, times: &[f64], series: &[f64]) -> Vec<f64> {
        match self {
            WheelSensor::Counts {
                window_s,
                held: true,
                ..
            } => resampled(times, series, |time| window_end(seen, time, *window_s)),
            _ => series.to_vec(),
        }
    }

    /// Random noise behind the sensor.
    pub fn add_noise(&self, values: &mut [f64], period: f64, draw: &mut Draw) {
        if let WheelSensor::Tacho { noise, .. } = self {
            let errors = noise.series(values.len(), period, draw);
            for (value, error) in values.iter_mut().zip(errors) {
                *value += error;
            }
        }
    }

    /// Mean delay at an angular speed, s.
    pub fn delay(&self, wheel_rad_s: f64) -> f64 {
        match self {
            WheelSensor::Ideal => 0.0,
            WheelSensor::ToneRing {
                pitch_errors,
                averaged,
                ..
            } => {
                let tooth_s =
                    std::f64::consts::TAU / pitch_errors.len() as f64 / wheel_rad_s.max(1e-6);
                // Half of what was timed, and half a tooth of waiting for the next edge.
                0.5 * tooth_s * (*averaged as f64 + 1.0)
            }
            WheelSensor::Counts { window_s, held, .. } => {
                if *held {
                    *window_s
                } else {
                    0.5 * window_s
                }
            }
            WheelSensor::Tacho { pole_s, poles, .. } => pole_s * *poles as f64,
        }
    }

    /// Whether the reading varies with the wheel's angle.
    pub fn ripples(&self) -> bool {
        match self {
            WheelSensor::ToneRing { .. } => true,
            WheelSensor::Tacho { ripple, .. } => *ripple > 0.0,
            _ => false,
        }
    }
}

/// Times at which the ring's edges pass, in order.
fn edges(seen: &Seen, pitch_errors: &[f64], errors: bool) -> Vec<f64> {
    let teeth = pitch_errors.len();
    let pitch = std::f64::consts::TAU / teeth as f64;
    let Some(first) = seen.angle.first() else {
        return Vec::new();
    };
    let mut found = Vec::new();
    let mut tooth = (first / pitch).ceil() as i64;
    let place = |tooth: i64| {
        let error = if errors {
            let own = usize::try_from(tooth.rem_euclid(teeth as i64)).unwrap_or(0);
            pitch_errors.get(own).copied().unwrap_or(0.0)
        } else {
            0.0
        };
        pitch * (tooth as f64 + error)
    };
    for index in 1..seen.angle.len() {
        let (a, b) = (seen.angle[index - 1], seen.angle[index]);
        while b > a && place(tooth) < b {
            let part = within(
                place(tooth) - a,
                seen.wheel[index - 1],
                seen.wheel[index],
                b - a,
            );
            found.push(seen.start + seen.dt * ((index - 1) as f64 + part));
            tooth += 1;
        }
    }
    found
}

/// Share of a step of angle `whole` at which it has covered `angle`, speed changing evenly from `from` to `to`.
fn within(angle: f64, from: f64, to: f64, whole: f64) -> f64 {
    let mean = 0.5 * (from + to);
    let share = (angle / whole).clamp(0.0, 1.0);
    if mean <= 0.0 {
        return share;
    }
    // angle/whole = (from x + (to - from) x²/2) / mean, one step of Newton's from the straight line.
    let (a, b) = (from / mean, 0.5 * (to - from) / mean);
    let (value, slope) = (a * share + b * share * share, a + 2.0 * b * share);
    if slope > 1e-3 {
        (share - (value - share) / slope).clamp(0.0, 1.0)
    } else {
        share
    }
}

/// When the window that a held reading is of ended.
pub fn window_end(seen: &Seen, time: f64, window_s: f64) -> f64 {
    seen.start + ((time - seen.start) / window_s).floor() * window_s
}

/// A series at equal times, taken at other ones.
pub fn resampled(times: &[f64], series: &[f64], when: impl Fn(f64) -> f64) -> Vec<f64> {
    let (Some(first), Some(last)) = (times.first(), times.last()) else {
        return Vec::new();
    };
    let per_s = (times.len().max(2) - 1) as f64 / (last - first).max(1e-9);
    times
        .iter()
        .map(|time| at(series, (when(*time) - first) * per_s))
        .collect()
}

/// Speed from whole steps of a position passed in a window; without `errors` from the position itself.
pub fn windowed(
    position: &[f64],
    seen: &Seen,
    times: &[f64],
    (step, window_s, held): (f64, f64, bool),
    errors: bool,
) -> Vec<f64> {
    let start = seen.start;
    let counted = |time: f64| {
        let value = at(position, seen.place(time));
        if errors {
            (value / step).floor() * step
        } else {
            value
        }
    };
    times
        .iter()
        .map(|&time| {
            let end = if held {
                window_end(seen, time, window_s)
            } else {
                time
            };
            let begin = (end - window_s).max(start);
            if end - begin < 0.5 * window_s {
                // The first window is not full yet: as from a fine one.
                let (a, b) = (
                    time.max(start),
                    (time + 2.0 * seen.dt).max(start + 2.0 * seen.dt),
                );
                return (at(position, seen.place(b)) - at(position, seen.place(a))) / (b - a);
            }
            (counted(end) - counted(begin)) / (end - begin)
        })
        .collect()
}
