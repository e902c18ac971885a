//! From judged campaigns to the figures of the trial, each with its confidence.

use std::collections::BTreeMap;

use crate::generate::form::{OUTSIDE, VOCABULARY};
use crate::judge::case::{BAR_STRENGTH, Case};
use crate::share::{Share, mean, percent, quantile};
use crate::table::Table;
/// Cases of a stratum.
pub fn of<'a>(cases: &'a [Case], stratum: &'a str) -> impl Iterator<Item = &'a Case> + Clone {
    cases.iter().filter(move |case| case.stratum == stratum)
}

/// Single effects strong enough for the bars.
pub fn strong(cases: &[Case]) -> impl Iterator<Item = &Case> + Clone {
    of(cases, "single").filter(|case| case.weakest() >= BAR_STRENGTH)
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
        "False alarms by sort of null campaign",
        &["null", "alarms", "95 % interval", "n", "what was named"],
    );
    let mut groups: BTreeMap<&str, Vec<&Case>> = BTreeMap::new();
    for case in of(cases, "null") {
        groups.entry(case.kind.as_str()).or_default().push(case);
    }
    for (kind, group) in groups {
        let share = Share::count(group.iter(), |case| case.verdict != "consistent");
        let mut named: Vec<&str> = group
            .iter()
            .flat_map(|case| case.named.iter().map(|named| named.id.as_str()))
            .collect();
        named.sort_unstable();
        named.dedup();
        let [value, interval, n] = share.cells();
        table.row([kind.to_owned(), value, interval, n, named.join(", ")]);
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
        let group: Vec<&Case> = of(cases, "single")
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

/// Of the calls made at a confidence, how many were right.
pub fn calibration(cases: &[Case]) -> Table {
    let mut table = Table::new(
        "Calibration of confidence",
        &["confidence", "mean", "right", "95 % interval", "n"],
    );
    let calls: Vec<(f64, bool)> = cases
        .iter()
        .flat_map(|case| {
            case.named
                .iter()
                .map(|named| (named.confidence, named.right))
        })
        .filter(|call| call.0.is_finite())
        .collect();
    let edges = [0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0 + 1e-9];
    for pair in edges.windows(2) {
        let group: Vec<&(f64, bool)> = calls
            .iter()
            .filter(|call| (pair[0]..pair[1]).contains(&call.0))
            .collect();
        if group.is_empty() {
            continue;
        }
        let average = group.iter().map(|call| call.0).sum::<f64>() / group.len() as f64;
        let [value, interval, n] = Share::count(group.iter(), |call| call.1).cells();
        table.row([
            format!("{:.2}..{:.2}", pair[0], pair[1].min(1.0)),
            format!("{average:.3}"),
            value,
            interval,
            n,
        ]);
    }
    table
}

/// How far figures lie off in their own standard deviations, by mechanism.
pub fn pulls(cases: &[Case]) -> Table {
    let mut table = Table::new(
        "Calibration of parameters",
        &[
            "figure",
            "n",
            "within 1 std",
            "within 2",
            "within 3",
            "95 % interval of within 3",
            "median error",
            "median std, relative",
        ],
    );
    let mut groups: BTreeMap<String, Vec<&crate::judge::case::FigureCase>> = BTreeMap::new();
    for figure in cases.iter().flat_map(|case| &case.figures) {
        for key in [
            "(all)".to_owned(),
            format!("{} {}", figure.mechanism, figure.name),
        ] {
            groups.entry(key).or_default().push(figure);
        }
    }
    for (key, group) in groups {
        let within = |limit: f64| Share::count(group.iter(), |figure| figure.pull.abs() <= limit);
        let [three, interval, _] = within(3.0).cells();
        let middle = |value: &dyn Fn(&crate::judge::case::FigureCase) -> f64| {
            let values: Vec<f64> = group.iter().map(|figure| value(figure)).collect();
            quantile(&values, 0.5)
        };
        let size = |figure: &crate::judge::case::FigureCase| figure.truth.abs().max(1e-12);
        table.row([
            key,
            group.len().to_string(),
            percent(within(1.0).value()),
            percent(within(2.0).value()),
            three,
            interval,
            percent(middle(&|f| (f.value - f.truth).abs() / size(f))),
            percent(middle(&|f| f.std / size(f))),
        ]);
    }
    table.note = Some(
        "A normal error lies within 1, 2 and 3 of its standard deviations in 68, 95 and 99.7 % of cases. Error and std relative to the true figure."
            .to_owned(),
    );
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
        let alarm = f64::from(u8::from(
            case.stratum == "null" && case.verdict != "consistent",
        ));
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
