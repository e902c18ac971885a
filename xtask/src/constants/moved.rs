//! What other answers move of the figures that users trust.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use super::tunable::Constant;

/// Confidence of a call that is to be right.
const SURE: f64 = 0.9;
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
    /// Names, first first; of a diagnosis that failed, with what.
    names: Vec<String>,
    failed: bool,
    /// What it counts in the figures.
    figures: [Share; FIGURES.len()],
}

/// Other answers to some campaigns, which stand for all in which another constant may change something.
pub struct Others {
    /// How many those are.
    pub touched: usize,
    /// To campaigns evenly of them.
    pub answers: Answers,
}

/// What other answers move.
pub struct Moved {
    /// Campaigns in which something may change, ...
    touched: usize,
    /// ... that were diagnosed again, ...
    played: usize,
    /// ... and whose names then differ.
    names: usize,
    /// Hits that each figure has more in them, ...
    hits: [i64; FIGURES.len()],
    /// ... and by how many points that would move it, were all touched campaigns like them.
    points: [f64; FIGURES.len()],
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

    /// None.
    pub fn none() -> Self {
        Self(BTreeMap::new())
    }

    /// All that they count in a figure.
    fn figure(&self, at: usize) -> Share {
        sum(self.0.values(), at)
    }

    /// What other answers move: each that was asked for again stands for as many that were not.
    ///
    /// # Errors
    /// Where a campaign is none of these.
    pub fn moved(&self, others: &Others) -> Result<Moved> {
        let mut pairs = Vec::new();
        for (campaign, other) in &others.answers.0 {
            let own = self.0.get(campaign).with_context(|| campaign.clone())?;
            pairs.push((own, other));
        }
        let stands_for = others.touched as f64 / pairs.len().max(1) as f64;
        let of = |at: usize| {
            let before = sum(pairs.iter().map(|pair| pair.0), at);
            (before, sum(pairs.iter().map(|pair| pair.1), at))
        };
        let points = |at: usize| {
            let (all, (before, after)) = (self.figure(at), of(at));
            let changed = |all: usize, before: usize, after: usize| {
                all as f64 + stands_for * (after as f64 - before as f64)
            };
            let hits = changed(all.hits, before.hits, after.hits);
            100.0 * hits / changed(all.of, before.of, after.of).max(1.0) - all.percent()
        };
        let hits = |at: usize| {
            let (before, after) = of(at);
            after.hits as i64 - before.hits as i64
        };
        let differ = |pair: &&(&Answer, &Answer)| pair.0.names != pair.1.names;
        Ok(Moved {
            touched: others.touched,
            played: pairs.len(),
            names: pairs.iter().filter(differ).count(),
            hits: core::array::from_fn(hits),
            points: core::array::from_fn(points),
        })
    }

    /// Refuses answers of which one is none: half of them would pass for a diagnosis that names nothing.
    ///
    /// # Errors
    /// Where a diagnosis failed.
    pub fn ensure_answered(&self) -> Result<()> {
        for (campaign, answer) in &self.0 {
            ensure!(!answer.failed, "{campaign}: {}", answer.names.join("; "));
        }
        Ok(())
    }
}

/// All that answers count in a figure.
fn sum<'a>(answers: impl Iterator<Item = &'a Answer>, at: usize) -> Share {
    answers.fold(Share::default(), |sum, own| Share {
        hits: sum.hits + own.figures[at].hits,
        of: sum.of + own.figures[at].of,
    })
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
        let complaints = list("complaints")?.iter().map(&text);
        let complaints = complaints.collect::<Result<Vec<_>>>()?;
        own.failed = !complaints.is_empty();
        own.names.extend(complaints);
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
        let moved = self.hits.iter().enumerate();
        let moved: Vec<String> = moved
            .filter(|(_, hits)| **hits != 0)
            .map(|(at, hits)| format!("{}: {hits:+}", at + 1))
            .collect();
        let names = if self.played == 0 {
            String::new()
        } else {
            format!("{} of {}", self.names, self.played)
        };
        format!("{} | {names} | {}", self.touched, moved.join(", "))
    }
}

/// One constant, halved and doubled.
pub struct Row<'a> {
    pub constant: &'a Constant,
    pub moved: [Moved; 2],
}

impl Row<'_> {
    /// Its line of the page's table.
    pub fn line(&self) -> String {
        let [low, high] = self.constant.varied();
        let [halved, doubled] = self.moved.each_ref().map(Moved::cell);
        let (path, value) = (self.constant.path(), self.constant.value);
        format!("| `{path}` | {value} | {low} | {halved} | {high} | {doubled} |")
    }
}

/// Mean, and its standard error.
fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (square / (n - 1.0).max(1.0) / n).sqrt())
}

