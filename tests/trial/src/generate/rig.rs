//! The rig: what stands on the test bench, what its file says, and how its sensors err.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use crate::draw::Draw;
use crate::generate::form::Needs;

/// The four sorts of rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RigKind {
    Trailer,
    Drum,
    Aircraft,
    ScaleCar,
}

/// Which column tells of the brake.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BrakeColumn {
    None,
    Torque,
    Pressure,
}

/// How the wheel gets its slip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Actuation {
    /// A servo drives the wheel's speed; the torque is whatever that takes.
    Servo,
    /// A brake works against the tyre, under a slip controller.
    Brake,
}

/// The character of the drag channel's noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoiseKind {
    White,
    Coloured,
    Arma,
    HeavyTailed,
    Outliers,
    Heteroscedastic,
    Quantised,
    MissingCells,
}

/// What the rig file says of the noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Declared {
    Right,
    Wrong,
    Absent,
}

/// Standard deviations of the channels' noise.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Sigmas {
    pub drag_force_n: f64,
    pub normal_force_n: f64,
    pub wheel_speed_rad_s: f64,
    pub vehicle_speed_m_s: f64,
    pub brake_torque_nm: f64,
}

/// One rig with its true and its filed figures.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Rig {
    pub kind: RigKind,
    pub radius_m: f64,
    pub inertia_kg_m2: f64,
    pub mass_kg: f64,
    pub coasting: bool,
    pub actuation: Actuation,
    pub brake: BrakeColumn,
    pub torque_per_pressure: f64,
    pub peak_friction: f64,
    pub critical_slip: f64,
    pub filed_peak_friction: f64,
    pub filed_critical_slip: f64,
    pub mean_load_n: f64,
    pub mean_speed_m_s: f64,
    pub rate_hz: f64,
    pub jitter: bool,
    pub noise: NoiseKind,
    pub noise_colour: f64,
    pub sigmas: Sigmas,
    pub declared: Declared,
    pub declared_factor: [f64; 5],
    pub feedback: bool,
    pub slip_noise_factor: f64,
}

impl Rig {
    /// A rig that offers what the concealed effects need.
    pub fn draw(needs: Needs, draw: &mut Draw) -> Rig {
        let kind = loop {
            let kind = draw.one_of(&[
                RigKind::Trailer,
                RigKind::Trailer,
                RigKind::Drum,
                RigKind::Drum,
                RigKind::Aircraft,
                RigKind::ScaleCar,
            ]);
            if !needs.coasting || kind != RigKind::Drum {
                break kind;
            }
        };
        let scale_car = kind == RigKind::ScaleCar;
        let ranges = match kind {
            RigKind::Trailer => [(0.28, 0.335), (0.8, 1.8), (2800.0, 4800.0), (17.0, 32.0)],
            RigKind::Drum => [(0.27, 0.33), (0.9, 2.2), (2500.0, 5500.0), (12.0, 30.0)],
            RigKind::Aircraft => [(0.45, 0.6), (7.0, 18.0), (28e3, 55e3), (40.0, 68.0)],
            RigKind::ScaleCar => [(0.030, 0.036), (2.5e-5, 6e-5), (7.0, 14.0), (2.0, 3.6)],
        };
        let [radius, inertia, load, speed] = ranges.map(|(low, high)| draw.between(low, high));
        let peak_friction = if kind == RigKind::Aircraft {
            draw.between(0.5, 0.8)
        } else {
            draw.between(0.65, 1.05)
        };
        let critical_slip = draw.between(0.08, 0.17);
        let coasting = needs.coasting
            || match kind {
                RigKind::Trailer => true,
                RigKind::Drum => false,
                RigKind::Aircraft => draw.chance(0.4),
                RigKind::ScaleCar => draw.chance(0.35),
            };
        let (actuation, brake) = if needs.pressure {
            (Actuation::Brake, BrakeColumn::Pressure)
        } else if draw.chance(if needs.brake { 0.75 } else { 0.5 }) {
            let column = if draw.chance(0.5) {
                BrakeColumn::Torque
            } else {
                BrakeColumn::Pressure
            };
            (
                Actuation::Brake,
                if !needs.brake && draw.chance(0.15) {
                    BrakeColumn::None
                } else {
                    column
                },
            )
        } else {
            (
                Actuation::Servo,
                if needs.brake || draw.chance(0.35) {
                    BrakeColumn::Torque
                } else {
                    BrakeColumn::None
                },
            )
        };
        // A lighter vehicle would stop within a second or two; this one is slowed over some ten seconds.
        let mass_kg = match kind {
            RigKind::ScaleCar => peak_friction * load * draw.between(1.6, 3.0) / speed,
            RigKind::Aircraft => peak_friction * load * draw.between(8.0, 14.0) / speed,
            _ => peak_friction * load * draw.between(4.0, 7.0) / speed,
        };
        let rate_hz = match kind {
            RigKind::ScaleCar => draw.one_of(&[100.0, 200.0, 250.0, 500.0]),
            _ => draw.one_of(&[100.0, 200.0, 250.0, 500.0, 500.0, 1000.0, 1000.0, 2000.0]),
        };
        let torque = peak_friction * load * radius;
        let drag = peak_friction * load;
        let mut sigmas = Sigmas {
            drag_force_n: drag * draw.log_between(0.008, 0.035),
            normal_force_n: load * draw.log_between(0.002, 0.012),
            wheel_speed_rad_s: speed / radius * draw.log_between(0.0005, 0.002),
            vehicle_speed_m_s: speed * draw.log_between(0.0003, 0.0015),
            brake_torque_nm: torque * draw.log_between(0.004, 0.012),
        };
        if !scale_car && kind != RigKind::Aircraft {
            sigmas.wheel_speed_rad_s = draw.log_between(0.04, 0.18);
            sigmas.vehicle_speed_m_s = draw.log_between(0.008, 0.04);
        }
        let noise = if draw.chance(0.4) {
            NoiseKind::White
        } else {
            draw.one_of(&[
                NoiseKind::Coloured,
                NoiseKind::Coloured,
                NoiseKind::Arma,
                NoiseKind::HeavyTailed,
                NoiseKind::Outliers,
                NoiseKind::Heteroscedastic,
                NoiseKind::Quantised,
                NoiseKind::MissingCells,
            ])
        };
        let declared = draw.one_of(&[
            Declared::Right,
            Declared::Right,
            Declared::Wrong,
            Declared::Absent,
        ]);
        let declared_factor = std::array::from_fn(|_| {
            if declared == Declared::Wrong {
                draw.log_between(0.5, 2.0)
            } else {
                1.0
            }
        });
        Rig {
            kind,
            radius_m: round(radius, 4),
            inertia_kg_m2: round(inertia, 3),
            mass_kg: round(mass_kg, 4),
            coasting,
            actuation,
            brake,
            torque_per_pressure: round(torque / draw.between(2e6, 6e6), 3),
            peak_friction,
            critical_slip,
            filed_peak_friction: round(peak_friction * draw.between(0.82, 1.2), 3),
            filed_critical_slip: round(critical_slip * draw.between(0.82, 1.2), 3),
            mean_load_n: load,
            mean_speed_m_s: speed,
            rate_hz,
            jitter: draw.chance(0.1),
            noise,
            noise_colour: draw.between(0.4, 0.9),
            sigmas,
            declared,
            declared_factor,
            feedback: draw.chance(0.3),
            slip_noise_factor: 1.0,
        }
    }

