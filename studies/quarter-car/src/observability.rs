//! What the readings can tell: rank of the linearised system, and filters that merely listen.

use muslip::law::TyreLaw;
use muslip_quarter_car::filter::{
    Channel, Config, Filter as QuarterCarFilter, Measurement, Road as FilterRoad, State, StateStd,
};
use nalgebra::{DMatrix, SMatrix, SVector};

use super::car::Truth;
use super::drivers::{
    Channels, NOMINAL, PerfectState, WHEEL_VARIANCE, belief_of, correct_with_rig, rolling_speed,
};
use super::error::SetupError;
use super::run::{Belief, Driver, Readings, Sample, traced};
use super::scenario::{GRAVITY_M_S2, Road, Scenario, SensorNoise};

/// A state is counted as seen where it moves the readings of five samples by over a thousandth of what a
/// typical error of it would if it were read itself.
const SEEN: f64 = 1e-3;

/// Typical errors, by which states are scaled: 1 rad/s, 1 m/s, 0.05, 0.1, 50 kg.
const TYPICAL: [f64; 5] = [1.0, 1.0, 0.05, 0.1, 50.0];

/// Names of the states.
const NAMES: [&str; 5] = ["ω", "v", "λ", "μ", "m"];

/// What five samples tell at a point of operation.
#[derive(Debug, Clone, PartialEq)]
pub struct Observability {
    /// Which point.
    pub point: &'static str,
    /// Whether the road is known.
    pub road_known: bool,
    /// Which channels.
    pub channels: Channels,
    /// Number of directions of the state space that the readings see, of 5.
    pub rank: usize,
    /// The weakest direction's singular value over the strongest's.
    pub weakest: f64,
    /// The states that make up what is not seen, largest part first; empty where all is seen.
    pub unseen: Vec<&'static str>,
}

/// The table: points below, near, at and past the peak of dry asphalt at 20 m/s.
///
/// # Errors
/// [`SetupError`] if a part refuses its configuration or step.
pub fn table() -> Result<Vec<Observability>, SetupError> {
    let law = Road::dry().law_at(0.0);
    let peak = law.peak().slip_ratio;
    let mut rows = Vec::new();
    for (point, slip) in [
        ("λ = 0.03", 0.03),
        ("0.9 of the peak", 0.9 * peak),
        ("the peak", peak),
        ("λ = 0.5", 0.5),
    ] {
        for road_known in [true, false] {
            for channels in [Channels::WheelSpeed, Channels::Rig] {
                rows.push(at(point, slip, road_known, channels)?);
            }
        }
    }
    Ok(rows)
}

fn at(
    point: &'static str,
    slip: f64,
    road_known: bool,
    channels: Channels,
) -> Result<Observability, SetupError> {
    let law = Road::dry().law_at(0.0);
    let road = if road_known {
        FilterRoad::Known(law)
    } else {
        FilterRoad::Unknown
    };
    let filter = Config::tuned(NOMINAL, road, 20.0).build()?;
    let (friction, mass) = (law.friction(slip), 450.0);
    let state = State {
        wheel_speed_rad_s: 20.0 * (1.0 - slip) / NOMINAL.radius_m,
        vehicle_speed_m_s: 20.0,
        slip_ratio: slip,
        friction,
        mass_kg: mass,
    };
    let torque = NOMINAL.radius_m * GRAVITY_M_S2 * friction * mass;
    // nalgebra takes an array by its columns.
    let f = SMatrix::<f64, 5, 5>::from(filter.transition_jacobian(&state, torque)).transpose();
    let scale = SMatrix::<f64, 5, 5>::from_diagonal(&SVector::from(TYPICAL));
    let mut heads = vec![[1.0, 0.0, 0.0, 0.0, 0.0]];
    if channels == Channels::Rig {
        // In typical errors of what is read, so that no channel counts for its unit.
        let force = mass * GRAVITY_M_S2;
        heads.push([0.0, 1.0, 0.0, 0.0, 0.0]);
        heads.push([0.0, 0.0, 0.0, 10.0, friction / mass * 10.0]);
        heads.push([0.0, 0.0, 0.0, 0.0, GRAVITY_M_S2 / force * 10.0]);
    }
    let mut rows = Vec::new();
    for head in heads {
        let mut row = SVector::<f64, 5>::from(head).transpose();
        for _ in 0..5 {
            rows.push(row * scale);
            row *= f;
        }
    }
    let matrix = DMatrix::from_fn(rows.len(), 5, |i, j| rows.get(i).map_or(0.0, |row| row[j]));
    let svd = matrix.svd(false, true);
    let strongest = svd.singular_values.max();
    let weakest = svd.singular_values.min();
    let unseen_directions: Vec<usize> = (0..5).filter(|&i| svd.singular_values[i] < SEEN).collect();
    let mut unseen = Vec::new();
    if let Some(directions) = &svd.v_t {
        let mut parts: Vec<(f64, &'static str)> = NAMES
            .iter()
            .enumerate()
            .map(|(j, name)| {
                let part: f64 = unseen_directions
                    .iter()
                    .map(|&i| directions[(i, j)].powi(2))
                    .sum();
                (part, *name)
            })
            .filter(|(part, _)| *part > 0.1)
            .collect();
        parts.sort_by(|a, b| b.0.total_cmp(&a.0));
        unseen.extend(parts.into_iter().map(|part| part.1));
    }
    Ok(Observability {
        point,
        road_known,
        channels,
        rank: 5 - unseen_directions.len(),
        weakest: weakest / strongest,
        unseen,
    })
}

/// A filter that listens to a stop which another one drives.
#[derive(Debug, Clone, PartialEq)]
pub struct Listener {
    /// What it is.
    pub name: &'static str,
    /// What it believed, sample by sample.
    pub samples: Vec<Sample>,
}

impl Listener {
    /// The last sample before a time in s.
    pub fn at(&self, time_s: f64) -> Option<&Sample> {
        self.samples
            .iter()
            .rev()
            .find(|sample| sample.truth.time_s <= time_s + 1e-9)
    }
}

/// What a listener starts from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WrongStart {
    /// Mass in kg that it starts with; 450 is true.
    pub mass_kg: f64,
    /// Error of the speed in m/s that it starts with.
    pub speed_error_m_s: f64,
}

