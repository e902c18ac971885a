//! The report of a diagnosis: `report.html`.

use std::collections::BTreeMap;

use muslip_analysis::diagnose::wording::{
    NO_BREAK, least, mechanism_sentence, percent, quantity, quantity_apart, range, short_name,
    sigmas, significant, spoken, stretch, unexplained_sentence, unseen, variable, verdict_sentence,
    with_unit,
};
use muslip_analysis::wording::capitalised;
use muslip_diagnose::mechanism::Id;
use muslip_diagnose::outcome::{
    Diagnosis, Interval, MinimumDetectable, NamedMechanism, Role, Verdict,
};
use muslip_diagnose::repaired::RepairedTerm;

use super::blocks::{section, table};
use super::proof::proof;
use super::views::Views;
use super::{effects, plots};
use crate::guide;
use crate::page::{Block, KeyFigure, Report, Section, Tone};
use crate::table::{Cell, Row, Table};

/// Most rows of the tables that grow with the recordings.
const MOST_ROWS: usize = 24;
/// Most parameters of a mechanism's equation that are listed.
const MOST_PARAMETERS: usize = 6;

/// The report of a diagnosis. `command` is what made it.
#[must_use]
pub fn report(diagnosis: &Diagnosis, views: &Views, command: &str) -> Report {
    let sections = [
        chain(diagnosis),
        findings(diagnosis, views),
        comparison(diagnosis),
        proof(diagnosis),
        places(diagnosis, views),
        looked_for(diagnosis),
        data(diagnosis),
        names(diagnosis),
    ];
    Report {
        title: "Diagnosis".into(),
        subject: subject(diagnosis),
        verdict: verdict_sentence(diagnosis),
        tone: match diagnosis.verdict {
            Verdict::Consistent | Verdict::Explained => Tone::Good,
            Verdict::PartlyExplained | Verdict::Unexplained | Verdict::Undecided => Tone::Warning,
        },
        key_figures: key_figures(diagnosis),
        sections: sections
            .into_iter()
            .filter(|section| !section.blocks.is_empty())
            .collect(),
        command: command.to_owned(),
    }
}

fn subject(diagnosis: &Diagnosis) -> String {
    let recordings = &diagnosis.recordings;
    let samples: usize = recordings.iter().map(|r| r.samples).sum();
    let held_out = recordings
        .iter()
        .filter(|r| r.role == Role::Holdout)
        .count();
    let names: Vec<&str> = recordings.iter().map(|r| short_name(&r.path)).collect();
    let names = match names.as_slice() {
        [] => "no recording".to_owned(),
        [one] => (*one).to_owned(),
        [first, .., last] => format!("{} recordings ({first} to {last})", names.len()),
    };
    match held_out {
        0 => format!("{names}, {samples} samples"),
        held_out => format!("{names}, {samples} samples, {held_out} held out"),
    }
}

fn key_figures(diagnosis: &Diagnosis) -> Vec<KeyFigure> {
    let mut figures = Vec::new();
    let mut key = |name: &str, value: String, remark: String| {
        figures.push(KeyFigure {
            name: name.into(),
            value,
            remark,
        });
    };
    if let Some(first) = diagnosis.mechanisms.first()
        && let Some(figure) = first.parameters.first()
    {
        let (value, std) = quantity_apart(figure.value, figure.std, &figure.unit);
        key(
            &format!(
                "{}: {}",
                capitalised(&spoken(first.id)),
                spoken(&figure.name)
            ),
            value,
            format!(
                "{std} (1-sigma); confidence {}",
                percent(first.evidence.confidence)
            ),
        );
    }
    let holdout = &diagnosis.fit.holdout;
    if holdout.before.rmse_n > 0.0 && diagnosis.verdict != Verdict::Consistent {
        let share = 100.0 * (holdout.after.rmse_n / holdout.before.rmse_n - 1.0);
        let change = if share.abs() < 0.5 {
            "unchanged".to_owned()
        } else {
            format!("{share:+.0} %").replace('-', "\u{2212}")
        };
        key(
            "Held-out error of the drag",
            change,
            format!(
                "RMSE {} N to {} N",
                significant(holdout.before.rmse_n, 3),
                significant(holdout.after.rmse_n, 3)
            ),
        );
    }
    if let Some(noise) = diagnosis.noise.get("drag_force_n") {
        let declared = match noise.declared {
            Some(declared) => format!("1-sigma; declared {} N", significant(declared, 3)),
            None => "1-sigma; none declared".to_owned(),
        };
        key(
            "Noise of the drag",
            format!("{} N", significant(noise.sigma, 3)),
            declared,
        );
    }
    figures
}

