//! The page of a fleet: many recordings of many rigs.

use muslip_analysis::wording::plus_minus;
use serde::Deserialize;

use crate::axis::{Axis, Extent};
use crate::figure::{Figure, Ink, Shape};
use crate::page::{Block, KeyFigure, Report, Section, Tone};
use crate::table::{Cell, Row, Table};

/// What a fleet says as a whole; `muslip.fleet.summary` of the Python package works it out.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Fleet {
    /// Recordings there are.
    pub recordings: u64,
    /// Those with an estimate.
    pub estimated: u64,
    /// Reasons why others have none, with the number of recordings, most frequent first.
    pub errors: serde_json::Map<String, serde_json::Value>,
    /// Pooled over all.
    pub peak_friction: Quantity,
    /// Pooled over all.
    pub critical_slip: Quantity,
    /// By rig, tyre, track.
    pub factors: Vec<Factor>,
    /// The way of rigs over days.
    pub drifts: Vec<Drift>,
    /// Recordings that stand out, the furthest first.
    pub outliers: Vec<Outlier>,
    /// How often each mechanism is named.
    pub mechanisms: Vec<Frequency>,
    /// Every recording with an estimate.
    pub points: Points,
}

/// A value with its 1-sigma.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct Quantity {
    /// The value.
    pub value: f64,
    /// Its 1-sigma.
    pub std: f64,
}

/// Estimates pooled over the levels of a factor as random effects.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Factor {
    /// `rig`, `tyre` or `track`.
    pub name: String,
    /// `peak_friction` or `critical_slip`.
    pub quantity: String,
    /// One a rig, tyre or track.
    pub levels: Vec<Level>,
    /// Mean of the levels.
    pub mean: Quantity,
    /// Scatter of their true means.
    pub between: f64,
    /// The same with the other factors in the model.
    pub crossed: Option<f64>,
}

/// One rig, tyre or track.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Level {
    /// Its name.
    pub name: String,
    /// How many recordings.
    pub recordings: u64,
    /// Their mean.
    pub mean: Quantity,
    /// Their scatter beyond their own uncertainty.
    pub scatter: f64,
}

/// The way of a rig over days.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Drift {
    /// The rig.
    pub rig: String,
    /// Peak friction a day.
    pub per_day: Quantity,
    /// Probability of as much by chance, corrected for the number of rigs.
    pub p: f64,
    /// Days with recordings.
    pub days: u64,
    /// Whether it is called so.
    pub drifts: bool,
    /// Day, mean of the day, 1-sigma of that.
    pub course: Vec<(String, f64, f64)>,
}

/// A recording that stands out.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Outlier {
    /// The recording.
    pub path: String,
    /// `peak_friction` or `critical_slip`.
    pub quantity: String,
    /// Its estimate.
    pub value: Quantity,
    /// Median of those like it.
    pub median: f64,
    /// How far from that, in robust sigma.
    pub sigmas: f64,
}

/// How often a mechanism is named.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Frequency {
    /// Its id.
    pub mechanism: String,
    /// In so many diagnoses.
    pub named: u64,
    /// Of so many.
    pub diagnoses: u64,
    /// Lower end of the 95 % interval of the share.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Mean confidence.
    pub confidence: f64,
}

/// The estimates of all recordings, in one order.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Points {
    /// Of each.
    pub peak_friction: Vec<f64>,
    /// Of each.
    pub critical_slip: Vec<f64>,
}

/// Most rows of a table: all of them are in the data set.
const MOST_ROWS: usize = 200;
/// Most rigs whose way over days is drawn.
const MOST_COURSES: usize = 6;
/// Most levels that are told apart in a figure.
const MOST_LEVELS: usize = 60;

