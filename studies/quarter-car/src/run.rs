//! One stop: plant, sensors and whoever drives the brake, sample by sample.

use std::collections::VecDeque;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::car::{Car, Truth};
use super::scenario::{FaultKind, GRAVITY_M_S2, SAMPLE_TIME_S, Scenario};

/// A slip at or above this counts as a locked wheel.
const LOCKED_SLIP: f64 = 0.95;
/// Speed in m/s above which a locked wheel is held against a controller.
const LOCK_SPEED_M_S: f64 = 3.0;
/// Stops that last longer are given up, in s.
const LONGEST_STOP_S: f64 = 60.0;

/// What the sensors read at a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Readings {
    /// Wheel speed in rad/s, where there is a reading.
    pub wheel_speed_rad_s: Option<f64>,
    /// Vehicle speed in m/s.
    pub vehicle_speed_m_s: f64,
    /// Drag in N.
    pub drag_force_n: f64,
    /// Normal force in N.
    pub normal_force_n: f64,
}

/// What a driver believes; NaN where it has no belief.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Belief {
    /// Wheel speed in rad/s.
    pub wheel_speed_rad_s: f64,
    /// Vehicle speed in m/s.
    pub vehicle_speed_m_s: f64,
    /// Slip, NaN where it has no meaning.
    pub slip_ratio: f64,
    /// Friction.
    pub friction: f64,
    /// Mass in kg.
    pub mass_kg: f64,
    /// Standard deviation of the vehicle speed in m/s.
    pub vehicle_speed_std_m_s: f64,
    /// Standard deviation of the mass in kg.
    pub mass_std_kg: f64,
}

impl Belief {
    /// None at all.
    pub const NONE: Self = Self {
        wheel_speed_rad_s: f64::NAN,
        vehicle_speed_m_s: f64::NAN,
        slip_ratio: f64::NAN,
        friction: f64::NAN,
        mass_kg: f64::NAN,
        vehicle_speed_std_m_s: f64::NAN,
        mass_std_kg: f64::NAN,
    };
}

/// Whoever drives the brake.
pub trait Driver {
    /// The torque to demand in N m until the next sample. `truth` is for drivers that are told it.
    fn demand(&mut self, readings: &Readings, truth: &Truth) -> f64;
    /// What it believes after the sample.
    fn belief(&self) -> Belief {
        Belief::NONE
    }
}

/// A sample of a stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// What is true.
    pub truth: Truth,
    /// What was read of the wheel speed.
    pub measured_wheel_speed_rad_s: Option<f64>,
    /// What the driver believes.
    pub belief: Belief,
}

/// How a stop went.
#[derive(Debug, Clone, PartialEq)]
pub struct Stop {
    /// Distance in m to the speed at which it is over; infinite if it never was.
    pub distance_m: f64,
    /// Time in s.
    pub time_s: f64,
    /// Share of the time with at least 95 % of the peak friction of the road under the wheel.
    pub share_near_peak: f64,
    /// Share of the time with slip above twice that of the peak.
    pub share_deep: f64,
    /// The longest time in s with a locked wheel above 3 m/s.
    pub longest_lock_s: f64,
    /// The samples, if they were asked for.
    pub samples: Vec<Sample>,
}

/// Runs a stop to its end.
pub fn stop(scenario: &Scenario, driver: &mut dyn Driver) -> Stop {
    run(scenario, driver, None)
}

/// Runs for a time in s, past the end of the stop too, and keeps the samples.
pub fn traced(scenario: &Scenario, driver: &mut dyn Driver, duration_s: f64) -> Stop {
    run(scenario, driver, Some(duration_s))
}

fn run(scenario: &Scenario, driver: &mut dyn Driver, traced_s: Option<f64>) -> Stop {
    let mut car = Car::new(scenario);
    let mut sensors = Sensors::new(scenario);
    let mut tally = Tally::new(scenario);
    let mut samples = Vec::new();
    let last = traced_s.unwrap_or(LONGEST_STOP_S);
    loop {
        let truth = car.truth();
        let over = traced_s.is_none() && tally.end.is_some();
        if over || truth.time_s > last - 0.5 * SAMPLE_TIME_S {
            break;
        }
        let readings = sensors.read(&truth);
        let demand = driver.demand(&readings, &truth);
        if traced_s.is_some() {
            samples.push(Sample {
                truth,
                measured_wheel_speed_rad_s: readings.wheel_speed_rad_s,
                belief: driver.belief(),
            });
        }
        car.sample(demand, |truth| tally.add(truth));
    }
    tally.stop(samples)
}