/// Filters that start wrong and listen to the same stop on dry asphalt, driven by one who knows.
///
/// # Errors
/// [`SetupError`] if a part refuses its configuration or step.
pub fn listeners(start: WrongStart, seed: u64) -> Result<Vec<Listener>, SetupError> {
    let scenario = Scenario::usual(Road::dry(), seed);
    let law = scenario.road.law_at(0.0);
    let honest = |config: &mut Config<f64>| {
        config.initial_std.mass_kg = 150.0;
        config.initial_std.vehicle_speed_m_s = 2.0;
    };
    let known = FilterRoad::Known(law);
    let speed = rolling_speed(&scenario) + start.speed_error_m_s;
    let tuned = |road, change: &dyn Fn(&mut Config<f64>)| {
        let mut config = Config::tuned(NOMINAL, road, speed);
        config.initial_mass_kg = start.mass_kg;
        change(&mut config);
        config
    };
    let mut tutorial = Config::tutorial(NOMINAL, law, speed);
    tutorial.initial_mass_kg = start.mass_kg;
    let wheel = Channels::WheelSpeed;
    [
        (
            "tutorial, P0 = 0",
            tutorial,
            wheel,
            Config::<f64>::tutorial_variance(),
        ),
        (
            "wheel speed, road known, P0 = 0",
            tuned(known, &|config| config.initial_std = StateStd::ZERO),
            wheel,
            WHEEL_VARIANCE,
        ),
        (
            "wheel speed, road known, honest prior",
            tuned(known, &honest),
            wheel,
            WHEEL_VARIANCE,
        ),
        (
            "wheel speed, road unknown, honest prior",
            tuned(FilterRoad::Unknown, &honest),
            wheel,
            WHEEL_VARIANCE,
        ),
        (
            "four channels, road unknown, honest prior",
            tuned(FilterRoad::Unknown, &honest),
            Channels::Rig,
            WHEEL_VARIANCE,
        ),
    ]
    .into_iter()
    .map(|(name, config, channels, variance)| {
        let mut driver = Listening {
            drives: PerfectState::new(&scenario)?,
            filter: config.build()?,
            channels,
            variance,
            noise: scenario.noise,
            demanded_nm: 0.0,
        };
        Ok(Listener {
            name,
            samples: traced(&scenario, &mut driver, 2.5).samples,
        })
    })
    .collect()
}

/// Drives by the truth, and lets a filter listen.
struct Listening {
    drives: PerfectState,
    filter: QuarterCarFilter<f64>,
    channels: Channels,
    variance: f64,
    noise: SensorNoise,
    demanded_nm: f64,
}

impl Driver for Listening {
    fn demand(&mut self, readings: &Readings, truth: &Truth) -> f64 {
        // A step that is refused leaves the filter as it is; the figure shows it standing still.
        let _ = self.filter.predict(self.demanded_nm);
        if let Some(value) = readings.wheel_speed_rad_s {
            let _ = self.filter.update(&Measurement {
                channel: Channel::WheelSpeed,
                value,
                variance: self.variance,
            });
        }
        if self.channels == Channels::Rig {
            let _ = correct_with_rig(&mut self.filter, readings, &self.noise);
        }
        self.demanded_nm = self.drives.demand(readings, truth);
        self.demanded_nm
    }

    fn belief(&self) -> Belief {
        belief_of(&self.filter)
    }
}