/// What the measuring chain does; nothing where nothing was found.
fn chain(diagnosis: &Diagnosis) -> Section {
    let rows: Vec<[String; 4]> = diagnosis
        .chain
        .iter()
        .map(|finding| {
            let recording = match finding.recording.as_str() {
                "*" => "all",
                recording => short_name(recording),
            };
            [
                finding.channel.clone(),
                capitalised(&finding.statement),
                quantity(finding.value, finding.std, &finding.unit),
                recording.to_owned(),
            ]
        })
        .collect();
    if rows.is_empty() {
        return section("The measuring chain", Vec::new());
    }
    let head = ["channel", "what it does", "how much", "recording"];
    section("The measuring chain", vec![table(head, rows)])
}

/// Where the page says what a name means.
fn anchor(id: &str) -> String {
    format!("explain-{id}")
}

/// A name that leads to what it means.
fn linked(id: &str, text: String) -> Cell {
    Cell {
        target: Some(format!("#{}", anchor(id))),
        ..Cell::from(text)
    }
}

/// What the names mean: the field guide's sections of all that the page names.
fn names(diagnosis: &Diagnosis) -> Section {
    let mut blocks = Vec::new();
    for &id in Id::ALL {
        let word = id.as_str();
        let looked_for = diagnosis.looked_for.iter().any(|entry| entry.id == word);
        if !looked_for && !diagnosis.mechanisms.iter().any(|named| named.id == word) {
            continue;
        }
        let guide = guide::section(id);
        blocks.push(Block::Anchored {
            anchor: anchor(word),
            text: guide.title,
        });
        blocks.push(Block::Paragraph(guide.physics.to_owned()));
        let rows = guide.rows.into_iter().map(|row| {
            let text = match row.about {
                Some(about) => linked(about.as_str(), row.text),
                None => Cell::from(row.text),
            };
            vec![Cell::from(row.label.to_owned()), text]
        });
        blocks.push(Block::Folded {
            summary: "Equation, alternatives, and the tests that separate them".into(),
            table: of_cells(["", word], rows),
        });
    }
    section("What the names mean", blocks)
}

/// A table some of whose cells are links.
fn of_cells<const N: usize>(head: [&str; N], rows: impl IntoIterator<Item = Vec<Cell>>) -> Table {
    Table {
        head: head.map(str::to_owned).to_vec(),
        rows: rows
            .into_iter()
            .map(|cells| Row {
                cells,
                marked: false,
            })
            .collect(),
        sortable: false,
    }
}

fn findings(diagnosis: &Diagnosis, views: &Views) -> Section {
    let mut blocks = Vec::new();
    for mechanism in &diagnosis.mechanisms {
        blocks.push(Block::Paragraph(mechanism_sentence(mechanism)));
        let mut terms = diagnosis.found.tyre.iter().chain(&diagnosis.found.dynamics);
        let term = terms.find(|term| term.id == mechanism.id);
        blocks.push(mechanism_table(mechanism, term));
        blocks.push(Block::Link {
            text: format!("What {} is", spoken(mechanism.id)),
            target: format!("#{}", anchor(mechanism.id)),
        });
        blocks.extend(
            views
                .effect(mechanism.id)
                .iter()
                .cloned()
                .map(Block::Figure),
        );
    }
    for rest in &diagnosis.unexplained {
        blocks.push(Block::Paragraph(unexplained_sentence(rest)));
    }
    for correction in &diagnosis.repaired.corrections {
        if let (Some(low), Some(high)) = (correction.knots.first(), correction.knots.last()) {
            blocks.push(Block::Paragraph(format!(
                "The repaired model corrects the {} by a table of {} values over {}, {}; outside, the \
                 base law takes over, unless a mechanism stands beside it.",
                spoken(&correction.acts_on),
                correction.knots.len(),
                variable(&correction.variable),
                range(&correction.variable, *low, *high),
            )));
            blocks.extend(effects::correction(correction).map(Block::Figure));
        }
    }
    if blocks.is_empty() {
        blocks.push(Block::Paragraph(match diagnosis.verdict {
            Verdict::Undecided => {
                "Nothing could be compared: see the faults of the data below.".to_owned()
            }
            _ => {
                "Nothing. The smallest detectable effects are listed below, under \u{201c}What was \
                  looked for\u{201d}."
                    .to_owned()
            }
        }));
    }
    section("What is missing", blocks)
}

