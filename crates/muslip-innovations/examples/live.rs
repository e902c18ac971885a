//! A stop from 35 m/s at 1 kHz in which the road turns wet after two seconds: the monitor says so while it runs.
//!
//! `cargo run -p muslip-innovations --example live`. On a rig everything between the marks is its sensors.

use std::error::Error;

use muslip::law::Rudd;
use muslip::sample::RigSample;
use muslip_innovations::detection::Band;
use muslip_innovations::monitor::{Balance, Verdict};
use muslip_innovations::reading::Reading;
use muslip_innovations::settings::{Rig, Sensors, Settings};

const STEP_S: f32 = 0.001;
const RADIUS_M: f32 = 0.31;
const INERTIA_KG_M2: f32 = 1.2;
const MASS_KG: f32 = 400.0;
const LOAD_N: f32 = 4000.0;

fn main() -> Result<(), Box<dyn Error>> {
    // What is known of the rig: wheel and vehicle, the tyre's law, the noise of one reading of each sensor.
    let rig = Rig {
        effective_radius_m: RADIUS_M,
        wheel_inertia_kg_m2: INERTIA_KG_M2,
        vehicle_mass_kg: Some(MASS_KG),
    };
    let law = Rudd::new(0.9, 0.12)?;
    let sensors = Sensors::white(0.05, 0.02, 20.0, 15.0, 5.0);
    let mut monitor = Settings::usual(rig, law, sensors, 3600.0).build()?;

    let mut simulated = Simulated::new();
    let mut said = monitor.verdict();
    for sample in 1..=5000_u16 {
        let time_s = STEP_S * f32::from(sample);
        let reading = simulated.reading(time_s);
        // A refused step has not happened; its time belongs to the next.
        let told = monitor.step(STEP_S, &reading)?;
        if monitor.verdict() != said {
            said = monitor.verdict();
            println!("{time_s:.3} s: {said:?}, innovations {told:.2?}");
        }
        if matches!(said, Verdict::Inconsistent { .. }) && time_s > 3.0 {
            break;
        }
    }
    println!(
        "\nbalance, band: mean square and lag one of the last full window, alarms in this run"
    );
    for balance in Balance::ALL {
        for band in [Band::Fast, Band::Slow] {
            let limits = monitor.limits(band);
            let alarms = monitor.alarms(balance, band);
            if let Some(statistics) = monitor.statistics(balance, band) {
                println!(
                    "{balance:?}, {band:?}: {:.2} (at most {:.2}), {:.2} (at most {:.2}), {alarms}",
                    statistics.mean_square, limits.mean_square, statistics.lag_one, limits.lag_one
                );
            }
        }
    }
    Ok(())
}

// ---- a simulated rig ----

struct Simulated {
    vehicle_speed_m_s: f32,
    wheel_speed_rad_s: f32,
    random: u32,
}

impl Simulated {
    fn new() -> Self {
        Self {
            vehicle_speed_m_s: 35.0,
            wheel_speed_rad_s: 35.0 / RADIUS_M,
            random: 1,
        }
    }

    /// Reads the sensors, then lets a millisecond pass.
    fn reading(&mut self, time_s: f32) -> Reading<f32> {
        let wet = if time_s > 2.0 { 0.8 } else { 1.0 };
        let torque = 600.0 * (time_s / 0.5).min(1.0);
        let drag = |speed: f32, wheel: f32| {
            let share = (speed - RADIUS_M * wheel) / speed / 0.12;
            wet * LOAD_N * 2.0 * 0.9 * share / (1.0 + share * share)
        };
        let (speed, wheel) = (self.vehicle_speed_m_s, self.wheel_speed_rad_s);
        let sample = RigSample {
            wheel_speed_rad_s: wheel + self.normal(0.05),
            vehicle_speed_m_s: speed + self.normal(0.02),
            drag_force_n: drag(speed, wheel) + self.normal(20.0),
            normal_force_n: LOAD_N + self.normal(15.0),
        };
        let read_torque = torque + self.normal(5.0);
        for _ in 0..10 {
            let force = drag(self.vehicle_speed_m_s, self.wheel_speed_rad_s);
            let turned = (RADIUS_M * force - torque) / INERTIA_KG_M2;
            self.wheel_speed_rad_s += turned * 0.1 * STEP_S;
            self.vehicle_speed_m_s -= force / MASS_KG * 0.1 * STEP_S;
        }
        Reading::new(&sample, Some(read_torque))
    }

    /// A normal number, nearly: a sum of twelve uniform ones.
    fn normal(&mut self, std: f32) -> f32 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.random = self
                .random
                .wrapping_mul(1_664_525)
                .wrapping_add(1_013_904_223);
            sum += f32::from((self.random >> 16) as u16) / 65_536.0;
        }
        std * sum
    }
}
