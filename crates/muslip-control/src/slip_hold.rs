//! Slip held by the PI controller on the quarter-car filter's estimates.
//!
//! The filter takes all four channels of the rig on a road that it does not know; where a drum's speed is held,
//! the measured vehicle speed overrules the model's deceleration. Its slip is what is held, and the tyre's torque
//! as estimated is fed forward.

use muslip::sample::RigSample;
use muslip_quarter_car::filter::{self, Channel, Filter, Measurement, Road, StateStd, Vehicle};
use muslip_quarter_car::slip_control::{self, SlipController};
use muslip_record::{Parameters, QuarterCar};

use crate::SAMPLE_S;

/// Standard gravity in m/s2 (3rd General Conference on Weights and Measures, 1901).
const GRAVITY_M_S2: f32 = 9.806_65;
/// Vehicle speed in m/s below which the controller's gain falls no further.
const SLOWEST_M_S: f32 = 2.0;
/// Standard deviation of the wheel's and the vehicle's speed: pulses are stamped within 12 ns, what is left is
/// the encoder's own unevenness.
const WHEEL_STD_RAD_S: f32 = 0.05;
const VEHICLE_STD_M_S: f32 = 0.01;
/// Standard deviation of the normal force as a share of it.
const NORMAL_STD: f32 = 0.01;

/// Filter or controller refused: the estimate is not to be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Refused;

/// Filter and controller of one application.
#[derive(Debug, Clone, Copy)]
pub struct SlipHold {
    filter: Filter<f32>,
    controller: SlipController<f32>,
    torque_at_full_nm: f32,
    friction_std: f32,
}

impl SlipHold {
    /// From a wheel that rolls freely.
    ///
    /// # Errors
    /// [`Refused`] where the sample or checked parameters make no filter or controller.
    pub fn new(
        parameters: &Parameters,
        target_slip: f32,
        sample: &RigSample<f32>,
    ) -> Result<Self, Refused> {
        let wheel = &parameters.wheel;
        let control = &parameters.slip_control;
        let vehicle = Vehicle {
            radius_m: wheel.effective_radius_m,
            inertia_kg_m2: wheel.inertia_kg_m2,
            gravity_m_s2: GRAVITY_M_S2,
        };
        let tuned = filter::Config::tuned(vehicle, Road::Unknown, sample.vehicle_speed_m_s);
        let filter = filter::Config {
            sample_time_s: SAMPLE_S,
            initial_mass_kg: sample.normal_force_n / GRAVITY_M_S2,
            process_std: StateStd {
                // The model's deceleration where the speed is held: friction of 1 for a sample.
                vehicle_speed_m_s: 2.0 * SAMPLE_S * GRAVITY_M_S2,
                slip_ratio: 0.002,
                friction: 0.01,
                ..tuned.process_std
            },
            // Two samples may well see the same pulse.
            refuses_repeats: false,
            ..tuned
        };
        let controller = slip_control::Config {
            setpoint_slip: target_slip,
            bandwidth_rad_s: control.bandwidth_rad_s,
            integral_time_s: control.integral_time_s,
            sample_time_s: SAMPLE_S,
            radius_m: wheel.effective_radius_m,
            inertia_kg_m2: wheel.inertia_kg_m2,
            maximum_torque_nm: parameters.brake.torque_at_full_nm,
            maximum_torque_rate_nm_s: control.maximum_torque_rate_nm_s,
            minimum_vehicle_speed_m_s: SLOWEST_M_S,
        };
        Ok(Self {
            filter: filter.build().map_err(|_| Refused)?,
            controller: controller.build().map_err(|_| Refused)?,
            torque_at_full_nm: parameters.brake.torque_at_full_nm,
            friction_std: parameters.estimator.friction_std,
        })
    }

    /// One sample: the share of full pressure to demand.
    ///
    /// # Errors
    /// [`Refused`].
    pub fn step(&mut self, sample: &RigSample<f32>) -> Result<f32, Refused> {
        self.filter
            .predict(self.controller.brake_torque_nm())
            .map_err(|_| Refused)?;
        let normal_n = sample.normal_force_n;
        for (channel, value, std) in [
            (
                Channel::WheelSpeed,
                sample.wheel_speed_rad_s,
                WHEEL_STD_RAD_S,
            ),
            (
                Channel::VehicleSpeed,
                sample.vehicle_speed_m_s,
                VEHICLE_STD_M_S,
            ),
            (
                Channel::DragForce,
                sample.drag_force_n,
                self.friction_std * normal_n,
            ),
            (Channel::NormalForce, normal_n, NORMAL_STD * normal_n),
        ] {
            let measurement = Measurement {
                channel,
                value,
                variance: std * std,
            };
            self.filter.update(&measurement).map_err(|_| Refused)?;
        }
        let input = slip_control::Input {
            slip_ratio: self.filter.slip_ratio(),
            vehicle_speed_m_s: self.filter.estimate().state.vehicle_speed_m_s,
            tyre_torque_nm: self.filter.tyre_torque_nm(),
        };
        let output = self.controller.step(&input).map_err(|_| Refused)?;
        Ok(output.brake_torque_nm / self.torque_at_full_nm)
    }

    /// As it is sent.
    pub fn report(&self, tick: u32) -> QuarterCar {
        let estimate = self.filter.estimate();
        let mut covariance = [0.0; 15];
        let upper = estimate
            .covariance
            .rows()
            .into_iter()
            .enumerate()
            .flat_map(|(row, values)| values.into_iter().skip(row));
        for (place, value) in covariance.iter_mut().zip(upper) {
            *place = value;
        }
        QuarterCar {
            tick,
            state: estimate.state.to_array(),
            covariance,
        }
    }
}
