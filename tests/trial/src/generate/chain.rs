//! The measurement chain: from what truly happened on the fine grid to what the instruments read,
//! before any random noise.

use crate::generate::effect::{Effect, Scale};
use crate::generate::form::Form;
use crate::generate::instrument::Seen;
use crate::generate::sim::{Stretch, derivative};

/// Readings of one stretch at its sample times, free of random noise.
#[derive(Clone, Debug, Default)]
pub struct Readings {
    pub time: Vec<f64>,
    pub wheel: Vec<f64>,
    pub speed: Vec<f64>,
    pub drag: Vec<f64>,
    pub load: Vec<f64>,
    pub torque: Vec<f64>,
    pub command: Vec<f64>,
    pub column: Vec<f64>,
    /// True angle and distance, for the truth file only.
    pub angle: Vec<f64>,
    pub distance: Vec<f64>,
}

impl Readings {
    /// Appends another stretch of the same run.
    pub fn extend(&mut self, other: Readings) {
        self.time.extend(other.time);
        self.wheel.extend(other.wheel);
        self.speed.extend(other.speed);
        self.drag.extend(other.drag);
        self.load.extend(other.load);
        self.torque.extend(other.torque);
        self.command.extend(other.command);
        self.column.extend(other.column);
        self.angle.extend(other.angle);
        self.distance.extend(other.distance);
    }
}

/// What the chain must know of the run.
#[derive(Clone, Copy)]
pub struct Chain<'a> {
    pub effects: &'a [Effect],
    pub scale: Scale,
    pub run: usize,
    /// Campaign clock at the start of the recording, s.
    pub clock: f64,
}

