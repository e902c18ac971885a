//! What a user meets on the first day, and a filter that believes in another road.

use muslip_laws::burckhardt::WET_ASPHALT;
use rayon::prelude::*;

use super::drivers::LockedWheel;
use super::error::SetupError;
use super::filtered::Filtered;
use super::optimum::optimum;
use super::options::StudyOptions;
use super::rows::{Ratios, Row};
use super::run::{Stop, stop};
use super::scenario::{FaultKind, Road, Scenario, SensorFault};
use super::who::Who;

/// A fault of a sensor of 50 ms from 0.5 s on.
pub fn fault(kind: FaultKind) -> SensorFault {
    SensorFault {
        from_s: 0.5,
        until_s: 0.55,
        kind,
    }
}

/// The tuned filter on a dry road with what a user meets on the first day.
pub(super) fn faults(options: StudyOptions) -> Result<Vec<Row>, SetupError> {
    type Change = fn(&mut Scenario);
    type Start = fn(&mut muslip_quarter_car::filter::Config<f64>);
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

pub(super) fn mistaken(options: StudyOptions) -> Result<Ratios, SetupError> {
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
