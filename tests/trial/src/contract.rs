//! The essentials of the contract that a `diagnosis.json` must keep.

use serde_json::Value;

use crate::generate::form::VOCABULARY;

const VERDICTS: [&str; 5] = [
    "consistent",
    "explained",
    "partly_explained",
    "unexplained",
    "undecided",
];
const BALANCES: [&str; 3] = ["tyre", "wheel", "vehicle"];

/// A list in a value, empty where there is none.
pub fn list<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value
        .get(key)
        .and_then(Value::as_array)
        .map_or(&[], Vec::as_slice)
}

/// A text in a value, empty where there is none.
pub fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value.get(key).and_then(Value::as_str).unwrap_or("")
}

/// A number in a value, not a number where there is none.
pub fn number(value: &Value, key: &str) -> f64 {
    value.get(key).and_then(Value::as_f64).unwrap_or(f64::NAN)
}

/// Everything in a diagnosis that breaks the contract.
pub fn complaints(diagnosis: &Value) -> Vec<String> {
    let mut found = Vec::new();
    let mut demand = |good: bool, what: &str| {
        if !good {
            found.push(what.to_owned());
        }
    };
    demand(
        text(diagnosis, "schema") == "muslip.diagnosis/1",
        "schema is not muslip.diagnosis/1",
    );
    let verdict = text(diagnosis, "verdict");
    demand(VERDICTS.contains(&verdict), "unknown verdict");
    for key in [
        "recordings",
        "where",
        "regions",
        "mechanisms",
        "unexplained",
        "looked_for",
        "data_faults",
    ] {
        demand(
            diagnosis.get(key).is_some_and(Value::is_array),
            &format!("{key} is no list"),
        );
    }
    for key in ["noise", "base", "fit"] {
        demand(
            diagnosis.get(key).is_some_and(Value::is_object),
            &format!("{key} is no table"),
        );
    }
    for parameter in ["peak_friction", "critical_slip"] {
        let estimate = diagnosis
            .get("base")
            .and_then(|base| base.get(parameter))
            .unwrap_or(&Value::Null);
        demand(
            number(estimate, "value").is_finite() && number(estimate, "std") >= 0.0,
            &format!("base.{parameter} has no value with std"),
        );
    }
    let (named, left) = (
        list(diagnosis, "mechanisms"),
        list(diagnosis, "unexplained"),
    );
    let agrees = match verdict {
        "consistent" => named.is_empty() && left.is_empty() && list(diagnosis, "where").is_empty(),
        "explained" => !named.is_empty() && left.is_empty(),
        "partly_explained" => !named.is_empty() && !left.is_empty(),
        "unexplained" => named.is_empty() && !left.is_empty(),
        _ => true,
    };
    demand(agrees, "verdict does not agree with the lists");
    let known = |id: &str| VOCABULARY.iter().any(|entry| entry.0 == id);
    for mechanism in named {
        let id = text(mechanism, "id");
        demand(known(id), &format!("`{id}` is no mechanism"));
        demand(
            BALANCES.contains(&text(mechanism, "balance")),
            &format!("{id}: unknown balance"),
        );
        demand(
            text(mechanism, "statement").len() >= 10,
            &format!("{id}: no statement"),
        );
        demand(
            !list(mechanism, "parameters").is_empty(),
            &format!("{id}: no parameters"),
        );
        for parameter in list(mechanism, "parameters") {
            demand(
                number(parameter, "value").is_finite() && number(parameter, "std") >= 0.0,
                &format!(
                    "{id}: parameter `{}` has no value with std",
                    text(parameter, "name")
                ),
            );
        }
        let confidence = mechanism
            .get("evidence")
            .map_or(f64::NAN, |evidence| number(evidence, "confidence"));
        demand(
            (0.0..=1.0).contains(&confidence),
            &format!("{id}: confidence is no probability"),
        );
        demand(
            list(mechanism, "confusable_with")
                .iter()
                .all(|other| known(text(other, "id"))),
            &format!("{id}: confusable with the unknown"),
        );
    }
    for interval in list(diagnosis, "where") {
        demand(
            BALANCES.contains(&text(interval, "balance"))
                && number(interval, "end_s") >= number(interval, "start_s"),
            "where: an interval without balance or backwards",
        );
    }
    found
}

/// The contract's words for what a measuring chain does.
const FINDINGS: [&str; 13] = [
    "late",
    "low_passed",
    "coloured_noise",
    "common_noise",
    "quantised",
    "held",
    "scale",
    "zero",
    "drifts",
    "hum",
    "ripple",
    "clock",
    "leaks",
];

/// What of the contract's later parts an answer does not keep: a list of what is looked for that is whole, the `chain`,
/// and no name held for more likely than not that makes unseen runs worse. Counted, not fatal.
pub fn breaches(diagnosis: &Value) -> Vec<String> {
    let mut found = Vec::new();
    for entry in VOCABULARY {
        if !list(diagnosis, "looked_for")
            .iter()
            .any(|sought| text(sought, "id") == entry.0)
        {
            found.push(format!("looked_for lacks {}", entry.0));
        }
    }
    if !diagnosis.get("chain").is_some_and(Value::is_array) {
        found.push("there is no chain".to_owned());
    }
    for entry in list(diagnosis, "chain") {
        let word = text(entry, "finding");
        if !FINDINGS.contains(&word) {
            found.push(format!("chain: unknown finding `{word}`"));
        }
        if !(number(entry, "value").is_finite() && number(entry, "std") >= 0.0) {
            found.push(format!("chain: {word} has no value with std"));
        }
        if text(entry, "channel").is_empty() || text(entry, "statement").len() < 10 {
            found.push(format!("chain: {word} without channel or statement"));
        }
    }
    for mechanism in list(diagnosis, "mechanisms") {
        let evidence = mechanism.get("evidence").unwrap_or(&Value::Null);
        let gain = number(evidence, "holdout_nll_gain_per_sample");
        if gain.is_nan() {
            let id = text(mechanism, "id");
            found.push(format!("{id}: no holdout_nll_gain_per_sample"));
        } else if number(evidence, "confidence") > 0.5 && gain < 0.0 {
            found.push("a name above 0.5 makes unseen runs worse".to_owned());
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_chain_is_held_to_its_words_and_a_name_to_unseen_runs() {
        let looked: Vec<Value> = VOCABULARY
            .iter()
            .map(|entry| json!({"id": entry.0}))
            .collect();
        let late = json!({"channel": "vehicle_speed_m_s", "finding": "late", "value": 0.05, "std": 0.002,
            "statement": "the vehicle speed is late"});
        let named = |gain: f64| json!({"id": "force_lag", "evidence": {"confidence": 0.9, "holdout_nll_gain_per_sample": gain}});
        let good = json!({"looked_for": looked, "chain": [late], "mechanisms": [named(0.1)]});
        assert!(breaches(&good).is_empty(), "{:?}", breaches(&good));
        let worse = json!({"looked_for": looked, "chain": [], "mechanisms": [named(-0.1)]});
        assert_eq!(breaches(&worse).len(), 1);
        let silent = json!({"looked_for": looked, "chain": [], "mechanisms": [{"id": "force_lag", "evidence": {"confidence": 0.3}}]});
        assert_eq!(breaches(&silent).len(), 1);
        let odd = json!({"looked_for": looked, "chain": [{"channel": "x", "finding": "tardy"}], "mechanisms": []});
        assert_eq!(breaches(&odd).len(), 3);
        let none = json!({"looked_for": [], "mechanisms": []});
        assert_eq!(breaches(&none).len(), VOCABULARY.len() + 1);
    }
}