impl Chain<'_> {
    /// All channels at the sample times.
    pub fn read(&self, stretch: &Stretch, times: &[f64]) -> Readings {
        let pick = |values: &[f64]| sample(values, stretch, times);
        let timing = self
            .effects
            .iter()
            .find(|effect| effect.form == Form::RippleTiming);
        Readings {
            time: times.to_vec(),
            wheel: match timing {
                Some(effect) => pulse_timing(effect, stretch, times, self.scale.rate_hz),
                None => pick(&self.late_wheel(&self.wheel(stretch), stretch.dt)),
            },
            speed: pick(&self.late_vehicle(&self.speed(stretch), stretch)),
            drag: pick(&self.drag(stretch)),
            load: pick(&self.load(stretch)),
            torque: pick(&stretch.torque),
            command: pick(&stretch.command),
            column: pick(&stretch.column),
            angle: pick(&stretch.angle),
            distance: pick(&stretch.distance),
        }
    }

    /// All channels on the fine grid, for instruments of their own; what makes a speed late is left to these.
    pub fn seen(&self, stretch: &Stretch, pressure: bool) -> Seen {
        let speed = self.speed(stretch);
        let banded = self
            .effects
            .iter()
            .any(|effect| effect.form == Form::OutSpeedBand);
        let mut seen = Seen {
            start: stretch.start,
            dt: stretch.dt,
            wheel: self.wheel(stretch),
            angle: stretch
                .angle
                .iter()
                .map(|angle| angle + self.effects.iter().map(|e| shift(e, *angle)).sum::<f64>())
                .collect(),
            // What a sensor counts is the path of the speed that it meets.
            distance: if banded {
                path(&speed, stretch.dt)
            } else {
                stretch.distance.clone()
            },
            speed,
            drag: self.drag(stretch),
            load: self.load(stretch),
            brake: if pressure {
                stretch.command.clone()
            } else {
                stretch.torque.clone()
            },
            ..Seen::default()
        };
        for effect in self.effects {
            match effect.form {
                Form::WheelLate => seen.wheel_late.pure_s += effect.a,
                Form::WheelLateWindow => seen.wheel_late.window_s += 2.0 * effect.a,
                Form::VehicleLate => seen.vehicle_late.pure_s += effect.a,
                Form::VehicleLateHeld => {
                    seen.vehicle_late.pure_s += (1.0 - HELD_SHARE) * effect.a;
                    seen.vehicle_late.hold_s += HELD_SHARE * 2.0 * effect.a;
                }
                _ => {}
            }
        }
        seen
    }

    /// The wheel's speed as its sensor meets it.
    fn wheel(&self, stretch: &Stretch) -> Vec<f64> {
        let mut wheel = stretch.wheel.clone();
        for effect in self.effects {
            if matches!(effect.form, Form::RippleSine | Form::RippleTiming) {
                for (value, angle) in wheel.iter_mut().zip(&stretch.angle) {
                    *value *= ripple(effect, *angle);
                }
            }
        }
        wheel
    }

    /// The same as an ideal sensor reads it.
    fn late_wheel(&self, values: &[f64], dt: f64) -> Vec<f64> {
        let mut out = values.to_vec();
        for effect in self.effects {
            match effect.form {
                Form::WheelLate => out = later(&out, dt, effect.a),
                Form::WheelLateWindow => out = moving_average(&out, dt, 2.0 * effect.a),
                _ => {}
            }
        }
        out
    }

    /// The vehicle's speed as its sensor meets it.
    fn speed(&self, stretch: &Stretch) -> Vec<f64> {
        let mut speed = stretch.speed.clone();
        for effect in self.effects {
            if effect.form == Form::OutSpeedBand {
                for value in &mut speed {
                    *value *=
                        1.0 + effect.a * (-((*value - effect.p[0]) / effect.p[1]).powi(2)).exp();
                }
            }
        }
        speed
    }

    /// The same as an ideal sensor reads it.
    fn late_vehicle(&self, values: &[f64], stretch: &Stretch) -> Vec<f64> {
        let mut out = values.to_vec();
        for effect in self.effects {
            match effect.form {
                Form::VehicleLate => out = later(&out, stretch.dt, effect.a),
                // A hold is late by half its length on the mean: the rest is a pure delay.
                Form::VehicleLateHeld => {
                    let hold = (HELD_SHARE * 2.0 * effect.a / stretch.dt).max(1.0);
                    let before = later(&out, stretch.dt, (1.0 - HELD_SHARE) * effect.a);
                    for (index, value) in out.iter_mut().enumerate() {
                        *value = at(&before, (index as f64 / hold).floor() * hold);
                    }
                }
                _ => {}
            }
        }
        out
    }

    fn load(&self, stretch: &Stretch) -> Vec<f64> {
        let mut load = stretch.load.clone();
        for effect in self.effects {
            if effect.form == Form::OutLoadLag {
                load = low_pass(&stretch.load, stretch.dt, effect.a);
            }
        }
        load
    }

    /// The load cell's reading on the fine grid.
    pub fn drag(&self, stretch: &Stretch) -> Vec<f64> {
        let mut reading = stretch.drag.clone();
        // In the order in which a signal meets them: mount, filter, amplifier.
        let mut ordered: Vec<&Effect> = self.effects.iter().collect();
        ordered.sort_by_key(|effect| match effect.form {
            Form::InertialDirect
            | Form::InertialSoft
            | Form::CrosstalkConstant
            | Form::CrosstalkBent => 0,
            Form::ResonanceMode | Form::ResonanceShare => 1,
            Form::OutCellBacklash => 2,
            Form::LagOnePole | Form::LagTwoPoles | Form::LagMovingAverage => 3,
            Form::DelayPure | Form::DelayHold => 4,
            Form::GainConstant | Form::GainBent => 5,
            Form::SaturationHard | Form::SaturationSoft => 7,
            _ => 6,
        });
        for effect in ordered {
            self.apply(effect, stretch, &mut reading);
        }
        reading
    }

    fn apply(&self, effect: &Effect, stretch: &Stretch, reading: &mut Vec<f64>) {
        let (a, p, dt, scale) = (effect.a, &effect.p, stretch.dt, &self.scale);
        let each = |reading: &mut Vec<f64>, change: &dyn Fn(usize, f64) -> f64| {
            for (index, value) in reading.iter_mut().enumerate() {
                *value = change(index, *value);
            }
        };
        let time = |index: usize| stretch.start + dt * index as f64;
        match effect.form {
            Form::InertialDirect => {
                let rate = derivative(&stretch.wheel, dt);
                each(reading, &|i, v| v + share(effect, scale) * rate[i]);
            }
            Form::InertialSoft => {
                let rate = low_pass(&derivative(&stretch.wheel, dt), dt, p[0]);
                each(reading, &|i, v| v + share(effect, scale) * rate[i]);
            }
            Form::CrosstalkConstant => each(reading, &|i, v| v + a * stretch.load[i]),
            Form::CrosstalkBent => each(reading, &|i, v| {
                v + a * stretch.load[i] * (1.0 + p[0] * (stretch.load[i] / scale.load - 1.0))
            }),
            Form::ResonanceMode | Form::ResonanceShare => {
                let ringing = mode(reading, dt, 1.0 / a, p[0]);
                each(reading, &|i, v| (1.0 - p[1]) * v + p[1] * ringing[i]);
            }
            Form::LagOnePole => *reading = low_pass(reading, dt, a),
            Form::LagTwoPoles => {
                *reading = low_pass(&low_pass(reading, dt, a * p[0]), dt, a * (1.0 - p[0]))
            }
            Form::LagMovingAverage => *reading = moving_average(reading, dt, 2.0 * a),
            Form::DelayPure => {
                let before = reading.clone();
                each(reading, &|i, _| at(&before, i as f64 - a / dt));
            }
            Form::DelayHold => {
                let before = reading.clone();
                let hold = (2.0 * a / dt).max(1.0);
                each(reading, &|i, _| {
                    at(&before, (i as f64 / hold).floor() * hold)
                });
            }
            Form::GainConstant => each(reading, &|_, v| v * (1.0 + a)),
            Form::GainBent => each(reading, &|_, v| {
                v * (1.0 + a * (1.0 + p[0] * (v / scale.drag - 0.5)))
            }),
            Form::DriftLinear => each(reading, &|i, v| {
                v + a * scale.drag * time(i) / scale.duration
            }),
            Form::DriftWarmUp => each(reading, &|i, v| {
                v - a * scale.drag * (-time(i) / p[0]).exp_m1()
            }),
            Form::DriftClock => each(reading, &|i, v| {
                v + a * scale.drag * (self.clock + time(i)) / scale.clock
            }),
            Form::DriftSlow => {
                let phase = p[2] + 2.399 * self.run as f64 * (1.0 + 0.37 * self.run as f64);
                let tau = std::f64::consts::TAU;
                each(reading, &|i, v| {
                    v + a
                        * scale.drag
                        * (0.7 * (tau * p[0] * time(i) + phase).sin()
                            + 0.4 * (tau * p[1] * time(i) + 1.7 * phase).sin())
                });
            }
            Form::OutColumnZero => each(reading, &|i, v| v + a * scale.drag * stretch.column[i]),
            Form::OutHum => {
                let phase = p[1] + 1.3 * self.run as f64 * (1.0 + 0.61 * self.run as f64);
                each(reading, &|i, v| {
                    v + a * scale.drag * (std::f64::consts::TAU * p[0] * time(i) + phase).sin()
                });
            }
            Form::OutCellBacklash => {
                let half = a * scale.drag;
                let mut held = reading.first().copied().unwrap_or(0.0);
                for value in reading.iter_mut() {
                    held = held.clamp(*value - half, *value + half);
                    *value = held;
                }
            }
            Form::SaturationHard => {
                let limit = saturation_limit(effect, scale);
                each(reading, &|_, v| v.min(limit));
            }
            Form::SaturationSoft => {
                let limit = saturation_limit(effect, scale);
                each(reading, &|_, v| {
                    if v > 0.0 {
                        v / (1.0 + (v / limit).powf(p[0])).powf(1.0 / p[0])
                    } else {
                        v
                    }
                });
            }
            _ => {}
        }
    }
}

