//! What other answers move of the figures that users trust.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use serde_json::Value;

use super::tunable::Constant;

/// Confidence of a call that is to be right.
const SURE: f64 = 0.9;
/// Points by which a figure moves.
const POINTS: f64 = 2.0;
/// Strength from which an effect is to be named, with the calibration's own tolerance.
const TO_BE_NAMED: f64 = 0.57;

/// A share: hits of so many.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Share {
    hits: usize,
    of: usize,
}

impl Share {
    fn add(&mut self, hit: bool) {
        self.hits += usize::from(hit);
        self.of += 1;
    }

    fn percent(self) -> f64 {
        100.0 * self.hits as f64 / self.of.max(1) as f64
    }
}

/// The figures, in the order in which they are read.
const FIGURES: [&str; 6] = [
    "nothing missing: false names",
    "one effect of the chain alone: told",
    "one effect from 0.6 sigma, ideal sensors: right first",
    "the same, real chains",
    "calls at 0.9 or more: wrong",
    "unseen runs: repaired worse than base by 1 %",
];

/// Judged answers to campaigns, by campaign.
#[derive(Clone)]
pub struct Answers(BTreeMap<String, Answer>);

/// A judged answer.
#[derive(Clone, Default)]
struct Answer {
    /// Names, first first.
    names: Vec<String>,
    /// What it counts in the figures.
    figures: [Share; FIGURES.len()],
}

/// What other answers move.
pub struct Moved {
    /// Campaigns whose names differ.
    names: usize,
    /// Points by which figures move, of those that move by more than [`POINTS`].
    figures: Vec<(usize, f64)>,
}

impl Answers {
    /// Reads what the judge wrote.
    pub fn read(file: &Path) -> Result<Self> {
        let of = || file.display().to_string();
        let cases: Vec<Value> =
            serde_json::from_str(&fs::read_to_string(file).with_context(of)?).with_context(of)?;
        let answers = cases.iter().map(Answer::of);
        answers.collect::<Result<_>>().with_context(of).map(Self)
    }

    /// These with others in place of their own.
    pub fn with(&self, others: Self) -> Self {
        let mut all = self.clone();
        all.0.extend(others.0);
        all
    }

    /// All that they count in a figure.
    fn figure(&self, at: usize) -> Share {
        let of = self.0.values().map(|answer| answer.figures[at]);
        of.fold(Share::default(), |sum, own| Share {
            hits: sum.hits + own.hits,
            of: sum.of + own.of,
        })
    }

    /// What other answers to the same campaigns move.
    pub fn moved(&self, others: &Self) -> Moved {
        let other = |(campaign, own): &(&String, &Answer)| {
            others
                .0
                .get(*campaign)
                .is_none_or(|other| other.names != own.names)
        };
        let points = |at: usize| others.figure(at).percent() - self.figure(at).percent();
        let figures = (0..FIGURES.len()).map(|at| (at, points(at)));
        Moved {
            names: self.0.iter().filter(other).count(),
            figures: figures
                .filter(|(_, points)| points.abs() > POINTS)
                .collect(),
        }
    }
}

impl Answer {
    /// Of one judged campaign, with its name.
    fn of(case: &Value) -> Result<(String, Self)> {
        let mut own = Self::default();
        let flag = |name: &str| case[name].as_bool().with_context(|| name.to_owned());
        let list = |name: &str| case[name].as_array().with_context(|| name.to_owned());
        let text =
            |value: &Value| Ok::<_, anyhow::Error>(value.as_str().context("a text")?.to_owned());
        let named = list("named")?;
        let ids = named.iter().map(|name| text(&name["id"]));
        own.names = ids.collect::<Result<_>>()?;
        let [null, told, ideal, chains, sure, worse] = &mut own.figures;
        match text(&case["stratum"])?.as_str() {
            "null" => null.add(flag("false_physics")?),
            "chain" => told.add(case["finding"]["right"].as_bool().context("finding")?),
            "single" => {
                let strength = list("strength")?.first().and_then(Value::as_f64);
                let strong = strength.context("strength")? >= TO_BE_NAMED;
                let right = if flag("real_chain")? { chains } else { ideal };
                if strong && !flag("of_the_chain")? {
                    right.add(flag("first_right")?);
                }
            }
            _ => {}
        }
        for name in named {
            if name["confidence"].as_f64().context("confidence")? >= SURE {
                sure.add(!name["right"].as_bool().context("right")?);
            }
        }
        for gain in list("gains")? {
            worse.add(gain["worse"].as_bool().context("worse")?);
        }
        Ok((text(&case["campaign"])?, own))
    }
}

