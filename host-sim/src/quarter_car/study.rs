//! The comparison: rows (a) to (f) on every road, variants, Monte Carlo and what goes wrong, each as a ratio
//! of stopping distance to the optimum of the same stop.

use muslip::law::burckhardt::WET_ASPHALT;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayon::prelude::*;

use super::SetupError;
use super::drivers::{Banked, Filtered, LockedWheel, PerfectState, RigDriven, Setpoint};
use super::observability::{self, Observability};
use super::optimum::{best_constant_slip, bound, optimum};
use super::run::{Driver, Stop, stop};
use super::scenario::{FaultKind, Road, Scenario, SensorFault};

/// What the bank is told of the mass, 1 sigma in kg: 5 %.
pub const BANK_MASS_STD_KG: f64 = 22.5;
/// Longest time in s for which a wheel may be locked above 3 m/s.
pub const LOCK_BAR_S: f64 = 0.2;

/// How much is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StudyOptions {
    /// Seed of the first stop; the others follow it.
    pub seed: u64,
    /// Stops of each row of the comparison.
    pub stops: u64,
    /// Draws of the Monte Carlo.
    pub draws: u64,
}

impl Default for StudyOptions {
    fn default() -> Self {
        Self {
            seed: 700_001,
            stops: 20,
            draws: 200,
        }
    }
}

impl StudyOptions {
    /// The command that computes the same.
    pub fn command(&self) -> String {
        format!(
            "muslip quarter-car --seed {} --stops {} --draws {}",
            self.seed, self.stops, self.draws
        )
    }
}

/// Who drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Who {
    /// (a)
    Perfect,
    /// (b)
    Tutorial,
    /// (c)
    Tuned,
    /// (d)
    Locked,
    /// (f) four channels, peak sought.
    RigSought,
    /// (f) four channels, slip 0.12.
    RigFixed,
    /// (f) wheel speed alone, bank of roads.
    Bank,
}

impl Who {
    /// Letter of the row.
    pub fn letter(self) -> &'static str {
        match self {
            Self::Perfect => "(a)",
            Self::Tutorial => "(b)",
            Self::Tuned => "(c)",
            Self::Locked => "(d)",
            Self::RigSought | Self::RigFixed | Self::Bank => "(f)",
        }
    }

    /// What it is.
    pub fn name(self) -> &'static str {
        match self {
            Self::Perfect => "perfect state",
            Self::Tutorial => "tutorial's filter",
            Self::Tuned => "tuned filter, road known",
            Self::Locked => "locked wheel",
            Self::RigSought => "four channels, peak sought",
            Self::RigFixed => "four channels, slip held at 0.12",
            Self::Bank => "wheel speed alone, bank of roads",
        }
    }

    fn driver(self, scenario: &Scenario) -> Result<Box<dyn Driver>, SetupError> {
        Ok(match self {
            Self::Perfect => Box::new(PerfectState::new(scenario)?),
            Self::Tutorial => Box::new(Filtered::tutorial(scenario)?),
            Self::Tuned => Box::new(Filtered::tuned(scenario)?),
            Self::Locked => Box::new(LockedWheel),
            Self::RigSought => Box::new(RigDriven::new(scenario, Setpoint::Sought)?),
            Self::RigFixed => Box::new(RigDriven::new(scenario, Setpoint::Fixed)?),
            Self::Bank => Box::new(Banked::new(scenario, BANK_MASS_STD_KG)?),
        })
    }

    /// The bar on the median of a stop as nominal on a road, where there is one.
    fn bar(self, road: &Road) -> Option<f64> {
        let one_surface = road.patches.len() == 1;
        match self {
            Self::Tuned if matches!(road.name, "dry" | "wet") => Some(1.05),
            Self::RigSought if one_surface => Some(1.10),
            Self::RigSought => Some(1.15),
            _ => None,
        }
    }
}

/// The references of a road.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    /// The road's name.
    pub road: &'static str,
    /// Distance in m with peak friction from the first instant.
    pub bound_m: f64,
    /// (e): distance in m of the best stop of the actuator.
    pub optimum_m: f64,
    /// Distance in m of the best constant slip.
    pub constant_m: f64,
    /// That slip as a multiple of the peak's.
    pub constant_factor: f64,
}

