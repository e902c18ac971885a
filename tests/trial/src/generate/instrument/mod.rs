//! Real measuring chains: what a rig's instruments make of what truly happened, before a recorder writes it.
//!
//! Drawn once a campaign and kept over its runs, sort by sort and independently, so that every combination comes up;
//! coupled as on real rigs (a drum has an encoder and no satellite receiver). Everything works on the simulation's
//! fine grid: edges of teeth are found in time, filters run at ten times the recording rate or faster.
//!
//! | part | module |
//! | --- | --- |
//! | wheel speed: tone ring, encoder counts, tachometer | [`wheel`] |
//! | vehicle speed: satellites, optical, fifth wheel, drum encoder | [`vehicle`] |
//! | drag, load, brake: filter, noise, hum, converter, drift | [`analogue`] |
//! | coloured noise | [`colour`] |
//! | what `chain` is to say of it, and which names it makes true | [`finding`] |

pub mod analogue;
pub mod colour;
pub mod finding;
pub mod vehicle;
pub mod wheel;

/// The room's own text, part of the generator's.
pub const TEXT: &[&str] = &[
    include_str!("mod.rs"),
    include_str!("analogue.rs"),
    include_str!("colour.rs"),
    include_str!("finding.rs"),
    include_str!("vehicle.rs"),
    include_str!("wheel.rs"),
];

use serde::{Deserialize, Serialize};

use crate::draw::Draw;
use crate::generate::rig::Rig;
use analogue::Analogue;
use colour::Colour;
use finding::FindingKind;
use vehicle::VehicleSensor;
use wheel::WheelSensor;

/// What of the measuring chain a campaign has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ChainKind {
    /// Sensors that read what is, with noise.
    Ideal,
    /// A whole chain, every part drawn.
    Real,
    /// Ideal but for one effect, large enough to be seen.
    Only(FindingKind),
}

/// All channels on the fine grid as the instruments meet them: effects are in, instruments are not.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    pub start: f64,
    pub dt: f64,
    pub wheel: Vec<f64>,
    /// Angle as the ring's teeth show it, rad.
    pub angle: Vec<f64>,
    pub speed: Vec<f64>,
    pub distance: Vec<f64>,
    pub drag: Vec<f64>,
    pub load: Vec<f64>,
    /// Torque of the brake, or what its pressure stands for.
    pub brake: Vec<f64>,
    /// By how much a concealed effect makes the readings of wheel and of vehicle speed late.
    pub wheel_late: Late,
    pub vehicle_late: Late,
}

/// How a channel's readings are late: a delay, a hold, a mean over a window.
#[derive(Clone, Copy, Debug, Default)]
pub struct Late {
    pub pure_s: f64,
    pub hold_s: f64,
    pub window_s: f64,
}

/// Points at which the mean over a window is taken.
const WINDOW_POINTS: usize = 9;

impl Late {
    /// A sensor's readings as late as this, whatever the sensor.
    fn apply(self, start: f64, times: &[f64], read: impl Fn(&[f64]) -> Vec<f64>) -> Vec<f64> {
        let shifted = |more: f64| -> Vec<f64> {
            times
                .iter()
                .map(|time| {
                    let held = if self.hold_s > 0.0 {
                        start + ((time - start) / self.hold_s).floor() * self.hold_s
                    } else {
                        *time
                    };
                    held - self.pure_s - more
                })
                .collect()
        };
        if self.window_s <= 0.0 {
            return read(&shifted(0.0));
        }
        let mut sum = vec![0.0; times.len()];
        for point in 0..WINDOW_POINTS {
            let share = (point as f64 + 0.5) / WINDOW_POINTS as f64;
            for (sum, value) in sum.iter_mut().zip(read(&shifted(share * self.window_s))) {
                *sum += value / WINDOW_POINTS as f64;
            }
        }
        sum
    }
}

impl Seen {
    /// Fractional index of a time.
    pub fn place(&self, time: f64) -> f64 {
        (time - self.start) / self.dt
    }
}

/// What the five instruments read at the recorder's times.
#[derive(Clone, Debug, Default)]
pub struct Channels {
    pub wheel: Vec<f64>,
    pub speed: Vec<f64>,
    pub drag: Vec<f64>,
    pub load: Vec<f64>,
    pub brake: Vec<f64>,
}

impl Channels {
    /// Appends another stretch of the same run.
    pub fn extend(&mut self, other: Channels) {
        self.wheel.extend(other.wheel);
        self.speed.extend(other.speed);
        self.drag.extend(other.drag);
        self.load.extend(other.load);
        self.brake.extend(other.brake);
    }
}

