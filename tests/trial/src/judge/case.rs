//! One campaign's answer held against its sealed truth.

use std::path::Path;

use anyhow::Result;
use serde::Serialize;
use serde_json::Value;

use crate::contract::{breaches, list, number, text};
use crate::generate::campaign::Truth;
use crate::generate::instrument::ChainKind;
use crate::judge::findings::{FindingCase, false_findings, finding};
use crate::judge::gain::{GainCase, gains};
use crate::judge::names::{self, Standing, standing};
use crate::judge::timing::{self, LateCase, Timing};
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
    /// Whether it is one of the concealed effects.
    pub accepted: bool,
    /// The same, or it may stand beside them, or is true of the measuring chain.
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
    /// The one concealed effect is of a sort that the real chain before it has as well: judged by `timing_right` alone.
    pub of_the_chain: bool,
    /// Of such a campaign, whether the net delay is told, or the lag or ripple named.
    pub timing_right: Option<bool>,
    /// Speed channels of a real chain that `chain` should call late or early.
    pub late: Vec<LateCase>,
    /// What `chain` says on ideal sensors that is not there.
    pub false_findings: Vec<String>,
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
    /// Whether anything is named that neither was concealed nor is of the chain, or explained by a column that leaks.
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
    /// The base law's parameters, of null campaigns.
    pub base: Vec<FigureCase>,
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
                _ if self.of_the_chain => {
                    self.weakest() >= BAR_STRENGTH && self.timing_right == Some(false)
                }
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
    let mechanisms = list(diagnosis, "mechanisms");
    let standings: Vec<Standing> = mechanisms
        .iter()
        .map(|mechanism| standing_of(truth, mechanism))
        .collect();
    let named: Vec<Named> = mechanisms
        .iter()
        .zip(&standings)
        .map(|(mechanism, standing)| Named {
            id: text(mechanism, "id").to_owned(),
            accepted: *standing == Standing::Accepted,
            right: *standing != Standing::False,
            confidence: evidence(mechanism, "confidence"),
            confusable_with: list(mechanism, "confusable_with")
                .iter()
                .map(|other| text(other, "id").to_owned())
                .collect(),
            score: evidence(mechanism, "delta_bic"),
        })
        .collect();
    let first = names::first(&standings).map(|place| &named[place]);
    let first_right = first.is_some_and(|first| first.accepted);
    let in_set = first_right
        || first.is_some_and(|first| {
            first
                .confusable_with
                .iter()
                .any(|other| standing(truth, other) == Standing::Accepted)
        });
    let told: Vec<(&str, Standing)> = named
        .iter()
        .zip(&standings)
        .map(|(named, standing)| (named.id.as_str(), *standing))
        .collect();
    let f1 = names::f1(truth, &told);
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
        of_the_chain: timing::of_the_chain(truth),
        timing_right: timing::right(truth, diagnosis),
        late: timing::late(truth, diagnosis),
        false_findings: false_findings(truth, diagnosis),
        false_physics: named.iter().any(|named| !named.right) || by_leak(truth, diagnosis),
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
        base: base(truth, diagnosis),
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

/// A number of a mechanism's evidence.
fn evidence(mechanism: &Value, key: &str) -> f64 {
    mechanism
        .get("evidence")
        .map_or(f64::NAN, |evidence| number(evidence, key))
}

/// How a mechanism stands, its sign included: a speed that the chain makes late is not early.
fn standing_of(truth: &Truth, mechanism: &Value) -> Standing {
    let id = text(mechanism, "id");
    let early = matches!(id, "vehicle_speed_delay" | "wheel_speed_delay")
        && list(mechanism, "parameters").iter().any(|parameter| {
            text(parameter, "name") == "delay" && number(parameter, "value") < 0.0
        });
    match standing(truth, id) {
        Standing::OfTheChain if early => Standing::False,
        standing => standing,
    }
}

/// Whether a mismatch is put down to a column that reproduces the drag, which explains nothing.
fn by_leak(truth: &Truth, diagnosis: &Value) -> bool {
    truth.instruments.leak
        && truth.column.as_deref().is_some_and(|column| {
            ["unexplained", "regions"].iter().any(|key| {
                list(diagnosis, key)
                    .iter()
                    .any(|entry| text(entry, "variable") == column)
            })
        })
}

