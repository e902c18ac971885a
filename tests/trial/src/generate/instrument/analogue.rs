//! An analogue channel: anti-alias filter, noise before and after it, mains hum, slow gain drift, converter.

use serde::{Deserialize, Serialize};

use super::Seen;
use super::colour::Colour;
use crate::draw::Draw;
use crate::generate::chain::{at, low_pass};
use crate::generate::measure::rms;
use crate::generate::rig::{Rig, RigKind};

/// One analogue channel; the default is ideal and noiseless.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Analogue {
    /// Time constants of the filter's equal poles, s.
    pub pole_s: f64,
    pub poles: usize,
    pub noise: Colour,
    /// Share of the noise's variance that arises before the filter, and so has its bandwidth.
    pub filtered_noise: f64,
    pub hum: f64,
    pub hum_hz: f64,
    /// Relative gain gained a second.
    pub gain_drift_per_s: f64,
    /// Step of the converter, in the channel's unit.
    pub step: f64,
    /// Offset, in the channel's unit.
    pub zero: f64,
}

impl Analogue {
    /// Drag, load and brake of one amplifier rack: filters equal, or each of its own card.
    pub fn draw_three(rig: &Rig, draw: &mut Draw) -> [Analogue; 3] {
        let fast = if rig.kind == RigKind::ScaleCar {
            2.0
        } else {
            1.0
        };
        let cutoff_hz = fast * draw.log_between(12.0, 120.0).min(0.35 * rig.rate_hz);
        let poles = draw.whole(1, 4);
        let differ = draw.chance(0.25);
        let filtered = draw.chance(0.85);
        let hum = draw.chance(0.35);
        let hum_hz = draw.one_of(&[50.0, 60.0]);
        let bits = draw.whole(12, 16) as i32;
        let s = &rig.sigmas;
        let scales = [
            (s.drag_force_n, rig.peak_drag_n()),
            (s.normal_force_n, rig.mean_load_n),
            (s.brake_torque_nm, rig.peak_drag_n() * rig.radius_m),
        ];
        scales.map(|(sigma, full)| {
            let own = if differ {
                draw.log_between(0.6, 1.7)
            } else {
                1.0
            };
            // Equal poles, so placed that the whole is down by 3 dB at the cut-off.
            let narrow = (2f64.powf(1.0 / poles as f64) - 1.0).sqrt();
            let slow = if draw.chance(0.6) {
                draw.between(0.1, 0.5)
            } else {
                0.0
            };
            let flicker = if draw.chance(0.5) {
                draw.between(0.1, 0.4)
            } else {
                0.0
            };
            Analogue {
                pole_s: if filtered {
                    narrow / (std::f64::consts::TAU * cutoff_hz * own)
                } else {
                    0.0
                },
                poles,
                noise: Colour {
                    std: sigma,
                    slow,
                    time_constant_s: draw.log_between(0.02, 0.3),
                    flicker,
                },
                filtered_noise: if filtered && draw.chance(0.6) {
                    draw.between(0.2, 0.9)
                } else {
                    0.0
                },
                hum: if hum {
                    sigma * draw.between(0.1, 0.8)
                } else {
                    0.0
                },
                hum_hz: hum_hz * draw.between(0.999, 1.001),
                gain_drift_per_s: if draw.chance(0.3) {
                    draw.between(-3e-4, 3e-4)
                } else {
                    0.0
                },
                step: 4.0 * full / 2f64.powi(bits),
                zero: 0.0,
            }
        })
    }

    /// What the channel does to any signal, at the recorder's times.
    pub fn read(&self, values: &[f64], seen: &Seen, times: &[f64]) -> Vec<f64> {
        let mut filtered = values.to_vec();
        if self.pole_s > 0.0 {
            for _ in 0..self.poles {
                filtered = low_pass(&filtered, seen.dt, self.pole_s);
            }
        }
        times
            .iter()
            .map(|time| {
                (1.0 + self.gain_drift_per_s * time) * at(&filtered, seen.place(*time)) + self.zero
            })
            .collect()
    }

    /// Noise, hum and the converter's steps.
    pub fn add_errors(&self, values: &mut [f64], times: &[f64], period: f64, draw: &mut Draw) {
        let mut noise = self.noise.series(values.len(), period, draw);
        if self.filtered_noise > 0.0 && self.pole_s > 0.0 {
            let mut before: Vec<f64> = (0..values.len()).map(|_| draw.normal()).collect();
            for _ in 0..self.poles {
                before = low_pass(&before, period, self.pole_s);
            }
            let size = rms(before.iter()).max(1e-12);
            let (old, new) = (
                (1.0 - self.filtered_noise).sqrt(),
                self.filtered_noise.sqrt() * self.noise.std / size,
            );
            for (value, before) in noise.iter_mut().zip(before) {
                *value = old * *value + new * before;
            }
        }
        let phase = draw.between(0.0, std::f64::consts::TAU);
        for ((value, error), time) in values.iter_mut().zip(noise).zip(times) {
            *value += error + self.hum * (std::f64::consts::TAU * self.hum_hz * time + phase).sin();
            if self.step > 0.0 {
                *value = (*value / self.step).round() * self.step;
            }
        }
    }

    /// Mean delay of the filter, s.
    pub fn delay(&self) -> f64 {
        self.pole_s * self.poles as f64
    }
}