/// Ratios of a set of stops.
#[derive(Debug, Clone, PartialEq)]
pub struct Ratios {
    /// Median.
    pub median: f64,
    /// The ninth decile: the worst tenth begins there.
    pub worst_tenth: f64,
    /// The worst.
    pub worst: f64,
    /// Mean share of the time with at least 95 % of peak friction.
    pub near_peak: f64,
    /// Mean share of the time with more than twice the peak's slip.
    pub deep: f64,
    /// Longest time in s with a locked wheel above 3 m/s.
    pub longest_lock_s: f64,
    /// How many there are.
    pub count: usize,
}

impl Ratios {
    /// Of (ratio, stop), at least one.
    fn of(mut stops: Vec<(f64, Stop)>) -> Self {
        stops.sort_by(|a, b| a.0.total_cmp(&b.0));
        let at = |share: f64| {
            let last = stops.len().saturating_sub(1) as f64;
            stops
                .get((share * last).round() as usize)
                .map_or(f64::NAN, |stop| stop.0)
        };
        let count = stops.len();
        let mean = |of: &dyn Fn(&Stop) -> f64| {
            stops.iter().map(|stop| of(&stop.1)).sum::<f64>() / count as f64
        };
        Self {
            median: at(0.5),
            worst_tenth: at(0.9),
            worst: at(1.0),
            near_peak: mean(&|stop| stop.share_near_peak),
            deep: mean(&|stop| stop.share_deep),
            longest_lock_s: stops
                .iter()
                .map(|stop| stop.1.longest_lock_s)
                .fold(0.0, f64::max),
            count,
        }
    }
}

/// A row of a table of ratios.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Who drives.
    pub who: Who,
    /// On what.
    pub road: &'static str,
    /// What is varied; empty in the comparison itself.
    pub variant: String,
    /// The ratios.
    pub ratios: Ratios,
    /// The bar on the median.
    pub bar: Option<f64>,
}

impl Row {
    /// Whether the median keeps to the bar, where there is one.
    pub fn keeps(&self) -> Option<bool> {
        self.bar.map(|bar| self.ratios.median <= bar)
    }

    /// Whether no wheel was locked above 3 m/s for longer than allowed; not asked of a locked wheel.
    pub fn keeps_rolling(&self) -> bool {
        self.who == Who::Locked || self.ratios.longest_lock_s <= LOCK_BAR_S
    }
}

/// All that was computed.
#[derive(Debug, Clone, PartialEq)]
pub struct Study {
    /// How much.
    pub options: StudyOptions,
    /// References of each road.
    pub references: Vec<Reference>,
    /// The comparison.
    pub comparison: Vec<Row>,
    /// Other speeds and the actuator's dead time.
    pub variants: Vec<Row>,
    /// Monte Carlo over vehicle and sensor.
    pub monte_carlo: Vec<Row>,
    /// What goes wrong.
    pub faults: Vec<Row>,
    /// What a filter that believes wet on a dry road makes of it: ratio.
    pub mistaken: Ratios,
    /// What the readings can tell.
    pub observability: Vec<Observability>,
}