/// `term`: the mechanism as the repaired model has it.
fn mechanism_table(mechanism: &NamedMechanism, term: Option<&RepairedTerm>) -> Block {
    let mut rows = vec![["equation".to_owned(), mechanism.equation.clone()]];
    for figure in &mechanism.parameters {
        rows.push([
            spoken(&figure.name),
            quantity(figure.value, figure.std, &figure.unit),
        ]);
    }
    // Further parameters of the equation, unless they are the coefficients of a phase in every run.
    let reported = |name: &str| {
        mechanism
            .parameters
            .iter()
            .any(|figure| figure.name == name)
    };
    let further = term.map_or(&[][..], |term| &term.parameters);
    if further.len() <= MOST_PARAMETERS {
        let further = further.iter().filter(|further| !reported(&further.name));
        rows.extend(further.map(|further| {
            [
                format!("{} (model)", spoken(&further.name)),
                quantity(further.value, further.std, &further.unit),
            ]
        }));
    }
    let evidence = &mechanism.evidence;
    rows.push([
        "evidence".to_owned(),
        format!(
            "BIC falls by {}; log likelihood on held-out data gains {} per sample; effect {} sigma of the noise (rms)",
            significant(evidence.delta_bic, 3),
            significant(evidence.holdout_nll_gain_per_sample, 2),
            significant(mechanism.effect_sigma, 2),
        ),
    ]);
    let mut rows: Vec<Vec<Cell>> = rows
        .into_iter()
        .map(|row| row.map(Cell::from).to_vec())
        .collect();
    for other in &mechanism.confusable_with {
        let text = format!("{} ({})", spoken(other.id), percent(other.confidence));
        rows.push(vec![
            Cell::from("could also be".to_owned()),
            linked(other.id, text),
        ]);
    }
    if !mechanism.separating_test.trim().is_empty() {
        rows.push(vec![
            Cell::from("to tell apart".to_owned()),
            Cell::from(capitalised(mechanism.separating_test.trim())),
        ]);
    }
    let name = capitalised(&spoken(mechanism.id));
    let balance = format!("{} balance", mechanism.balance);
    Block::Table(of_cells([&name, &balance], rows))
}

fn comparison(diagnosis: &Diagnosis) -> Section {
    let mut blocks = Vec::new();
    let traces = plots::chosen(diagnosis);
    for trace in &traces {
        blocks.push(Block::Figure(plots::drag(diagnosis, trace)));
        blocks.push(Block::Figure(plots::remainder(diagnosis, trace)));
    }
    if !traces.is_empty() {
        blocks.push(Block::Figure(plots::against_slip(diagnosis)));
    }
    let left_out = diagnosis.traces.len().saturating_sub(traces.len());
    if left_out > 0 {
        let recordings = match left_out {
            1 => "1 more recording is".to_owned(),
            many => format!("{many} more recordings are"),
        };
        blocks.push(Block::Paragraph(format!(
            "{recordings} not drawn against time."
        )));
    }
    section("Before and after", blocks)
}

fn places(diagnosis: &Diagnosis, views: &Views) -> Section {
    let maps = views.over_slip_and_speed(diagnosis).into_iter();
    let maps = maps.chain(Views::over_time(diagnosis));
    let mut blocks: Vec<Block> = maps.map(Block::Figure).collect();
    if !diagnosis.regions.is_empty() {
        let rows = diagnosis
            .regions
            .iter()
            .map(|region| {
                [
                    region.balance.to_owned(),
                    variable(&region.variable),
                    range(&region.variable, region.low, region.high),
                    percent(region.share),
                    sigmas(region.z),
                ]
            })
            .collect();
        let head = [
            "balance",
            "operating region",
            "from, to",
            "share of the error",
            "sigma",
        ];
        blocks.push(table(head, rows));
    }
    if !diagnosis.r#where.is_empty() {
        let shown = strongest(&diagnosis.r#where);
        let rows: Vec<[String; 5]> = shown
            .iter()
            .map(|interval| {
                [
                    short_name(&interval.recording).to_owned(),
                    interval.balance.to_owned(),
                    interval.channel.clone(),
                    stretch(interval.start_s, interval.end_s),
                    sigmas(interval.z),
                ]
            })
            .collect();
        if shown.len() < diagnosis.r#where.len() {
            blocks.push(Block::Paragraph(format!(
                "The {} strongest of {} flagged intervals; diagnosis.json has all.",
                shown.len(),
                diagnosis.r#where.len()
            )));
        }
        blocks.push(Block::Folded {
            summary: "Flagged intervals as a table".into(),
            table: Table::new(["recording", "balance", "channel", "time", "sigma"], rows),
        });
    }
    section("Where", blocks)
}