/// The base law's parameters of a campaign in which nothing is missing.
fn base(truth: &Truth, diagnosis: &Value) -> Vec<FigureCase> {
    if truth.stratum != "null" {
        return Vec::new();
    }
    [
        ("peak_friction", truth.base.peak_friction),
        ("critical_slip", truth.base.critical_slip),
    ]
    .into_iter()
    .filter_map(|(name, truth)| {
        let told = diagnosis.get("base")?.get(name)?;
        let (value, std) = (number(told, "value"), number(told, "std"));
        Some(FigureCase {
            mechanism: "base".to_owned(),
            name: name.to_owned(),
            truth,
            value,
            std,
            pull: pull(value, truth, std),
            attainable_std: None,
        })
    })
    .collect()
}

/// An error in its own standard deviations.
fn pull(value: f64, truth: f64, std: f64) -> f64 {
    (value - truth) / std.max(1e-12 * truth.abs()).max(f64::MIN_POSITIVE)
}

fn figures(truth: &Truth, mechanisms: &[Value]) -> Vec<FigureCase> {
    let mut cases = Vec::new();
    let chain = Timing::of_chain(truth);
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
                // A delay is told as it shows: with that of the chain.
                .map(|truth| match figure.name.as_str() {
                    "delay" => truth + chain.added(&concealed.effect.id),
                    _ => truth,
                })
                .min_by(|a, b| (a - value).abs().total_cmp(&(b - value).abs()));
            if let Some(true_value) = nearest {
                cases.push(FigureCase {
                    mechanism: concealed.effect.id.clone(),
                    name: figure.name.clone(),
                    truth: true_value,
                    value,
                    std,
                    pull: pull(value, true_value, std),
                    attainable_std: figure.attainable_std,
                });
            }
        }
    }
    cases
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
    use crate::judge::family::toy;

    #[test]
    fn overlap_is_intersection_over_union_of_the_balances_asked_for() {
        let interval = |start: f64, end: f64| serde_json::json!({"recording": "a/run01.csv", "balance": "tyre", "channel": "", "start_s": start, "end_s": end, "z": 1.0});
        let mut truth = toy::truth("null", "", "", 0.0);
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

    #[test]
    fn a_delay_that_the_chain_makes_has_a_sign() {
        let mut truth = toy::truth("null", "", "", 0.0);
        truth.tolerated = vec!["vehicle_speed_delay".into()];
        let named = |delay: f64| serde_json::json!({"id": "vehicle_speed_delay", "parameters": [{"name": "delay", "value": delay}]});
        assert_eq!(standing_of(&truth, &named(0.02)), Standing::OfTheChain);
        assert_eq!(standing_of(&truth, &named(-0.02)), Standing::False);
    }

    #[test]
    fn a_leaking_column_explains_nothing() {
        let mut truth = toy::truth("chain", "", "", 0.0);
        truth.column = Some("copy_n".into());
        let left = serde_json::json!({"unexplained": [{"variable": "copy_n"}]});
        let region = serde_json::json!({"regions": [{"variable": "copy_n"}]});
        assert!(!by_leak(&truth, &left));
        truth.instruments.leak = true;
        assert!(by_leak(&truth, &left) && by_leak(&truth, &region));
        assert!(!by_leak(
            &truth,
            &serde_json::json!({"unexplained": [{"variable": "slip"}]})
        ));
    }

    #[test]
    fn a_delay_is_judged_with_that_of_its_chain() {
        let mut truth = toy::truth("single", "wheel_speed_delay", "delay", 0.03);
        truth.instruments.wheel_late_s = 0.02;
        // One pole in every card: the drag is as late as its time constant.
        for card in [
            &mut truth.instruments.drag,
            &mut truth.instruments.load,
            &mut truth.instruments.brake,
        ] {
            (card.pole_s, card.poles) = (0.005, 1);
        }
        let named = serde_json::json!({"id": "wheel_speed_delay", "parameters": [{"name": "delay", "value": 0.044, "std": 0.001}]});
        let told = figures(&truth, &[named]);
        assert!((told[0].truth - 0.045).abs() < 1e-12 && (told[0].pull + 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_base_of_a_null_is_held_to_its_truth() {
        let truth = toy::truth("null", "", "", 0.0);
        let peak = truth.base.peak_friction;
        let diagnosis =
            serde_json::json!({"base": {"peak_friction": {"value": peak + 0.02, "std": 0.01}}});
        let told = base(&truth, &diagnosis);
        assert_eq!(told.len(), 1);
        assert!((told[0].pull - 2.0).abs() < 1e-9);
    }
}
