//! The figures, the report and the page of the documentation.

use super::SetupError;
use super::drivers::{Filtered, NOMINAL};
use super::observability::{Listener, WrongStart, listeners};
use super::run::{Sample, traced};
use super::scenario::{Road, Scenario};
use super::study::Study;
use crate::paper::Table;
use crate::report::{Axis, Block, Extent, Figure, Ink, KeyFigure, Report, Section, Shape, Tone};

const TITLE: &str = "Slip control of a braked quarter car";
const SUBJECT: &str = "after P. Goddard, Using an Extended Kalman Filter for Estimating Vehicle \
                       Dynamics and Mass";

/// Length of the figures' stop in s.
const SHOWN_S: f64 = 3.0;
/// The wrong mass that listeners start with, in kg; 450 is true.
const WRONG_MASS_KG: f64 = 600.0;

const ABOUT_SETUP: &str = "Quarter car of 450 kg on a wheel of 0.30 m and 1 kg m², from 30 m/s to 1 m/s; \
    brake 0 to 3 kN m at 20 kN m/s; samples every 5 ms; wheel speed with noise of 0.1 rad/s (1 sigma), on \
    the rig vehicle speed 0.02 m/s, drag 90 N, normal force 20 N. Burckhardt's dry asphalt, wet asphalt and \
    snow, and dry with wet from 15 to 30 m. The plant is integrated with steps of 0.25 ms, the loop runs on \
    estimates.";

const ABOUT_OPTIMUM: &str = "(e) is the best stop of an actuator with these limits, driven by one who knows \
    everything beforehand: torque rises at the full rate, falls at the full rate until the peak's slip is \
    met, holds it, and starts before each edge of the road; the times are searched for. The bound is peak \
    friction from the first instant, which no actuator reaches, so that the true optimum lies between the \
    second column and 1. The best constant slip is held by the same hand without the overshoot.";

const ABOUT_COMPARISON: &str = "Distance over that of (e), median and worst of the stops. Near the peak: \
    share of the time with at least 95 % of the peak friction of the road under the wheel; deep slip: with \
    more than twice the peak's slip; locked: the longest time above 3 m/s. Setpoint: 0.9 of the known peak's \
    slip. The controller is the same in all rows: bandwidth 40 rad/s, integral time 0.25 s.";

const ABOUT_UNKNOWN: &str = "What (f) needs. Four channels: nothing but their readings; \"peak sought\" holds \
    0.9 of the critical slip that the two-state filter finds while braking, and 0.12 until its standard \
    deviation is below 15 %; a fixed 0.12 lies so well between these three peaks that it does better than \
    the search here, which it would not on a road with another peak. Wheel speed alone: that the road is one \
    of the bank's three, and the mass to about 5 %, because a light car on a dry road and a heavy one on a \
    wet road lock at the same torque. With a mass within 30 % the median still holds, the worst tenth does \
    not. Short releases of the brake that probe for the vehicle's speed were tried and did not help.";

const ABOUT_TUNING: &str = "Tuned by hand on stops from 30 m/s, seeds 1 and 5000 to 5099 with vehicles drawn \
    by seeds 1000 to 1099: Q of the tuned filter was written down from what each equation leaves out and \
    changed once (friction's share of the peak, for snow); setpoint share, bandwidth and integral time were \
    not changed after the first run; the bank's friction noise, told variance and probability of change are \
    the best of about twenty sets, and two safeguards (vehicle speed held at or above the wheel's, the \
    lock guard) came after failures on these seeds. The mass floor came after the first full run on the \
    reported seeds, where a mass had gone negative. The tables are of other seeds, and of 20 and 45 m/s.";

const ABOUT_MONTE_CARLO: &str = "Mass uniform within the stated range and radius within ±2 % of what the \
    filter believes, twice the noise, every reading one sample late; each draw over its own optimum. A \
    vehicle that has not come below 1 m/s within 60 s does not stop: the tutorial's filter, with no variance \
    at the start, believes that it stands and opens the brake.";

const ABOUT_WEAKNESS: &str = "Where it is weak: on snow the tuned filter's dead reckoning drifts over a stop \
    of 15 s and carries slip past twice the peak's for part of the time, which costs up to a seventh from \
    20 m/s in the worst stops; the bank pays up to a tenth on wet asphalt when readings or torque come late.";

const ABOUT_FAULTS: &str = "The tuned filter on the first day. Sensors fail at 0.5 s. The weak brake is \
    compared with its own full torque.";