/// How one run differs from its neighbours.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct RunSpread {
    /// Zero of the load cell, N.
    pub zero_n: f64,
    /// Relative gain of the load cell.
    pub gain: f64,
    /// Relative change of peak friction.
    pub friction: f64,
}

/// Standard deviations of what differs between runs.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Spread {
    pub zero_n: f64,
    pub gain: f64,
    pub friction: f64,
}

impl Spread {
    /// How one run differs.
    pub fn draw(&self, draw: &mut Draw) -> RunSpread {
        RunSpread {
            zero_n: self.zero_n * draw.normal(),
            gain: self.gain * draw.normal(),
            friction: (self.friction * draw.normal()).clamp(-0.15, 0.15),
        }
    }
}

/// Relative error that wheel and vehicle speed have in common.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Common {
    pub relative: f64,
    pub time_constant_s: f64,
}

/// The measuring chain of a campaign.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Instruments {
    pub kind: ChainKind,
    pub wheel: WheelSensor,
    pub vehicle: VehicleSensor,
    pub drag: Analogue,
    pub load: Analogue,
    pub brake: Analogue,
    /// By how much each logger is out of step with that of drag and load, s; positive is later.
    pub wheel_late_s: f64,
    pub vehicle_late_s: f64,
    pub brake_late_s: f64,
    /// How much faster the vehicle-speed logger's clock runs, relative.
    pub clock: f64,
    pub common: Option<Common>,
    pub spread: Spread,
    /// Coloured noise of the vehicle speed, m/s.
    pub vehicle_noise: Colour,
    /// Whether an extra column copies the drag.
    pub leak: bool,
}

/// Least delay against the drag, s, at which a name of timing is true.
const KNOWN_DELAY_S: f64 = 1e-3;

impl Instruments {
    /// Sensors that add noise and nothing else.
    pub fn ideal(kind: ChainKind) -> Instruments {
        Instruments {
            kind,
            wheel: WheelSensor::Ideal,
            vehicle: VehicleSensor::Ideal,
            drag: Analogue::default(),
            load: Analogue::default(),
            brake: Analogue::default(),
            wheel_late_s: 0.0,
            vehicle_late_s: 0.0,
            brake_late_s: 0.0,
            clock: 0.0,
            common: None,
            spread: Spread::default(),
            vehicle_noise: Colour::default(),
            leak: false,
        }
    }

    /// The chain of a campaign.
    pub fn draw(kind: ChainKind, rig: &Rig, draw: &mut Draw) -> Instruments {
        match kind {
            ChainKind::Ideal => Instruments::ideal(kind),
            ChainKind::Only(only) => only.instruments(rig, draw),
            ChainKind::Real => {
                let mut chain = Instruments::ideal(kind);
                chain.wheel = WheelSensor::draw(rig, draw);
                chain.vehicle = VehicleSensor::draw(rig, draw);
                [chain.drag, chain.load, chain.brake] = Analogue::draw_three(rig, draw);
                if draw.chance(0.35) {
                    // Separate loggers, started by hand or by a trigger of their own.
                    chain.wheel_late_s = draw.between(-0.02, 0.02);
                    chain.vehicle_late_s = draw.between(-0.02, 0.02);
                    if draw.chance(0.5) {
                        chain.brake_late_s = draw.between(-0.02, 0.02);
                    }
                }
                if draw.chance(0.25) {
                    chain.clock = draw.between(-1e-4, 1e-4);
                }
                if draw.chance(0.3) {
                    chain.common = Some(Common {
                        relative: draw.log_between(0.0003, 0.002),
                        time_constant_s: draw.log_between(0.01, 0.3),
                    });
                }
                if draw.chance(0.5) {
                    chain.spread = Spread {
                        zero_n: rig.peak_drag_n() * draw.log_between(0.001, 0.01),
                        gain: draw.log_between(0.001, 0.01),
                        friction: draw.log_between(0.005, 0.03),
                    };
                }
                chain.vehicle_noise = chain.vehicle.noise(rig, draw);
                chain
            }
        }
    }

    /// Whether the recorder gets what this chain makes of the signals, rather than ideal readings.
    pub fn acts(&self) -> bool {
        self.kind != ChainKind::Ideal
    }

