use muslip::filter::Decision;
use muslip::real::Real;
use muslip::sample::slip_ratio;

use super::config::Config;
use super::error::{ConfigError, Input, StepError};
use super::model::{Model, Motion, Road};
use super::state::{Covariance, Estimate, State, StateStd};
use super::update::{Channel, Fusion, Measurement, corrected};

/// The filter: configuration, estimate, and how the quarter car moves.
///
/// One sample is [`predict`](Self::predict) with the brake torque that acted since the last one, then
/// [`update`](Self::update) with each reading there is. A sample without a reading is a prediction alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filter<T> {
    config: Config<T>,
    estimate: Estimate<T>,
    motion: Motion,
    last_wheel_speed_rad_s: Option<T>,
    gated_in_a_row: Gated,
}

/// Readings of each channel outside the gate, one after the other. One count for all would be set back by every
/// healthy channel, and the one that is off would stay locked out.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Gated {
    wheel_speed: u8,
    vehicle_speed: u8,
    drag_force: u8,
    normal_force: u8,
}

impl Gated {
    fn of(&mut self, channel: Channel) -> &mut u8 {
        match channel {
            Channel::WheelSpeed => &mut self.wheel_speed,
            Channel::VehicleSpeed => &mut self.vehicle_speed,
            Channel::DragForce => &mut self.drag_force,
            Channel::NormalForce => &mut self.normal_force,
        }
    }
}

/// Readings of a channel outside the gate, one after the other, that are rejected before one is believed: then it is the
/// estimate that is off, not the sensor.
const GATE_PATIENCE: u8 = 5;

/// Smallest mass that a correction leaves, as a share of the mass at the start.
const SMALLEST_MASS: f64 = 0.1;

impl<T: Real> Config<T> {
    /// The filter, at its start.
    ///
    /// # Errors
    /// [`ConfigError`] naming the first field that is outside its range.
    pub fn build(self) -> Result<Filter<T>, ConfigError> {
        self.check()?;
        Ok(Filter::new(self))
    }
}

impl<T: Real> Filter<T> {
    /// The configuration was validated by [`Config::build`].
    fn new(config: Config<T>) -> Self {
        let v = config.initial_vehicle_speed_m_s;
        let state = State {
            wheel_speed_rad_s: v / config.vehicle.radius_m,
            vehicle_speed_m_s: v,
            slip_ratio: T::ZERO,
            friction: T::ZERO,
            mass_kg: config.initial_mass_kg,
        };
        Self {
            config,
            estimate: Estimate {
                state,
                covariance: Covariance::from_std(config.initial_std),
            },
            motion: if v >= config.minimum_vehicle_speed_m_s {
                Motion::Rolling
            } else {
                Motion::Standstill
            },
            last_wheel_speed_rad_s: None,
            gated_in_a_row: Gated::default(),
        }
    }

    /// The configuration.
    pub fn config(&self) -> &Config<T> {
        &self.config
    }

    /// The present estimate.
    pub fn estimate(&self) -> Estimate<T> {
        self.estimate
    }

    /// How the quarter car moves, as of the last prediction.
    pub fn motion(&self) -> Motion {
        self.motion
    }

    /// Slip of now, (v − R ω)/v of the estimated speeds, dimensionless; `None` at standstill, where it has
    /// no meaning, and exactly 1 where the wheel is locked.
    ///
    /// [`State::slip_ratio`] is the model's, a sample older; a controller wants this one.
    pub fn slip_ratio(&self) -> Option<T> {
        let State {
            wheel_speed_rad_s: omega,
            vehicle_speed_m_s: v,
            ..
        } = self.estimate.state;
        if v < self.config.minimum_vehicle_speed_m_s {
            return None;
        }
        match self.motion {
            Motion::Standstill => None,
            Motion::Locked => Some(T::ONE),
            Motion::Rolling => slip_ratio(omega, v, self.config.vehicle.radius_m),
        }
    }

