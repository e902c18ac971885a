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
    for entry in VOCABULARY {
        demand(
            list(diagnosis, "looked_for")
                .iter()
                .any(|sought| text(sought, "id") == entry.0),
            &format!("looked_for lacks {}", entry.0),
        );
    }
    found
}