/// The page.
pub fn page(command: &str, commit: &str, as_it_is: &Answers, rows: &[Row<'_>]) -> String {
    let campaigns = as_it_is.0.len();
    let all: Vec<&Moved> = rows.iter().flat_map(|row| &row.moved).collect();
    let count = |of: fn(&Moved) -> usize| all.iter().map(|moved| of(moved)).sum::<usize>();
    let figures: String = FIGURES
        .iter()
        .enumerate()
        .map(|(at, what)| {
            let share = as_it_is.figure(at);
            let points: Vec<f64> = all.iter().map(|moved| moved.points[at]).collect();
            let (mean, error) = mean_and_error(&points);
            let settings = |sign: i64| {
                let moved = all.iter().filter(|moved| moved.hits[at].signum() == sign);
                moved.count()
            };
            format!(
                "| {} | {what} | {} of {} | {mean:+.2} ± {error:.2} | {} | {} |\n",
                at + 1,
                share.hits,
                share.of,
                settings(1),
                settings(-1),
            )
        })
        .collect();
    let lines: Vec<String> = rows.iter().map(Row::line).collect();
    format!(
        "# The engine's constants, halved and doubled\n\n\
         {campaigns} development campaigns with nothing missing, one effect, or one effect of the measuring chain alone, on ideal sensors and \
         through real chains; the same for every line. Engine of commit `{commit}`. Printed by\n\n\
         ```\n{command}\n```\n\n\
         {} scalar constants of the engine's tables, each halved and doubled: {} settings. A constant that is only compared says itself where half or twice of it compares otherwise; \
         elsewhere the answer is the same, and is not asked for. Of {} answers so touched {} were asked for again, evenly spread, and stand for the others; {} of them have other \
         names (in number, kind or order).\n\n\
         ## Figures\n\n\
         A setting is one constant halved or doubled. What it moves a figure by: the mean over settings with its standard error, were all that it touches like what was \
         asked for again; as if settings were drawn independently, which those of one constant, or on one campaign, are not. Of one setting alone so few answers say little.\n\n\
         | | figure | as it is | a setting moves it by, points | settings with more | with fewer |\n\
         | --- | --- | --- | --- | --- | --- |\n{figures}\n\
         ## Each constant\n\n\
         Of a share or a probability of 0.4 and more its odds are halved and doubled; a count is no less than one. Touched: campaigns of {campaigns} in which it may change something. \
         Moved: figures of the table above that count more or fewer in what was asked for again; more is good of 2 to 4, bad of the others.\n\n\
         | constant | as it is | halved | touched | other names | moved | doubled | touched | other names | moved |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n{}\n",
        rows.len(),
        all.len(),
        count(|moved| moved.touched),
        count(|moved| moved.played),
        count(|moved| moved.names),
        lines.join("\n")
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
                "gains": [{"worse": false}, {"worse": !right}], "complaints": [],
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
        let right = answers("force_lag", true);
        let others = |answers: Answers, touched| Others { touched, answers };
        let none = right.moved(&others(answers("force_lag", true), 2)).unwrap();
        assert!(none.names == 0 && none.hits == [0; 6]);
        let untouched = right.moved(&others(Answers::none(), 0)).unwrap();
        assert!(untouched.played == 0 && untouched.points == [0.0; 6]);
        let moved = right
            .moved(&others(answers("force_delay", false), 2))
            .unwrap();
        assert_eq!((moved.names, moved.played), (1, 2));
        // Right first, wrong calls of two, and worse runs of four.
        assert_eq!(moved.points, [0.0, 0.0, 0.0, -100.0, 50.0, 25.0]);
        assert_eq!(moved.cell(), "2 | 1 of 2 | 4: -1, 5: +1, 6: +1");
    }

    #[test]
    fn a_diagnosis_that_failed_is_no_answer() {
        let case = json!({
            "campaign": "0", "stratum": "pair", "named": [], "gains": [], "complaints": ["it took too long"],
        });
        let failed = Answers([Answer::of(&case).unwrap()].into());
        assert!(failed.ensure_answered().is_err());
        assert!(answers("force_lag", true).ensure_answered().is_ok());
        // Of another value it is another answer.
        let own = Answers([("0".to_owned(), Answer::default())].into());
        let others = Others {
            touched: 1,
            answers: failed,
        };
        assert_eq!(own.moved(&others).unwrap().names, 1);
    }

    #[test]
    fn a_mean_is_as_sure_as_its_values_are_alike_and_many() {
        // Four thirds are their variance.
        let (mean, error) = mean_and_error(&[1.0, 1.0, 3.0, 3.0]);
        assert!((mean - 2.0).abs() < 1e-12 && (error - (4.0f64 / 3.0 / 4.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn what_is_asked_for_again_stands_for_what_is_not() {
        // Ten with nothing missing, of which one of four that are touched is asked for again.
        let nulls = |names: core::ops::Range<usize>, false_physics: bool| {
            let case = |name: usize| {
                json!({
                    "campaign": format!("{name}"), "stratum": "null", "real_chain": true, "of_the_chain": false,
                    "strength": [], "false_physics": false_physics, "first_right": false, "named": [], "gains": [], "complaints": [],
                })
            };
            Answers(names.map(|name| Answer::of(&case(name)).unwrap()).collect())
        };
        let moved = nulls(0..10, false).moved(&Others {
            touched: 4,
            answers: nulls(3..4, true),
        });
        let moved = moved.unwrap();
        assert!((moved.points[0] - 40.0).abs() < 1e-9 && moved.hits[0] == 1);
    }
}
