//! Two estimates of one run whose drag channel drifts as its amplifier warms up: of the readings as they are, and with
//! the drift compensated.
//!
//! `cargo run -p muslip-compensate --example load_cell`. The rise and its time constant are known from a calibration
//! with the wheel rolling freely, or from `muslip diagnose`.

use std::error::Error;

use muslip::filter::mu_slip::{Config, Range};
use muslip::filter::{Estimator, FrictionMeasurement, PeakEstimate};
use muslip::sample::{RigSample, SampleLimits, slip_friction};
use muslip_compensate::{Compensated, Compensation, ZeroDrift};

const EFFECTIVE_RADIUS_M: f32 = 0.31;
const LOAD_N: f32 = 4000.0;
const DRAG_STD_N: f32 = 80.0;
const STEP_S: f32 = 0.01;
/// The zero of the drag channel rises by this much, 63 % of it in the time constant.
const RISE_N: f32 = 500.0;
const TIME_CONSTANT_S: f32 = 4.0;

/// Ten brake applications of one second each; the tyre has peak friction 0.8 at slip 0.14.
fn read(tick: u16) -> RigSample<f32> {
    let time_s = f32::from(tick) * STEP_S;
    let slip = 0.3 * time_s.fract();
    let r = slip / 0.14;
    let drag_n = 2.0 * 0.8 * r / (1.0 + r * r) * LOAD_N;
    let zero_n = RISE_N * (1.0 - (-time_s / TIME_CONSTANT_S).exp());
    RigSample {
        wheel_speed_rad_s: 20.0 * (1.0 - slip) / EFFECTIVE_RADIUS_M,
        vehicle_speed_m_s: 20.0,
        drag_force_n: drag_n + zero_n,
        normal_force_n: LOAD_N,
    }
}

fn print(what: &str, peak: &PeakEstimate<f32>) {
    println!(
        "{what:12} peak friction {:.3} ± {:.3}, at slip {:.3} ± {:.3}",
        peak.peak_friction, peak.peak_friction_std, peak.critical_slip, peak.critical_slip_std
    );
}

fn main() -> Result<(), Box<dyn Error>> {
    let limits = SampleLimits::for_median_normal_force(LOAD_N);
    let mut as_read = Config::for_range(Range::Automotive).build()?;
    let mut compensated = as_read;
    // No delay is compensated, so the delay line needs no room.
    let mut compensator = Compensation {
        zero_drift: Some(ZeroDrift::WarmUp {
            rise_n: RISE_N,
            time_constant_s: TIME_CONSTANT_S,
            start_s: 0.0,
        }),
        ..Compensation::none()
    }
    .build::<0>(EFFECTIVE_RADIUS_M, limits)?;

    for tick in 0..1000 {
        let sample = read(tick);

        let point = slip_friction(&sample, EFFECTIVE_RADIUS_M, &limits)?;
        as_read.update(&FrictionMeasurement {
            slip_ratio: point.slip_ratio,
            friction: point.friction,
            friction_std: DRAG_STD_N / LOAD_N,
        })?;

        // The filter's state goes in: what it expects is put through the same channel as the reading.
        match compensator.step(&sample, STEP_S, &compensated.state())? {
            Compensated::Measurement(m) => {
                let measurement = m.measurement(DRAG_STD_N / m.normal_force_n);
                compensated.update_expecting(&measurement, m.expected)?;
            }
            Compensated::Nothing(why) => println!("sample {tick} is no measurement: {why}"),
        }
    }

    println!("true         peak friction 0.800, at slip 0.140");
    print("as read", &as_read.peak());
    print("compensated", &compensated.peak());
    Ok(())
}
