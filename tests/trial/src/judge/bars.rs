//! The bars of the trial beside what was measured.

use crate::judge::case::Case;
use crate::judge::tally::{of, shares, strong};
use crate::share::{Share, mean, percent, quantile};
use crate::table::Table;

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
