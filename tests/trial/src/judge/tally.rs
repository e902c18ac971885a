//! From judged campaigns to the figures of the trial, each with its confidence.

use std::collections::BTreeMap;

use crate::generate::form::{OUTSIDE, VOCABULARY};
use crate::judge::case::{BAR_STRENGTH, Case};
use crate::judge::findings::FindingCase;
use crate::share::{Share, mean, percent, quantile};
use crate::table::Table;

/// Cases of a stratum.
pub fn of<'a>(cases: &'a [Case], stratum: &'a str) -> impl Iterator<Item = &'a Case> + Clone {
    cases.iter().filter(move |case| case.stratum == stratum)
}

/// Single effects but for those that the chain before them has as well.
pub fn single(cases: &[Case]) -> impl Iterator<Item = &Case> + Clone {
    of(cases, "single").filter(|case| !case.of_the_chain)
}

/// Of these, strong enough for the bars.
pub fn strong(cases: &[Case]) -> impl Iterator<Item = &Case> + Clone {
    single(cases).filter(|case| case.weakest() >= BAR_STRENGTH)
}

/// Shares of the oracle's gain on all fresh runs on which it means anything.
pub fn shares(cases: &[Case]) -> Vec<f64> {
    cases
        .iter()
        .flat_map(|case| case.gains.iter().filter_map(|gain| gain.share))
        .collect()
}

/// False alarms by sort of null campaign.
pub fn nulls(cases: &[Case]) -> Table {
    let mut table = Table::new(
        "False names by sort of null campaign",
        &[
            "nothing missing",
            "false names",
            "95 % interval",
            "n",
            "what was named, and how often",
        ],
    );
    let mut groups: BTreeMap<String, Vec<&Case>> = BTreeMap::new();
    for case in of(cases, "null") {
        let keys = if case.real_chain {
            vec![
                format!("real chain, wheel {}", case.wheel_sensor),
                format!("real chain, vehicle {}", case.vehicle_sensor),
            ]
        } else {
            vec![format!("ideal sensors, {}", case.kind)]
        };
        for key in keys {
            groups.entry(key).or_default().push(case);
        }
    }
    for (kind, group) in groups {
        let share = Share::count(group.iter(), |case| case.false_physics);
        let [value, interval, n] = share.cells();
        table.row([
            kind,
            value,
            interval,
            n,
            most_frequent(group.iter().flat_map(|case| {
                case.named
                    .iter()
                    .filter(|named| !named.right)
                    .map(|named| named.id.as_str())
            })),
        ]);
    }
    table
}

/// Words with their counts, the most frequent first, at most eight.
pub fn most_frequent<'a>(words: impl Iterator<Item = &'a str>) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for word in words {
        *counts.entry(word).or_default() += 1;
    }
    let mut ranked: Vec<(&str, usize)> = counts.into_iter().collect();
    ranked.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(b.0)));
    let told: Vec<String> = ranked
        .iter()
        .take(8)
        .map(|(word, count)| format!("{word} {count}"))
        .collect();
    told.join(", ")
}

/// One effect of the chain alone: whether `chain` says so, and what was named instead.
pub fn chains(cases: &[Case]) -> Table {
    let mut table = Table::new(
        "One effect of the measuring chain alone",
        &[
            "effect",
            "found",
            "value within 20 % or 2 ms",
            "n",
            "false names",
            "named",
        ],
    );
    let mut groups: BTreeMap<&str, Vec<&Case>> = BTreeMap::new();
    for case in of(cases, "chain") {
        groups.entry(case.kind.as_str()).or_default().push(case);
    }
    for (kind, group) in groups {
        let with = |condition: &dyn Fn(&FindingCase) -> bool| {
            let share = Share::count(group.iter(), |case| {
                case.finding.as_ref().is_some_and(condition)
            });
            share.hits.to_string()
        };
        table.row([
            kind.to_owned(),
            with(&|finding| finding.reported.is_some()),
            with(&|finding| finding.right),
            group.len().to_string(),
            percent(Share::count(group.iter(), |case| case.false_physics).value()),
            most_frequent(
                group
                    .iter()
                    .flat_map(|case| case.named.iter().map(|named| named.id.as_str())),
            ),
        ]);
    }
    table
}

