//! Whether `chain` tells the one effect of a measuring chain that is there, and nothing that is not.

use serde::Serialize;
use serde_json::Value;

use crate::contract::{list, number, text};
use crate::generate::campaign::Truth;
use crate::generate::instrument::ChainKind;
use crate::generate::instrument::finding::Finding;
use crate::generate::rig::NoiseKind;
use crate::judge::timing::{RELATIVE_SLACK, TIME_SLACK_S, Timing};

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

/// What `chain` says of the one effect of a chain that a campaign has: any entry of it, as there may be one a run.
pub fn finding(truth: &Truth, diagnosis: &Value) -> Option<FindingCase> {
    let first = truth.findings.first()?;
    let said: Vec<(&Finding, f64, f64)> = truth
        .findings
        .iter()
        .flat_map(|wanted| {
            list(diagnosis, "chain")
                .iter()
                .filter(|entry| text(entry, "finding") == wanted.finding)
                .filter_map(move |entry| {
                    let sign = if text(entry, "channel") == wanted.channel {
                        1.0
                    } else if wanted.finding == "late"
                        && text(entry, "relative_to") == wanted.channel
                    {
                        // The other channel is early by as much.
                        -1.0
                    } else {
                        return None;
                    };
                    Some((wanted, sign * number(entry, "value"), number(entry, "std")))
                })
        })
        .collect();
    let right = |(wanted, value, _): &&(&Finding, f64, f64)| {
        let slack = if matches!(wanted.finding.as_str(), "late" | "low_passed" | "held") {
            TIME_SLACK_S
        } else {
            0.0
        };
        (value - wanted.value).abs() <= slack.max(RELATIVE_SLACK * wanted.value.abs())
    };
    let best = said.iter().find(right);
    Some(FindingCase {
        channel: first.channel.clone(),
        finding: first.finding.clone(),
        truth: first.value,
        reported: best.or(said.first()).map(|said| (said.1, said.2)),
        right: best.is_some(),
    })
}

/// Findings on ideal sensors that are not there, as `channel: finding`. A concealed effect that works like a part of a
/// chain may be told as one.
pub fn false_findings(truth: &Truth, diagnosis: &Value) -> Vec<String> {
    if truth.instruments.kind != ChainKind::Ideal {
        return Vec::new();
    }
    let timing = Timing::of(truth);
    list(diagnosis, "chain")
        .iter()
        .filter(|entry| is_false(truth, &timing, entry))
        .map(|entry| format!("{}: {}", text(entry, "channel"), text(entry, "finding")))
        .collect()
}

