//! The tutorial's three figures, and what becomes of a wrong mass.

use muslip_report::{Axis, Extent, Figure, Ink, Shape};

use super::drivers::NOMINAL;
use super::error::SetupError;
use super::filtered::Filtered;
use super::observability::{Listener, WrongStart, listeners};
use super::run::{Sample, traced};
use super::scenario::{Road, SAMPLE_TIME_S, Scenario};

/// Length of the figures' stop in s.
const SHOWN_S: f64 = 3.0;
/// The wrong mass that listeners start with, in kg; 450 is true.
pub(super) const WRONG_MASS_KG: f64 = 600.0;
/// Left end of the logarithmic axis of time, in s.
const EARLIEST_S: f64 = 0.002;

/// A figure with the name of its file.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedFigure {
    /// Name without extension.
    pub name: &'static str,
    /// Heading of its section.
    pub heading: &'static str,
    /// The figure.
    pub figure: Figure,
}

/// The tutorial's three figures (the first two in two panels each), and what becomes of a wrong mass.
///
/// # Errors
/// [`SetupError`] if a filter or controller refuses its configuration.
pub fn figures(seed: u64) -> Result<Vec<NamedFigure>, SetupError> {
    let scenario = Scenario::usual(Road::dry(), seed);
    let tuned = traced(&scenario, &mut Filtered::tuned(&scenario)?, SHOWN_S).samples;
    let tutorial = traced(&scenario, &mut Filtered::tutorial(&scenario)?, SHOWN_S).samples;
    let wrong = WrongStart {
        mass_kg: WRONG_MASS_KG,
        speed_error_m_s: 0.0,
    };
    let named = |name, heading, figure| NamedFigure {
        name,
        heading,
        figure,
    };
    Ok(vec![
        named("true-speeds", "True signals", true_speeds(&tuned)),
        named("true-slip-friction", "True signals", true_slip(&tuned)),
        named(
            "estimated-speeds",
            "Estimated signals",
            estimated_speeds(&tuned),
        ),
        named(
            "estimated-slip-friction",
            "Estimated signals",
            estimated_slip(&tuned),
        ),
        named("mass", "Mass", mass(&tuned, &tutorial)),
        named(
            "mass-from-a-wrong-start",
            "A wrong mass at the start",
            wrong_mass(&listeners(wrong, seed)?),
        ),
    ])
}

fn line(samples: &[Sample], of: impl Fn(&Sample) -> f64) -> Vec<(f64, f64)> {
    samples
        .iter()
        .map(|sample| (sample.truth.time_s, of(sample)))
        .filter(|point| point.1.is_finite())
        .collect()
}

/// A quantity of a vehicle that moves; none of one that stands.
fn moving(of: impl Fn(&Sample) -> f64) -> impl Fn(&Sample) -> f64 {
    move |sample| {
        if sample.truth.vehicle_speed_m_s > 0.0 {
            of(sample)
        } else {
            f64::NAN
        }
    }
}

fn time() -> Axis {
    Axis::new("time (s)").over(Extent::Fixed(0.0, SHOWN_S))
}

fn true_speeds(samples: &[Sample]) -> Figure {
    let radius = NOMINAL.radius_m;
    Figure::new(
        "True speeds of vehicle and wheel in a stop from 30 m/s on dry asphalt, controlled on the tuned \
         filter's estimates.",
        time(),
        Axis::new("speed (m/s)").over(Extent::Including(0.0)),
    )
    .with(
        Ink::Truth,
        "vehicle",
        Shape::Line(line(samples, |s| s.truth.vehicle_speed_m_s)),
    )
    .with(
        Ink::Second,
        "wheel's circumference",
        Shape::Line(line(samples, |s| radius * s.truth.wheel_speed_rad_s)),
    )
}

fn true_slip(samples: &[Sample]) -> Figure {
    Figure::new(
        "True slip and friction of the same stop, dimensionless, until the vehicle stands.",
        time(),
        Axis::new("slip, friction").over(Extent::Including(0.0)),
    )
    .with(
        Ink::Truth,
        "friction",
        Shape::Line(line(samples, moving(|s| s.truth.friction))),
    )
    .with(
        Ink::Second,
        "slip",
        Shape::Line(line(samples, moving(|s| s.truth.slip_ratio))),
    )
}