/// Share of the wheel's angular acceleration in the reading, kg m.
pub fn share(effect: &Effect, scale: &Scale) -> f64 {
    effect.a * 4.0 * scale.inertia / scale.radius
}

/// The clipping force, N.
pub fn saturation_limit(effect: &Effect, scale: &Scale) -> f64 {
    scale.drag * (1.75 - effect.a)
}

/// Relative reading of a rippling encoder.
pub fn ripple(effect: &Effect, angle: f64) -> f64 {
    let second = if effect.form == Form::RippleSine {
        effect.p[1]
    } else {
        0.0
    };
    1.0 + effect.a * ((angle + effect.p[0]).cos() + second * (2.0 * angle + effect.p[2]).cos())
}

/// The share of a held speed's delay that is the hold's.
const HELD_SHARE: f64 = 0.3;

/// By how much the angle that a rippling encoder shows is ahead of the wheel's.
fn shift(effect: &Effect, angle: f64) -> f64 {
    match effect.form {
        Form::RippleSine => {
            effect.a
                * ((angle + effect.p[0]).sin()
                    + 0.5 * effect.p[1] * (2.0 * angle + effect.p[2]).sin())
        }
        Form::RippleTiming => effect.a * (angle + effect.p[0]).sin(),
        _ => 0.0,
    }
}

/// The path of a speed.
fn path(speed: &[f64], dt: f64) -> Vec<f64> {
    let mut sum = 0.0;
    (0..speed.len())
        .map(|index| {
            if index > 0 {
                sum += 0.5 * dt * (speed[index] + speed[index - 1]);
            }
            sum
        })
        .collect()
}

