//! A quarter car braked from 30 m/s with its slip held near the peak, by the wheel's speed alone.
//!
//! `cargo run -p muslip-quarter-car --example slip_control`. The plant below stands for the vehicle: two equations of
//! motion on dry asphalt, integrated with a step of 0.1 ms. The controller sees the wheel's speed every 5 ms, with noise.

use std::error::Error;

use muslip::law::TyreLaw;
use muslip_laws::Burckhardt;
use muslip_laws::burckhardt::DRY_ASPHALT;
use muslip_quarter_car::filter::{Channel, Config, Measurement, Road, Vehicle};
use muslip_quarter_car::{lock_guard, slip_control};

const SAMPLE_S: f64 = 0.005;
const RADIUS_M: f64 = 0.3;
const INERTIA_KG_M2: f64 = 1.0;
const GRAVITY_M_S2: f64 = 9.81;
/// The quarter car is a tenth heavier than the filter is told.
const MASS_KG: f64 = 495.0;
const WHEEL_STD_RAD_S: f64 = 0.1;

/// The vehicle, the wheel and the brake.
struct Plant {
    road: Burckhardt<f64>,
    wheel_speed_rad_s: f64,
    vehicle_speed_m_s: f64,
}

impl Plant {
    fn slip(&self) -> f64 {
        (self.vehicle_speed_m_s - RADIUS_M * self.wheel_speed_rad_s) / self.vehicle_speed_m_s
    }

    /// One sample under a brake torque in N m.
    fn brake(&mut self, torque_nm: f64) {
        const STEPS: u8 = 50;
        let step_s = SAMPLE_S / f64::from(STEPS);
        for _ in 0..STEPS {
            let drag_n = self.road.friction(self.slip()) * MASS_KG * GRAVITY_M_S2;
            let wheel = (RADIUS_M * drag_n - torque_nm) / INERTIA_KG_M2;
            self.wheel_speed_rad_s = (self.wheel_speed_rad_s + step_s * wheel).max(0.0);
            self.vehicle_speed_m_s -= step_s * drag_n / MASS_KG;
        }
    }
}

/// About normal, mean 0 and deviation 1: twelve uniform numbers of a linear congruential generator.
fn noise(random: &mut u32) -> f64 {
    let mut sum = -6.0;
    for _ in 0..12 {
        *random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        sum += f64::from(*random >> 8) / 16_777_216.0;
    }
    sum
}

fn main() -> Result<(), Box<dyn Error>> {
    let road: Burckhardt<f64> = DRY_ASPHALT.law();
    let mut plant = Plant {
        road,
        wheel_speed_rad_s: 30.0 / RADIUS_M,
        vehicle_speed_m_s: 30.0,
    };

    let vehicle = Vehicle {
        radius_m: RADIUS_M,
        inertia_kg_m2: INERTIA_KG_M2,
        gravity_m_s2: GRAVITY_M_S2,
    };
    let mut filter = Config::tuned(vehicle, Road::Known(road), 30.0).build()?;
    let mut controller = slip_control::Config {
        setpoint_slip: 0.9 * road.peak().slip_ratio,
        bandwidth_rad_s: 40.0,
        integral_time_s: 0.5,
        sample_time_s: SAMPLE_S,
        radius_m: RADIUS_M,
        inertia_kg_m2: INERTIA_KG_M2,
        maximum_torque_nm: 3000.0,
        maximum_torque_rate_nm_s: 20_000.0,
        minimum_vehicle_speed_m_s: 2.0,
    }
    .build()?;
    let mut guard = lock_guard::Config::usual()
        .build()
        .ok_or("a field of the guard is outside its range")?;

    let mut random = 1;
    let (mut distance_m, mut time_s) = (0.0, 0.0);
    let mut torque_nm = 0.0;
    println!("time s  vehicle m/s  estimated  slip   torque N m");
    for tick in 0.. {
        if plant.vehicle_speed_m_s < 1.0 {
            break;
        }
        plant.brake(torque_nm);
        distance_m += plant.vehicle_speed_m_s * SAMPLE_S;
        time_s += SAMPLE_S;

        // What a controller does every 5 ms: the torque that acted, what was read, the torque to demand.
        let read = plant.wheel_speed_rad_s + WHEEL_STD_RAD_S * noise(&mut random);
        filter.predict(torque_nm)?;
        filter.update(&Measurement {
            channel: Channel::WheelSpeed,
            value: read,
            variance: WHEEL_STD_RAD_S * WHEEL_STD_RAD_S,
        })?;
        let speed = filter.estimate().state.vehicle_speed_m_s;
        torque_nm = if guard.step(Some(read)) == lock_guard::Advice::Free {
            controller
                .step(&slip_control::Input {
                    slip_ratio: filter.slip_ratio(),
                    vehicle_speed_m_s: speed,
                    tyre_torque_nm: filter.tyre_torque_nm(),
                })?
                .brake_torque_nm
        } else {
            controller.release();
            controller.brake_torque_nm()
        };

        if tick % 50 == 0 {
            println!(
                "{time_s:6.2}  {:11.2}  {speed:9.2}  {:5.3}  {torque_nm:10.0}",
                plant.vehicle_speed_m_s,
                plant.slip()
            );
        }
    }
    let best_m = (30.0 * 30.0 - 1.0) / (2.0 * GRAVITY_M_S2 * road.peak().friction);
    println!("{distance_m:.1} m to 1 m/s; {best_m:.1} m at peak friction throughout");
    Ok(())
}