    /// Torque of the tyre on the wheel as estimated, R g μ m in N m: what the brake must hold for the wheel
    /// to keep its speed.
    pub fn tyre_torque_nm(&self) -> T {
        let vehicle = &self.config.vehicle;
        let state = &self.estimate.state;
        vehicle.radius_m * vehicle.gravity_m_s2 * state.friction * state.mass_kg
    }

    /// Replaces the law of the road, for one who is told of a change.
    pub fn set_road(&mut self, road: Road<T>) {
        self.config.road = road;
    }

    /// Replaces the estimate, for instance by one logged earlier.
    ///
    /// # Errors
    /// [`StepError::NonFinite`] or [`StepError::Negative`], naming state or covariance; nothing changes.
    pub fn restore(&mut self, estimate: Estimate<T>) -> Result<(), StepError> {
        if !estimate.state.is_finite() {
            return Err(StepError::NonFinite(Input::State));
        }
        if !estimate.covariance.is_valid() {
            return Err(StepError::Negative(Input::Covariance));
        }
        self.estimate = estimate;
        Ok(())
    }

    /// Starts again at a wheel that rolls freely at a measured speed: v = R ω, no slip, no friction. Mass
    /// and its variance are kept, the rest is uncertain as at the first start. For the moment before the
    /// brake is applied, and after a standstill.
    ///
    /// # Errors
    /// [`StepError::NonFinite`] or [`StepError::Negative`] of the measurement; nothing changes.
    pub fn restart(&mut self, wheel_speed_rad_s: T) -> Result<(), StepError> {
        if !wheel_speed_rad_s.is_finite() {
            return Err(StepError::NonFinite(Input::Measurement));
        }
        if wheel_speed_rad_s < T::ZERO {
            return Err(StepError::Negative(Input::Measurement));
        }
        let Estimate { state, covariance } = self.estimate;
        let config = Config {
            initial_vehicle_speed_m_s: self.config.vehicle.radius_m * wheel_speed_rad_s,
            initial_mass_kg: state.mass_kg,
            initial_std: StateStd {
                mass_kg: covariance.p44.max(T::ZERO).sqrt(),
                ..self.config.initial_std
            },
            ..self.config
        };
        let started = Self::new(config);
        self.estimate = started.estimate;
        self.motion = started.motion;
        self.last_wheel_speed_rad_s = None;
        self.gated_in_a_row = Gated::default();
        Ok(())
    }

    /// Moves on by one sample time under a brake torque in N m, >= 0, as it acted over that sample.
    ///
    /// The torque slows the wheel whichever way it turns, holds it where it stands, and never turns it
    /// backwards.
    ///
    /// # Errors
    /// [`StepError`]; state, covariance and motion are what they were before.
    pub fn predict(&mut self, brake_torque_nm: T) -> Result<Motion, StepError> {
        if !brake_torque_nm.is_finite() {
            return Err(StepError::NonFinite(Input::BrakeTorque));
        }
        if brake_torque_nm < T::ZERO {
            return Err(StepError::Negative(Input::BrakeTorque));
        }
        let predicted = self
            .model()
            .predicted(&self.estimate.state, brake_torque_nm);
        let mut process = self.config.process_std.variances();
        if predicted.motion == Motion::Standstill {
            // No model of the wheel is left there but that it turns no faster than at that speed.
            let [wheel, ..] = &mut process;
            *wheel +=
                (self.config.minimum_vehicle_speed_m_s / self.config.vehicle.radius_m).squared();
        }
        let covariance = predicted
            .jacobian
            .propagated(&self.estimate.covariance, process);
        if !(predicted.state.is_finite() && covariance.is_valid()) {
            return Err(StepError::Overflow);
        }
        self.estimate = Estimate {
            state: predicted.state,
            covariance,
        };
        self.motion = predicted.motion;
        Ok(predicted.motion)
    }