/// The strongest intervals, in the order of the list.
fn strongest(intervals: &[Interval]) -> Vec<&Interval> {
    let mut order: Vec<usize> = (0..intervals.len()).collect();
    order.sort_by(|&a, &b| intervals[b].z.total_cmp(&intervals[a].z));
    order.truncate(MOST_ROWS);
    order.sort_unstable();
    order.into_iter().map(|index| &intervals[index]).collect()
}

/// The smallest effect that would have been seen, under its name.
fn smallest(effect: &MinimumDetectable) -> String {
    // A phase and a place are searched by parameters that have no name of their own.
    let numbered = |stem: &str| {
        let rest = effect.name.strip_prefix(stem);
        rest.is_some_and(|rest| rest.starts_with(|letter: char| letter.is_ascii_digit()))
    };
    let name = if numbered("cos") || numbered("sin") {
        "amplitude".to_owned()
    } else if numbered("change") {
        "change of friction".to_owned()
    } else {
        spoken(&effect.name)
    };
    format!("{name} {}", least(effect))
}

fn looked_for(diagnosis: &Diagnosis) -> Section {
    let (hidden, visible) = unseen(diagnosis);
    let what = |id: &str| Id::parse(id).map_or("", Id::what).to_owned();
    let mut rows: Vec<[String; 4]> = Vec::new();
    for entry in &diagnosis.looked_for {
        if diagnosis
            .mechanisms
            .iter()
            .any(|named| named.id == entry.id)
        {
            let effect = entry.minimum_detectable.as_ref();
            let effect = effect.map_or(String::new(), smallest);
            rows.push([spoken(entry.id), what(entry.id), "found".to_owned(), effect]);
        }
    }
    rows.extend(visible.iter().map(|(entry, effect)| {
        [
            spoken(entry.id),
            what(entry.id),
            format!("not{NO_BREAK}found"),
            smallest(effect),
        ]
    }));
    let unmeasured = diagnosis.looked_for.iter().filter(|entry| {
        entry.identifiable
            && entry.minimum_detectable.is_none()
            && !diagnosis
                .mechanisms
                .iter()
                .any(|named| named.id == entry.id)
    });
    rows.extend(unmeasured.map(|entry| {
        [
            spoken(entry.id),
            what(entry.id),
            format!("not{NO_BREAK}found"),
            "not known".to_owned(),
        ]
    }));
    rows.extend(hidden.iter().map(|entry| {
        [
            spoken(entry.id),
            what(entry.id),
            "cannot be identified in these recordings".to_owned(),
            String::new(),
        ]
    }));
    if rows.is_empty() {
        return section("What was looked for", Vec::new());
    }
    let head = [
        "mechanism",
        "what it is",
        "result",
        "smallest detectable effect",
    ];
    let ids: BTreeMap<String, &str> = diagnosis
        .looked_for
        .iter()
        .map(|entry| (spoken(entry.id), entry.id))
        .collect();
    let rows = rows.into_iter().map(|row| {
        let mut cells = row.map(Cell::from).to_vec();
        if let Some(name) = cells.first_mut()
            && let Some(id) = ids.get(&name.text)
        {
            *name = linked(id, name.text.clone());
        }
        cells
    });
    section(
        "What was looked for",
        vec![Block::Table(of_cells(head, rows))],
    )
}

fn data(diagnosis: &Diagnosis) -> Section {
    let mut blocks: Vec<Block> = diagnosis
        .caveats
        .iter()
        .map(|text| Block::Paragraph(text.clone()))
        .collect();
    let faults = &diagnosis.data_faults;
    if faults.is_empty() {
        blocks.push(Block::Paragraph(
            "No fault of the data was found.".to_owned(),
        ));
    } else {
        if faults.len() > MOST_ROWS {
            blocks.push(Block::Paragraph(format!(
                "The first {MOST_ROWS} of {} faults; diagnosis.json has all.",
                faults.len()
            )));
        }
        let rows = faults
            .iter()
            .take(MOST_ROWS)
            .map(|fault| {
                [
                    short_name(&fault.recording).to_owned(),
                    fault.channel.clone(),
                    stretch(fault.start_s, fault.end_s),
                    fault.what.clone(),
                ]
            })
            .collect();
        blocks.push(table(["recording", "channel", "time", "fault"], rows));
    }
    let rows = diagnosis
        .recordings
        .iter()
        .map(|recording| {
            let role = match recording.role {
                Role::Fit => "fitted",
                Role::Holdout => "held out",
            };
            [
                recording.path.clone(),
                with_unit(recording.samples.to_string(), ""),
                role.to_owned(),
            ]
        })
        .collect();
    blocks.push(table(["recording", "samples", "use"], rows));
    section("Data", blocks)
}
