//! What went wrong, in words: the symptom of a case as far as its own files tell, and where the misses
//! behind a missed bar come from.

use std::collections::BTreeMap;

use crate::judge::case::Case;
use crate::judge::tally;
use crate::table::Table;

/// What was wrong with a case, in one line.
pub fn symptom(case: &Case) -> String {
    let mut said = Vec::new();
    if let Some(first) = case.complaints.first() {
        said.push(format!("the call or its file broke the contract: {first}"));
    }
    let wrong: Vec<String> = case
        .named
        .iter()
        .filter(|named| !named.right)
        .map(|named| format!("{} ({:.2})", named.id, named.confidence))
        .collect();
    let wrong = wrong.join(", ");
    match case.stratum.as_str() {
        "null" | "chain" if case.false_physics || !case.unexplained.is_empty() => {
            said.push(if wrong.is_empty() {
                format!(
                    "nothing is concealed, yet a dependence on {} was claimed",
                    left(case)
                )
            } else {
                format!("nothing is concealed, yet it named {wrong}")
            })
        }
        "outside" => {
            if !case.honest {
                said.push(if wrong.is_empty() {
                    "an effect that no mechanism accounts for went unseen".to_owned()
                } else {
                    format!("an effect that no mechanism accounts for was put down to {wrong} and nothing left open")
                });
            } else if !wrong.is_empty() {
                said.push(format!(
                    "said that something is left, but named {wrong} beside it"
                ));
            }
            if case.variable_right == Some(false) && !case.unexplained.is_empty() {
                said.push(format!(
                    "it depends on another variable than {}",
                    left(case)
                ));
            }
        }
        _ => {
            let found: Vec<&str> = case.named.iter().map(|named| named.id.as_str()).collect();
            let missing: Vec<String> = case
                .truth
                .iter()
                .zip(&case.strength)
                .filter(|(id, _)| !case.of_the_chain && !found.contains(&id.as_str()))
                .map(|(id, size)| format!("{id} ({size:.1} sigma)"))
                .collect();
            if case.of_the_chain && case.timing_right == Some(false) {
                said.push(format!(
                    "{} before a chain that has its own was not told as it shows",
                    case.truth.join(" and ")
                ));
            } else if !(missing.is_empty() || case.stratum == "single" && case.first_right) {
                said.push(match (case.verdict.as_str(), wrong.is_empty()) {
                    ("consistent", _) => format!("{} went unseen", missing.join(" and ")),
                    (_, false) => format!("{} was taken for {wrong}", missing.join(" and ")),
                    ("unexplained", _) => format!(
                        "{} was seen but left unnamed, as a dependence on {}",
                        missing.join(" and "),
                        left(case)
                    ),
                    _ => format!("{} went unseen beside the other", missing.join(" and ")),
                });
            } else if !wrong.is_empty() {
                said.push(format!("right, with {wrong} named beside it"));
            }
        }
    }
    let worse: Vec<f64> = case
        .gains
        .iter()
        .filter(|gain| gain.worse)
        .map(|gain| (gain.repaired / gain.base.max(1e-300)).sqrt())
        .collect();
    if !worse.is_empty() {
        said.push(format!(
            "the repaired model predicts {} of {} fresh runs worse than the base (RMS error up to {:.2} times)",
            worse.len(),
            case.gains.len(),
            worse.iter().copied().fold(0.0, f64::max)
        ));
    } else if let Some(least) = case
        .gains
        .iter()
        .filter_map(|gain| gain.share)
        .min_by(f64::total_cmp)
        && least < 0.7
    {
        said.push(format!(
            "{:.0} % of the oracle's gain on a fresh run",
            100.0 * least
        ));
    }
    if let Some(figure) = case
        .figures
        .iter()
        .filter(|figure| figure.pull.abs() > 3.0)
        .max_by(|a, b| a.pull.abs().total_cmp(&b.pull.abs()))
    {
        said.push(format!(
            "{} {:.4} instead of {:.4}, {:.0} of its own std off",
            figure.name,
            figure.value,
            figure.truth,
            figure.pull.abs()
        ));
    }
    if said.is_empty() {
        said.push("all asked for was found".to_owned());
    }
    said.join("; ")
}

/// What was said, and of what.
fn for_forms(said: String, case: &Case) -> String {
    format!("{said} for {}", case.forms.join("+"))
}

fn left(case: &Case) -> String {
    case.unexplained
        .first()
        .cloned()
        .unwrap_or_else(|| "nothing named".to_owned())
}

