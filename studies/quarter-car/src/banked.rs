//! (f) with wheel speed alone: a bank of road hypotheses.

use muslip::law::TyreLaw;
use muslip_laws::burckhardt::{DRY_ASPHALT, SNOW, WET_ASPHALT};
use muslip_quarter_car::filter::{Config, Road as FilterRoad};
use muslip_quarter_car::lock_guard::{self, LockGuard};
use muslip_quarter_car::road_bank::RoadBank;
use muslip_quarter_car::slip_control::{self, SlipController};

use super::car::Truth;
use super::drivers::{NOMINAL, SETPOINT_SHARE, act, controller, rolling_speed};
use super::error::SetupError;
use super::run::{Belief, Driver, Readings};
use super::scenario::Scenario;

/// Probability of a change of road in a sample that the bank reckons with: one in half a second.
const CHANGE_PROBABILITY: f64 = 0.01;
/// Standard deviation of the friction's process noise in the bank: wider than where the road is known.
const BANK_FRICTION_STD: f64 = 0.05;
/// Variance of the wheel speed in rad²/s² that the bank is told: twice the sensor's sigma, so that what no
/// road explains (lateness, another radius) does not decide between roads.
const BANK_VARIANCE: f64 = 0.04;

/// (f) with wheel speed alone: a bank of dry, wet and snow.
pub struct Banked {
    bank: RoadBank<f64, 3>,
    setpoints: [f64; 3],
    controller: SlipController<f64>,
    guard: Option<LockGuard<f64>>,
    demanded_nm: f64,
    /// Steps that bank or controller refused.
    pub refused: u32,
}

impl Banked {
    /// For a scenario, with the mass known give or take `mass_std_kg` as far as the bank is told.
    ///
    /// # Errors
    /// [`SetupError`] if a part refuses its configuration or step.
    pub fn new(scenario: &Scenario, mass_std_kg: f64) -> Result<Self, SetupError> {
        let speed = rolling_speed(scenario);
        let sets = [DRY_ASPHALT, WET_ASPHALT, SNOW];
        let filter = |set: muslip_laws::burckhardt::PublishedSet| {
            let mut config = Config::tuned(NOMINAL, FilterRoad::Known(set.law()), speed);
            config.initial_std.mass_kg = mass_std_kg;
            config.process_std.friction = BANK_FRICTION_STD;
            config.build()
        };
        let [dry, wet, snow] = sets;
        Ok(Self {
            bank: RoadBank::new(
                [filter(dry)?, filter(wet)?, filter(snow)?],
                CHANGE_PROBABILITY,
            )?,
            setpoints: sets.map(|set| SETPOINT_SHARE * set.law::<f64>().peak().slip_ratio),
            controller: controller(scenario, 0.1).build()?,
            guard: lock_guard::Config::usual().build(),
            demanded_nm: 0.0,
            refused: 0,
        })
    }

    fn try_demand(&mut self, readings: &Readings) -> Result<(), SetupError> {
        self.bank.step(
            self.demanded_nm,
            readings
                .wheel_speed_rad_s
                .map(|value| (value, BANK_VARIANCE)),
        )?;
        let setpoint = self
            .bank
            .weights()
            .iter()
            .zip(self.setpoints)
            .map(|(weight, setpoint)| weight * setpoint)
            .sum();
        self.controller.set_setpoint_slip(setpoint)?;
        act(
            &mut self.guard,
            &mut self.controller,
            readings,
            &slip_control::Input {
                slip_ratio: self.bank.slip_ratio(),
                vehicle_speed_m_s: self.bank.estimate().state.vehicle_speed_m_s,
                tyre_torque_nm: self.bank.tyre_torque_nm(),
            },
        )?;
        Ok(())
    }

    /// The probabilities of dry, wet and snow.
    pub fn weights(&self) -> [f64; 3] {
        self.bank.weights()
    }
}

impl Driver for Banked {
    fn demand(&mut self, readings: &Readings, _: &Truth) -> f64 {
        if self.try_demand(readings).is_err() {
            self.refused += 1;
        }
        self.demanded_nm = self.controller.brake_torque_nm();
        self.demanded_nm
    }

    fn belief(&self) -> Belief {
        let estimate = self.bank.estimate();
        let std = estimate.covariance.std();
        Belief {
            wheel_speed_rad_s: estimate.state.wheel_speed_rad_s,
            vehicle_speed_m_s: estimate.state.vehicle_speed_m_s,
            slip_ratio: self.bank.slip_ratio().unwrap_or(f64::NAN),
            friction: estimate.state.friction,
            mass_kg: estimate.state.mass_kg,
            vehicle_speed_std_m_s: std.vehicle_speed_m_s,
            mass_std_kg: std.mass_kg,
        }
    }
}
