//! `muslip diagnose` on recordings that others have measured: what is certain to come out of them.
//!
//! What ought to come out but does not yet is in the sealed trial's table of measured recordings
//! (`cargo xtask trial`), with its figures.

use std::path::Path;

use crate::common::{Scratch, measured_data};
use serde_json::Value;

fn diagnosed(folder: &Path, names: &[String]) -> Value {
    let scratch = Scratch::new();
    let path = |name: &str| folder.join(name).display().to_string();
    let rig = path("rig.toml");
    let runs: Vec<String> = names.iter().map(|name| path(name)).collect();
    let mut arguments = vec!["diagnose", "--json", "--rig", &rig, "--out", "found"];
    arguments.extend(runs.iter().map(String::as_str));
    scratch.json(&arguments)
}

#[test]
fn coast_downs_convict_the_vehicle_balance_of_a_constant_force_and_not_of_aero_drag() {
    let Some(folder) = measured_data("dart-coastdown") else {
        return;
    };
    let names: Vec<String> = (1..=6).map(|n| format!("coast{n}.csv")).collect();
    let found = diagnosed(&folder, &names);
    let mechanisms = found["mechanisms"].as_array().unwrap();
    assert_eq!(mechanisms[0]["id"], "grade_or_drive", "{mechanisms:#?}");
    assert!(
        mechanisms.iter().all(|m| m["id"] != "aero_drag"),
        "{mechanisms:#?}"
    );
    let places = found["where"].as_array().unwrap();
    for name in &names {
        assert!(
            places.iter().any(|place| place["balance"] == "vehicle"
                && place["recording"].as_str().unwrap().ends_with(name)),
            "{name}: {places:#?}"
        );
    }
}

#[test]
fn rubber_and_tape_do_not_follow_one_pair_of_parameters_and_it_is_said() {
    let Some(folder) = measured_data("dart-friction") else {
        return;
    };
    // Enough for unseen runs to decide; the whole set takes a minute.
    let names = [
        "circle01.csv",
        "circle02.csv",
        "circle04.csv",
        "drift09.csv",
        "drift10.csv",
    ]
    .map(str::to_owned);
    let verdict = diagnosed(&folder, &names)["verdict"].clone();
    assert!(
        ["explained", "partly_explained", "unexplained"].contains(&verdict.as_str().unwrap()),
        "{verdict}"
    );
}
