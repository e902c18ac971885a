//! What the design buys: textbook baselines on the same files, and parts of the argument left out.

use crate::baseline::regression::Verdicts;
use crate::generate::campaign::Truth;
use crate::judge::case::{BAR_STRENGTH, Case};
use crate::judge::tally::{of, shares, strong};
use crate::share::{Share, mean, percent, quantile};
use crate::table::Table;

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