fn estimated_speeds(samples: &[Sample]) -> Figure {
    let radius = NOMINAL.radius_m;
    let error = samples
        .iter()
        .map(|s| (s.belief.vehicle_speed_m_s - s.truth.vehicle_speed_m_s).abs())
        .fold(0.0, f64::max);
    Figure::new(
        format!(
            "Estimated speeds, from the measured wheel speed alone; that of the vehicle is wrong by {error:.2} m/s \
             at most."
        ),
        time(),
        Axis::new("speed (m/s)").over(Extent::Including(0.0)),
    )
    .with(
        Ink::Estimate,
        "vehicle",
        Shape::Line(line(samples, |s| s.belief.vehicle_speed_m_s)),
    )
    .with(
        Ink::Second,
        "wheel's circumference",
        Shape::Line(line(samples, |s| radius * s.belief.wheel_speed_rad_s)),
    )
    .with(
        Ink::Truth,
        "true vehicle",
        Shape::Dashes(line(samples, |s| s.truth.vehicle_speed_m_s)),
    )
}

fn estimated_slip(samples: &[Sample]) -> Figure {
    Figure::new(
        "Estimated slip and friction, dimensionless. They end where slip has no meaning any more, below 0.5 m/s.",
        time(),
        Axis::new("slip, friction").over(Extent::Including(0.0)),
    )
    .with(
        Ink::Estimate,
        "friction",
        Shape::Line(line(samples, |s| {
            if s.belief.slip_ratio.is_finite() {
                s.belief.friction
            } else {
                f64::NAN
            }
        })),
    )
    .with(
        Ink::Second,
        "slip",
        Shape::Line(line(samples, |s| s.belief.slip_ratio)),
    )
    .with(
        Ink::Truth,
        "true",
        Shape::Dashes(line(samples, moving(|s| s.truth.friction))),
    )
    .with(
        Ink::Truth,
        "",
        Shape::Dashes(line(samples, moving(|s| s.truth.slip_ratio))),
    )
}

fn mass(tuned: &[Sample], tutorial: &[Sample]) -> Figure {
    let band = tuned
        .iter()
        .map(|sample| {
            let belief = &sample.belief;
            let low = belief.mass_kg - belief.mass_std_kg;
            (
                sample.truth.time_s,
                low,
                belief.mass_kg + belief.mass_std_kg,
            )
        })
        .collect();
    Figure::new(
        "Estimated mass of the same stop, started at the true one: the tutorial's filter is certain from \
         the start and hardly moves; the tuned one gives or takes a sixth and learns it at the peak.",
        time(),
        Axis::new("mass (kg)").over(Extent::Including(350.0)),
    )
    .with(Ink::Estimate, "tuned, 1-sigma", Shape::Band(band))
    .with(
        Ink::Estimate,
        "tuned",
        Shape::Line(line(tuned, |s| s.belief.mass_kg)),
    )
    .with(
        Ink::Second,
        "tutorial",
        Shape::Line(line(tutorial, |s| s.belief.mass_kg)),
    )
    .with(Ink::Truth, "true", Shape::Level(450.0))
}

fn wrong_mass(listeners: &[Listener]) -> Figure {
    let mut figure = Figure::new(
        format!(
            "Mass from a wrong start, {WRONG_MASS_KG:.0} kg for 450, of filters that listen to one stop: \
             with no variance at the start it stays wrong or comes late; with an honest prior wheel speed \
             finds it where the road is known and not where it is unknown; the rig's channels find it with the \
             first reading, which is drawn one sample after the start."
        ),
        Axis::new("time since the start (s)")
            .over(Extent::Fixed(EARLIEST_S, 2.5))
            .logarithmic(),
        Axis::new("mass (kg)").over(Extent::Including(300.0)),
    );
    let inks = [
        Ink::Reference,
        Ink::Reference,
        Ink::Estimate,
        Ink::Measured,
        Ink::Second,
    ];
    for (index, (listener, ink)) in listeners.iter().zip(inks).enumerate() {
        // A logarithmic axis has no zero: the start is at its left end, the first reading a sample later.
        let start = (EARLIEST_S, WRONG_MASS_KG);
        let read = line(&listener.samples, |s| s.belief.mass_kg);
        let points = std::iter::once(start)
            .chain(read.into_iter().map(|(t, mass)| (t + SAMPLE_TIME_S, mass)))
            .collect();
        let shape = if index == 1 {
            Shape::Dashes(points)
        } else {
            Shape::Line(points)
        };
        figure = figure.with(ink, listener.name, shape);
    }
    figure.with(Ink::Truth, "true", Shape::Level(450.0))
}
