//! The brake controllers that are compared, and the code that they share.

use muslip_quarter_car::filter::{
    Channel, Filter as QuarterCarFilter, Measurement, StepError, Vehicle,
};
use muslip_quarter_car::lock_guard::{Advice, LockGuard};
use muslip_quarter_car::slip_control::{self, SlipController};

use super::car::Truth;
use super::run::{Belief, Driver, Readings};
use super::scenario::{GRAVITY_M_S2, Road, SAMPLE_TIME_S, Scenario, SensorNoise};

/// The vehicle as the controller's maker knows it; the true one may differ.
pub const NOMINAL: Vehicle<f64> = Vehicle {
    radius_m: 0.30,
    inertia_kg_m2: 1.0,
    gravity_m_s2: GRAVITY_M_S2,
};

/// Setpoint as a share of the slip at the peak of the road that is known: below 1 because the curve falls
/// slowly to the left of the peak and the loop is stable there.
pub const SETPOINT_SHARE: f64 = 0.9;

/// The controller of all rows, for a setpoint and a scenario's brake.
pub fn controller(scenario: &Scenario, setpoint_slip: f64) -> slip_control::Config<f64> {
    slip_control::Config {
        setpoint_slip,
        bandwidth_rad_s: 40.0,
        integral_time_s: 0.25,
        sample_time_s: SAMPLE_TIME_S,
        radius_m: NOMINAL.radius_m,
        inertia_kg_m2: NOMINAL.inertia_kg_m2,
        maximum_torque_nm: scenario.actuator.maximum_torque_nm,
        maximum_torque_rate_nm_s: scenario.actuator.maximum_rate_nm_s,
        minimum_vehicle_speed_m_s: 0.5,
    }
}

/// Variance of the wheel speed in rad²/s² that the tuned filter is told.
pub const WHEEL_VARIANCE: f64 = 0.01;

/// The vehicle's speed in m/s as a freely rolling wheel tells it, by the nominal radius.
pub fn rolling_speed(scenario: &Scenario) -> f64 {
    scenario.from_m_s / scenario.radius_m * NOMINAL.radius_m
}

/// (d): all the torque there is.
pub struct LockedWheel;

impl Driver for LockedWheel {
    fn demand(&mut self, _: &Readings, _: &Truth) -> f64 {
        f64::MAX
    }
}

/// (a): the controller, told the truth.
pub struct PerfectState {
    controller: SlipController<f64>,
    road: Road,
    vehicle: Vehicle<f64>,
    mass_kg: f64,
    /// Steps that the controller refused.
    pub refused: u32,
}

impl PerfectState {
    /// For a scenario; the setpoint is the share of the peak's slip under the wheel.
    ///
    /// # Errors
    /// [`slip_control::ControlError`] if a part refuses its configuration or step.
    pub fn new(scenario: &Scenario) -> Result<Self, slip_control::ControlError> {
        let (_, peak_slip) = scenario.road.peak_at(0.0);
        Ok(Self {
            controller: controller(scenario, SETPOINT_SHARE * peak_slip).build()?,
            road: scenario.road.clone(),
            vehicle: Vehicle {
                radius_m: scenario.radius_m,
                ..NOMINAL
            },
            mass_kg: scenario.mass_kg,
            refused: 0,
        })
    }
}

impl Driver for PerfectState {
    fn demand(&mut self, _: &Readings, truth: &Truth) -> f64 {
        let (_, peak_slip) = self.road.peak_at(truth.distance_m);
        let outcome = self
            .controller
            .set_setpoint_slip(SETPOINT_SHARE * peak_slip)
            .and_then(|()| {
                self.controller.step(&slip_control::Input {
                    slip_ratio: (truth.vehicle_speed_m_s > 0.5).then_some(truth.slip_ratio),
                    vehicle_speed_m_s: truth.vehicle_speed_m_s,
                    tyre_torque_nm: self.vehicle.radius_m
                        * GRAVITY_M_S2
                        * self.mass_kg
                        * truth.friction,
                })
            });
        self.refused += u32::from(outcome.is_err());
        self.controller.brake_torque_nm()
    }
}

/// Which channels a filter is corrected with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channels {
    /// Wheel speed alone.
    WheelSpeed,
    /// Wheel speed, vehicle speed, drag and normal force.
    Rig,
}

/// Corrects a filter with the wheel's speed, where there is a reading of it.
///
/// # Errors
/// [`StepError`] if the filter refuses it.
pub(super) fn correct_with_wheel(
    filter: &mut QuarterCarFilter<f64>,
    readings: &Readings,
    variance: f64,
) -> Result<(), StepError> {
    if let Some(value) = readings.wheel_speed_rad_s {
        filter.update(&Measurement {
            channel: Channel::WheelSpeed,
            value,
            variance,
        })?;
    }
    Ok(())
}

/// What a controller is told of a filter's estimate.
pub(super) fn slip_input(filter: &QuarterCarFilter<f64>) -> slip_control::Input<f64> {
    slip_control::Input {
        slip_ratio: filter.slip_ratio(),
        vehicle_speed_m_s: filter.estimate().state.vehicle_speed_m_s,
        tyre_torque_nm: filter.tyre_torque_nm(),
    }
}

/// Corrects a filter with the three channels that a rig has and a car has not.
///
/// # Errors
/// [`StepError`] if a part refuses its configuration or step.
pub fn correct_with_rig(
    filter: &mut QuarterCarFilter<f64>,
    readings: &Readings,
    noise: &SensorNoise,
) -> Result<(), StepError> {
    for (channel, value, sigma) in [
        (
            Channel::VehicleSpeed,
            readings.vehicle_speed_m_s,
            noise.vehicle_speed_m_s,
        ),
        (
            Channel::DragForce,
            readings.drag_force_n,
            noise.drag_force_n,
        ),
        (
            Channel::NormalForce,
            readings.normal_force_n,
            noise.normal_force_n,
        ),
    ] {
        filter.update(&Measurement {
            channel,
            value,
            variance: sigma * sigma,
        })?;
    }
    Ok(())
}

/// One sample of the controller, unless the guard against a locked wheel wants the brake open.
pub(super) fn act(
    guard: &mut Option<LockGuard<f64>>,
    controller: &mut SlipController<f64>,
    readings: &Readings,
    input: &slip_control::Input<f64>,
) -> Result<(), slip_control::ControlError> {
    let advice = guard
        .as_mut()
        .map_or(Advice::Free, |guard| guard.step(readings.wheel_speed_rad_s));
    if advice == Advice::Open {
        controller.release();
    } else {
        controller.step(input)?;
    }
    Ok(())
}

/// What a filter believes.
pub fn belief_of(filter: &QuarterCarFilter<f64>) -> Belief {
    let estimate = filter.estimate();
    let std = estimate.covariance.std();
    Belief {
        wheel_speed_rad_s: estimate.state.wheel_speed_rad_s,
        vehicle_speed_m_s: estimate.state.vehicle_speed_m_s,
        slip_ratio: filter.slip_ratio().unwrap_or(f64::NAN),
        friction: estimate.state.friction,
        mass_kg: estimate.state.mass_kg,
        vehicle_speed_std_m_s: std.vehicle_speed_m_s,
        mass_std_kg: std.mass_kg,
    }
}