/// Computes it all, over all cores.
///
/// # Errors
/// [`SetupError`] if a filter or controller refuses its configuration.
pub fn study(options: StudyOptions, progress: &mut dyn FnMut(u64)) -> Result<Study, SetupError> {
    let mut done = 0;
    let mut tell = |amount| {
        done += amount;
        progress(done);
    };
    let references: Vec<Reference> = Road::all().par_iter().map(reference).collect();
    tell(4);
    let mut comparison = Vec::new();
    for (road, reference) in Road::all().into_iter().zip(&references) {
        for who in [
            Who::Perfect,
            Who::Tutorial,
            Who::Tuned,
            Who::Locked,
            Who::RigSought,
            Who::RigFixed,
            Who::Bank,
        ] {
            let bar = who.bar(&road);
            let scenario = Scenario::usual(road.clone(), options.seed);
            comparison.push(row(who, &scenario, reference.optimum_m, options, "", bar)?);
            tell(1);
        }
    }
    let mut variants = Vec::new();
    for (variant, change) in [
        (
            "from 20 m/s",
            &(|s: &mut Scenario| s.from_m_s = 20.0) as &(dyn Fn(&mut Scenario) + Sync),
        ),
        ("from 45 m/s", &|s| s.from_m_s = 45.0),
        ("dead time 5 ms", &|s| s.actuator.dead_samples = 1),
    ] {
        for road in Road::all() {
            let mut scenario = Scenario::usual(road.clone(), options.seed);
            change(&mut scenario);
            // Dead time is no limit to one who knows everything beforehand.
            let mut prompt = scenario.clone();
            prompt.actuator.dead_samples = 0;
            let best = optimum(&prompt).distance_m;
            for who in [Who::Tuned, Who::RigSought, Who::Bank] {
                variants.push(row(who, &scenario, best, options, variant, who.bar(&road))?);
            }
        }
        tell(4);
    }
    let mut monte_carlo = Vec::new();
    for (mass_share, variant, drivers) in [
        (
            0.3,
            "mass ±30 %",
            &[Who::Tutorial, Who::Tuned, Who::RigSought, Who::Bank][..],
        ),
        (0.05, "mass ±5 %", &[Who::Bank]),
    ] {
        for road in Road::all() {
            let draws = draws(&road, options, mass_share);
            tell(8);
            for &who in drivers {
                monte_carlo.push(Row {
                    who,
                    road: road.name,
                    variant: variant.into(),
                    ratios: drawn(who, &draws)?,
                    bar: who.bar(&road).filter(|_| who == Who::Tuned),
                });
                tell(2);
            }
        }
    }
    Ok(Study {
        options,
        references,
        comparison,
        variants,
        monte_carlo,
        faults: faults(options)?,
        mistaken: mistaken(options)?,
        observability: observability::table()?,
    })
}

/// Units of work that [`study`] tells of.
pub fn work() -> u64 {
    4 + 28 + 12 + 64 + 40
}

fn reference(road: &Road) -> Reference {
    let scenario = Scenario::usual(road.clone(), 1);
    let (constant_factor, constant_m) = best_constant_slip(&scenario);
    Reference {
        road: road.name,
        bound_m: bound(&scenario),
        optimum_m: optimum(&scenario).distance_m,
        constant_m,
        constant_factor,
    }
}

/// Stops that differ in their noise alone, against one optimum in m.
fn row(
    who: Who,
    like: &Scenario,
    best: f64,
    options: StudyOptions,
    variant: &str,
    bar: Option<f64>,
) -> Result<Row, SetupError> {
    // Without noise in what they are told, one stop is all stops.
    let stops = match who {
        Who::Perfect | Who::Locked => 1,
        _ => options.stops,
    };
    let stops: Result<Vec<(f64, Stop)>, SetupError> = (0..stops)
        .into_par_iter()
        .map(|index| {
            let scenario = Scenario {
                seed: options.seed.wrapping_add(index),
                ..like.clone()
            };
            let stop = stop(&scenario, who.driver(&scenario)?.as_mut());
            Ok((stop.distance_m / best, stop))
        })
        .collect();
    Ok(Row {
        who,
        road: like.road.name,
        variant: variant.into(),
        ratios: Ratios::of(stops?),
        bar,
    })
}

/// Vehicles drawn at random (mass within ±`mass_share`, radius within ±2 %, twice the noise, all readings
/// one sample late), each with the distance in m of its own optimum.
fn draws(road: &Road, options: StudyOptions, mass_share: f64) -> Vec<(Scenario, f64)> {
    (0..options.draws)
        .into_par_iter()
        .map(|index| {
            let scenario = draw(road, options.seed.wrapping_add(index), mass_share);
            let best = optimum(&scenario).distance_m;
            (scenario, best)
        })
        .collect()
}

fn drawn(who: Who, draws: &[(Scenario, f64)]) -> Result<Ratios, SetupError> {
    let stops: Result<Vec<(f64, Stop)>, SetupError> = draws
        .par_iter()
        .map(|(scenario, best)| {
            let stop = stop(scenario, who.driver(scenario)?.as_mut());
            Ok((stop.distance_m / best, stop))
        })
        .collect();
    Ok(Ratios::of(stops?))
}