/// Each mechanism: found first, in the set, figures, gain and place.
pub fn mechanisms(cases: &[Case]) -> Table {
    let mut table = Table::new(
        "Single effects from 0.6 sigma, by mechanism",
        &[
            "mechanism",
            "first",
            "in set",
            "n",
            "figures within 3 std",
            "gain, median",
            "worst",
            "IoU",
        ],
    );
    for (id, _, _) in VOCABULARY {
        let group: Vec<&Case> = strong(cases)
            .filter(|case| case.truth.first().is_some_and(|truth| truth == id))
            .collect();
        if group.is_empty() {
            continue;
        }
        let first = Share::count(group.iter(), |case| case.first_right);
        let in_set = Share::count(group.iter(), |case| case.in_set);
        let figures = Share::count(group.iter().flat_map(|case| &case.figures), |figure| {
            figure.pull.abs() <= 3.0
        });
        let gained: Vec<f64> = group
            .iter()
            .flat_map(|case| case.gains.iter().filter_map(|gain| gain.share))
            .collect();
        let overlaps: Vec<f64> = group.iter().filter_map(|case| case.iou).collect();
        let or_dash = |value: f64| {
            if value.is_nan() {
                "-".to_owned()
            } else {
                format!("{value:.2}")
            }
        };
        table.row([
            id.to_owned(),
            percent(first.value()),
            percent(in_set.value()),
            group.len().to_string(),
            format!("{}/{}", figures.hits, figures.of),
            or_dash(quantile(&gained, 0.5)),
            or_dash(quantile(&gained, 0.0)),
            or_dash(if overlaps.is_empty() {
                f64::NAN
            } else {
                mean(&overlaps).0
            }),
        ]);
    }
    table
}

/// Found against strength, single effects.
pub fn strengths(cases: &[Case]) -> Table {
    let mut table = Table::new(
        "Single effects by size",
        &[
            "sigma RMS after refit",
            "named first",
            "in set",
            "said nothing",
            "n",
        ],
    );
    for (low, high) in [
        (0.0, 0.25),
        (0.25, 0.45),
        (0.45, 0.8),
        (0.8, 1.5),
        (1.5, 3.0),
        (3.0, 99.0),
    ] {
        let group: Vec<&Case> = single(cases)
            .filter(|case| (low..high).contains(&case.weakest()))
            .collect();
        if group.is_empty() {
            continue;
        }
        let part = |condition: &dyn Fn(&&Case) -> bool| {
            percent(Share::count(group.iter().copied(), condition).value())
        };
        table.row([
            format!("{low}..{high}"),
            part(&|case| case.first_right),
            part(&|case| case.in_set),
            part(&|case| case.verdict == "consistent"),
            group.len().to_string(),
        ]);
    }
    table
}

/// Effects outside the vocabulary.
pub fn outside(cases: &[Case]) -> Table {
    let mut table = Table::new(
        "Effects outside the vocabulary",
        &[
            "effect",
            "says so",
            "right variable",
            "n",
            "variables given",
            "named",
        ],
    );
    for (form, _, _) in OUTSIDE {
        let name = serde_json::to_value(form)
            .ok()
            .and_then(|value| value.as_str().map(str::to_owned))
            .unwrap_or_default();
        let group: Vec<&Case> = of(cases, "outside")
            .filter(|case| case.forms.contains(&name))
            .collect();
        if group.is_empty() {
            continue;
        }
        let listed = |mut words: Vec<&str>| {
            words.sort_unstable();
            words.dedup();
            words.join(", ")
        };
        table.row([
            name,
            format!("{}", Share::count(group.iter(), |case| case.honest).hits),
            format!(
                "{}",
                Share::count(group.iter(), |case| case.variable_right == Some(true)).hits
            ),
            group.len().to_string(),
            listed(
                group
                    .iter()
                    .filter_map(|case| case.unexplained.first().map(String::as_str))
                    .collect(),
            ),
            listed(
                group
                    .iter()
                    .flat_map(|case| case.named.iter().map(|named| named.id.as_str()))
                    .collect(),
            ),
        ]);
    }
    table
}

