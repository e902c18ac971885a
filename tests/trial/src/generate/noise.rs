//! How the sensors err: sequences of random errors of every character that a rig shows.

use crate::generate::chain::Readings;
use crate::draw::Draw;
use crate::generate::rig::{BrakeColumn, NoiseKind, Rig};

/// Random errors of one stretch, one value a sample and channel.
pub struct Errors {
    pub drag: Vec<f64>,
    pub load: Vec<f64>,
    pub wheel: Vec<f64>,
    pub speed: Vec<f64>,
    pub brake: Vec<f64>,
    pub column: Vec<f64>,
}

/// What the recorder wrote: one run, one column a channel; a missing cell is not a number.
#[derive(Clone, Debug, Default)]
pub struct Written {
    pub time: Vec<f64>,
    pub wheel: Vec<f64>,
    pub speed: Vec<f64>,
    pub drag: Vec<f64>,
    pub load: Vec<f64>,
    pub brake: Vec<f64>,
    pub column: Vec<f64>,
}

impl Errors {
    /// Errors for so many samples.
    pub fn draw(rig: &Rig, samples: usize, draw: &mut Draw) -> Errors {
        let s = &rig.sigmas;
        let kind = rig.noise;
        let coloured = matches!(kind, NoiseKind::Coloured | NoiseKind::Arma);
        let outlier_share = draw.log_between(0.001, 0.01);
        let series = |sigma: f64, kind: NoiseKind, colour: f64, draw: &mut Draw| -> Vec<f64> {
            let mut slow = draw.normal();
            (0..samples)
                .map(|_| {
                    let white = draw.normal();
                    sigma
                        * match kind {
                            NoiseKind::Coloured => {
                                slow = colour * slow + (1.0 - colour * colour).sqrt() * white;
                                slow
                            }
                            NoiseKind::Arma => {
                                slow = 0.95 * slow + (1.0f64 - 0.95 * 0.95).sqrt() * white;
                                0.6 * slow + 0.8 * draw.normal()
                            }
                            NoiseKind::HeavyTailed => draw.student_three(),
                            NoiseKind::Outliers => {
                                white
                                    + if draw.chance(outlier_share) {
                                        12.0 * draw.normal()
                                    } else {
                                        0.0
                                    }
                            }
                            NoiseKind::Quantised => 0.6 * white,
                            _ => white,
                        }
                })
                .collect()
        };
        let mild = if coloured {
            NoiseKind::Coloured
        } else {
            NoiseKind::White
        };
        Errors {
            drag: series(s.drag_force_n, kind, rig.noise_colour, draw),
            load: series(s.normal_force_n, mild, 0.6 * rig.noise_colour, draw),
            wheel: series(s.wheel_speed_rad_s, NoiseKind::White, 0.0, draw),
            speed: series(s.vehicle_speed_m_s, mild, 0.7 * rig.noise_colour, draw),
            brake: series(rig.brake_sigma_in_column(), NoiseKind::White, 0.0, draw),
            column: series(0.01, NoiseKind::White, 0.0, draw),
        }
    }
}

/// What the recorder writes of a stretch.
pub fn write(rig: &Rig, readings: &Readings, errors: &Errors, draw: &mut Draw) -> Written {
    let with = |clean: &[f64], error: &[f64]| -> Vec<f64> {
        clean
            .iter()
            .zip(error)
            .map(|(value, error)| value + error)
            .collect()
    };
    let brake_clean: Vec<f64> = match rig.brake {
        BrakeColumn::Pressure => readings
            .command
            .iter()
            .map(|torque| torque / rig.torque_per_pressure)
            .collect(),
        _ => readings.torque.clone(),
    };
    let mut written = Written {
        time: readings.time.clone(),
        wheel: with(&readings.wheel, &errors.wheel),
        speed: with(&readings.speed, &errors.speed),
        drag: with(&readings.drag, &errors.drag),
        load: with(&readings.load, &errors.load),
        brake: with(&brake_clean, &errors.brake),
        column: with(&readings.column, &errors.column),
    };
    match rig.noise {
        NoiseKind::Heteroscedastic => {
            let peak = rig.peak_drag_n();
            for (value, (clean, error)) in written
                .drag
                .iter_mut()
                .zip(readings.drag.iter().zip(&errors.drag))
            {
                *value = clean + error * (0.16 + (1.3 * clean / peak).powi(2)).sqrt();
            }
        }
        NoiseKind::Quantised => {
            let step = |values: &mut Vec<f64>, size: f64| {
                for value in values.iter_mut() {
                    *value = (*value / size).round() * size;
                }
            };
            step(&mut written.drag, 2.2 * rig.sigmas.drag_force_n);
            step(&mut written.load, 2.0 * rig.sigmas.normal_force_n);
            step(&mut written.wheel, 1.0 * rig.sigmas.wheel_speed_rad_s);
        }
        _ => {}
    }
    drop_cells(rig, &mut written, draw);
    written
}

/// Leaves cells empty where the rig's recorder does.
pub fn drop_cells(rig: &Rig, written: &mut Written, draw: &mut Draw) {
    if rig.noise != NoiseKind::MissingCells {
        return;
    }
    let share = draw.between(0.002, 0.02);
    for values in [
        &mut written.wheel,
        &mut written.speed,
        &mut written.drag,
        &mut written.load,
    ] {
        let mut left = 0;
        for value in values.iter_mut() {
            if left == 0 && draw.chance(share / 4.0) {
                left = draw.whole(1, 6);
            }
            if left > 0 {
                left -= 1;
                *value = f64::NAN;
            }
        }
    }
}

impl Written {
    /// Appends another stretch.
    pub fn extend(&mut self, other: Written) {
        self.time.extend(other.time);
        self.wheel.extend(other.wheel);
        self.speed.extend(other.speed);
        self.drag.extend(other.drag);
        self.load.extend(other.load);
        self.brake.extend(other.brake);
        self.column.extend(other.column);
    }
}