/// A vehicle and its sensor of the Monte Carlo.
pub fn draw(road: &Road, seed: u64, mass_share: f64) -> Scenario {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    // A stream of its own beside those of the sensors.
    random.set_stream(17);
    let mut factor = |share: f64| 1.0 + share * (2.0 * random.random::<f64>() - 1.0);
    let mut scenario = Scenario::usual(road.clone(), seed);
    scenario.mass_kg *= factor(mass_share);
    scenario.radius_m *= factor(0.02);
    scenario.noise.wheel_speed_rad_s *= 2.0;
    scenario.late_samples = 1;
    scenario
}

/// A fault of a sensor of 50 ms from 0.5 s on.
pub fn fault(kind: FaultKind) -> SensorFault {
    SensorFault {
        from_s: 0.5,
        until_s: 0.55,
        kind,
    }
}

/// The tuned filter on a dry road with what a user meets on the first day.
fn faults(options: StudyOptions) -> Result<Vec<Row>, SetupError> {
    type Change = fn(&mut Scenario);
    type Start = fn(&mut muslip::filter::quarter_car::Config<f64>);
    let cases: [(&str, Change, Start); 8] = [
        ("nothing wrong", |_| {}, |_| {}),
        (
            "mass 600 kg at the start",
            |_| {},
            |c| c.initial_mass_kg = 600.0,
        ),
        (
            "mass 300 kg at the start",
            |_| {},
            |c| c.initial_mass_kg = 300.0,
        ),
        (
            "speed 1 m/s too high at the start",
            |_| {},
            |c| {
                c.initial_vehicle_speed_m_s += 1.0;
                c.initial_std.vehicle_speed_m_s = 1.0;
            },
        ),
        (
            "speed 1 m/s too low at the start",
            |_| {},
            |c| {
                c.initial_vehicle_speed_m_s -= 1.0;
                c.initial_std.vehicle_speed_m_s = 1.0;
            },
        ),
        (
            "brake gives 1000 N m at most",
            |s| s.actuator.maximum_torque_nm = 1000.0,
            |_| {},
        ),
        (
            "no reading for 50 ms",
            |s| s.fault = Some(fault(FaultKind::Missing)),
            |_| {},
        ),
        (
            "frozen reading for 50 ms",
            |s| s.fault = Some(fault(FaultKind::Frozen)),
            |_| {},
        ),
    ];
    let mut rows = Vec::new();
    for (name, change, start) in cases {
        for road in [Road::dry(), Road::wet()] {
            let mut changed = Scenario::usual(road.clone(), options.seed);
            change(&mut changed);
            let best = if changed.actuator.maximum_torque_nm < 1500.0 {
                weak_brake(&changed)
            } else {
                optimum(&Scenario {
                    fault: None,
                    ..changed.clone()
                })
                .distance_m
            };
            let stops: Result<Vec<(f64, Stop)>, SetupError> = (0..options.stops)
                .into_par_iter()
                .map(|index| {
                    let scenario = Scenario {
                        seed: options.seed.wrapping_add(index),
                        ..changed.clone()
                    };
                    let mut driver = Filtered::tuned_with(&scenario, start)?;
                    let stop = stop(&scenario, &mut driver);
                    Ok((stop.distance_m / best, stop))
                })
                .collect();
            rows.push(Row {
                who: Who::Tuned,
                road: road.name,
                variant: name.into(),
                ratios: Ratios::of(stops?),
                bar: None,
            });
        }
    }
    Ok(rows)
}

/// The best stop of a brake too weak for the peak: all that it has, which a wheel that it cannot lock
/// bears; where it can, the optimum as ever.
fn weak_brake(scenario: &Scenario) -> f64 {
    let all = stop(scenario, &mut LockedWheel).distance_m;
    all.min(optimum(scenario).distance_m)
}

fn mistaken(options: StudyOptions) -> Result<Ratios, SetupError> {
    let scenario = Scenario::usual(Road::dry(), options.seed);
    let best = optimum(&scenario).distance_m;
    let stops: Result<Vec<(f64, Stop)>, SetupError> = (0..options.stops)
        .into_par_iter()
        .map(|index| {
            let scenario = Scenario {
                seed: options.seed.wrapping_add(index),
                ..scenario.clone()
            };
            let mut driver = Filtered::mistaken(&scenario, WET_ASPHALT.law())?;
            let stop = stop(&scenario, &mut driver);
            Ok((stop.distance_m / best, stop))
        })
        .collect();
    Ok(Ratios::of(stops?))
}
