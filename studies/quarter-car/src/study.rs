//! The comparison: rows (a) to (f) on every road, variants, Monte Carlo and what goes wrong, each as a ratio
//! of stopping distance to the optimum of the same stop.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayon::prelude::*;

use super::error::SetupError;
use super::faults::{faults, mistaken};
use super::observability::{self, Observability};
use super::optimum::{best_constant_slip, bound, optimum};
use super::options::StudyOptions;
use super::rows::{Ratios, Row};
use super::run::{Stop, stop};
use super::scenario::{Road, Scenario};
use super::who::Who;

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

/// All that was computed.
#[derive(Debug, Clone, PartialEq)]
pub struct Study {
    /// How much.
    pub options: StudyOptions,
    /// References of each road.
    pub references: Vec<Reference>,
    /// The comparison.
    pub comparison: Vec<Row>,
    /// References of each road under a tyre that no filter has.
    pub foreign_references: Vec<Reference>,
    /// The comparison on that tyre.
    pub foreign: Vec<Row>,
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
    let references = references(Road::all(), Scenario::usual);
    let foreign_references = self::references(Road::all_foreign(), Scenario::foreign);
    tell(8);
    let comparison = comparison(
        Road::all(),
        Scenario::usual,
        &references,
        options,
        &mut tell,
    )?;
    let foreign = self::comparison(
        Road::all_foreign(),
        Scenario::foreign,
        &foreign_references,
        options,
        &mut tell,
    )?;
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
            &[
                Who::Tutorial,
                Who::Tuned,
                Who::RigSought,
                Who::Bank,
                Who::BankWide,
            ][..],
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
        foreign_references,
        foreign,
        variants,
        monte_carlo,
        faults: faults(options)?,
        mistaken: mistaken(options)?,
        observability: observability::table()?,
    })
}

/// Units of work that [`study`] tells of.
pub fn work() -> u64 {
    8 + 56 + 12 + 64 + 48
}

/// A stop on a road, by seed.
type Usual = fn(Road, u64) -> Scenario;

fn references(roads: [Road; 4], like: Usual) -> Vec<Reference> {
    roads
        .into_par_iter()
        .map(|road| {
            let name = road.name;
            let scenario = like(road, 1);
            let (constant_factor, constant_m) = best_constant_slip(&scenario);
            Reference {
                road: name,
                bound_m: bound(&scenario),
                optimum_m: optimum(&scenario).distance_m.min(constant_m),
                constant_m,
                constant_factor,
            }
        })
        .collect()
}

/// Rows (a) to (f) on every road.
fn comparison(
    roads: [Road; 4],
    like: Usual,
    references: &[Reference],
    options: StudyOptions,
    tell: &mut impl FnMut(u64),
) -> Result<Vec<Row>, SetupError> {
    let mut rows = Vec::new();
    for (road, reference) in roads.into_iter().zip(references) {
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
            let scenario = like(road.clone(), options.seed);
            rows.push(row(who, &scenario, reference.optimum_m, options, "", bar)?);
            tell(1);
        }
    }
    Ok(rows)
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
