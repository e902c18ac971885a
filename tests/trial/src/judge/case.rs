//! One campaign's answer held against its sealed truth.

use std::path::Path;

use anyhow::{Context, Result};
use serde::Serialize;
use serde_json::Value;

use crate::baseline::record::read as read_run;
use crate::contract::{breaches, list, number, text};
use crate::generate::campaign::Truth;
use crate::generate::files::read_column;
use crate::generate::instrument::ChainKind;
use crate::generate::instrument::finding::Finding;
use crate::generate::measure::{Base, base_drag, refit};
use crate::tool::Answer;

/// The weakest effect that the bars speak of, with the calibration's own tolerance.
pub const BAR_STRENGTH: f64 = 0.57;

/// A mechanism as the tool named it.
#[derive(Clone, Debug, Serialize)]
pub struct Named {
    pub id: String,
    pub confidence: f64,
    pub confusable_with: Vec<String>,
    /// Strength of the evidence by the tool's own criterion: `evidence.delta_bic`.
    pub score: f64,
    /// Whether it is one of the concealed effects (or may stand beside it).
    pub right: bool,
}

/// A reported figure beside the true one.
#[derive(Clone, Debug, Serialize)]
pub struct FigureCase {
    pub mechanism: String,
    pub name: String,
    pub truth: f64,
    pub value: f64,
    pub std: f64,
    pub pull: f64,
    /// Standard deviation that least squares with the true form could reach on these recordings; none where the
    /// parameter is not the strength that the effect was calibrated by.
    pub attainable_std: Option<f64>,
}

/// How a fresh run was predicted, in mean squared errors (N²) against the noise-free reading.
#[derive(Clone, Debug, Serialize)]
pub struct GainCase {
    pub file: String,
    pub repaired: f64,
    pub base: f64,
    pub floor: f64,
    pub floor_best: f64,
    /// Share of the oracle's gain above the floor; absent where the base is as good as the floor.
    pub share: Option<f64>,
    /// The same with the floor of an oracle that smooths its inputs.
    pub share_of_best: Option<f64>,
    /// Repaired worse than base by over 1 % of its mean squared error.
    pub worse: bool,
    /// The base worse than plain least squares of the law on the raw channels by over 1 %.
    pub base_worse: bool,
    /// Where the run stands in the campaign's order: `first`, `middle` or `last`.
    pub place: String,
    /// Scored samples whose reading lies within the 90 % band of the repaired prediction, of so many.
    pub in_band: (usize, usize),
}

/// What the measuring chain did, and whether `chain` says so.
#[derive(Clone, Debug, Serialize)]
pub struct FindingCase {
    pub channel: String,
    pub finding: String,
    pub truth: f64,
    /// Reported value and standard deviation, of the finding of that kind and channel.
    pub reported: Option<(f64, f64)>,
    /// Found, with its value within 20 % or 2 ms.
    pub right: bool,
}

/// One campaign, judged.
#[derive(Clone, Debug, Serialize)]
pub struct Case {
    pub campaign: String,
    pub stratum: String,
    pub kind: String,
    /// Sort of wheel-speed and of vehicle-speed sensor: `ideal`, `tone_ring`, `gps`, ...
    pub wheel_sensor: String,
    pub vehicle_sensor: String,
    /// Whether the recordings came through a real measuring chain.
    pub real_chain: bool,
    pub truth: Vec<String>,
    pub forms: Vec<String>,
    pub strength: Vec<f64>,
    pub verdict: String,
    pub named: Vec<Named>,
    pub unexplained: Vec<String>,
    /// p-value of the residuals' whiteness after the repair, on the runs that were fitted.
    pub whiteness_p: Option<f64>,
    /// What stands alone in the measuring chain, and whether `chain` says so.
    pub finding: Option<FindingCase>,
    /// Whether anything is named that neither was concealed nor is of the chain.
    pub false_physics: bool,
    /// What of the answer breaks the contract.
    pub breaches: Vec<String>,
    pub first_right: bool,
    pub in_set: bool,
    pub f1: f64,
    pub honest: bool,
    /// None where the contract has no word for the variable.
    pub variable_right: Option<bool>,
    pub figures: Vec<FigureCase>,
    pub gains: Vec<GainCase>,
    /// Intersection over union of the intervals, in the balances of the concealed effects.
    pub iou: Option<f64>,
    /// The same over all balances.
    pub iou_all: Option<f64>,
    pub local: bool,
    /// Wall time of `diagnose` on one thread, s.
    pub seconds: f64,
    /// Its processor time, s.
    pub processor_s: f64,
    pub samples: usize,
    pub complaints: Vec<String>,
}