/// What was named first for each truth: the full confusion matrix.
pub fn confusion(cases: &[Case]) -> Table {
    let truth_of = |case: &Case| match case.stratum.as_str() {
        "null" => "(null)".to_owned(),
        "outside" => "(outside)".to_owned(),
        _ => case.truth.first().cloned().unwrap_or_default(),
    };
    let answer_of = |case: &Case| {
        case.named.first().map_or_else(
            || {
                if case.verdict == "unexplained" {
                    "(unexplained)".to_owned()
                } else {
                    "(nothing)".to_owned()
                }
            },
            |named| named.id.clone(),
        )
    };
    let mut rows: Vec<String> = VOCABULARY.iter().map(|entry| entry.0.to_owned()).collect();
    rows.extend(["(outside)".to_owned(), "(null)".to_owned()]);
    let mut columns: Vec<String> = VOCABULARY.iter().map(|entry| entry.0.to_owned()).collect();
    columns.extend(["(unexplained)".to_owned(), "(nothing)".to_owned()]);
    let mut header = vec!["concealed".to_owned()];
    header.extend((1..=columns.len()).map(|number| number.to_string()));
    let mut table = Table::new(
        "Confusion matrix: concealed (rows, all sizes) against named first (columns)",
        &[],
    );
    table.header = header;
    for (index, row) in rows.iter().enumerate() {
        let group: Vec<&Case> = cases
            .iter()
            .filter(|case| case.stratum != "pair" && &truth_of(case) == row)
            .collect();
        if group.is_empty() {
            continue;
        }
        let mut cells = vec![format!("{} {row}", index + 1)];
        for column in &columns {
            let count = group
                .iter()
                .filter(|case| &answer_of(case) == column)
                .count();
            cells.push(if count == 0 {
                "·".to_owned()
            } else {
                count.to_string()
            });
        }
        table.rows.push(cells);
    }
    table.note = Some(format!(
        "Columns in the rows' order; {} is unexplained, {} is nothing found.",
        columns.len() - 1,
        columns.len()
    ));
    table
}

/// The worst cases, most embarrassing first: confident and wrong, then missed by the largest effect.
pub fn worst(cases: &[Case], most: usize) -> Vec<&Case> {
    let shame = |case: &Case| -> f64 {
        let wrong = case
            .named
            .iter()
            .filter(|named| !named.right)
            .map(|named| named.confidence)
            .fold(0.0, f64::max);
        let missed = if case.stratum == "single" && !case.in_set {
            case.weakest().min(4.0) / 4.0
        } else {
            0.0
        };
        let worse = case.gains.iter().filter(|gain| gain.worse).count() as f64;
        let lost = case
            .gains
            .iter()
            .filter_map(|gain| gain.share)
            .map(|share| (0.7 - share).clamp(0.0, 1.0))
            .fold(0.0, f64::max);
        let broken = 3.0 * f64::from(u8::from(!case.complaints.is_empty()));
        let dishonest = f64::from(u8::from(case.stratum == "outside" && !case.honest));
        let alarm = f64::from(u8::from(case.stratum == "null" && case.false_physics));
        wrong + missed + worse + lost + broken + dishonest + alarm
    };
    let mut ranked: Vec<(f64, &Case)> = cases
        .iter()
        .map(|case| (shame(case), case))
        .filter(|ranked| ranked.0 > 0.0)
        .collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.campaign.cmp(&b.1.campaign)));
    ranked
        .into_iter()
        .take(most)
        .map(|ranked| ranked.1)
        .collect()
}

/// Parameters worst in units of their own standard deviation.
pub fn figures(cases: &[Case], most: usize) -> Table {
    let mut table = Table::new(
        "Figures furthest off, in their own std",
        &[
            "campaign",
            "mechanism",
            "figure",
            "truth",
            "reported",
            "std",
            "pull",
        ],
    );
    let mut all: Vec<_> = cases
        .iter()
        .flat_map(|case| case.figures.iter().map(move |figure| (case, figure)))
        .collect();
    all.sort_by(|a, b| b.1.pull.abs().total_cmp(&a.1.pull.abs()));
    for (case, figure) in all
        .into_iter()
        .take(most)
        .filter(|pair| pair.1.pull.abs() > 3.0)
    {
        table.row([
            case.campaign.clone(),
            format!("{} ({})", figure.mechanism, case.forms.join(" + ")),
            figure.name.clone(),
            format!("{:.5}", figure.truth),
            format!("{:.5}", figure.value),
            format!("{:.2e}", figure.std),
            format!("{:.1}", figure.pull),
        ]);
    }
    table
}