const ABOUT_OBSERVABILITY: &str = "Rank of (h; h F; ..; h F⁴) at 20 m/s on dry asphalt, states scaled by \
    typical errors (1 rad/s, 1 m/s, 0.05, 0.1, 50 kg); a direction counts from a singular value of 0.001. \
    With the road known, wheel speed tells vehicle speed through the slope of the curve: below the peak it \
    does, at the peak it does not, and there it tells the mass. With the road unknown it tells μ m alone. \
    The rig's channels tell all but λ of the last sample, which nothing depends on where the road is \
    unknown.";

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
        "True slip and friction of the same stop.",
        time(),
        Axis::new("slip, friction").over(Extent::Including(0.0)),
    )
    .with(
        Ink::Truth,
        "friction",
        Shape::Line(line(samples, |s| s.truth.friction)),
    )
    .with(
        Ink::Second,
        "slip",
        Shape::Line(line(samples, |s| s.truth.slip_ratio)),
    )
}

fn estimated_speeds(samples: &[Sample]) -> Figure {
    let radius = NOMINAL.radius_m;
    Figure::new(
        "Estimated speeds, from the measured wheel speed alone.",
        time(),
        Axis::new("speed (m/s)").over(Extent::Including(0.0)),
    )
    .with(
        Ink::Measured,
        "measured wheel",
        Shape::Points(line(samples, |s| {
            radius * s.measured_wheel_speed_rad_s.unwrap_or(f64::NAN)
        })),
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
}

fn estimated_slip(samples: &[Sample]) -> Figure {
    Figure::new(
        "Estimated slip and friction. Slip ends where it has no meaning any more, below 0.5 m/s.",
        time(),
        Axis::new("slip, friction").over(Extent::Including(0.0)),
    )
    .with(
        Ink::Estimate,
        "friction",
        Shape::Line(line(samples, |s| s.belief.friction)),
    )
    .with(
        Ink::Second,
        "slip",
        Shape::Line(line(samples, |s| s.belief.slip_ratio)),
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
        Axis::new("mass (kg)").over(Extent::Fixed(350.0, 550.0)),
    )
    .with(Ink::Estimate, "tuned, 1-sigma", Shape::Band(band))
    .with(Ink::Truth, "true", Shape::Level(450.0))
    .with(
        Ink::Second,
        "tutorial",
        Shape::Line(line(tutorial, |s| s.belief.mass_kg)),
    )
    .with(
        Ink::Estimate,
        "tuned",
        Shape::Line(line(tuned, |s| s.belief.mass_kg)),
    )
}

fn wrong_mass(listeners: &[Listener]) -> Figure {
    let mut figure = Figure::new(
        format!(
            "Mass from a wrong start, {WRONG_MASS_KG:.0} kg for 450, of filters that listen to one stop: \
             with no variance at the start it stays wrong or comes late; with an honest prior wheel speed \
             finds it where the road is known and not where it is unknown; the rig's channels find it at once."
        ),
        Axis::new("time (s)").over(Extent::Fixed(0.0, 2.5)),
        Axis::new("mass (kg)").over(Extent::Fixed(300.0, 800.0)),
    )
    .with(Ink::Truth, "true", Shape::Level(450.0));
    let inks = [
        Ink::Reference,
        Ink::Reference,
        Ink::Estimate,
        Ink::Measured,
        Ink::Second,
    ];
    for (index, (listener, ink)) in listeners.iter().zip(inks).enumerate() {
        let points = line(&listener.samples, |s| s.belief.mass_kg);
        let shape = if index == 1 {
            Shape::Dashes(points)
        } else {
            Shape::Line(points)
        };
        figure = figure.with(ink, listener.name, shape);
    }
    figure
}

/// What becomes of wrong starts, as a table.
fn wrong_starts_table(seed: u64) -> Result<Table, SetupError> {
    let mut rows = Vec::new();
    for (what, start) in [
        (
            "mass 600 kg",
            WrongStart {
                mass_kg: WRONG_MASS_KG,
                speed_error_m_s: 0.0,
            },
        ),
        (
            "speed 1 m/s too high",
            WrongStart {
                mass_kg: 450.0,
                speed_error_m_s: 1.0,
            },
        ),
    ] {
        for listener in listeners(start, seed)? {
            let at = |time_s| {
                listener.at(time_s).map_or_else(String::new, |sample| {
                    let (belief, truth) = (&sample.belief, &sample.truth);
                    format!(
                        "{:.0} ± {:.0} kg, v {:+.2} ± {:.2} m/s",
                        belief.mass_kg,
                        belief.mass_std_kg,
                        belief.vehicle_speed_m_s - truth.vehicle_speed_m_s,
                        belief.vehicle_speed_std_m_s
                    )
                })
            };
            rows.push(vec![
                what.to_owned(),
                listener.name.to_owned(),
                at(0.1),
                at(0.5),
                at(2.0),
            ]);
        }
    }
    Ok(Table {
        head: [
            "wrong start",
            "filter",
            "after 0.1 s",
            "after 0.5 s",
            "after 2 s",
        ]
        .map(str::to_owned)
        .to_vec(),
        rows,
    })
}

/// A heading, what is said below it, and its table.
type Part = (&'static str, Vec<String>, Table);

/// All parts, for the report and the page alike.
fn parts(study: &Study) -> Result<Vec<Part>, SetupError> {
    let mistaken = format!(
        "A tuned filter that believes wet on a dry road stops in {:.2} times the distance (median), which is \
         why (f) needs more.",
        study.mistaken.median
    );
    let one = |text: &str| vec![words(text)];
    Ok(vec![
        (
            "The best stop",
            vec![words(ABOUT_SETUP), words(ABOUT_OPTIMUM)],
            study.references_table(),
        ),
        (
            "The comparison",
            vec![words(ABOUT_COMPARISON), words(ABOUT_UNKNOWN), mistaken],
            study.comparison_table(),
        ),
        (
            "Other speeds, dead time",
            vec![words(ABOUT_TUNING), words(ABOUT_WEAKNESS)],
            study.variants_table(),
        ),
        (
            "Monte Carlo",
            one(ABOUT_MONTE_CARLO),
            study.monte_carlo_table(),
        ),
        (
            "What a user meets on the first day",
            one(ABOUT_FAULTS),
            study.faults_table(),
        ),
        (
            "What wheel speed can tell",
            one(ABOUT_OBSERVABILITY),
            study.observability_table(),
        ),
        (
            "Wrong starts",
            one(
                "Filters that listen to one stop driven by another, prior ± 150 kg and ± 2 m/s where it is \
                 honest: the estimate with what the filter says of it, and the error of its speed. On an \
                 unknown road what is said of mass and speed is worth nothing, its sigma included.",
            ),
            wrong_starts_table(study.options.seed)?,
        ),
    ])
}

fn words(text: &str) -> String {
    let words: Vec<&str> = text.split_whitespace().collect();
    words.join(" ")
}

/// The report with the tables and all figures.
///
/// # Errors
/// As for [`figures`].
pub fn report_page(study: &Study) -> Result<Report, SetupError> {
    let of = |name: &str, who: super::study::Who, road: &str| {
        study
            .comparison
            .iter()
            .find(|row| row.who == who && row.road == road)
            .map(|row| KeyFigure {
                name: name.to_owned(),
                value: format!("{:.3}", row.ratios.median),
                remark: "distance over the best stop's".into(),
            })
    };
    let key_figures = [
        of("(c) dry", super::study::Who::Tuned, "dry"),
        of("(c) wet", super::study::Who::Tuned, "wet"),
        of(
            "(f) four channels, dry-wet-dry",
            super::study::Who::RigSought,
            "dry-wet-dry",
        ),
    ];
    let mut sections: Vec<Section> = Vec::new();
    for named in figures(study.options.seed)? {
        let block = Block::Figure(named.figure);
        match sections.last_mut() {
            Some(section) if section.heading == named.heading => section.blocks.push(block),
            _ => sections.push(Section {
                heading: named.heading.into(),
                blocks: vec![block],
            }),
        }
    }
    for (heading, paragraphs, table) in parts(study)? {
        let mut blocks: Vec<Block> = paragraphs.into_iter().map(Block::Paragraph).collect();
        blocks.push(Block::Table {
            head: table.head,
            rows: table.rows,
        });
        sections.push(Section {
            heading: heading.into(),
            blocks,
        });
    }
    Ok(Report {
        title: TITLE.into(),
        subject: SUBJECT.into(),
        verdict: study.verdict(),
        tone: if study.keeps_all() {
            Tone::Good
        } else {
            Tone::Warning
        },
        key_figures: key_figures.into_iter().flatten().collect(),
        sections,
        command: study.options.command(),
    })
}

/// `docs/quarter-car.md`: the tables with the command that prints them.
///
/// # Errors
/// As for [`figures`].
pub fn markdown(study: &Study) -> Result<String, SetupError> {
    let options = study.options;
    let mut page = format!(
        "# {TITLE}\n\n{}.\n\n{}\n\nThis page is written by the command below as \
         `muslip-quarter-car/quarter-car.md`, with the report and the figures beside it: {} stops of each \
         row, {} draws of the Monte Carlo, noise by ChaCha8 seeded from {}. The same arguments give the same \
         bytes whatever the number of cores.\n\n```\ncargo run --release -- quarter-car --seed {} --stops {} \
         --draws {}\n```\n",
        words(SUBJECT),
        study.verdict(),
        options.stops,
        options.draws,
        options.seed,
        options.seed,
        options.stops,
        options.draws
    );
    for (heading, paragraphs, table) in parts(study)? {
        page += &format!("\n## {heading}\n");
        for paragraph in paragraphs {
            page += &format!("\n{paragraph}\n");
        }
        page += &format!("\n{}", table.markdown());
    }
    Ok(page)
}
