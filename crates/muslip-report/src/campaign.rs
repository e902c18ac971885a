//! The campaign's page.

use muslip_analysis::campaign::{Campaign, Run};
use muslip_analysis::wording::plus_minus;

use crate::axis::{Axis, Extent};
use crate::figure::{Figure, Ink, Shape, ellipse};
use crate::page::{Block, KeyFigure, Report, Section, Tone};
use crate::table::{Cell, Row, Table};

/// The page that compares the runs and links to theirs. `rig` is the rig file as the user named it.
pub fn index(campaign: &Campaign, rig: &str, command: &str) -> Report {
    let standing_out = campaign.standing_out();
    let key = |name: &str, value: String, remark: &str| KeyFigure {
        name: name.into(),
        value,
        remark: remark.into(),
    };
    let (peak, peak_spread) = campaign.peak_friction;
    let (slip, slip_spread) = campaign.critical_slip;
    Report {
        title: "Campaign".into(),
        subject: format!("{} recordings of {rig}", campaign.runs.len()),
        verdict: campaign.verdict(),
        tone: if campaign.is_quiet() {
            Tone::Good
        } else {
            Tone::Warning
        },
        key_figures: vec![
            key(
                "Peak friction",
                plus_minus(peak, peak_spread),
                "median, 1-sigma scatter of the runs",
            ),
            key(
                "Critical slip (slip of the peak)",
                plus_minus(slip, slip_spread),
                "median, 1-sigma scatter of the runs",
            ),
            key(
                "Runs that stand out",
                format!("{standing_out} of {}", campaign.runs.len()),
                "beyond 3.5 robust sigma, or inconsistent",
            ),
        ],
        sections: vec![
            Section {
                heading: "Comparison of the runs".into(),
                blocks: figures(campaign).map(Block::Figure).into(),
            },
            Section {
                heading: "All runs".into(),
                blocks: vec![
                    Block::Paragraph(
                        "Click a column's head to sort. Marked runs lie more than 3.5 robust standard deviations \
                         from the median (their own uncertainty included), or are overconfident."
                            .into(),
                    ),
                    Block::Table(table(campaign)),
                ],
            },
        ],
        command: command.to_owned(),
    }
}

/// Most runs whose ellipses can be told apart.
const MOST_ELLIPSES: usize = 20;

fn figures(campaign: &Campaign) -> [Figure; 3] {
    let last = campaign.runs.len() as f64;
    let against_number = |caption: &str, label: &str, name: &str, of: fn(&Run) -> (f64, f64)| {
        let values = || {
            (1u32..)
                .zip(&campaign.runs)
                .map(|(n, run)| (f64::from(n), of(run)))
        };
        let bars = values()
            .flat_map(|(x, (value, std))| [(x, value - std), (x, value + std), (x, f64::NAN)])
            .collect();
        with_runs(
            Figure::new(
                caption,
                Axis::new("run, in the order given").over(Extent::Fixed(0.5, last + 0.5)),
                Axis::new(label),
            )
            .named(name)
            .with(Ink::Reference, "1-sigma", Shape::Line(bars)),
            campaign,
            &values()
                .map(|(x, (value, _))| (x, value))
                .collect::<Vec<_>>(),
        )
    };
    let peak = against_number(
        "Peak friction of each run with its 1-sigma.",
        "peak friction",
        "peak-friction",
        |run| run.peak_friction,
    )
    .with(Ink::Truth, "median", Shape::Level(campaign.peak_friction.0));
    let slip = against_number(
        "Critical slip of each run with its 1-sigma.",
        "critical slip",
        "critical-slip",
        |run| run.critical_slip,
    )
    .with(Ink::Truth, "median", Shape::Level(campaign.critical_slip.0));
    let points: Vec<(f64, f64)> = campaign
        .runs
        .iter()
        .map(|run| (run.critical_slip.0, run.peak_friction.0))
        .collect();
    let mut peaks = Figure::new(
        "Where the peaks lie.",
        Axis::new("critical slip"),
        Axis::new("peak friction"),
    )
    .named("peaks");
    if campaign.runs.len() <= MOST_ELLIPSES {
        peaks.caption = "Where the peaks lie, each with its 1-sigma ellipse.".into();
        let mut label = "1-sigma of a run";
        for run in &campaign.runs {
            let (slip, peak) = (run.critical_slip, run.peak_friction);
            let outline = ellipse((slip.0, peak.0), (slip.1, peak.1), run.correlation);
            peaks = peaks.with(Ink::Reference, label, Shape::Outline(outline));
            label = "";
        }
    }
    [peak, slip, with_runs(peaks, campaign, &points)]
}

/// The runs as points, those that stand out as markers.
fn with_runs(figure: Figure, campaign: &Campaign, points: &[(f64, f64)]) -> Figure {
    let usual = points
        .iter()
        .zip(&campaign.stands_out)
        .filter(|(_, words)| words.is_empty())
        .map(|(point, _)| *point)
        .collect();
    let mut figure = figure.with(Ink::Measured, "a run", Shape::Points(usual));
    let mut label = "stands out";
    for ((point, words), run) in points.iter().zip(&campaign.stands_out).zip(&campaign.runs) {
        if !words.is_empty() {
            let name = run.recording.file_stem().unwrap_or_default();
            let marker = Shape::Marker(*point, name.to_string_lossy().into_owned());
            figure = figure.with(Ink::Estimate, label, marker);
            label = "";
        }
    }
    figure
}

fn table(campaign: &Campaign) -> Table {
    let head = [
        "run",
        "recording",
        "peak friction",
        "1-sigma",
        "critical slip",
        "1-sigma",
        "mean NIS",
        "consistency",
        "samples used",
        "stands out in",
    ];
    let number = |value: f64, decimals: usize| Cell {
        text: format!("{value:.decimals$}").replace('-', "\u{2212}"),
        key: Some(value),
        target: None,
    };
    let rows = (1u32..)
        .zip(campaign.runs.iter().zip(&campaign.stands_out))
        .map(|(index, (run, words))| Row {
            cells: vec![
                number(f64::from(index), 0),
                Cell {
                    text: run.recording.display().to_string(),
                    key: None,
                    target: Some(run.page.clone()),
                },
                number(run.peak_friction.0, 5),
                number(run.peak_friction.1, 5),
                number(run.critical_slip.0, 5),
                number(run.critical_slip.1, 5),
                number(run.mean_nis, 3),
                Cell::from(run.verdict.word().to_owned()),
                number(run.used as f64, 0),
                Cell::from(words.join(", ")),
            ],
            marked: !words.is_empty(),
        });
    Table {
        head: head.map(str::to_owned).into(),
        rows: rows.collect(),
        sortable: true,
    }
}