    /// Reads a stretch at the recorder's times. Without `errors` what is left is what the chain does to any signal
    /// (delays, filters, windows, holds); with them, random ones are drawn from `draw`.
    pub fn read(
        &self,
        seen: &Seen,
        times: &[f64],
        spread: RunSpread,
        errors: Option<&mut Draw>,
    ) -> Channels {
        let at = |late: f64| -> Vec<f64> { times.iter().map(|time| time - late).collect() };
        let vehicle_times: Vec<f64> = times
            .iter()
            .map(|time| time - self.vehicle_late_s - self.clock * time)
            .collect();
        let wheel_times = at(self.wheel_late_s);
        let erring = errors.is_some();
        let mut channels = Channels {
            wheel: seen.wheel_late.apply(seen.start, &wheel_times, |times| {
                self.wheel.read(seen, times, erring)
            }),
            speed: seen
                .vehicle_late
                .apply(seen.start, &vehicle_times, |times| {
                    self.vehicle.read(seen, times, erring)
                }),
            drag: self.drag.read(&seen.drag, seen, times),
            load: self.load.read(&seen.load, seen, times),
            brake: self.brake.read(&seen.brake, seen, &at(self.brake_late_s)),
        };
        for value in &mut channels.drag {
            *value = *value * (1.0 + spread.gain) + spread.zero_n;
        }
        if let Some(draw) = errors {
            let period = times
                .get(1)
                .zip(times.first())
                .map_or(1e-3, |(b, a)| (b - a).max(1e-6));
            if let Some(common) = self.common {
                // A time base, or the frame's pitching: it changes when the reading does.
                let series = colour::ornstein_uhlenbeck(
                    times.len(),
                    period,
                    common.time_constant_s,
                    common.relative,
                    draw,
                );
                let on_wheel = self.wheel.hold(seen, &wheel_times, &series);
                let on_speed = self.vehicle.hold(seen, &vehicle_times, &series);
                for (value, error) in channels.wheel.iter_mut().zip(on_wheel) {
                    *value *= 1.0 + error;
                }
                for (value, error) in channels.speed.iter_mut().zip(on_speed) {
                    *value *= 1.0 + error;
                }
            }
            self.wheel.add_noise(&mut channels.wheel, period, draw);
            let noise = self.vehicle_noise.series(times.len(), period, draw);
            let noise = self.vehicle.hold(seen, &vehicle_times, &noise);
            for (value, error) in channels.speed.iter_mut().zip(noise) {
                *value += error;
            }
            self.drag
                .add_errors(&mut channels.drag, times, period, draw);
            self.load
                .add_errors(&mut channels.load, times, period, draw);
            self.brake
                .add_errors(&mut channels.brake, times, period, draw);
        }
        channels
    }

    /// How long before a stretch's end the recorder must stop, s, so that a logger that is early still reads what was.
    pub fn ahead_s(&self) -> f64 {
        [self.wheel_late_s, self.vehicle_late_s, self.brake_late_s]
            .into_iter()
            .fold(0.0, |ahead: f64, late| ahead.max(-late))
            + if self.clock < 0.0 { 0.01 } else { 0.0 }
    }

    /// Mean delays of wheel speed, vehicle speed, drag, load and brake, s, the wheel's at an angular speed.
    pub fn delays(&self, wheel_rad_s: f64) -> [f64; 5] {
        [
            self.wheel.delay(wheel_rad_s) + self.wheel_late_s,
            self.vehicle.delay() + self.vehicle_late_s,
            self.drag.delay(),
            self.load.delay(),
            self.brake.delay() + self.brake_late_s,
        ]
    }

    /// Names of the vocabulary that the chain itself makes true: neither asked for nor false.
    pub fn tolerated(&self, rig: &Rig) -> Vec<String> {
        let [wheel, vehicle, drag, load, brake] =
            self.delays(0.8 * rig.mean_speed_m_s / rig.radius_m);
        let mut names = Vec::new();
        let mut name = |condition: bool, id: &str| {
            if condition {
                names.push(id.to_owned());
            }
        };
        name(vehicle - drag > KNOWN_DELAY_S, "vehicle_speed_delay");
        name(wheel - drag > KNOWN_DELAY_S, "wheel_speed_delay");
        name(drag - brake > KNOWN_DELAY_S, "brake_lag");
        // The load cell's own channel is the late one: against the other channels of its kind, or against both speeds.
        let late = drag - load > KNOWN_DELAY_S || drag - wheel.max(vehicle) > KNOWN_DELAY_S;
        name(late, "force_delay");
        name(late, "force_lag");
        name(self.wheel.ripples(), "encoder_ripple");
        names
    }
}

#[cfg(test)]
mod tests;
