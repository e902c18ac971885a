//! The figures of the trial beside their bars: what the diagnosis is judged by.

use crate::judge::case::{BAR_STRENGTH, Case};
use crate::judge::family::{APART, Family};
use crate::judge::headline::{Better, Headline};
use crate::judge::tally::{of, shares, strong};
use crate::share::Share;
use crate::table::Table;

/// Mechanisms that show in the vehicle balance alone.
const VEHICLE: [&str; 3] = ["aero_drag", "grade_or_drive", "vehicle_inertia"];

/// A sort of sensor is bad where the whole interval of its false alarms lies above this.
const SENSOR_BAR: f64 = 0.10;

/// The figures of the verdicts, in the order in which they are read.
pub fn figures(cases: &[Case]) -> Vec<Headline> {
    let mut found = Vec::new();
    let within = |family: Family| move |case: &&Case| family.holds(case);
    for (family, bar) in APART.into_iter().zip([0.03, 0.05]) {
        let (name, words) = (family.name(), family.words());
        let nulls: Vec<&Case> = of(cases, "null").filter(within(family)).collect();
        found.push(Headline::share(
            &format!("null.{name}.false_physics"),
            &format!("nothing missing, {words}: false names"),
            Better::Lower,
            Some(bar),
            Share::count(nulls.iter(), |case| case.false_physics),
        ));
        found.push(Headline::share(
            &format!("null.{name}.sure"),
            "the same, at a confidence of 0.9 or more",
            Better::Lower,
            None,
            Share::count(nulls.iter(), |case| {
                case.named
                    .iter()
                    .any(|named| !named.right && named.confidence >= 0.9)
            }),
        ));
        found.push(Headline::share(
            &format!("null.{name}.left_open"),
            "the same, something left unexplained",
            Better::Lower,
            None,
            Share::count(nulls.iter(), |case| !case.unexplained.is_empty()),
        ));
        found.push(Headline::share(
            &format!("null.{name}.worse"),
            "the same, a fresh run predicted worse than by the base",
            Better::Lower,
            None,
            Share::count(nulls.iter().flat_map(|case| &case.gains), |gain| gain.worse),
        ));
    }
    let bad: Vec<String> = sensors(cases)
        .into_iter()
        .filter(|(_, share)| share.of > 0 && share.interval().0 > SENSOR_BAR)
        .map(|(sensor, _)| sensor)
        .collect();
    found.push(Headline::share(
        "null.chains.bad_sensors",
        "sorts of sensor whose false alarms lie wholly above 10 %",
        Better::Lower,
        Some(0.0),
        Share {
            hits: bad.len(),
            of: sensors(cases).len(),
        },
    ));
    found.push(Headline::share(
        "chain.right",
        "one effect of the chain alone: right finding, value within 20 % or 2 ms",
        Better::Higher,
        Some(0.90),
        Share::count(
            of(cases, "chain").filter_map(|case| case.finding.as_ref()),
            |finding| finding.right,
        ),
    ));
    found.push(Headline::share(
        "chain.false_physics",
        "one effect of the chain alone: false names",
        Better::Lower,
        None,
        Share::count(of(cases, "chain"), |case| case.false_physics),
    ));
    found.push(Headline::share(
        "chain.left_open",
        "one effect of the chain alone: something left unexplained",
        Better::Lower,
        None,
        Share::count(of(cases, "chain"), |case| !case.unexplained.is_empty()),
    ));
    let late = || cases.iter().flat_map(|case| &case.late);
    found.push(Headline::share(
        "chain.late.right",
        "real chains, a speed 5 ms or more off the drag: found, and within 20 % or 2 ms",
        Better::Higher,
        Some(0.90),
        Share::count(late(), |late| late.right),
    ));
    found.push(Headline::share(
        "chain.late.shown",
        "the same, of a wheel's speed and a coasting vehicle's",
        Better::Higher,
        Some(0.90),
        Share::count(late().filter(|late| late.shown), |late| late.right),
    ));
    found.push(Headline::share(
        "chain.late.driven",
        "the same, of a driven vehicle's, which hardly changes",
        Better::Higher,
        None,
        Share::count(late().filter(|late| !late.shown), |late| late.right),
    ));
    found.push(Headline::share(
        "chain.late.covered",
        "real chains, a speed 5 ms or more off, of all findings with a std: truth within two of it",
        Better::Higher,
        Some(0.90),
        Share::count(late().filter_map(|late| late.covered), |covered| *covered),
    ));
    found.push(Headline::share(
        "chain.false_findings",
        "ideal sensors: a finding that is not there",
        Better::Lower,
        Some(0.05),
        Share::count(
            cases
                .iter()
                .filter(|case| !case.real_chain && case.stratum != "chain"),
            |case| !case.false_findings.is_empty(),
        ),
    ));
    found.push(Headline::share(
        "timing.chains.right",
        "one delay, lag or ripple from 0.6 sigma before a chain with its own: told as it shows",
        Better::Higher,
        Some(0.90),
        Share::count(
            cases
                .iter()
                .filter(|case| case.weakest() >= BAR_STRENGTH)
                .filter_map(|case| case.timing_right),
            |right| *right,
        ),
    ));
    for (family, (first_bar, set_bar)) in APART.into_iter().zip([(0.93, 0.98), (0.90, 0.93)]) {
        let (name, words) = (family.name(), family.words());
        let single: Vec<&Case> = strong(cases).filter(within(family)).collect();
        found.push(Headline::share(
            &format!("single.{name}.first"),
            &format!("one effect from 0.6 sigma, {words}: right first"),
            Better::Higher,
            Some(first_bar),
            Share::count(single.iter(), |case| case.first_right),
        ));
        found.push(Headline::share(
            &format!("single.{name}.in_set"),
            "the same, right or in the confusable set",
            Better::Higher,
            Some(set_bar),
            Share::count(single.iter(), |case| case.in_set),
        ));
        found.push(Headline::share(
            &format!("single.{name}.false_beside"),
            "the same, a false name beside",
            Better::Lower,
            None,
            Share::count(single.iter(), |case| case.false_physics),
        ));
    }
    found.push(Headline::share(
        "single.vehicle.first",
        "air drag, grade or mass, from 0.6 sigma: right first",
        Better::Higher,
        Some(0.95),
        Share::count(
            strong(cases).filter(|case| {
                case.truth
                    .first()
                    .is_some_and(|id| VEHICLE.contains(&id.as_str()))
            }),
            |case| case.first_right,
        ),
    ));
    for (family, bar) in APART.into_iter().zip([0.92, 0.85]) {
        let (name, words) = (family.name(), family.words());
        let f1: Vec<f64> = of(cases, "pair")
            .filter(within(family))
            .map(|case| case.f1)
            .collect();
        found.push(Headline::mean(
            &format!("pair.{name}.f1"),
            &format!("two effects, {words}: F1 of the names"),
            Better::Higher,
            Some(bar),
            &f1,
        ));
    }
    found.push(Headline::share(
        "outside.says",
        "outside the vocabulary: says so",
        Better::Higher,
        Some(0.93),
        Share::count(of(cases, "outside"), |case| case.honest),
    ));
    found.push(Headline::share(
        "outside.variable",
        "outside the vocabulary: right variable",
        Better::Higher,
        Some(0.85),
        Share::count(
            of(cases, "outside").filter(|case| case.variable_right.is_some()),
            |case| case.variable_right == Some(true),
        ),
    ));
    let gained = shares(cases);
    for (key, what, bar, at) in [
        (
            "predict.gain",
            "gain above the floor on fresh runs, median",
            0.97,
            0.5,
        ),
        (
            "predict.gain_worst_tenth",
            "the same, worst tenth",
            0.8,
            0.1,
        ),
    ] {
        found.push(Headline::quantile(
            key,
            what,
            Better::Higher,
            Some(bar),
            &gained,
            at,
        ));
    }
    found.push(Headline::share(
        "predict.worse_named",
        "every fresh run predicted worse than by the base, yet a name above 0.5",
        Better::Lower,
        Some(0.0),
        Share::count(cases.iter().filter(|case| !case.gains.is_empty()), |case| {
            case.gains.iter().all(|gain| gain.worse)
                && case.named.iter().any(|named| named.confidence > 0.5)
        }),
    ));
    for (key, what, bar, local) in [
        ("where.iou", "location, IoU, all effects", 0.8, false),
        (
            "where.iou_local",
            "location, IoU, local effects",
            0.75,
            true,
        ),
    ] {
        let overlaps: Vec<f64> = strong(cases)
            .filter(|case| !local || case.local)
            .filter_map(|case| case.iou)
            .collect();
        found.push(Headline::mean(
            key,
            what,
            Better::Higher,
            Some(bar),
            &overlaps,
        ));
    }
    found.push(Headline::share(
        "contract.failed",
        "calls that failed, or answers that cannot be read",
        Better::Lower,
        Some(0.0),
        Share::count(cases, |case| !case.complaints.is_empty()),
    ));
    found.push(Headline::share(
        "contract.breached",
        "answers that lack a part of the contract",
        Better::Lower,
        Some(0.0),
        Share::count(cases, |case| !case.breaches.is_empty()),
    ));
    found
}