impl Fleet {
    /// The page. `results` is the data set as the user named it.
    pub fn page(&self, results: &str, command: &str) -> Report {
        let failed = self.recordings.saturating_sub(self.estimated);
        let drifting = self.drifts.iter().filter(|drift| drift.drifts).count();
        let is_quiet = failed == 0 && drifting == 0 && self.outliers.is_empty();
        let mut sections = vec![self.peaks()];
        sections.extend(self.pooled());
        sections.extend(self.over_days());
        sections.extend(self.diagnosed());
        sections.extend(self.standing_out());
        sections.extend(self.failed());
        let key = |name: &str, value: String, remark: String| KeyFigure {
            name: name.into(),
            value,
            remark,
        };
        Report {
            title: "Fleet".into(),
            subject: format!("{} recordings in {results}", self.recordings),
            verdict: self.verdict(failed, drifting),
            tone: if is_quiet { Tone::Good } else { Tone::Warning },
            key_figures: vec![
                key(
                    "Peak friction",
                    plus_minus(self.peak_friction.value, self.peak_friction.std),
                    "mean of all recordings as random effects".into(),
                ),
                key(
                    "Critical slip (slip of the peak)",
                    plus_minus(self.critical_slip.value, self.critical_slip.std),
                    "mean of all recordings as random effects".into(),
                ),
                key(
                    "Rigs that drift",
                    format!("{drifting} of {}", self.drifts.len()),
                    "of those with five days or more".into(),
                ),
                key(
                    "Recordings without an estimate",
                    format!("{failed} of {}", self.recordings),
                    "each has its reason in the data set".into(),
                ),
            ],
            sections,
            command: command.to_owned(),
        }
    }

    fn verdict(&self, failed: u64, drifting: usize) -> String {
        let mut parts = Vec::new();
        let plural = |count: u64, one: &str, many: &str| match count {
            1 => format!("1 {one}"),
            _ => format!("{count} {many}"),
        };
        if drifting > 0 {
            parts.push(plural(drifting as u64, "rig drifts", "rigs drift"));
        }
        if !self.outliers.is_empty() {
            let count = self.outliers.len() as u64;
            parts.push(plural(count, "estimate stands out", "estimates stand out"));
        }
        if failed > 0 {
            parts.push(plural(
                failed,
                "recording has no estimate",
                "recordings have no estimate",
            ));
        }
        match parts.as_slice() {
            [] => "No rig drifts, nothing stands out, and every recording has an estimate.".into(),
            _ => format!("Of {} recordings: {}.", self.recordings, parts.join(", ")),
        }
    }

    fn peaks(&self) -> Section {
        let points = &self.points;
        let peaks: Vec<(f64, f64)> = points
            .critical_slip
            .iter()
            .copied()
            .zip(points.peak_friction.iter().copied())
            .collect();
        let caption = "Where the peaks of all recordings lie.";
        let figure = Figure::new(
            caption,
            Axis::new("critical slip"),
            Axis::new("peak friction"),
        )
        .with(Ink::Measured, "a recording", Shape::Points(peaks));
        Section {
            heading: "All recordings".into(),
            blocks: vec![
                Block::Figure(figure),
                Block::Figure(shares(
                    "How peak friction is spread over the recordings.",
                    "peak friction",
                    &points.peak_friction,
                )),
            ],
        }
    }

    fn pooled(&self) -> Option<Section> {
        if self.factors.is_empty() {
            return None;
        }
        let mut blocks = vec![Block::Paragraph(
            "Means of random effects, each with its 1-sigma: the recordings of one rig, tyre or track scatter by their own uncertainty and by \
             more, and so do the rigs, tyres and tracks. The last column has the other factors in the same model, so that a rig is not charged \
             with the tyres that it happened to test."
                .into(),
        )];
        let rows = self.factors.iter().map(|factor| {
            vec![
                quantity_word(&factor.quantity),
                factor.name.clone(),
                factor.levels.len().to_string(),
                plus_minus(factor.mean.value, factor.mean.std),
                format!("{:.4}", factor.between),
                factor
                    .crossed
                    .map_or("\u{2013}".into(), |crossed| format!("{crossed:.4}")),
            ]
        });
        blocks.push(Block::Table(Table::new(
            [
                "of",
                "over",
                "how many",
                "mean",
                "scatter between",
                "of its own",
            ],
            rows,
        )));
        blocks.extend(self.factors.iter().map(|f| Block::Figure(forest(f))));
        blocks.extend(self.factors.iter().map(|factor| Block::Folded {
            summary: format!("{} by {}", quantity_word(&factor.quantity), factor.name),
            table: levels(factor),
        }));
        Some(Section {
            heading: "By rig, tyre and track".into(),
            blocks,
        })
    }

