//! Vehicle or drum speed: satellites, optical sensor, fifth wheel, drum encoder.

use serde::{Deserialize, Serialize};

use super::Seen;
use super::colour::Colour;
use super::wheel::{resampled, window_end, windowed};
use crate::draw::Draw;
use crate::generate::chain::{at, low_pass};
use crate::generate::rig::{Rig, RigKind};

/// How the speed over the road, or of the drum, is measured.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VehicleSensor {
    /// The speed itself, with noise.
    Ideal,
    /// Fixes at a rate of their own, late, behind a filter, held or joined by straight lines.
    Gps {
        rate_hz: f64,
        latency_s: f64,
        pole_s: f64,
        interpolated: bool,
        /// When the first fix came, as a share of their period.
        phase: f64,
    },
    /// A mean over the time that the surface takes past the grid.
    Optical { window_s: f64 },
    /// Pulses of so many metres counted in a window.
    FifthWheel {
        step_m: f64,
        window_s: f64,
        held: bool,
    },
    /// Lines of a drum's encoder, fine.
    DrumEncoder { step_m: f64, window_s: f64 },
}

impl VehicleSensor {
    /// A sensor of a rig.
    pub fn draw(rig: &Rig, draw: &mut Draw) -> VehicleSensor {
        let scale_car = rig.kind == RigKind::ScaleCar;
        let choice = if rig.kind == RigKind::Drum {
            draw.one_of(&["drum", "drum", "optical"])
        } else if scale_car {
            draw.one_of(&["gps", "optical"])
        } else {
            draw.one_of(&["gps", "gps", "optical", "fifth"])
        };
        match choice {
            "drum" => VehicleSensor::DrumEncoder {
                step_m: std::f64::consts::TAU * draw.between(0.5, 1.7)
                    / draw.one_of(&[5000.0, 10000.0, 20000.0]),
                window_s: (2.0 / rig.rate_hz).max(draw.log_between(0.005, 0.02)),
            },
            "optical" => VehicleSensor::Optical {
                window_s: draw.between(0.01, 0.04),
            },
            "fifth" => VehicleSensor::FifthWheel {
                step_m: std::f64::consts::TAU * 0.3 / draw.one_of(&[500.0, 1000.0, 2000.0]),
                window_s: draw.between(0.01, 0.05),
                held: draw.chance(0.5),
            },
            _ => VehicleSensor::Gps {
                // A scale car's position comes from cameras, as fast as they are.
                rate_hz: if scale_car {
                    100.0
                } else {
                    draw.one_of(&[10.0, 20.0, 50.0, 100.0])
                },
                latency_s: draw.between(0.02, 0.08),
                pole_s: draw.log_between(0.005, 0.05),
                interpolated: draw.chance(0.6),
                phase: draw.between(0.0, 1.0),
            },
        }
    }

    /// The sensor's word.
    pub fn word(&self) -> &'static str {
        match self {
            VehicleSensor::Ideal => "ideal",
            VehicleSensor::Gps { .. } => "gps",
            VehicleSensor::Optical { .. } => "optical",
            VehicleSensor::FifthWheel { .. } => "fifth_wheel",
            VehicleSensor::DrumEncoder { .. } => "drum_encoder",
        }
    }

    /// The sensor's random noise beside its steps.
    pub fn noise(&self, rig: &Rig, draw: &mut Draw) -> Colour {
        let std = rig.sigmas.vehicle_speed_m_s;
        match self {
            VehicleSensor::Gps { .. } => Colour {
                std,
                slow: draw.between(0.3, 0.8),
                time_constant_s: draw.log_between(0.1, 1.0),
                flicker: 0.0,
            },
            VehicleSensor::Optical { .. } => Colour {
                std,
                slow: draw.between(0.0, 0.6),
                time_constant_s: draw.log_between(0.02, 0.3),
                flicker: if draw.chance(0.5) { 0.2 } else { 0.0 },
            },
            // What these err by is their steps.
            _ => Colour::default(),
        }
    }

    /// Readings at the recorder's times; without `errors` as from lines without end.
    pub fn read(&self, seen: &Seen, times: &[f64], errors: bool) -> Vec<f64> {
        match self {
            VehicleSensor::Ideal => times
                .iter()
                .map(|time| at(&seen.speed, seen.place(*time)))
                .collect(),
            VehicleSensor::Gps {
                latency_s, pole_s, ..
            } => {
                let filtered = low_pass(&seen.speed, seen.dt, *pole_s);
                self.fixes(times, |fix| at(&filtered, seen.place(fix - latency_s)))
            }
            VehicleSensor::Optical { window_s } => times
                .iter()
                .map(|time| {
                    let (a, b) = (seen.place(time - window_s), seen.place(*time));
                    if a < 0.0 {
                        return at(&seen.speed, b);
                    }
                    (at(&seen.distance, b) - at(&seen.distance, a)) / window_s
                })
                .collect(),
            VehicleSensor::FifthWheel {
                step_m,
                window_s,
                held,
            } => windowed(
                &seen.distance,
                seen,
                times,
                (*step_m, *window_s, *held),
                errors,
            ),
            VehicleSensor::DrumEncoder { step_m, window_s } => windowed(
                &seen.distance,
                seen,
                times,
                (*step_m, *window_s, false),
                errors,
            ),
        }
    }

    /// What a value that is known at any time is at the recorder's times, by way of the fixes.
    fn fixes(&self, times: &[f64], value: impl Fn(f64) -> f64) -> Vec<f64> {
        let VehicleSensor::Gps {
            rate_hz,
            interpolated,
            phase,
            ..
        } = self
        else {
            return times.iter().map(|time| value(*time)).collect();
        };
        let period = 1.0 / rate_hz;
        times
            .iter()
            .map(|&time| {
                let number = (time / period - phase).floor();
                let last = (number + phase) * period;
                if *interpolated {
                    let part = (time - last) / period;
                    value(last) + part * (value(last + period) - value(last))
                } else {
                    value(last)
                }
            })
            .collect()
    }

    /// Values of the recorder's times as the sensor passes them on: held or joined as its readings are.
    pub fn hold(&self, seen: &Seen, times: &[f64], series: &[f64]) -> Vec<f64> {
        let (Some(first), Some(last)) = (times.first(), times.last()) else {
            return Vec::new();
        };
        let per_s = (times.len().max(2) - 1) as f64 / (last - first).max(1e-9);
        match self {
            VehicleSensor::FifthWheel {
                window_s,
                held: true,
                ..
            } => resampled(times, series, |time| window_end(seen, time, *window_s)),
            _ => self.fixes(times, |fix| at(series, (fix - first) * per_s)),
        }
    }

    /// Mean delay, s.
    pub fn delay(&self) -> f64 {
        match self {
            VehicleSensor::Ideal => 0.0,
            VehicleSensor::Gps {
                rate_hz,
                latency_s,
                pole_s,
                interpolated,
                ..
            } => latency_s + pole_s + if *interpolated { 0.0 } else { 0.5 / rate_hz },
            VehicleSensor::Optical { window_s } => 0.5 * window_s,
            VehicleSensor::FifthWheel { window_s, held, .. } => {
                if *held {
                    *window_s
                } else {
                    0.5 * window_s
                }
            }
            VehicleSensor::DrumEncoder { window_s, .. } => 0.5 * window_s,
        }
    }
}
