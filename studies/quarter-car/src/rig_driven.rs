//! (f) with the rig's four channels: the peak is found while braking.

use muslip::filter::FrictionMeasurement;
use muslip::sample::{RigSample, SampleLimits, slip_friction};
use muslip_quarter_car::filter::{Config, Filter as QuarterCarFilter, Road as FilterRoad};
use muslip_quarter_car::lock_guard::{self, LockGuard};
use muslip_quarter_car::peak_seeker::{self, PeakSeeker};
use muslip_quarter_car::slip_control::SlipController;

use super::car::Truth;
use super::drivers::{
    NOMINAL, act, belief_of, controller, correct_with_rig, correct_with_wheel, rolling_speed,
    slip_input,
};
use super::error::SetupError;
use super::run::{Belief, Driver, Readings};
use super::scenario::{Scenario, SensorNoise};

/// Where the setpoint of an unknown road comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Setpoint {
    /// From the two-state filter.
    Sought,
    /// 0.12, between the peaks of all three roads.
    Fixed,
}

/// (f) with the rig's four channels.
pub struct RigDriven {
    filter: QuarterCarFilter<f64>,
    seeker: PeakSeeker<f64>,
    setpoint: Setpoint,
    controller: SlipController<f64>,
    noise: SensorNoise,
    guard: Option<LockGuard<f64>>,
    demanded_nm: f64,
    /// Steps that a part refused.
    pub refused: u32,
}

impl RigDriven {
    /// For a scenario.
    ///
    /// # Errors
    /// [`SetupError`] if a part refuses its configuration or step.
    pub fn new(scenario: &Scenario, setpoint: Setpoint) -> Result<Self, SetupError> {
        let speed = rolling_speed(scenario);
        Ok(Self {
            filter: Config::tuned(NOMINAL, FilterRoad::Unknown, speed).build()?,
            seeker: peak_seeker::Config::usual().build()?,
            setpoint,
            controller: controller(scenario, 0.12).build()?,
            noise: scenario.noise,
            guard: lock_guard::Config::usual().build(),
            demanded_nm: 0.0,
            refused: 0,
        })
    }

    fn try_demand(&mut self, readings: &Readings) -> Result<(), SetupError> {
        self.filter.predict(self.demanded_nm)?;
        let sigma = self.noise.wheel_speed_rad_s;
        correct_with_wheel(&mut self.filter, readings, sigma * sigma)?;
        correct_with_rig(&mut self.filter, readings, &self.noise)?;
        if self.setpoint == Setpoint::Sought {
            self.seek(readings)?;
        }
        act(
            &mut self.guard,
            &mut self.controller,
            readings,
            &slip_input(&self.filter),
        )?;
        Ok(())
    }

    fn seek(&mut self, readings: &Readings) -> Result<(), SetupError> {
        let Some(wheel_speed_rad_s) = readings.wheel_speed_rad_s else {
            return Ok(());
        };
        let sample = RigSample {
            wheel_speed_rad_s,
            vehicle_speed_m_s: readings.vehicle_speed_m_s,
            drag_force_n: readings.drag_force_n,
            normal_force_n: readings.normal_force_n,
        };
        // A sample that is no point of the curve (standstill) leaves the setpoint where it is.
        let limits = SampleLimits::for_median_normal_force(readings.normal_force_n);
        if let Ok(point) = slip_friction(&sample, NOMINAL.radius_m, &limits) {
            let setpoint = self.seeker.step(&FrictionMeasurement {
                slip_ratio: point.slip_ratio,
                friction: point.friction,
                friction_std: self.noise.drag_force_n / readings.normal_force_n,
            })?;
            self.controller.set_setpoint_slip(setpoint)?;
        }
        Ok(())
    }

    /// The seeker.
    pub fn seeker(&self) -> &PeakSeeker<f64> {
        &self.seeker
    }
}

impl Driver for RigDriven {
    fn demand(&mut self, readings: &Readings, _: &Truth) -> f64 {
        if self.try_demand(readings).is_err() {
            self.refused += 1;
        }
        self.demanded_nm = self.controller.brake_torque_nm();
        self.demanded_nm
    }

    fn belief(&self) -> Belief {
        belief_of(&self.filter)
    }
}
