//! The report and the page of the documentation.

use muslip_report::text::Table;
use muslip_report::{Block, KeyFigure, Report, Section, Tone};

use super::error::SetupError;
use super::figures::{WRONG_MASS_KG, figures};
use super::observability::{WrongStart, listeners};
use super::scenario::FOREIGN_RELAXATION_M;
use super::study::Study;
use super::surface::Surface;
use super::who::Who;

const TITLE: &str = "Slip control of a braked quarter car";
const SUBJECT: &str = "after P. Goddard, Using an Extended Kalman Filter for Estimating Vehicle \
                       Dynamics and Mass";

const ABOUT_SETUP: &str = "Quarter car of 450 kg on a wheel of 0.30 m and 1 kg m², from 30 m/s to 1 m/s; \
    brake 0 to 3 kN m at 20 kN m/s; samples every 5 ms; wheel speed with noise of 0.1 rad/s (1 sigma), on \
    the rig vehicle speed 0.02 m/s, drag 90 N, normal force 20 N. Burckhardt's dry asphalt, wet asphalt and \
    snow, and dry with wet from 15 to 30 m. The plant is integrated with steps of 0.25 ms, the loop runs on \
    estimates.";

const ABOUT_OPTIMUM: &str = "(e) is the best stop found of an actuator with these limits, driven by one who \
    knows everything beforehand: torque rises at the full rate, falls at the full rate until the peak's slip is \
    met, holds it, and starts before each edge of the road; the times are searched for. The best constant slip \
    is held by the same hand without the overshoot.";

const ABOUT_BOUND: &str = "How near (e) is to the true optimum: no torque history can stop shorter than the \
    bound. On the road friction is at most the peak's, so speed falls by at most g μp a second. While torque \
    rises from zero at its rate r, momentum bounds it as well: J dω/dt = R F − T and m dv/dt = −F, with R ω ≤ v \
    throughout (slip starts at zero, where the brake can only raise it), give (m + J/R²)(v0 − v) ≤ ∫T dt / R ≤ \
    r t²/(2 R). With A = r/(R (m + J/R²)) speed is therefore at least v0 − A t²/2 until t = g μp/A, and falls by \
    at most g μp a second from then on; whoever is at least as fast at every instant is at least as fast at \
    every place, so the argument goes on over the patches. The optimum that nobody knows lies between the bound \
    and (e): a ratio in these tables could grow by no more than 1 over the second column.";

const ABOUT_FOREIGN: &str = "Told the nearest law of its own kind, the filter stops on dry and wet as well as \
    on its own tyre: what it needs is the curve's rise and peak, not its form. On snow this tyre's peak lies at slip \
    0.31, beyond the seeker's ceiling of 0.18 (chosen for peaks like those of the published sets), which costs the four \
    channels almost a fifth, and their bar; the tuned filter's speed drifts over that long stop until the wheel \
    slides deep, which costs little only because this curve hardly falls past its peak. The bank is the most \
    fragile: friction of 0.30 lies between its 0.19 and 0.80, and none of its roads fits.";

const ABOUT_COMPARISON: &str = "Distance over that of (e), median and worst of the stops. Near the peak: \
    share of the time with at least 95 % of the peak friction of the road under the wheel; deep slip: with \
    more than twice the peak's slip; locked: the longest time above 3 m/s. Setpoint: 0.9 of the known peak's \
    slip. The controller is the same in all rows: bandwidth 40 rad/s, integral time 0.25 s.";

const ABOUT_UNKNOWN: &str = "What (f) needs. Four channels: nothing but their readings; \"peak sought\" holds \
    0.9 of the critical slip that the two-state filter finds while braking, and 0.12 until its standard \
    deviation is below 15 %; a fixed 0.12 lies so well between these three peaks that it does better than \
    the search here, which it would not on a road with another peak. Wheel speed alone: that the road is one \
    of the bank's three, and the mass to about 5 % (why, below the Monte Carlo).";

