//! From judged campaigns to the figures of the trial, each with its confidence.

use std::collections::BTreeMap;

use statrs::distribution::{Beta, ContinuousCDF};

use crate::baseline::Verdicts;
use crate::campaign::Truth;
use crate::form::{OUTSIDE, VOCABULARY};
use crate::judge::{BAR_STRENGTH, Case};
use crate::table::Table;

/// So many of so many.
#[derive(Clone, Copy, Debug, Default)]
pub struct Share {
    pub hits: usize,
    pub of: usize,
}

impl Share {
    /// Counts those of which the condition holds.
    pub fn count<T>(items: impl IntoIterator<Item = T>, condition: impl Fn(&T) -> bool) -> Share {
        items
            .into_iter()
            .fold(Share::default(), |share, item| Share {
                hits: share.hits + usize::from(condition(&item)),
                of: share.of + 1,
            })
    }

    /// The share itself.
    pub fn value(self) -> f64 {
        self.hits as f64 / self.of as f64
    }

    /// Clopper and Pearson's exact 95 % interval.
    pub fn interval(self) -> (f64, f64) {
        let (k, n) = (self.hits as f64, self.of as f64);
        let quantile =
            |a: f64, b: f64, p: f64| Beta::new(a, b).map_or(f64::NAN, |beta| beta.inverse_cdf(p));
        let low = if self.hits == 0 {
            0.0
        } else {
            quantile(k, n - k + 1.0, 0.025)
        };
        let high = if self.hits == self.of {
            1.0
        } else {
            quantile(k + 1.0, n - k, 0.975)
        };
        (low, high)
    }

    fn cells(self) -> [String; 3] {
        if self.of == 0 {
            return ["-".into(), "-".into(), "0".into()];
        }
        let (low, high) = self.interval();
        [
            percent(self.value()),
            format!("{}..{}", percent(low), percent(high)),
            format!("{}/{}", self.hits, self.of),
        ]
    }
}

fn percent(value: f64) -> String {
    format!("{:.1} %", 100.0 * value)
}

/// A quantile of numbers, linear between them.
pub fn quantile(values: &[f64], at: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    if sorted.is_empty() {
        f64::NAN
    } else {
        crate::chain::at(&sorted, at * (sorted.len() - 1) as f64)
    }
}

fn mean(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values
        .iter()
        .map(|value| (value - mean).powi(2))
        .sum::<f64>()
        / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Cases of a stratum.
fn of<'a>(cases: &'a [Case], stratum: &'a str) -> impl Iterator<Item = &'a Case> + Clone {
    cases.iter().filter(move |case| case.stratum == stratum)
}

/// Single effects strong enough for the bars.
fn strong(cases: &[Case]) -> impl Iterator<Item = &Case> + Clone {
    of(cases, "single").filter(|case| case.weakest() >= BAR_STRENGTH)
}

fn shares(cases: &[Case]) -> Vec<f64> {
    cases
        .iter()
        .flat_map(|case| case.gains.iter().filter_map(|gain| gain.share))
        .collect()
}

/// Whether a bar is met, and whether the interval of the figure leaves no doubt of it.
fn word(value: f64, bar: f64, at_least: bool, low: f64, high: f64) -> &'static str {
    let met = (value - bar).abs() < 1e-12 || (value >= bar) == at_least;
    let sure = if met == at_least {
        low >= bar
    } else {
        high <= bar
    };
    // Met and at least: the whole interval above; missed and at least: the whole interval below; and the reverse.
    match (met, sure) {
        (true, true) => "met",
        (true, false) => "met, interval spans the bar",
        (false, true) => "**missed**",
        (false, false) => "**missed**, interval spans the bar",
    }
}