/// The same signal so much later, the first value held before it.
fn later(values: &[f64], dt: f64, delay: f64) -> Vec<f64> {
    (0..values.len())
        .map(|index| at(values, index as f64 - delay / dt))
        .collect()
}

/// Value at a fractional index, linear between points, held beyond the ends.
pub fn at(values: &[f64], index: f64) -> f64 {
    let last = values.len().saturating_sub(1);
    let index = index.clamp(0.0, last as f64);
    let low = index.floor() as usize;
    let high = (low + 1).min(last);
    values[low] + (values[high] - values[low]) * (index - low as f64)
}

fn sample(values: &[f64], stretch: &Stretch, times: &[f64]) -> Vec<f64> {
    times
        .iter()
        .map(|time| at(values, (time - stretch.start) / stretch.dt))
        .collect()
}

/// A first-order low-pass, exact for inputs that are straight between points.
pub fn low_pass(values: &[f64], dt: f64, time_constant: f64) -> Vec<f64> {
    if time_constant < 1e-9 {
        return values.to_vec();
    }
    let decay = (-dt / time_constant).exp();
    let ratio = time_constant / dt * (1.0 - decay);
    let mut out = Vec::with_capacity(values.len());
    let mut state = values.first().copied().unwrap_or(0.0);
    let mut before = state;
    for &value in values {
        state = decay * state + (ratio - decay) * before + (1.0 - ratio) * value;
        before = value;
        out.push(state);
    }
    out
}

fn moving_average(values: &[f64], dt: f64, width: f64) -> Vec<f64> {
    let window = (width / dt).round().max(1.0) as usize;
    let first = values.first().copied().unwrap_or(0.0);
    let mut sum = first * window as f64;
    values
        .iter()
        .enumerate()
        .map(|(index, value)| {
            sum += value
                - if index >= window {
                    values[index - window]
                } else {
                    first
                };
            sum / window as f64
        })
        .collect()
}

/// A second-order mode of unit gain, stepped by the trapezium rule.
fn mode(values: &[f64], dt: f64, frequency: f64, damping: f64) -> Vec<f64> {
    let w = std::f64::consts::TAU * frequency;
    let k = 2.0 / dt;
    let (b, a0, a1, a2) = (
        w * w,
        k * k + 2.0 * damping * w * k + w * w,
        2.0 * (w * w - k * k),
        k * k - 2.0 * damping * w * k + w * w,
    );
    let first = values.first().copied().unwrap_or(0.0);
    let (mut x1, mut x2, mut y1, mut y2) = (first, first, first, first);
    values
        .iter()
        .map(|&x| {
            let y = (b * (x + 2.0 * x1 + x2) - a1 * y1 - a2 * y2) / a0;
            (x2, x1, y2, y1) = (x1, x, y1, y);
            y
        })
        .collect()
}

/// Wheel speed from the times at which the teeth of an eccentric ring pass: whole teeth that
/// enclose the sample's own period, divided by the time they took.
fn pulse_timing(effect: &Effect, stretch: &Stretch, times: &[f64], rate_hz: f64) -> Vec<f64> {
    let pitch = std::f64::consts::TAU / effect.p[1];
    let seen: Vec<f64> = stretch
        .angle
        .iter()
        .map(|angle| angle + effect.a * (angle + effect.p[0]).sin())
        .collect();
    let crossing = |tooth: f64| -> Option<f64> {
        let after = seen.partition_point(|angle| *angle < tooth);
        let (a, b) = (seen.get(after.checked_sub(1)?)?, seen.get(after)?);
        let part = if b > a { (tooth - a) / (b - a) } else { 0.0 };
        Some(stretch.start + stretch.dt * ((after - 1) as f64 + part))
    };
    times
        .iter()
        .map(|&time| {
            let half = 0.5 / rate_hz;
            let early =
                (at(&seen, (time - half - stretch.start) / stretch.dt) / pitch).floor() * pitch;
            let late =
                (at(&seen, (time + half - stretch.start) / stretch.dt) / pitch).ceil() * pitch;
            let plain = at(&stretch.wheel, (time - stretch.start) / stretch.dt);
            match (crossing(early), crossing(late)) {
                (Some(a), Some(b)) if b > a && b - a < 6.0 * half => (late - early) / (b - a),
                _ => {
                    plain
                        * ripple(
                            effect,
                            at(&stretch.angle, (time - stretch.start) / stretch.dt),
                        )
                }
            }
        })
        .collect()
}