    fn over_days(&self) -> Option<Section> {
        if self.drifts.is_empty() {
            return None;
        }
        let mut by_size: Vec<&Drift> = self.drifts.iter().collect();
        by_size.sort_by(|a, b| a.p.total_cmp(&b.p));
        let mut blocks = vec![Block::Paragraph(
            "A straight line through the means of the days, each tyre and track counted from its own mean. A rig is called drifting where the \
             probability of such a line by chance, corrected for the number of rigs, is below 0.01."
                .into(),
        )];
        blocks.extend(
            by_size
                .iter()
                .filter(|drift| drift.drifts)
                .take(MOST_COURSES)
                .map(|drift| Block::Figure(course(drift))),
        );
        let rows = by_size.iter().take(MOST_ROWS).map(|drift| Row {
            cells: vec![
                Cell::from(drift.rig.clone()),
                number(1000.0 * drift.per_day.value, 4),
                number(1000.0 * drift.per_day.std, 4),
                number(drift.p, 5),
                number(drift.days as f64, 0),
            ],
            marked: drift.drifts,
        });
        blocks.push(Block::Table(Table {
            head: ["rig", "peak friction in 1,000 days", "1-sigma", "p", "days"]
                .map(str::to_owned)
                .into(),
            rows: rows.collect(),
            sortable: true,
        }));
        Some(Section {
            heading: "Rigs over days".into(),
            blocks,
        })
    }

    fn diagnosed(&self) -> Option<Section> {
        let diagnoses = self.mechanisms.first()?.diagnoses;
        let rows = self.mechanisms.iter().map(|one| Row {
            cells: vec![
                Cell::from(one.mechanism.clone()),
                number(one.named as f64, 0),
                number(100.0 * one.named as f64 / one.diagnoses.max(1) as f64, 1),
                Cell::from(format!("{:.1} to {:.1}", 100.0 * one.low, 100.0 * one.high)),
                number(one.confidence, 2),
            ],
            marked: false,
        });
        Some(Section {
            heading: "Mechanisms".into(),
            blocks: vec![
                Block::Paragraph(format!(
                    "What {diagnoses} diagnoses name; 95 % intervals (Wilson)."
                )),
                Block::Table(Table {
                    head: ["mechanism", "diagnoses", "%", "95 %", "mean confidence"]
                        .map(str::to_owned)
                        .into(),
                    rows: rows.collect(),
                    sortable: true,
                }),
            ],
        })
    }

    fn standing_out(&self) -> Option<Section> {
        if self.outliers.is_empty() {
            return None;
        }
        let rows = self.outliers.iter().take(MOST_ROWS).map(|one| Row {
            cells: vec![
                Cell::from(one.path.clone()),
                Cell::from(quantity_word(&one.quantity)),
                number(one.value.value, 5),
                number(one.value.std, 5),
                number(one.median, 5),
                number(one.sigmas, 1),
            ],
            marked: false,
        });
        Some(Section {
            heading: "Recordings that stand out".into(),
            blocks: vec![
                Block::Paragraph(format!(
                    "More than 3.5 robust standard deviations from the median of the same rig, tyre and track, their own uncertainty included: \
                     {} of {}, of which here are {}, the furthest first.",
                    self.outliers.len(),
                    self.estimated,
                    self.outliers.len().min(MOST_ROWS)
                )),
                Block::Table(Table {
                    head: [
                        "recording",
                        "estimate of",
                        "value",
                        "1-sigma",
                        "median",
                        "sigma from it",
                    ]
                    .map(str::to_owned)
                    .into(),
                    rows: rows.collect(),
                    sortable: true,
                }),
            ],
        })
    }

    fn failed(&self) -> Option<Section> {
        if self.errors.is_empty() {
            return None;
        }
        let rows =
            self.errors.iter().take(MOST_ROWS).map(|(why, count)| {
                vec![why.clone(), count.as_u64().unwrap_or_default().to_string()]
            });
        Some(Section {
            heading: "Recordings without an estimate".into(),
            blocks: vec![Block::Table(Table::new(["reason", "recordings"], rows))],
        })
    }
}

fn quantity_word(key: &str) -> String {
    key.replace('_', " ")
}

fn number(value: f64, decimals: usize) -> Cell {
    Cell {
        text: format!("{value:.decimals$}").replace('-', "\u{2212}"),
        key: Some(value),
        target: None,
    }
}