    /// Corrects the estimate with one reading, or rejects it: outside the gate (but not more than five of a
    /// channel in a row), or a wheel speed that repeats the last reading exactly where the configuration says that a
    /// healthy sensor does not. A correction leaves vehicle speed at or above zero and at least a tenth of
    /// the mass at the start.
    ///
    /// # Errors
    /// [`StepError`]; the estimate is what it was before.
    pub fn update(&mut self, measurement: &Measurement<T>) -> Result<Fusion<T>, StepError> {
        let corrected = corrected(
            &self.estimate,
            measurement,
            self.config.vehicle.gravity_m_s2,
        )?;
        let is_wheel = measurement.channel == Channel::WheelSpeed;
        let repeats = is_wheel && self.last_wheel_speed_rad_s == Some(measurement.value);
        if is_wheel {
            self.last_wheel_speed_rad_s = Some(measurement.value);
        }
        let mut fusion = corrected.fusion;
        if repeats && self.config.refuses_repeats {
            fusion.decision = Decision::Rejected;
            return Ok(fusion);
        }
        let outside = self.config.nis_gate.is_some_and(|gate| fusion.nis > gate);
        let gated_in_a_row = self.gated_in_a_row.of(measurement.channel);
        if outside && *gated_in_a_row < GATE_PATIENCE {
            *gated_in_a_row += 1;
            fusion.decision = Decision::Rejected;
            return Ok(fusion);
        }
        *gated_in_a_row = 0;
        self.estimate = corrected.estimate;
        // Noise must not carry a vehicle that brakes to rest backwards.
        let speed = &mut self.estimate.state.vehicle_speed_m_s;
        *speed = speed.max(T::ZERO);
        // Friction and mass are seen as a product; both must not change their sign together.
        let mass = &mut self.estimate.state.mass_kg;
        *mass = mass.max(T::from_f64(SMALLEST_MASS) * self.config.initial_mass_kg);
        if self.config.keeps_slip_positive {
            self.keep_slip_positive();
        }
        Ok(fusion)
    }

    /// Raises the vehicle's speed to the wheel's where it lies below by more than the wheel's uncertainty.
    fn keep_slip_positive(&mut self) {
        let Estimate { state, covariance } = &mut self.estimate;
        let radius = self.config.vehicle.radius_m;
        let circumference = radius * state.wheel_speed_rad_s;
        let wheel_variance = radius.squared() * covariance.p00;
        let below = circumference - state.vehicle_speed_m_s;
        let margin = T::from_f64(3.0) * wheel_variance.sqrt();
        if below > margin {
            state.vehicle_speed_m_s = circumference;
            *covariance = Covariance {
                p01: T::ZERO,
                p11: wheel_variance + below.squared(),
                p12: T::ZERO,
                p13: T::ZERO,
                p14: T::ZERO,
                ..*covariance
            };
        }
    }

    /// The same filter at another estimate, unchecked: for mixtures of estimates that were checked.
    pub(crate) fn at(&self, estimate: Estimate<T>) -> Self {
        Self { estimate, ..*self }
    }

    /// The five rows of the model's Jacobian F at a state and a brake torque in N m, order ω, v, λ, μ, m;
    /// for analysis. [`predict`](Self::predict) never forms it.
    pub fn transition_jacobian(&self, state: &State<T>, brake_torque_nm: T) -> [[T; 5]; 5] {
        self.model()
            .predicted(state, brake_torque_nm)
            .jacobian
            .rows()
    }

    /// Where the model carries a state in one sample under a brake torque in N m; for analysis.
    pub fn transition(&self, state: &State<T>, brake_torque_nm: T) -> State<T> {
        self.model().predicted(state, brake_torque_nm).state
    }

    fn model(&self) -> Model<T> {
        Model {
            vehicle: self.config.vehicle,
            road: self.config.road,
            sample_time_s: self.config.sample_time_s,
            minimum_vehicle_speed_m_s: self.config.minimum_vehicle_speed_m_s,
        }
    }
}