impl Moved {
    fn cell(&self) -> String {
        let figures: Vec<String> = self
            .figures
            .iter()
            .map(|(at, points)| format!("{}: {points:+.0}", at + 1))
            .collect();
        format!("{} | {}", self.names, figures.join(", "))
    }
}

/// One line of the page's table.
pub fn row(constant: &Constant, [halved, doubled]: [&Moved; 2]) -> String {
    let [low, high] = constant.varied();
    format!(
        "| `{}` | {} | {low} | {} | {high} | {} |",
        constant.path(),
        constant.value,
        halved.cell(),
        doubled.cell()
    )
}

/// The page.
pub fn page(command: &str, commit: &str, as_it_is: &Answers, rows: &[String]) -> String {
    let campaigns = as_it_is.0.len();
    let figures: String = FIGURES
        .iter()
        .enumerate()
        .map(|(at, what)| {
            let share = as_it_is.figure(at);
            format!(
                "| {} | {what} | {} of {} | {:.1} |\n",
                at + 1,
                share.hits,
                share.of,
                100.0 / share.of.max(1) as f64
            )
        })
        .collect();
    format!(
        "# The engine's constants, halved and doubled\n\n\
         {campaigns} development campaigns with nothing missing, one effect, or one effect of the measuring chain alone, on ideal sensors and \
         through real chains; the same for every line. Engine of commit `{commit}`. Printed by\n\n\
         ```\n{command}\n```\n\n\
         ## As it is\n\n\
         | | figure | | one campaign, name or run is worth, points |\n| --- | --- | --- | --- |\n{figures}\n\
         ## Each constant halved and doubled\n\n\
         Of a share or a probability of 0.4 and more its odds are; a count is no less than one. Names: campaigns of {campaigns} whose names differ in number, kind or order. \
         Moved: figures of the table above that move by more than {POINTS} points, with by how many; a rise is good of 2 to 4, bad of the others.\n\n\
         | constant | as it is | halved | names | moved | doubled | names | moved |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |\n{}\n",
        rows.join("\n")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn answers(first: &str, right: bool) -> Answers {
        let case = |campaign: &str, stratum: &str, id: &str, right: bool| {
            json!({
                "campaign": campaign, "stratum": stratum, "real_chain": true, "of_the_chain": false,
                "strength": [1.0], "false_physics": !right, "first_right": right,
                "named": [{"id": id, "confidence": 0.95, "right": right}],
                "gains": [{"worse": false}, {"worse": !right}],
            })
        };
        let cases = [
            case("0", "single", first, right),
            case("1", "null", "force_gain", false),
        ];
        Answers(cases.iter().map(|case| Answer::of(case).unwrap()).collect())
    }

    #[test]
    fn a_campaign_that_is_named_otherwise_moves_what_it_counts_in() {
        let (right, wrong) = (answers("force_lag", true), answers("force_delay", false));
        let none = right.moved(&answers("force_lag", true));
        assert!(none.names == 0 && none.figures.is_empty());
        let moved = right.moved(&wrong);
        assert_eq!(moved.names, 1);
        // Right first, wrong calls of two, and worse runs of four.
        assert_eq!(moved.figures, [(3, -100.0), (4, 50.0), (5, 25.0)]);
        assert_eq!(moved.cell(), "1 | 4: -100, 5: +50, 6: +25");
    }
}