/// A histogram as the outline of its bars.
fn shares(caption: &str, label: &str, values: &[f64]) -> Figure {
    const BARS: usize = 60;
    let figure = Figure::new(
        caption,
        Axis::new(label),
        Axis::new("recordings").over(Extent::Including(0.0)),
    );
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if low >= high {
        return figure;
    }
    let width = (high - low) / BARS as f64;
    let mut counts = [0_u64; BARS];
    for value in values {
        let bar = ((value - low) / width) as usize;
        if let Some(count) = counts.get_mut(bar.min(BARS - 1)) {
            *count += 1;
        }
    }
    let outline = counts.iter().enumerate().flat_map(|(bar, &count)| {
        let from = low + bar as f64 * width;
        [(from, count as f64), (from + width, count as f64)]
    });
    let outline = [(low, 0.0)]
        .into_iter()
        .chain(outline)
        .chain([(high, 0.0)])
        .collect();
    figure.with(Ink::Measured, "recordings", Shape::Outline(outline))
}

/// The levels of a factor in the order of their means, each with its 1-sigma.
fn forest(factor: &Factor) -> Figure {
    let mut ordered: Vec<&Level> = factor.levels.iter().collect();
    ordered.sort_by(|a, b| a.mean.value.total_cmp(&b.mean.value));
    let stride = ordered.len().div_ceil(MOST_LEVELS).max(1);
    let kept: Vec<(f64, &Level)> = (1_u32..)
        .map(f64::from)
        .zip(ordered.into_iter().step_by(stride))
        .collect();
    let last = kept.len() as f64;
    let bars = kept.iter().flat_map(|&(at, level)| {
        let Quantity { value, std } = level.mean;
        [(at, value - std), (at, value + std), (at, f64::NAN)]
    });
    let quantity = quantity_word(&factor.quantity);
    let caption = match stride {
        1 => format!(
            "{quantity} of each {}, with its 1-sigma, in the order of size; dashed: the mean of them.",
            factor.name
        ),
        _ => format!(
            "{quantity} of every {stride}th {} in the order of size, with its 1-sigma; dashed: the mean of all.",
            factor.name
        ),
    };
    Figure::new(
        capital(&caption),
        Axis::new(format!("{}, in the order of size", factor.name))
            .over(Extent::Fixed(0.5, last + 0.5)),
        Axis::new(quantity),
    )
    .with(Ink::Reference, "1-sigma", Shape::Line(bars.collect()))
    .with(
        Ink::Measured,
        format!("a {}", factor.name),
        Shape::Points(kept.iter().map(|&(at, l)| (at, l.mean.value)).collect()),
    )
    .with(Ink::Truth, "mean", Shape::Level(factor.mean.value))
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

fn levels(factor: &Factor) -> Table {
    let rows = factor.levels.iter().take(MOST_ROWS).map(|level| Row {
        cells: vec![
            Cell::from(level.name.clone()),
            number(level.recordings as f64, 0),
            number(level.mean.value, 5),
            number(level.mean.std, 5),
            number(level.scatter, 5),
        ],
        marked: false,
    });
    Table {
        head: [
            factor.name.as_str(),
            "recordings",
            "mean",
            "1-sigma",
            "scatter of its recordings",
        ]
        .map(str::to_owned)
        .into(),
        rows: rows.collect(),
        sortable: true,
    }
}

fn course(drift: &Drift) -> Figure {
    let at = |index: usize| index as f64 + 1.0;
    let days = drift.course.iter().enumerate();
    let bars = days.clone().flat_map(|(index, &(_, mean, std))| {
        [
            (at(index), mean - std),
            (at(index), mean + std),
            (at(index), f64::NAN),
        ]
    });
    let first = drift.course.first().map_or("", |day| day.0.as_str());
    let last = drift.course.last().map_or("", |day| day.0.as_str());
    Figure::new(
        format!(
            "Rig {}: peak friction of each day with its 1-sigma.",
            drift.rig
        ),
        Axis::new(format!("day of {}, {first} to {last}", drift.days)),
        Axis::new("peak friction"),
    )
    .with(Ink::Reference, "1-sigma", Shape::Line(bars.collect()))
    .with(
        Ink::Measured,
        "a day",
        Shape::Points(days.map(|(index, day)| (at(index), day.1)).collect()),
    )
}