/// Sums over the steps of the plant.
struct Tally<'a> {
    scenario: &'a Scenario,
    before: Truth,
    end: Option<(f64, f64)>,
    near_peak_s: f64,
    deep_s: f64,
    lock_s: f64,
    longest_lock_s: f64,
}

impl<'a> Tally<'a> {
    fn new(scenario: &'a Scenario) -> Self {
        Self {
            scenario,
            before: Car::new(scenario).truth(),
            end: None,
            near_peak_s: 0.0,
            deep_s: 0.0,
            lock_s: 0.0,
            longest_lock_s: 0.0,
        }
    }

    fn add(&mut self, truth: &Truth) {
        if self.end.is_some() {
            return;
        }
        let before = self.before;
        let dt = truth.time_s - before.time_s;
        let to = self.scenario.to_m_s;
        if truth.vehicle_speed_m_s <= to {
            let share = (before.vehicle_speed_m_s - to)
                / (before.vehicle_speed_m_s - truth.vehicle_speed_m_s);
            let between = |a: f64, b: f64| a + share * (b - a);
            self.end = Some((
                between(before.distance_m, truth.distance_m),
                between(before.time_s, truth.time_s),
            ));
        }
        let (friction, slip) = self.scenario.road.peak_at(truth.distance_m);
        if truth.friction >= 0.95 * friction {
            self.near_peak_s += dt;
        }
        if truth.slip_ratio > 2.0 * slip {
            self.deep_s += dt;
        }
        if truth.slip_ratio >= LOCKED_SLIP && truth.vehicle_speed_m_s > LOCK_SPEED_M_S {
            self.lock_s += dt;
            self.longest_lock_s = self.longest_lock_s.max(self.lock_s);
        } else {
            self.lock_s = 0.0;
        }
        self.before = *truth;
    }

    fn stop(self, samples: Vec<Sample>) -> Stop {
        let (distance_m, time_s) = self.end.unwrap_or((f64::INFINITY, f64::INFINITY));
        Stop {
            distance_m,
            time_s,
            share_near_peak: self.near_peak_s / time_s,
            share_deep: self.deep_s / time_s,
            longest_lock_s: self.longest_lock_s,
            samples,
        }
    }
}

/// Noise, lateness and failure of the sensors. Each channel has its own stream of one seed.
struct Sensors<'a> {
    scenario: &'a Scenario,
    streams: [ChaCha8Rng; 4],
    late: VecDeque<Readings>,
    frozen: Option<f64>,
}

impl<'a> Sensors<'a> {
    fn new(scenario: &'a Scenario) -> Self {
        let streams = std::array::from_fn(|channel| {
            let mut stream = ChaCha8Rng::seed_from_u64(scenario.seed);
            stream.set_stream(channel as u64);
            stream
        });
        Self {
            scenario,
            streams,
            late: VecDeque::new(),
            frozen: None,
        }
    }

    fn read(&mut self, truth: &Truth) -> Readings {
        let noise = &self.scenario.noise;
        let normal_force = self.scenario.mass_kg * GRAVITY_M_S2;
        let channels = [
            (truth.wheel_speed_rad_s, noise.wheel_speed_rad_s),
            (truth.vehicle_speed_m_s, noise.vehicle_speed_m_s),
            (truth.friction * normal_force, noise.drag_force_n),
            (normal_force, noise.normal_force_n),
        ];
        let mut read = [0.0; 4];
        for ((read, (value, sigma)), stream) in read.iter_mut().zip(channels).zip(&mut self.streams)
        {
            let unit: f64 = StandardNormal.sample(stream);
            *read = value + sigma * unit;
        }
        let [wheel, vehicle_speed_m_s, drag_force_n, normal_force_n] = read;
        self.late.push_back(Readings {
            wheel_speed_rad_s: Some(wheel),
            vehicle_speed_m_s,
            drag_force_n,
            normal_force_n,
        });
        let mut readings = self.late.front().copied().unwrap_or(Readings {
            wheel_speed_rad_s: None,
            vehicle_speed_m_s,
            drag_force_n,
            normal_force_n,
        });
        if self.late.len() > self.scenario.late_samples {
            self.late.pop_front();
        }
        if let Some(fault) = &self.scenario.fault {
            let failing = (fault.from_s..fault.until_s).contains(&truth.time_s);
            match fault.kind {
                FaultKind::Missing if failing => readings.wheel_speed_rad_s = None,
                FaultKind::Frozen if failing => readings.wheel_speed_rad_s = self.frozen,
                _ => self.frozen = readings.wheel_speed_rad_s,
            }
        }
        readings
    }
}
