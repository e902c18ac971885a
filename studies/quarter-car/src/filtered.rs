//! (b) and (c): the controller on a filter that is told the road.

use muslip::law::TyreLaw;
use muslip_laws::Burckhardt;
use muslip_quarter_car::filter::{Config, Filter as QuarterCarFilter, Road as FilterRoad};
use muslip_quarter_car::lock_guard::{self, LockGuard};
use muslip_quarter_car::slip_control::{self, SlipController};

use super::car::Truth;
use super::drivers::{
    Channels, NOMINAL, SETPOINT_SHARE, WHEEL_VARIANCE, act, belief_of, controller,
    correct_with_rig, correct_with_wheel, rolling_speed, slip_input,
};
use super::error::SetupError;
use super::run::{Belief, Driver, Readings};
use super::scenario::{Road, Scenario, SensorNoise};

/// (b) and (c): the controller on a filter's estimates.
pub struct Filtered {
    filter: QuarterCarFilter<f64>,
    controller: SlipController<f64>,
    road: Road,
    /// Whether it is told where which road begins.
    told: bool,
    channels: Channels,
    wheel_variance: f64,
    noise: SensorNoise,
    guard: Option<LockGuard<f64>>,
    demanded_nm: f64,
    /// Steps that filter or controller refused.
    pub refused: u32,
}

impl Filtered {
    /// The controller on a filter. `wheel_variance` in rad²/s² is what the filter is told.
    ///
    /// # Errors
    /// [`slip_control::ControlError`] if a part refuses its configuration or step.
    pub fn new(
        scenario: &Scenario,
        filter: QuarterCarFilter<f64>,
        channels: Channels,
        wheel_variance: f64,
    ) -> Result<Self, slip_control::ControlError> {
        let peak_slip = scenario.road.law_at(0.0).peak().slip_ratio;
        Ok(Self {
            filter,
            controller: controller(scenario, SETPOINT_SHARE * peak_slip).build()?,
            road: scenario.road.clone(),
            told: true,
            channels,
            wheel_variance,
            noise: scenario.noise,
            guard: lock_guard::Config::usual().build(),
            demanded_nm: 0.0,
            refused: 0,
        })
    }

    /// (b): the tutorial's filter.
    ///
    /// # Errors
    /// [`SetupError`] if a part refuses its configuration or step.
    pub fn tutorial(scenario: &Scenario) -> Result<Self, SetupError> {
        let law = scenario.road.law_at(0.0);
        let filter = Config::tutorial(NOMINAL, law, scenario.from_m_s).build()?;
        Ok(Self::new(
            scenario,
            filter,
            Channels::WheelSpeed,
            Config::<f64>::tutorial_variance(),
        )?)
    }

    /// (c): the tuned filter, started at the speed of the freely rolling wheel.
    ///
    /// # Errors
    /// [`SetupError`] if a part refuses its configuration or step.
    pub fn tuned(scenario: &Scenario) -> Result<Self, SetupError> {
        Self::tuned_with(scenario, |_| {})
    }

    /// (c) with a change to the filter's configuration.
    ///
    /// # Errors
    /// [`SetupError`] if a part refuses its configuration or step.
    pub fn tuned_with(
        scenario: &Scenario,
        change: impl FnOnce(&mut Config<f64>),
    ) -> Result<Self, SetupError> {
        let law = scenario.road.law_at(0.0);
        let mut config = Config::tuned(NOMINAL, FilterRoad::Known(law), rolling_speed(scenario));
        change(&mut config);
        let filter = config.build()?;
        Ok(Self::new(
            scenario,
            filter,
            Channels::WheelSpeed,
            WHEEL_VARIANCE,
        )?)
    }

    /// (c), but believing in another road than is there.
    ///
    /// # Errors
    /// [`SetupError`] if a part refuses its configuration or step.
    pub fn mistaken(scenario: &Scenario, believed: Burckhardt<f64>) -> Result<Self, SetupError> {
        let mut mistaken = Self::tuned(scenario)?;
        mistaken.told = false;
        mistaken.filter.set_road(FilterRoad::Known(believed));
        mistaken
            .controller
            .set_setpoint_slip(SETPOINT_SHARE * believed.peak().slip_ratio)?;
        Ok(mistaken)
    }

    fn try_demand(&mut self, readings: &Readings, truth: &Truth) -> Result<(), SetupError> {
        if self.told && self.road.patches.len() > 1 {
            let law = self.road.law_at(truth.distance_m);
            self.filter.set_road(FilterRoad::Known(law));
            self.controller
                .set_setpoint_slip(SETPOINT_SHARE * law.peak().slip_ratio)?;
        }
        self.filter.predict(self.demanded_nm)?;
        correct_with_wheel(&mut self.filter, readings, self.wheel_variance)?;
        if self.channels == Channels::Rig {
            correct_with_rig(&mut self.filter, readings, &self.noise)?;
        }
        act(
            &mut self.guard,
            &mut self.controller,
            readings,
            &slip_input(&self.filter),
        )?;
        Ok(())
    }
}

impl Driver for Filtered {
    fn demand(&mut self, readings: &Readings, truth: &Truth) -> f64 {
        if self.try_demand(readings, truth).is_err() {
            self.refused += 1;
        }
        self.demanded_nm = self.controller.brake_torque_nm();
        self.demanded_nm
    }

    fn belief(&self) -> Belief {
        belief_of(&self.filter)
    }
}
