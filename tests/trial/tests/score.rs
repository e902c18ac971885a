//! The scorer against tools whose worth is known: one that never sees anything, and one that knows all.
#![cfg(unix)]
#![expect(clippy::unwrap_used, reason = "a test stops where it cannot go on")]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use sealed_trial::{Report, Request, ScoreRequest, Tool, generate, score};
use serde_json::{Value, json};

const IDS: [&str; 29] = [
    "curve_shape",
    "load_sensitivity",
    "speed_sensitivity",
    "thermal_fade",
    "relaxation_length",
    "rolling_resistance",
    "effective_radius",
    "surface_patch",
    "wear_drift",
    "slip_hysteresis",
    "force_delay",
    "force_lag",
    "structural_resonance",
    "inertial_reaction",
    "load_crosstalk",
    "zero_drift",
    "force_gain",
    "force_saturation",
    "run_out",
    "encoder_ripple",
    "vehicle_speed_delay",
    "wheel_speed_delay",
    "aero_drag",
    "grade_or_drive",
    "vehicle_inertia",
    "bearing_drag",
    "brake_fade",
    "brake_lag",
    "wheel_inertia",
];

fn campaigns(directory: &Path) {
    let request = |stratum: &str, count: usize, mechanism: Option<&str>| Request {
        stratum: stratum.into(),
        real_chain: false,
        count,
        mechanism: mechanism.map(Into::into),
        strength: mechanism.map(|_| 1.0),
    };
    let wanted = [
        request("null", 3, None),
        request("single", 2, Some("force_delay")),
        request("single", 1, Some("surface_patch")),
        request("outside", 2, None),
        request("chain", 13, None),
        Request {
            real_chain: true,
            ..request("null", 2, None)
        },
    ];
    generate(directory, &wanted, 77).unwrap();
}

fn diagnosis(truth: Option<&Value>) -> Value {
    let mut mechanisms = vec![];
    let mut unexplained = vec![];
    let mut places = vec![];
    for concealed in truth.map_or(&vec![], |truth| truth["concealed"].as_array().unwrap()) {
        if concealed["effect"]["id"] == "outside" {
            let variable = concealed["variables"].get(0).cloned().unwrap_or(json!(""));
            unexplained.push(json!({"balance": "tyre", "variable": variable, "form": "", "z": 9.0, "share": 0.5}));
            continue;
        }
        let parameters: Vec<Value> = concealed["figures"]
            .as_array()
            .unwrap()
            .iter()
            .map(|figure| json!({"name": figure["name"], "value": figure["values"][0], "std": 1e-6, "unit": figure["unit"]}))
            .collect();
        mechanisms.push(
            json!({"id": concealed["effect"]["id"], "balance": concealed["effect"]["balance"],
            "statement": "as the sealed file says", "equation": "", "parameters": parameters,
            "evidence": {"delta_bic": 1.0, "holdout_nll_gain_per_sample": 0.1, "confidence": 0.99},
            "confusable_with": [], "separating_test": ""}),
        );
    }
    if let Some(truth) = truth {
        places = truth["where"].as_array().unwrap().clone();
        for place in &mut places {
            place["channel"] = json!("drag_force_n");
            place["z"] = json!(5.0);
        }
    }
    let verdict = match (mechanisms.is_empty(), unexplained.is_empty()) {
        (true, true) => "consistent",
        (false, true) => "explained",
        (true, false) => "unexplained",
        _ => "partly_explained",
    };
    if verdict == "consistent" {
        places.clear();
    }
    let looked: Vec<Value> = IDS
        .iter()
        .map(|id| json!({"id": id, "identifiable": true, "minimum_detectable": null}))
        .collect();
    let chain: Vec<Value> = truth
        .and_then(|truth| truth["findings"].as_array())
        .into_iter()
        .flatten()
        .map(|finding| {
            json!({"recording": "*", "channel": finding["channel"], "finding": finding["finding"],
                "value": finding["value"], "std": 0.0, "unit": "", "statement": "as the sealed file says"})
        })
        .collect();
    json!({"schema": "muslip.diagnosis/1", "verdict": verdict, "chain": chain, "recordings": [], "noise": {}, "where": places, "regions": [],
        "base": {"peak_friction": {"value": 0.8, "std": 0.01}, "critical_slip": {"value": 0.1, "std": 0.01}},
        "mechanisms": mechanisms, "unexplained": unexplained, "looked_for": looked, "data_faults": [], "fit": {}})
}

