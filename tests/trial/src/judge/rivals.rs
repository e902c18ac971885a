//! What the design buys: textbook baselines and other engines on the same files.

use std::collections::BTreeMap;

use crate::baseline::Verdicts;
use crate::generate::campaign::Truth;
use crate::judge::case::{BAR_STRENGTH, Case};
use crate::judge::names::{self, Standing, standing};
use crate::judge::timing;
use crate::share::{Share, mean, percent};
use crate::table::Table;

/// One method's answer to one campaign, in what the table of methods asks.
struct Answer<'a> {
    stratum: &'a str,
    real_chain: bool,
    /// The chain has the concealed effect as well: not counted among the single ones.
    of_the_chain: bool,
    weakest: f64,
    /// Names of what is not there; of a test that names nothing, any alarm.
    alarm: bool,
    /// None where the method names nothing by its nature.
    first_right: Option<bool>,
    f1: Option<f64>,
    /// None where the method cannot say so.
    says_so: Option<bool>,
}

impl<'a> Answer<'a> {
    /// Of the tool, or another build of it.
    fn of_case(case: &'a Case) -> Answer<'a> {
        Answer {
            stratum: &case.stratum,
            real_chain: case.real_chain,
            of_the_chain: case.of_the_chain,
            weakest: case.weakest(),
            alarm: case.false_physics,
            first_right: Some(case.first_right),
            f1: Some(case.f1),
            says_so: Some(case.honest),
        }
    }

    /// Of a method that gives names alone.
    fn of_names(truth: &'a Truth, real_chain: bool, names: &[&str]) -> Answer<'a> {
        let told: Vec<(&str, Standing)> =
            names.iter().map(|id| (*id, standing(truth, id))).collect();
        let standings: Vec<Standing> = told.iter().map(|name| name.1).collect();
        Answer {
            alarm: standings.contains(&Standing::False),
            first_right: Some(
                names::first(&standings)
                    .is_some_and(|place| standings[place] == Standing::Accepted),
            ),
            f1: Some(names::f1(truth, &told)),
            says_so: None,
            ..Answer::of_whiteness(truth, real_chain, true)
        }
    }

    /// Of a test that says that something is amiss, but not what.
    fn of_whiteness(truth: &'a Truth, real_chain: bool, white: bool) -> Answer<'a> {
        Answer {
            stratum: &truth.stratum,
            real_chain,
            of_the_chain: timing::of_the_chain(truth),
            weakest: truth
                .concealed
                .iter()
                .map(|concealed| concealed.effect.strength_sigma)
                .fold(f64::INFINITY, f64::min),
            alarm: !white,
            first_right: None,
            f1: None,
            says_so: Some(!white),
        }
    }
}

/// The tool beside textbook methods, and beside other builds of itself (`others`: name and judged cases), on the same
/// files.
pub fn baselines(
    cases: &[Case],
    verdicts: &[(Truth, Verdicts)],
    others: &[(&str, &[Case])],
) -> Table {
    let chains: BTreeMap<&str, bool> = cases
        .iter()
        .map(|case| (case.campaign.as_str(), case.real_chain))
        .collect();
    let textbook = |answer: &dyn Fn(&Verdicts) -> Vec<&'static str>| -> Vec<Answer> {
        verdicts
            .iter()
            .map(|(truth, verdict)| {
                let real = chains.get(truth.campaign.as_str()).copied();
                Answer::of_names(truth, real.unwrap_or(false), &answer(verdict))
            })
            .collect()
    };
    let mut methods: Vec<(&str, Vec<Answer>)> = vec![(
        "muslip diagnose",
        cases.iter().map(Answer::of_case).collect(),
    )];
    for (name, cases) in others {
        methods.push((name, cases.iter().map(Answer::of_case).collect()));
    }
    methods.push((
        "regression without errors in variables, BIC",
        textbook(&|verdict| verdict.regression.clone()),
    ));
    methods.push((
        "output-error fit of each balance, BIC",
        textbook(&|verdict| verdict.output_error.clone()),
    ));
    methods.push((
        "best single by training error",
        textbook(&|verdict| {
            Vec::from_iter((!verdict.best_single.is_empty()).then_some(verdict.best_single))
        }),
    ));
    methods.push((
        "residual whiteness alone",
        verdicts
            .iter()
            .map(|(truth, verdict)| {
                let real = chains.get(truth.campaign.as_str()).copied();
                Answer::of_whiteness(truth, real.unwrap_or(false), verdict.white)
            })
            .collect(),
    ));
    let mut table = Table::new(
        "Methods on the same files",
        &[
            "method",
            "false names, ideal nulls",
            "nulls through chains",
            "right first, ideal, from 0.6 sigma",
            "right first, chains",
            "pairs, F1",
            "outside: says so",
        ],
    );
    for (name, answers) in &methods {
        table.row(cells(name, answers));
    }
    table.note = Some(
        "False names: those that are neither concealed nor true of the measuring chain; of the whiteness test, any alarm. The textbook methods take every sample as independent; \"-\": not tried, or not in the method's nature."
            .to_owned(),
    );
    table
}

fn cells(name: &str, answers: &[Answer]) -> [String; 7] {
    let share = |stratum: &str,
                 condition: &dyn Fn(&Answer) -> bool,
                 value: &dyn Fn(&Answer) -> Option<bool>| {
        let share = Share::count(
            answers
                .iter()
                .filter(|answer| answer.stratum == stratum && condition(answer))
                .filter_map(value),
            |value| *value,
        );
        if share.of == 0 {
            "-".to_owned()
        } else {
            format!("{} ({}/{})", percent(share.value()), share.hits, share.of)
        }
    };
    let strong = |answer: &Answer| answer.weakest >= BAR_STRENGTH && !answer.of_the_chain;
    let f1: Vec<f64> = answers
        .iter()
        .filter(|answer| answer.stratum == "pair")
        .filter_map(|answer| answer.f1)
        .collect();
    [
        name.to_owned(),
        share("null", &|answer| !answer.real_chain, &|answer| {
            Some(answer.alarm)
        }),
        share("null", &|answer| answer.real_chain, &|answer| {
            Some(answer.alarm)
        }),
        share(
            "single",
            &|answer| !answer.real_chain && strong(answer),
            &|answer| answer.first_right,
        ),
        share(
            "single",
            &|answer| answer.real_chain && strong(answer),
            &|answer| answer.first_right,
        ),
        if f1.is_empty() {
            "-".to_owned()
        } else {
            format!("{:.2}", mean(&f1).0)
        },
        share("outside", &|_| true, &|answer| answer.says_so),
    ]
}