    /// Makes the slip channels noisier by a factor.
    pub fn scale_slip_noise(&mut self, factor: f64) {
        self.slip_noise_factor *= factor;
        self.sigmas.wheel_speed_rad_s *= factor;
        self.sigmas.vehicle_speed_m_s *= factor;
    }

    /// Drag at the peak of the curve and at mean load, in newton.
    pub fn peak_drag_n(&self) -> f64 {
        self.peak_friction * self.mean_load_n
    }

    /// The slowest usable speed of this rig, in m/s.
    pub fn slowest_m_s(&self) -> f64 {
        0.5f64.max(if self.kind == RigKind::ScaleCar {
            0.5
        } else {
            1.0
        })
    }

    /// Torque error of the brake channel in its own column's unit.
    pub fn brake_sigma_in_column(&self) -> f64 {
        match self.brake {
            BrakeColumn::Pressure => self.sigmas.brake_torque_nm / self.torque_per_pressure,
            _ => self.sigmas.brake_torque_nm,
        }
    }

    /// The rig file as the bench's engineer would have written it.
    pub fn file(&self) -> String {
        let mut text = String::new();
        let _ = writeln!(
            text,
            "[wheel]\nradius_m = {}\ninertia_kg_m2 = {}\n",
            self.radius_m, self.inertia_kg_m2
        );
        let _ = writeln!(
            text,
            "[vehicle]\nmass_kg = {}\ncoasting = {}\n",
            self.mass_kg, self.coasting
        );
        if self.brake == BrakeColumn::Pressure {
            let _ = writeln!(
                text,
                "[brake]\ntorque_per_pressure_nm_pa = {:e}\n",
                self.torque_per_pressure
            );
        }
        let _ = writeln!(
            text,
            "[tyre]\nlaw = \"rudd\"\npeak_friction = {}\ncritical_slip = {}",
            self.filed_peak_friction, self.filed_critical_slip
        );
        if self.declared != Declared::Absent {
            let s = &self.sigmas;
            let f = &self.declared_factor;
            let _ = writeln!(text, "\n[noise]");
            let _ = writeln!(text, "drag_force_n = {}", round(s.drag_force_n * f[0], 3));
            let _ = writeln!(
                text,
                "normal_force_n = {}",
                round(s.normal_force_n * f[1], 3)
            );
            let _ = writeln!(
                text,
                "wheel_speed_rad_s = {}",
                round(s.wheel_speed_rad_s * f[2], 3)
            );
            let _ = writeln!(
                text,
                "vehicle_speed_m_s = {}",
                round(s.vehicle_speed_m_s * f[3], 3)
            );
            match self.brake {
                BrakeColumn::None => {}
                BrakeColumn::Torque => {
                    let _ = writeln!(
                        text,
                        "brake_torque_nm = {}",
                        round(s.brake_torque_nm * f[4], 3)
                    );
                }
                BrakeColumn::Pressure => {
                    let _ = writeln!(
                        text,
                        "brake_pressure_pa = {}",
                        round(self.brake_sigma_in_column() * f[4], 3)
                    );
                }
            }
        }
        text
    }
}

/// A number to so many significant digits.
pub fn round(value: f64, digits: i32) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    format!("{value:.*e}", usize::try_from(digits - 1).unwrap_or(0))
        .parse()
        .unwrap_or(value)
}