/// Where the misses come from: for every bar of counts, what they have in common, the most frequent first.
pub fn shortfalls(cases: &[Case]) -> Table {
    let mut table = Table::new(
        "Where the misses come from",
        &["figure", "misses", "of", "most frequent"],
    );
    let mut row = |figure: &str, all: Vec<&Case>, miss: &dyn Fn(&Case) -> Vec<String>| {
        let mut groups: BTreeMap<String, usize> = BTreeMap::new();
        let mut count = 0;
        for case in &all {
            let words = miss(case);
            count += usize::from(!words.is_empty());
            for word in words {
                *groups.entry(word).or_default() += 1;
            }
        }
        let mut ranked: Vec<(String, usize)> = groups.into_iter().collect();
        ranked.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
        let told: Vec<String> = ranked
            .iter()
            .take(8)
            .map(|(word, count)| format!("{word} {count}"))
            .collect();
        table.row([
            figure.to_owned(),
            count.to_string(),
            all.len().to_string(),
            told.join(", "),
        ]);
    };
    let of = |stratum: &str| -> Vec<&Case> {
        cases
            .iter()
            .filter(|case| case.stratum == stratum)
            .collect()
    };
    let first_named = |case: &Case| {
        case.named.first().map_or_else(
            || match case.verdict.as_str() {
                "unexplained" => "(unexplained)".to_owned(),
                _ => "(nothing)".to_owned(),
            },
            |named| named.id.clone(),
        )
    };
    let strong: Vec<&Case> = tally::strong(cases).collect();
    row("false names, nothing missing", of("null"), &|case| {
        if !case.false_physics {
            return vec![];
        }
        vec![format!(
            "{} {}",
            first_named(case),
            if case.real_chain {
                "through a chain"
            } else {
                "on ideal sensors"
            }
        )]
    });
    row("right mechanism first", strong.clone(), &|case| {
        if case.first_right {
            return vec![];
        }
        vec![for_forms(first_named(case), case)]
    });
    row("right first or confusable", strong.clone(), &|case| {
        if case.in_set {
            return vec![];
        }
        vec![for_forms(first_named(case), case)]
    });
    row(
        "what a real chain has too, not told",
        {
            let timed = cases.iter().filter(|case| case.of_the_chain);
            timed.collect()
        },
        &|case| {
            if case.timing_right != Some(false) {
                return vec![];
            }
            vec![for_forms(first_named(case), case)]
        },
    );
    row("pairs, an effect not found", of("pair"), &|case| {
        case.truth
            .iter()
            .filter(|id| !case.named.iter().any(|named| &named.id == *id))
            .cloned()
            .collect()
    });
    row("pairs, a name too many", of("pair"), &|case| {
        case.named
            .iter()
            .filter(|named| !named.right)
            .map(|named| named.id.clone())
            .collect()
    });
    row("outside, not said", of("outside"), &|case| {
        if case.honest {
            return vec![];
        }
        vec![for_forms(first_named(case), case)]
    });
    row("outside, other variable", of("outside"), &|case| {
        if case.variable_right != Some(false) {
            return vec![];
        }
        vec![for_forms(left(case), case)]
    });
    row("parameter beyond 3 std", cases.iter().collect(), &|case| {
        case.figures
            .iter()
            .filter(|figure| figure.pull.abs() > 3.0)
            .map(|figure| format!("{} {}", figure.mechanism, figure.name))
            .collect()
    });
    row(
        "repaired worse than base",
        cases.iter().collect(),
        &|case| {
            if !case.gains.iter().any(|gain| gain.worse) {
                return vec![];
            }
            vec![match case.stratum.as_str() {
                "null" => "null".to_owned(),
                "outside" => case.forms.join("+"),
                _ => case.truth.join("+"),
            }]
        },
    );
    row("gain share below 0.7", cases.iter().collect(), &|case| {
        if !case
            .gains
            .iter()
            .any(|gain| gain.share.is_some_and(|share| share < 0.7))
        {
            return vec![];
        }
        vec![match case.stratum.as_str() {
            "outside" => case.forms.join("+"),
            _ => case.truth.join("+"),
        }]
    });
    row("location, IoU below 0.5", strong, &|case| {
        if case.iou.is_none_or(|iou| iou >= 0.5) {
            return vec![];
        }
        vec![case.truth.join("+")]
    });
    table.note = Some(
        "Counts of campaigns (and of their effects or names where one campaign can miss in several ways)."
            .to_owned(),
    );
    table
}