/// A tool that answers with prepared files. Its base predicts nothing at all; its repaired model
/// gives the sealed reading, or nothing either.
fn tool(directory: &Path, knowing: bool) -> Tool {
    let answers = directory.join("prepared");
    for entry in fs::read_dir(directory.join("sealed")).unwrap() {
        let sealed = entry.unwrap().path();
        let truth: Value =
            serde_json::from_str(&fs::read_to_string(sealed.join("truth.json")).unwrap()).unwrap();
        let target = answers.join(sealed.file_name().unwrap());
        fs::create_dir_all(&target).unwrap();
        fs::write(
            target.join("diagnosis.json"),
            diagnosis(knowing.then_some(&truth)).to_string(),
        )
        .unwrap();
    }
    let script = format!(
        r#"#!/bin/sh
if [ "$1" = diagnose ]; then
  cp "{answers}/$(basename "$5")/diagnosis.json" "$5/diagnosis.json"; echo > "$5/model.toml"
else
  for last; do :; done
  base=no; for word; do [ "$word" = --base ] && base=yes; done
  campaign=$(basename "$(dirname "$last")")
  if [ $base = no ] && [ {knowing} = true ]; then cp "{root}/sealed/$campaign/$(basename "$last")" "$7"
  else awk 'NR==1 {{print "time_s,drag_force_n"}} NR>1 {{split($0,c,","); print c[1] ",0"}}' "$last" > "$7"; fi
fi
"#,
        answers = answers.display(),
        root = directory.display(),
    );
    let path = directory.join(if knowing { "knowing.sh" } else { "blind.sh" });
    fs::write(&path, script).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    Tool {
        path,
        diagnose_arguments: vec![],
    }
}

fn judged(directory: &Path, knowing: bool) -> Report {
    score(&request(directory, knowing)).unwrap()
}

fn request(directory: &Path, knowing: bool) -> ScoreRequest {
    ScoreRequest {
        tool: tool(directory, knowing),
        campaigns: PathBuf::from(directory),
        results: directory.join(if knowing {
            "answers-knowing"
        } else {
            "answers-blind"
        }),
        strata: vec![],
        only: None,
        baselines: false,
        jobs: 2,
        reuse: false,
        every: 1,
    }
}

#[test]
fn a_tool_that_knows_the_truth_gets_full_marks_and_a_blind_one_none() {
    let directory = tempfile::tempdir().unwrap();
    campaigns(directory.path());
    let knowing = judged(directory.path(), true).lines(true);
    assert_eq!(knowing, "", "nothing may be counted against the truth");
    let report = judged(directory.path(), false);
    let lines = report.lines(false);
    assert_eq!(lines.lines().count(), 23, "{lines}");
    for line in lines.lines() {
        let fails = [" single ", " outside ", " chain "]
            .iter()
            .any(|stratum| line.contains(stratum));
        assert_eq!(line.starts_with("FAIL"), fails, "{line}");
    }
    assert!(
        report
            .text()
            .contains("one effect from 0.6 sigma, ideal sensors: right first")
    );
    assert!(
        report
            .text()
            .contains("nothing missing, real chains: false names")
    );
}

#[test]
fn a_broken_seal_is_noticed() {
    let directory = tempfile::tempdir().unwrap();
    campaigns(directory.path());
    let truth = directory.path().join("sealed/campaign-0000/truth.json");
    let text = fs::read_to_string(&truth).unwrap();
    fs::write(&truth, text + " ").unwrap();
    let refused = score(&request(directory.path(), false));
    assert!(
        refused
            .unwrap_err()
            .to_string()
            .contains("not what was sealed")
    );
}

#[test]
fn the_same_seed_gives_the_same_seal() {
    let (one, two) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let request = [Request {
        stratum: "pair".into(),
        real_chain: false,
        count: 2,
        mechanism: None,
        strength: None,
    }];
    assert_eq!(
        generate(one.path(), &request, 5).unwrap(),
        generate(two.path(), &request, 5).unwrap()
    );
    assert_ne!(
        generate(tempfile::tempdir().unwrap().path(), &request, 6).unwrap(),
        generate(tempfile::tempdir().unwrap().path(), &request, 5).unwrap()
    );
}
