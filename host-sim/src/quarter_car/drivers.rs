//! Who drives the brake in the rows of the comparison.

use muslip::control::lock_guard::{self, Advice, LockGuard};
use muslip::control::peak_seeker::{self, PeakSeeker};
use muslip::control::slip::{self, SlipController};
use muslip::filter::FrictionMeasurement;
use muslip::filter::quarter_car::{
    Channel, Config, Measurement, QuarterCarFilter, Road as FilterRoad, StepError, Vehicle,
};
use muslip::filter::road_bank::RoadBank;
use muslip::law::burckhardt::{DRY_ASPHALT, SNOW, WET_ASPHALT};
use muslip::law::{Burckhardt, TyreLaw};
use muslip::sample::{RigSample, SampleLimits, slip_friction};

use super::SetupError;
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
pub fn controller(scenario: &Scenario, setpoint_slip: f64) -> slip::Config<f64> {
    slip::Config {
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
    /// [`slip::ControlError`] if a part refuses its configuration or step.
    pub fn new(scenario: &Scenario) -> Result<Self, slip::ControlError> {
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
                self.controller.step(&slip::Input {
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
    /// [`slip::ControlError`] if a part refuses its configuration or step.
    pub fn new(
        scenario: &Scenario,
        filter: QuarterCarFilter<f64>,
        channels: Channels,
        wheel_variance: f64,
    ) -> Result<Self, slip::ControlError> {
        let (_, peak_slip) = scenario.road.peak_at(0.0);
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
        if let Some(value) = readings.wheel_speed_rad_s {
            self.filter.update(&Measurement {
                channel: Channel::WheelSpeed,
                value,
                variance: self.wheel_variance,
            })?;
        }
        if self.channels == Channels::Rig {
            correct_with_rig(&mut self.filter, readings, &self.noise)?;
        }
        act(
            &mut self.guard,
            &mut self.controller,
            readings,
            &slip::Input {
                slip_ratio: self.filter.slip_ratio(),
                vehicle_speed_m_s: self.filter.estimate().state.vehicle_speed_m_s,
                tyre_torque_nm: self.filter.tyre_torque_nm(),
            },
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
fn act(
    guard: &mut Option<LockGuard<f64>>,
    controller: &mut SlipController<f64>,
    readings: &Readings,
    input: &slip::Input<f64>,
) -> Result<(), slip::ControlError> {
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
        let filter = |set: muslip::law::burckhardt::PublishedSet| {
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
            &slip::Input {
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
        if let Some(value) = readings.wheel_speed_rad_s {
            let sigma = self.noise.wheel_speed_rad_s;
            self.filter.update(&Measurement {
                channel: Channel::WheelSpeed,
                value,
                variance: sigma * sigma,
            })?;
        }
        correct_with_rig(&mut self.filter, readings, &self.noise)?;
        if self.setpoint == Setpoint::Sought {
            self.seek(readings)?;
        }
        act(
            &mut self.guard,
            &mut self.controller,
            readings,
            &slip::Input {
                slip_ratio: self.filter.slip_ratio(),
                vehicle_speed_m_s: self.filter.estimate().state.vehicle_speed_m_s,
                tyre_torque_nm: self.filter.tyre_torque_nm(),
            },
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