/// False names on null campaigns through real chains, by sort of wheel and of vehicle sensor.
pub fn sensors(cases: &[Case]) -> Vec<(String, Share)> {
    let nulls: Vec<&Case> = of(cases, "null").filter(|case| case.real_chain).collect();
    let mut found: Vec<(String, Share)> = Vec::new();
    for (side, sensor) in [
        ("wheel", (|case| &case.wheel_sensor) as fn(&Case) -> &String),
        ("vehicle", |case| &case.vehicle_sensor),
    ] {
        let mut words: Vec<&str> = nulls.iter().map(|case| sensor(case).as_str()).collect();
        words.sort_unstable();
        words.dedup();
        for word in words {
            found.push((
                format!("{side}: {word}"),
                Share::count(nulls.iter().filter(|case| sensor(case) == word), |case| {
                    case.false_physics
                }),
            ));
        }
    }
    found
}

/// Figures with their bars beside those of another engine, each against the other's of the same key.
pub fn beside(other: &str, own: &[Headline], others: &[Headline]) -> Table {
    let mut table = Table::new(
        "Figures and bars",
        &[
            "figure",
            "bar",
            "this engine",
            "95 % interval",
            "n",
            "met",
            other,
            "95 % interval",
            "n",
            "met",
        ],
    );
    for figure in own {
        let [what, bar, value, interval, n, met] = figure.cells();
        let of_other = others.iter().find(|other| other.key == figure.key);
        let [_, _, others_value, others_interval, others_n, others_met] =
            of_other.map_or_else(Default::default, Headline::cells);
        table.row([
            what,
            bar,
            value,
            interval,
            n,
            met,
            others_value,
            others_interval,
            others_n,
            others_met,
        ]);
    }
    table
}

/// Figures with their bars as a table.
pub fn table(title: &str, figures: &[Headline]) -> Table {
    let mut table = Table::new(
        title,
        &["figure", "bar", "measured", "95 % interval", "n", "met"],
    );
    for figure in figures {
        table.row(figure.cells());
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_stands_beside_the_other_engine_s_of_the_same_key() {
        let share = |key: &str, hits| {
            Headline::share(key, key, Better::Lower, Some(0.05), Share { hits, of: 40 })
        };
        let own = [share("null.false", 2), share("null.sure", 0)];
        let table = beside("the other", &own, &[share("null.false", 26)]);
        let cells = |row: usize| [2, 5, 6, 9].map(|column: usize| table.rows[row][column].as_str());
        assert_eq!(cells(0)[2], "65.0 %");
        assert!(cells(0)[3].contains("missed") && cells(0)[0] == "5.0 %");
        assert_eq!(cells(1)[2], "");
    }
}