impl Case {
    /// The weakest of the concealed effects.
    pub fn weakest(&self) -> f64 {
        self.strength.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Whether the campaign went wrong in what it was made to show.
    pub fn failed(&self) -> bool {
        !self.complaints.is_empty()
            || match self.stratum.as_str() {
                "null" => {
                    self.false_physics || (self.verdict != "consistent" && self.named.is_empty())
                }
                "chain" => {
                    self.false_physics
                        || self.finding.as_ref().is_some_and(|finding| !finding.right)
                }
                "outside" => !self.honest || self.variable_right == Some(false),
                "pair" => self.f1 < 1.0,
                _ => self.weakest() >= BAR_STRENGTH && !self.first_right,
            }
            || self
                .gains
                .iter()
                .any(|gain| gain.worse || gain.share.is_some_and(|share| share < 0.7))
    }

    /// One terse line.
    pub fn line(&self) -> String {
        let truth: Vec<String> = self
            .truth
            .iter()
            .zip(&self.forms)
            .zip(&self.strength)
            .map(|((id, form), z)| {
                if id == "outside" {
                    format!("{form}@{z:.1}")
                } else {
                    format!("{id}/{form}@{z:.1}")
                }
            })
            .collect();
        let named: Vec<String> = self
            .named
            .iter()
            .map(|named| {
                let others = if named.confusable_with.is_empty() {
                    String::new()
                } else {
                    format!("~{}", named.confusable_with.join("~"))
                };
                format!(
                    "{}{}:{:.2}{others}",
                    if named.right { "" } else { "!" },
                    named.id,
                    named.confidence
                )
            })
            .collect();
        let shares: Vec<String> = self
            .gains
            .iter()
            .map(|gain| {
                gain.share.map_or_else(
                    || {
                        if gain.worse {
                            "worse".into()
                        } else {
                            "-".into()
                        }
                    },
                    |s| format!("{s:.2}"),
                )
            })
            .collect();
        format!(
            "{} {} {:<7} {} {} -> {} [{}]{} gain {}{} {:.1}s{}",
            if self.failed() { "FAIL" } else { "ok  " },
            self.campaign.trim_start_matches("campaign-"),
            self.stratum,
            self.kind,
            truth.join(" + "),
            self.verdict,
            named.join(", "),
            if self.unexplained.is_empty() {
                String::new()
            } else {
                format!(" left({})", self.unexplained.join(","))
            },
            shares.join("/"),
            self.iou
                .map_or_else(String::new, |iou| format!(" iou {iou:.2}")),
            self.seconds,
            if self.complaints.is_empty() {
                String::new()
            } else {
                format!(" !! {}", self.complaints.join("; "))
            },
        )
    }
}

/// Judges an answer.
pub fn judge(campaigns: &Path, truth: &Truth, answer: &Answer) -> Result<Case> {
    let diagnosis = &answer.diagnosis;
    let accepted = |id: &str| {
        truth
            .concealed
            .iter()
            .any(|concealed| concealed.accept.iter().any(|name| name == id))
    };
    let tolerated = |id: &str| {
        truth
            .concealed
            .iter()
            .any(|concealed| concealed.tolerated.iter().any(|name| name == id))
    };
    let of_the_chain = |id: &str| truth.tolerated.iter().any(|name| name == id);
    let mechanisms = list(diagnosis, "mechanisms");
    let named: Vec<Named> = mechanisms
        .iter()
        .map(|mechanism| {
            let id = text(mechanism, "id").to_owned();
            Named {
                right: accepted(&id) || tolerated(&id) || of_the_chain(&id),
                confidence: mechanism
                    .get("evidence")
                    .map_or(f64::NAN, |evidence| number(evidence, "confidence")),
                confusable_with: list(mechanism, "confusable_with")
                    .iter()
                    .map(|other| text(other, "id").to_owned())
                    .collect(),
                score: mechanism
                    .get("evidence")
                    .map_or(f64::NAN, |evidence| number(evidence, "delta_bic")),
                id,
            }
        })
        .collect();
    // What the measuring chain itself makes true is neither the answer nor in its way.
    let first = named
        .iter()
        .find(|named| accepted(&named.id) || !of_the_chain(&named.id));
    let first_right = first.is_some_and(|first| accepted(&first.id));
    let in_set = first_right
        || first.is_some_and(|first| first.confusable_with.iter().any(|other| accepted(other)));
    let hits = truth
        .concealed
        .iter()
        .filter(|concealed| {
            named
                .iter()
                .any(|named| concealed.accept.contains(&named.id))
        })
        .count();
    let judged = named
        .iter()
        .filter(|named| accepted(&named.id) || !(tolerated(&named.id) || of_the_chain(&named.id)))
        .count();
    let wanted = truth
        .concealed
        .iter()
        .filter(|concealed| concealed.effect.id != "outside")
        .count();
    let f1 = if judged + wanted == 0 {
        1.0
    } else {
        2.0 * hits as f64 / (judged + wanted) as f64
    };
    let verdict = text(diagnosis, "verdict").to_owned();
    let unexplained: Vec<String> = list(diagnosis, "unexplained")
        .iter()
        .map(|left| text(left, "variable").to_owned())
        .collect();
    let variables: Vec<&String> = truth
        .concealed
        .iter()
        .flat_map(|concealed| &concealed.variables)
        .collect();
    let variable_right = (!variables.is_empty()).then(|| {
        unexplained
            .first()
            .is_some_and(|first| variables.contains(&first))
    });
    let own: Vec<&str> = truth
        .concealed
        .iter()
        .map(|concealed| concealed.effect.balance.as_str())
        .collect();
    let all: Vec<&str> = truth.balances.iter().map(String::as_str).collect();
    let coverage = truth
        .coverage
        .iter()
        .find(|(balance, _)| own.first() == Some(&balance.as_str()))
        .map_or(1.0, |entry| entry.1);
    let local = truth.concealed.len() == 1
        && (truth
            .concealed
            .iter()
            .any(|c| c.effect.id == "surface_patch" || c.effect.id == "force_saturation")
            || coverage < 0.25);
    Ok(Case {
        campaign: truth.campaign.clone(),
        stratum: truth.stratum.clone(),
        kind: match (truth.null, truth.instruments.kind) {
            (_, ChainKind::Only(kind)) => kind.word(),
            (Some(kind), _) => word(&kind),
            _ => String::new(),
        },
        wheel_sensor: truth.instruments.wheel.word().to_owned(),
        vehicle_sensor: truth.instruments.vehicle.word().to_owned(),
        real_chain: truth.instruments.kind == ChainKind::Real,
        false_physics: named.iter().any(|named| !named.right),
        whiteness_p: diagnosis
            .pointer("/fit/fit/after/whiteness_p")
            .and_then(Value::as_f64),
        finding: finding(truth, diagnosis),
        truth: truth
            .concealed
            .iter()
            .map(|concealed| concealed.effect.id.clone())
            .collect(),
        forms: truth
            .concealed
            .iter()
            .map(|concealed| word(&concealed.effect.form))
            .collect(),
        strength: truth
            .concealed
            .iter()
            .map(|concealed| concealed.effect.strength_sigma)
            .collect(),
        honest: matches!(verdict.as_str(), "unexplained" | "partly_explained"),
        verdict,
        first_right,
        in_set,
        f1,
        variable_right,
        figures: figures(truth, mechanisms),
        gains: gains(campaigns, truth, answer)?,
        iou: overlap(truth, diagnosis, &own),
        iou_all: overlap(truth, diagnosis, &all),
        local,
        named,
        unexplained,
        seconds: answer.cost.wall_s,
        processor_s: answer.cost.processor_s,
        samples: answer.samples,
        complaints: answer.complaints.clone(),
        breaches: breaches(diagnosis),
    })
}

/// A serialised enum's own word.
fn word(value: &impl Serialize) -> String {
    serde_json::to_value(value)
        .ok()
        .and_then(|value| value.as_str().map(str::to_owned))
        .unwrap_or_default()
}

fn figures(truth: &Truth, mechanisms: &[Value]) -> Vec<FigureCase> {
    let mut cases = Vec::new();
    for concealed in &truth.concealed {
        let Some(mechanism) = mechanisms
            .iter()
            .find(|mechanism| text(mechanism, "id") == concealed.effect.id)
        else {
            continue;
        };
        for figure in &concealed.figures {
            let Some(reported) = list(mechanism, "parameters")
                .iter()
                .find(|parameter| text(parameter, "name") == figure.name)
            else {
                continue;
            };
            let (mut value, std) = (number(reported, "value"), number(reported, "std"));
            // The loop has a height, and an amplitude a size; their signs are a matter of phase.
            let unsigned = matches!(figure.name.as_str(), "loop_share" | "amplitude");
            if unsigned {
                value = value.abs();
            }
            let nearest = figure
                .values
                .iter()
                .map(|truth| if unsigned { truth.abs() } else { *truth })
                .min_by(|a, b| (a - value).abs().total_cmp(&(b - value).abs()));
            if let Some(true_value) = nearest {
                cases.push(FigureCase {
                    mechanism: concealed.effect.id.clone(),
                    name: figure.name.clone(),
                    truth: true_value,
                    value,
                    std,
                    pull: (value - true_value)
                        / std.max(1e-12 * true_value.abs()).max(f64::MIN_POSITIVE),
                    attainable_std: figure.attainable_std,
                });
            }
        }
    }
    cases
}

/// Samples whose written reading lies within 1.645 stated standard deviations of the prediction: nine in ten of them
/// if these are right.
fn in_band(predicted: &[f64], sigma: &[f64], written: &[f64], scored: &[f64]) -> (usize, usize) {
    let mut found = (0, 0);
    for (((predicted, sigma), written), scored) in
        predicted.iter().zip(sigma).zip(written).zip(scored)
    {
        if *scored > 0.5 && written.is_finite() {
            found.0 += usize::from((written - predicted).abs() <= 1.645 * sigma);
            found.1 += 1;
        }
    }
    found
}

/// Plain least squares of the law on the raw channels of the fitted runs.
fn least_squares(campaigns: &Path, truth: &Truth) -> Result<Base> {
    let mut runs = Vec::new();
    for number in 1.. {
        let path = campaigns
            .join(&truth.campaign)
            .join(format!("run{number:02}.csv"));
        if !path.exists() {
            break;
        }
        runs.push(read_run(&path, &truth.rig)?);
    }
    Ok(refit(&truth.rig, &runs))
}

/// A fresh run's drag by the law alone.
fn plain_base(campaigns: &Path, truth: &Truth, file: &str, base: Base) -> Option<Vec<f64>> {
    let path = campaigns.join("fresh").join(&truth.campaign).join(file);
    let run = read_run(&path, &truth.rig).ok()?;
    Some(
        (0..run.time.len())
            .map(|index| base_drag(&truth.rig, base, &run, index))
            .collect(),
    )
}

/// What `chain` says of the one effect of a chain that a campaign has.
fn finding(truth: &Truth, diagnosis: &Value) -> Option<FindingCase> {
    let first = truth.findings.first()?;
    let said = |wanted: &Finding| {
        list(diagnosis, "chain")
            .iter()
            .find(|entry| {
                text(entry, "channel") == wanted.channel && text(entry, "finding") == wanted.finding
            })
            .map(|entry| (number(entry, "value"), number(entry, "std")))
    };
    let right = |wanted: &Finding| {
        // A time may be off by 2 ms, whatever its size.
        let slack: f64 = if matches!(wanted.finding.as_str(), "late" | "low_passed" | "held") {
            2e-3
        } else {
            0.0
        };
        said(wanted).is_some_and(|(value, _)| {
            (value - wanted.value).abs() <= slack.max(0.2 * wanted.value.abs())
        })
    };
    Some(FindingCase {
        channel: first.channel.clone(),
        finding: first.finding.clone(),
        truth: first.value,
        reported: truth.findings.iter().find_map(said),
        right: truth.findings.iter().any(right),
    })
}

fn gains(campaigns: &Path, truth: &Truth, answer: &Answer) -> Result<Vec<GainCase>> {
    let mut cases = Vec::new();
    let least_squares = least_squares(campaigns, truth)?;
    for fresh in &truth.fresh {
        let sealed = campaigns
            .join("sealed")
            .join(&truth.campaign)
            .join(&fresh.file);
        let reading = read_column(&sealed, "drag_force_n").context("sealed reading")?;
        let scored = read_column(&sealed, "scored")?;
        let Some(prediction) = answer
            .predictions
            .iter()
            .find(|prediction| prediction.file == fresh.file)
        else {
            continue;
        };
        let error = |predicted: &[f64]| -> f64 {
            if predicted.len() != reading.len() {
                return f64::INFINITY;
            }
            let mut sum = 0.0;
            let mut count = 0.0;
            for ((predicted, reading), scored) in predicted.iter().zip(&reading).zip(&scored) {
                if *scored > 0.5 {
                    sum += if predicted.is_finite() {
                        (predicted - reading).powi(2)
                    } else {
                        f64::INFINITY
                    };
                    count += 1.0;
                }
            }
            if count > 0.0 { sum / count } else { f64::NAN }
        };
        let predicted = |path: &Path| read_column(path, "drag_force_n").unwrap_or_default();
        let plain = plain_base(campaigns, truth, &fresh.file, least_squares)
            .map(|predicted| error(&predicted));
        let in_band = in_band(
            &predicted(&prediction.repaired),
            &read_column(&prediction.repaired, "drag_force_sigma_n").unwrap_or_default(),
            &read_column(&sealed, "written_drag_force_n")?,
            &scored,
        );
        let (repaired, base) = (
            error(&predicted(&prediction.repaired)),
            error(&predicted(&prediction.base)),
        );
        let share = |floor: f64| {
            (fresh.gain_scored && base > 1.25 * floor && base.is_finite())
                .then(|| 1.0 - (repaired - floor) / (base - floor))
        };
        cases.push(GainCase {
            file: fresh.file.clone(),
            repaired,
            base,
            floor: fresh.floor,
            floor_best: fresh.floor_best,
            share: share(fresh.floor),
            share_of_best: share(fresh.floor_best),
            worse: repaired.is_nan() || repaired > 1.01 * base,
            base_worse: plain.is_some_and(|plain| base > 1.01 * plain),
            place: fresh.place.clone(),
            in_band,
        });
    }
    Ok(cases)
}

/// Intersection over union of the intervals in some balances; absent where the truth has none.
fn overlap(truth: &Truth, diagnosis: &Value, balances: &[&str]) -> Option<f64> {
    let mut spans: Vec<(String, f64, f64, bool)> = Vec::new();
    for interval in &truth.intervals {
        if balances.contains(&interval.balance.as_str()) {
            spans.push((
                format!("{} {}", interval.recording, interval.balance),
                interval.start_s,
                interval.end_s,
                true,
            ));
        }
    }
    let total: f64 = spans.iter().map(|span| span.2 - span.1).sum();
    if total < 0.1 {
        return None;
    }
    for interval in list(diagnosis, "where") {
        if balances.contains(&text(interval, "balance")) {
            let recording = text(interval, "recording")
                .rsplit(['/', '\\'])
                .next()
                .unwrap_or("");
            spans.push((
                format!("{recording} {}", text(interval, "balance")),
                number(interval, "start_s"),
                number(interval, "end_s"),
                false,
            ));
        }
    }
    let mut keys: Vec<String> = spans.iter().map(|span| span.0.clone()).collect();
    keys.sort();
    keys.dedup();
    let (mut both, mut either) = (0.0, 0.0);
    for key in keys {
        // A sweep over all edges of this recording and balance.
        let mut edges: Vec<(f64, bool, i32)> = Vec::new();
        for (_, start, end, true_one) in spans.iter().filter(|span| span.0 == key) {
            edges.push((*start, *true_one, 1));
            edges.push((*end, *true_one, -1));
        }
        edges.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut in_truth, mut in_answer, mut last) = (0, 0, f64::NAN);
        for (time, true_one, step) in edges {
            let span = if last.is_finite() { time - last } else { 0.0 };
            if in_truth > 0 && in_answer > 0 {
                both += span;
            }
            if in_truth > 0 || in_answer > 0 {
                either += span;
            }
            if true_one {
                in_truth += step;
            } else {
                in_answer += step;
            }
            last = time;
        }
    }
    Some(if either > 0.0 { both / either } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlap_is_intersection_over_union_of_the_balances_asked_for() {
        let interval = |start: f64, end: f64| serde_json::json!({"recording": "a/run01.csv", "balance": "tyre", "channel": "", "start_s": start, "end_s": end, "z": 1.0});
        let mut truth: Truth = minimal();
        truth.intervals = vec![crate::generate::measure::Interval {
            recording: "run01.csv".into(),
            balance: "tyre".into(),
            start_s: 1.0,
            end_s: 3.0,
        }];
        let diagnosis = serde_json::json!({"where": [interval(2.0, 4.0)]});
        let iou = overlap(&truth, &diagnosis, &["tyre"]).unwrap();
        assert!((iou - 1.0 / 3.0).abs() < 1e-12);
        assert_eq!(
            overlap(
                &truth,
                &serde_json::json!({"where": [interval(1.0, 3.0)]}),
                &["tyre"]
            ),
            Some(1.0)
        );
        assert_eq!(overlap(&truth, &diagnosis, &["wheel"]), None);
    }

    fn minimal() -> Truth {
        let order = crate::generate::campaign::Order {
            stratum: "null".into(),
            forms: vec![],
            strength: vec![],
            null: Some(crate::generate::campaign::NullKind::White),
            chain: crate::generate::instrument::ChainKind::Ideal,
        };
        crate::generate::campaign::make("campaign-0000", 5, &order)
            .unwrap()
            .truth
    }
}