/// The figures of the trial beside their bars.
pub fn bars(cases: &[Case]) -> Table {
    let mut table = Table::new(
        "Figures and bars",
        &["figure", "bar", "measured", "95 % interval", "n", "met"],
    );
    let mut proportion = |figure: &str, bar: f64, at_least: bool, share: Share| {
        let [value, interval, n] = share.cells();
        let met = if share.of == 0 {
            "-"
        } else {
            let (low, high) = share.interval();
            word(share.value(), bar, at_least, low, high)
        };
        table.row([
            figure.to_owned(),
            format!("{} {}", if at_least { ">=" } else { "<=" }, percent(bar)),
            value,
            interval,
            n,
            met.to_owned(),
        ]);
    };
    proportion(
        "false alarms on null campaigns",
        0.05,
        false,
        Share::count(of(cases, "null"), |case| case.verdict != "consistent"),
    );
    proportion(
        "right mechanism first, single, from 0.6 sigma",
        0.90,
        true,
        Share::count(strong(cases), |case| case.first_right),
    );
    proportion(
        "right first or in its confusable_with",
        0.97,
        true,
        Share::count(strong(cases), |case| case.in_set),
    );
    proportion(
        "outside the vocabulary: says so",
        0.90,
        true,
        Share::count(of(cases, "outside"), |case| case.honest),
    );
    proportion(
        "outside the vocabulary: right variable",
        0.80,
        true,
        Share::count(
            of(cases, "outside").filter(|case| case.variable_right.is_some()),
            |case| case.variable_right == Some(true),
        ),
    );
    let pulls: Vec<f64> = cases
        .iter()
        .flat_map(|case| case.figures.iter().map(|figure| figure.pull.abs()))
        .collect();
    proportion(
        "parameter within 3 of its own std",
        0.95,
        true,
        Share::count(pulls.iter(), |pull| **pull <= 3.0),
    );
    let gains: Vec<_> = cases.iter().flat_map(|case| &case.gains).collect();
    proportion(
        "repaired worse than base on a fresh run",
        0.01,
        false,
        Share::count(gains.iter(), |gain| gain.worse),
    );
    let mut number =
        |figure: &str, bar: f64, at_least: bool, value: f64, (low, high): (f64, f64), n: usize| {
            let met = if value.is_nan() {
                "-"
            } else {
                word(value, bar, at_least, low, high)
            };
            let interval = if low.is_finite() && high.is_finite() {
                format!("{low:.3}..{high:.3}")
            } else {
                "-".to_owned()
            };
            table.row([
                figure.to_owned(),
                format!("{} {bar}", if at_least { ">=" } else { "<=" }),
                format!("{value:.3}"),
                interval,
                n.to_string(),
                met.to_owned(),
            ]);
        };
    let with_error = |values: &[f64]| {
        let (mean, error) = mean(values);
        (mean, (mean - 1.96 * error, mean + 1.96 * error))
    };
    let f1: Vec<f64> = of(cases, "pair").map(|case| case.f1).collect();
    let (value, interval) = with_error(&f1);
    number(
        "pairs of effects, F1 of the set",
        0.85,
        true,
        value,
        interval,
        f1.len(),
    );
    let gained = shares(cases);
    let spread = |at: f64| {
        // Order statistics: the ranks that bracket the quantile.
        let n = gained.len() as f64;
        let half = 1.96 * (at * (1.0 - at) / n.max(1.0)).sqrt();
        (
            quantile(&gained, (at - half).max(0.0)),
            quantile(&gained, (at + half).min(1.0)),
        )
    };
    number(
        "gain on fresh runs, share of the oracle's, median",
        0.95,
        true,
        quantile(&gained, 0.5),
        spread(0.5),
        gained.len(),
    );
    number(
        "the same, worst tenth",
        0.7,
        true,
        quantile(&gained, 0.1),
        spread(0.1),
        gained.len(),
    );
    for (figure, bar, local) in [
        ("location, IoU, all effects", 0.6, false),
        ("location, IoU, local effects", 0.75, true),
    ] {
        let overlaps: Vec<f64> = strong(cases)
            .filter(|case| !local || case.local)
            .filter_map(|case| case.iou)
            .collect();
        let (value, interval) = with_error(&overlaps);
        number(figure, bar, true, value, interval, overlaps.len());
    }
    table
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
    let mut groups: BTreeMap<String, Vec<&crate::judge::FigureCase>> = BTreeMap::new();
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
        let middle = |value: &dyn Fn(&crate::judge::FigureCase) -> f64| {
            let values: Vec<f64> = group.iter().map(|figure| value(figure)).collect();
            quantile(&values, 0.5)
        };
        let size = |figure: &crate::judge::FigureCase| figure.truth.abs().max(1e-12);
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

/// The tool beside textbook methods on the same files.
pub fn baselines(cases: &[Case], verdicts: &[(Truth, Verdicts)]) -> Table {
    let mut table = Table::new(
        "Baselines on the same files",
        &[
            "method",
            "false alarms",
            "right first, single from 0.6 sigma",
            "pairs, F1",
            "outside: says so",
        ],
    );
    let share = |share: Share| {
        if share.of == 0 {
            "-".to_owned()
        } else {
            percent(share.value())
        }
    };
    let number = |values: &[f64]| {
        if values.is_empty() {
            "-".to_owned()
        } else {
            format!("{:.2}", mean(values).0)
        }
    };
    let f1: Vec<f64> = of(cases, "pair").map(|case| case.f1).collect();
    table.row([
        "muslip diagnose".to_owned(),
        share(Share::count(of(cases, "null"), |case| {
            case.verdict != "consistent"
        })),
        share(Share::count(strong(cases), |case| case.first_right)),
        number(&f1),
        share(Share::count(of(cases, "outside"), |case| case.honest)),
    ]);
    let stratum = |name: &'static str| verdicts.iter().filter(move |pair| pair.0.stratum == name);
    let single = || {
        stratum("single").filter(|pair| {
            pair.0
                .concealed
                .iter()
                .all(|concealed| concealed.effect.strength_sigma >= BAR_STRENGTH)
        })
    };
    let right = |truth: &Truth, id: Option<&str>| {
        id.is_some_and(|id| {
            truth
                .concealed
                .iter()
                .any(|concealed| concealed.accept.iter().any(|name| name == id))
        })
    };
    let overlap = |truth: &Truth, named: &[&str]| {
        let hits = truth
            .concealed
            .iter()
            .filter(|concealed| {
                named
                    .iter()
                    .any(|id| concealed.accept.iter().any(|name| name == id))
            })
            .count();
        2.0 * hits as f64 / (named.len() + truth.concealed.len()) as f64
    };
    let pairs: Vec<f64> = stratum("pair")
        .map(|(truth, verdict)| overlap(truth, &verdict.selected))
        .collect();
    table.row([
        "white-noise BIC, forward".to_owned(),
        share(Share::count(stratum("null"), |pair| {
            !pair.1.selected.is_empty()
        })),
        share(Share::count(single(), |pair| {
            right(&pair.0, pair.1.selected.first().copied())
        })),
        number(&pairs),
        "never".to_owned(),
    ]);
    let pairs: Vec<f64> = stratum("pair")
        .map(|(truth, verdict)| overlap(truth, &[verdict.best_single]))
        .collect();
    table.row([
        "best single by training error".to_owned(),
        share(Share::count(stratum("null"), |pair| {
            !pair.1.best_single.is_empty()
        })),
        share(Share::count(single(), |pair| {
            right(&pair.0, Some(pair.1.best_single))
        })),
        number(&pairs),
        "never".to_owned(),
    ]);
    table.row([
        "residual whiteness alone".to_owned(),
        share(Share::count(stratum("null"), |pair| !pair.1.white)),
        "names nothing".to_owned(),
        "-".to_owned(),
        share(Share::count(stratum("outside"), |pair| !pair.1.white)),
    ]);
    table
}

/// The tool with parts of its argument left out, beside the whole on the same campaigns.
pub fn ablations(rows: &[(String, std::result::Result<Vec<Case>, String>)]) -> Table {
    let mut table = Table::new(
        "Ablations",
        &[
            "left out",
            "campaigns",
            "false alarms",
            "right first, single from 0.6 sigma",
            "in set",
            "pairs, F1",
            "outside: says so",
            "figures within 3 std",
            "gain share, median",
            "worst tenth",
            "worse than base",
        ],
    );
    for (name, cases) in rows {
        let cases = match cases {
            Ok(cases) => cases,
            Err(why) => {
                table.rows.push(vec![name.clone(), why.clone()]);
                continue;
            }
        };
        let share = |share: Share| {
            if share.of == 0 {
                "-".to_owned()
            } else {
                format!("{} ({}/{})", percent(share.value()), share.hits, share.of)
            }
        };
        let number = |value: f64| {
            if value.is_nan() {
                "-".to_owned()
            } else {
                format!("{value:.2}")
            }
        };
        let f1: Vec<f64> = of(cases, "pair").map(|case| case.f1).collect();
        let gained = shares(cases);
        table.row([
            name.clone(),
            cases.len().to_string(),
            share(Share::count(of(cases, "null"), |case| {
                case.verdict != "consistent"
            })),
            share(Share::count(strong(cases), |case| case.first_right)),
            share(Share::count(strong(cases), |case| case.in_set)),
            number(if f1.is_empty() { f64::NAN } else { mean(&f1).0 }),
            share(Share::count(of(cases, "outside"), |case| case.honest)),
            share(Share::count(
                cases.iter().flat_map(|case| &case.figures),
                |figure| figure.pull.abs() <= 3.0,
            )),
            number(quantile(&gained, 0.5)),
            number(quantile(&gained, 0.1)),
            share(Share::count(
                cases.iter().flat_map(|case| &case.gains),
                |gain| gain.worse,
            )),
        ]);
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_interval_agrees_with_published_values() {
        // Clopper and Pearson for 0 of 10 and 5 of 10, as tabulated in any textbook.
        let (low, high) = Share { hits: 0, of: 10 }.interval();
        assert!(low == 0.0 && (high - 0.3085).abs() < 1e-3);
        let (low, high) = Share { hits: 5, of: 10 }.interval();
        assert!((low - 0.1871).abs() < 1e-3 && (high - 0.8129).abs() < 1e-3);
    }

    #[test]
    fn quantiles_lie_between_neighbours() {
        assert!((quantile(&[3.0, 1.0, 2.0], 0.5) - 2.0).abs() < 1e-12);
        assert!((quantile(&[0.0, 10.0], 0.1) - 1.0).abs() < 1e-12);
        assert!(quantile(&[], 0.5).is_nan());
    }
}