fn is_false(truth: &Truth, timing: &Timing, entry: &Value) -> bool {
    let channel = text(entry, "channel");
    let (value, std) = (number(entry, "value"), number(entry, "std").max(0.0));
    let concealed = |ids: &[&str]| {
        truth.concealed.iter().any(|concealed| {
            let form = serde_json::to_value(concealed.effect.form).unwrap_or_default();
            ids.iter()
                .any(|id| concealed.effect.id == *id || form == *id)
        })
    };
    let beyond = value.abs() > 3.0 * std;
    // What delays or smooths the drag, and lags of which the recordings may not tell which they are.
    let slow_drag = concealed(&[
        "force_lag",
        "force_delay",
        "structural_resonance",
        "relaxation_length",
        "out_load_lag",
    ]);
    match text(entry, "finding") {
        "late" => {
            if slow_drag || (channel.starts_with("brake") && concealed(&["brake_lag"])) {
                return false;
            }
            let net = timing.net(channel, text(entry, "relative_to"));
            let off = (value - net.unwrap_or(0.0)).abs();
            off > 3.0 * std && off > TIME_SLACK_S
        }
        "low_passed" | "held" => {
            let slow = match channel {
                "vehicle_speed_m_s" => concealed(&["vehicle_speed_delay"]),
                "wheel_speed_rad_s" => concealed(&["wheel_speed_delay"]),
                "drag_force_n" => slow_drag,
                _ => channel.starts_with("brake") && concealed(&["brake_lag"]),
            };
            beyond && !slow
        }
        "common_noise" | "clock" | "leaks" => beyond,
        "hum" => beyond && !concealed(&["out_hum"]),
        // A wheel whose radius varies with its angle turns as unevenly as one whose ring is uneven.
        "ripple" => beyond && !concealed(&["encoder_ripple", "run_out"]),
        "coloured_noise" => {
            beyond && !matches!(truth.rig.noise, NoiseKind::Coloured | NoiseKind::Arma)
        }
        "quantised" => {
            let s = &truth.rig.sigmas;
            let sigma = match channel {
                "wheel_speed_rad_s" => s.wheel_speed_rad_s,
                "vehicle_speed_m_s" => s.vehicle_speed_m_s,
                "drag_force_n" => s.drag_force_n,
                "normal_force_n" => s.normal_force_n,
                _ => f64::INFINITY,
            };
            // The last decimal of a file is a step too, and a true one.
            beyond && truth.rig.noise != NoiseKind::Quantised && value.abs() > 0.05 * sigma
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::family::toy;
    use serde_json::json;

    fn entry(channel: &str, finding: &str, value: f64, std: f64) -> Value {
        json!({"recording": "run01.csv", "channel": channel, "relative_to": "", "finding": finding, "value": value, "std": std})
    }

    #[test]
    fn any_entry_of_a_finding_will_do_and_so_will_its_mirror() {
        let mut truth = toy::truth("chain", "", "", 0.0);
        truth.findings = vec![Finding {
            channel: "vehicle_speed_m_s".into(),
            finding: "late".into(),
            value: 0.05,
        }];
        let found = |entries: &[Value]| finding(&truth, &json!({"chain": entries})).unwrap();
        let late = |value: f64| entry("vehicle_speed_m_s", "late", value, 0.001);
        assert!(found(&[]).reported.is_none());
        assert!(!found(&[late(0.03)]).right);
        assert!(found(&[late(0.03), late(0.052)]).right);
        let mut mirror = entry("wheel_speed_rad_s", "late", -0.05, 0.001);
        assert!(!found(&[mirror.clone()]).right);
        mirror["relative_to"] = json!("vehicle_speed_m_s");
        let told = found(&[mirror]);
        assert!(told.right && told.reported == Some((0.05, 0.001)));
    }

    #[test]
    fn what_is_not_there_on_ideal_sensors_is_false() {
        let mut truth = toy::truth("null", "", "", 0.0);
        truth.rig.noise = NoiseKind::White;
        let count = |truth: &Truth, entries: &[Value]| {
            false_findings(truth, &json!({"chain": entries})).len()
        };
        let late = |value: f64, std: f64| entry("vehicle_speed_m_s", "late", value, std);
        assert_eq!(count(&truth, &[late(0.0015, 1e-4)]), 0, "within 2 ms");
        assert_eq!(count(&truth, &[late(0.01, 0.005)]), 0, "within 3 std");
        assert_eq!(count(&truth, &[late(0.01, 0.002)]), 1);
        let coloured = entry("drag_force_n", "coloured_noise", 30.0, 1.0);
        let hum = entry("drag_force_n", "hum", 30.0, 1.0);
        let zero = entry("drag_force_n", "zero", 30.0, 1.0);
        assert_eq!(count(&truth, &[coloured.clone(), hum, zero]), 2);
        truth.rig.noise = NoiseKind::Coloured;
        assert_eq!(count(&truth, &[coloured]), 0);
        let step = truth.rig.sigmas.drag_force_n;
        let quantised = |step: f64| entry("drag_force_n", "quantised", step, 0.0);
        assert_eq!(
            count(&truth, &[quantised(0.01 * step), quantised(2.0 * step)]),
            1
        );
        let delayed = toy::truth("single", "vehicle_speed_delay", "delay", 0.03);
        assert_eq!(count(&delayed, &[late(0.03, 0.001)]), 0);
        assert_eq!(count(&delayed, &[late(0.09, 0.001)]), 1);
    }
}