const ABOUT_MASS: &str = "Why an unknown mass spoils wheel speed alone in the worst tenth: of friction and mass the wheel's \
    equation holds the product alone, and vehicle speed, which friction moves without the mass, reaches \
    the wheel through the slope of the curve, which is zero where the controller wants to be (two \
    directions of five are seen with the road unknown, see below). At the peak a car on dry asphalt \
    reads like one 1.46 times as heavy on wet asphalt, that being the ratio of 1.17 and 0.80. So there \
    the prior on mass alone tells the two roads apart, and only where it excludes such a pair: (1 + \
    d)/(1 − d) < 1.46, a mass known to 18.7 %. Snow, 4.2 times below wet, is always told. What decides \
    within ±30 % is the short rise below the peak, where the curves' shapes differ, and it is noisy. \
    Tried: the same bank with an honest prior (78 kg, the spread of ±30 %). On wet asphalt and snow it \
    is a little better, on dry asphalt and through the step its median more than doubles, for every road \
    is then free to explain the readings by a mass of its own; the narrow prior is wrong about the mass, \
    but keeps the roads apart. Short releases of the brake that probe for the vehicle's speed were tried \
    before and did not help. What does help is a weighed car, vehicle speed or normal force; drag is the \
    same product again.";

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
    let median = study.mistaken.median;
    let stops = if median.is_finite() {
        format!("stops in {median:.2} times the distance (median)")
    } else {
        "does not stop (median)".to_owned()
    };
    let mistaken = format!(
        "A tuned filter that believes wet on a dry road {stops}, which is why (f) needs more."
    );
    let one = |text: &str| vec![words(text)];
    Ok(vec![
        (
            "The best stop",
            vec![words(ABOUT_SETUP), words(ABOUT_OPTIMUM), words(ABOUT_BOUND)],
            study.references_table(),
        ),
        (
            "The comparison",
            vec![words(ABOUT_COMPARISON), words(ABOUT_UNKNOWN), mistaken],
            study.comparison_table(),
        ),
        (
            "Another tyre in the plant",
            vec![
                about_foreign(),
                study.foreign_verdict(),
                words(ABOUT_FOREIGN),
            ],
            study.foreign_references_table(),
        ),
        ("The comparison on it", Vec::new(), study.foreign_table()),
        (
            "Other speeds, dead time",
            vec![words(ABOUT_TUNING), words(ABOUT_WEAKNESS)],
            study.variants_table(),
        ),
        (
            "Monte Carlo",
            vec![words(ABOUT_MONTE_CARLO), words(ABOUT_MASS)],
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

/// What the foreign tyre is, with how near a filter's law comes to it.
fn about_foreign() -> String {
    let told: Vec<String> = Surface::magic()
        .iter()
        .zip(["dry", "wet", "snow"])
        .map(|(surface, name)| {
            let (c1, c2, c3) = surface.told.coefficients();
            format!(
                "{name}: {} told as {c1:.3}, {c2:.2}, {c3:.3}, misfit {:.3}",
                surface.truth,
                surface.misfit()
            )
        })
        .collect();
    format!(
        "Above, filter and plant share Burckhardt's law. Here the plant has the Magic Formula with MathWorks' common \
         coefficients for dry and wet tarmac and snow, and its force follows slip over a relaxation length of \
         {FOREIGN_RELAXATION_M} m. A filter that knows the road is told the Burckhardt law of least squares over slip \
         up to 0.4 ({}), which has neither the shape nor the lag; the bank is told nothing and keeps the three \
         published sets. Nothing was tuned on it.",
        told.join("; ")
    )
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
    let of = |name: &str, who: Who, road: &str| {
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
        of("(c) dry", Who::Tuned, "dry"),
        of("(c) wet", Who::Tuned, "wet"),
        of(
            "(f) four channels, dry-wet-dry",
            Who::RigSought,
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
        blocks.push(Block::Table(muslip_report::Table::new(
            table.head, table.rows,
        )));
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
         `study-quarter-car/quarter-car.md`, with the report and the figures beside it: {} stops of each \
         row, {} draws of the Monte Carlo, noise by ChaCha8 seeded from {}. The same arguments give the same \
         bytes whatever the number of cores.\n\n```\n{}\n```\n",
        words(SUBJECT),
        study.verdict(),
        options.stops,
        options.draws,
        options.seed,
        options.command()
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
