//! `muslip diagnose` from files to files, the engine included.

use crate::common::Scratch;
use crate::diagnosis::{HEADER, RIG, Random, assert_valid, campaign, lagging};
use proptest::prelude::*;
use serde_json::Value;

fn faithful(_: u64) -> Box<dyn FnMut(f64, f64) -> f64> {
    Box::new(|_, drag| drag)
}

fn names(count: usize) -> Vec<String> {
    (0..count).map(|k| format!("run{k}.csv")).collect()
}

fn bench(recordings: &[String]) -> Scratch {
    let scratch = Scratch::with_rig(RIG);
    for (name, text) in names(recordings.len()).iter().zip(recordings) {
        scratch.write(name, text);
    }
    scratch
}

fn arguments<'a>(names: &'a [String], more: &[&'a str]) -> Vec<&'a str> {
    let mut all = vec!["diagnose", "--rig", "rig.toml", "--out", "found"];
    all.extend(more);
    all.extend(names.iter().map(String::as_str));
    all
}

/// Diagnoses recordings that must not be refused; what the files say is checked against the contract.
fn diagnosed(recordings: &[String]) -> Value {
    let scratch = bench(recordings);
    scratch.output(&arguments(&names(recordings.len()), &[]));
    let text = scratch.read("found/diagnosis.json");
    assert_valid(&text);
    let value: Value = serde_json::from_str(&text).unwrap();
    let has = |key: &str| value[key].as_array().is_some_and(|list| !list.is_empty());
    let expected = match value["verdict"].as_str().unwrap() {
        "explained" => (true, false),
        "partly_explained" => (true, true),
        "unexplained" => (false, true),
        _ => (false, false),
    };
    assert_eq!(
        (has("mechanisms"), has("unexplained")),
        expected,
        "{value:#}"
    );
    value
}

fn faults(value: &Value) -> Vec<(String, String)> {
    let text = |fault: &Value, key: &str| fault[key].as_str().unwrap().to_owned();
    let list = value["data_faults"].as_array().unwrap();
    list.iter()
        .map(|fault| (text(fault, "channel"), text(fault, "what")))
        .collect()
}

#[test]
fn a_concealed_lag_is_found_and_the_repaired_model_predicts_a_run_that_it_never_saw() {
    let recordings = campaign(1..6, lagging);
    let scratch = bench(&recordings);
    let seen = names(4);
    let told = scratch.output(&arguments(&seen, &[]));
    assert!(
        told.starts_with("Explained: the simulation lacks force lag;"),
        "{told}"
    );
    let value: Value = serde_json::from_str(&scratch.read("found/diagnosis.json")).unwrap();
    assert_valid(&scratch.read("found/diagnosis.json"));
    let lag = &value["mechanisms"][0]["parameters"][0];
    assert_eq!(value["mechanisms"][0]["id"], "force_lag");
    let (constant, std) = (lag["value"].as_f64().unwrap(), lag["std"].as_f64().unwrap());
    assert!(
        (constant - 0.010).abs() < 4.0 * std.max(2e-4),
        "{constant} {std}"
    );
    assert!(scratch.read("found/report.html").contains("Force lag"));
    assert_eq!(
        scratch.files(),
        [
            "found", "rig.toml", "run0.csv", "run1.csv", "run2.csv", "run3.csv", "run4.csv"
        ]
    );

    let errors: Vec<f64> = [None, Some("--base")]
        .into_iter()
        .map(|flag| {
            let mut predict = vec![
                "predict",
                "--rig",
                "rig.toml",
                "--model",
                "found/model.toml",
            ];
            predict.extend(["--out", "pred.csv", "run4.csv"]);
            predict.extend(flag);
            scratch.output(&predict);
            let column = |name: &str, at: usize| -> Vec<f64> {
                let text = scratch.read(name);
                let rows = text.lines().skip(1);
                rows.map(|row| row.split(',').nth(at).unwrap().parse().unwrap())
                    .collect()
            };
            let (predicted, measured) = (column("pred.csv", 1), column("run4.csv", 3));
            assert_eq!(predicted.len(), measured.len());
            let square: f64 = predicted
                .iter()
                .zip(&measured)
                .map(|(p, m)| (p - m).powi(2))
                .sum();
            (square / measured.len() as f64).sqrt()
        })
        .collect();
    assert!(errors[0] < 105.0, "the noise is 90 N: {errors:?}");
    assert!(errors[1] > 1.3 * errors[0], "{errors:?}");
}

#[test]
fn nothing_is_found_where_nothing_is_missing() {
    let value = diagnosed(&campaign(1..5, faithful));
    assert_eq!(value["verdict"], "consistent");
    assert_eq!(value["where"], Value::Array(vec![]));
    assert!(value["looked_for"].as_array().unwrap().len() >= 27);
}

#[test]
fn what_cannot_be_read_is_refused_in_one_line_before_anything_is_written() {
    let good = campaign(1..2, faithful).remove(0);
    let line = |number: usize, with: &str| -> String {
        let mut lines: Vec<&str> = good.lines().collect();
        lines[number - 1] = with;
        lines.join("\n") + "\n"
    };
    let without_load = good.replacen(",normal_force_n", "", 1);
    let twice = good.replacen("normal_force_n", "drag_force_n", 1);
    let not_utf8 = [good.as_bytes(), b"1,2,\xff,4,5\n"].concat();
    let cases: Vec<(Vec<u8>, &str)> = vec![
        (b"".to_vec(), "bad.csv:1:1: the file is empty"),
        (
            format!("{HEADER}\n").into(),
            ":1:71: no rows below the header",
        ),
        (
            without_load.into(),
            "bad.csv:1:1: required column normal_force_n is missing",
        ),
        (
            twice.into(),
            "bad.csv:1:57: column \"drag_force_n\" appears twice",
        ),
        (
            line(5, "0.006,60,20,100").into(),
            "bad.csv:5:16: 4 cells where the header has 5",
        ),
        (
            line(5, "0.006,60,20,100,4000,7").into(),
            "bad.csv:5:22: 6 cells where the header has 5",
        ),
        (
            line(5, "0.006,60,fast,100,4000").into(),
            "bad.csv:5:10: vehicle_speed_m_s: \"fast\" is not a number",
        ),
        (not_utf8, ":5: not UTF-8 text"),
        (
            line(5, "0.004,60,20,100,4000").into(),
            "bad.csv:5:1: time_s repeats",
        ),
        (
            line(5, "0.003,60,20,100,4000").into(),
            "bad.csv:5:1: time_s goes back",
        ),
    ];
    for (bytes, expected) in cases {
        let scratch = bench(std::slice::from_ref(&good));
        scratch.write("bad.csv", bytes);
        let names = ["run0.csv".to_owned(), "bad.csv".to_owned()];
        let complaint = scratch.complaint(&arguments(&names, &[]));
        assert!(complaint.contains(expected), "{complaint}");
        assert!(complaint.starts_with("bad.csv:"), "{complaint}");
        assert_eq!(scratch.files(), ["bad.csv", "rig.toml", "run0.csv"]);
    }
    let scratch = bench(std::slice::from_ref(&good));
    let gone = ["run0.csv".to_owned(), "gone.csv".to_owned()];
    let complaint = scratch.complaint(&arguments(&gone, &[]));
    assert!(
        complaint.starts_with("gone.csv:1:1: cannot be read"),
        "{complaint}"
    );
    let twice = ["run0.csv".to_owned(), "./run0.csv".to_owned()];
    let complaint = scratch.complaint(&arguments(&twice, &[]));
    assert_eq!(
        complaint,
        "./run0.csv:1:1: given twice: the same file as run0.csv"
    );
    assert_eq!(scratch.files(), ["rig.toml", "run0.csv"]);
}

#[test]
fn a_rig_file_that_cannot_be_read_is_refused_in_one_line() {
    let good = campaign(1..2, faithful).remove(0);
    for (from, to, expected) in [
        ("[wheel]", "[wheel", "rig.toml:1:7: "),
        (
            "radius_m = 0.31",
            "",
            "rig.toml:1:1: missing field `radius_m`",
        ),
        (
            "radius_m = 0.31",
            "radius_m = 310",
            "rig.toml:2:12: wheel.radius_m = 310: must be between",
        ),
        (
            "mass_kg = 1260.0",
            "mass_kg = inf",
            "rig.toml:6:11: vehicle.mass_kg = inf: must be finite",
        ),
        (
            "mass_kg = 1260.0",
            "mass_kg = 0",
            "rig.toml:6:11: vehicle.mass_kg = 0: must be finite",
        ),
    ] {
        let scratch = bench(std::slice::from_ref(&good));
        scratch.write("rig.toml", RIG.replace(from, to));
        let complaint = scratch.complaint(&arguments(&names(1), &[]));
        assert!(complaint.starts_with(expected), "{complaint}");
        assert_eq!(scratch.files(), ["rig.toml", "run0.csv"]);
    }
    let scratch = Scratch::new();
    let complaint = scratch.complaint(&arguments(&names(1), &[]));
    assert!(
        complaint.starts_with("rig.toml:1:1: cannot be read"),
        "{complaint}"
    );
}

/// Recordings with every cell passed through a change: (run, row, cells).
fn changed(recordings: &[String], change: impl Fn(usize, usize, &mut Vec<String>)) -> Vec<String> {
    let one = |run: usize, text: &String| -> String {
        let mut lines = text.lines();
        let mut out = lines.next().unwrap().to_owned() + "\n";
        for (row, line) in lines.enumerate() {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            change(run, row, &mut cells);
            if !cells.is_empty() {
                out += &(cells.join(",") + "\n");
            }
        }
        out
    };
    recordings
        .iter()
        .enumerate()
        .map(|(run, text)| one(run, text))
        .collect()
}

fn with_column(
    recordings: &[String],
    name: &str,
    value: impl Fn(usize, usize) -> String,
) -> Vec<String> {
    let recordings: Vec<String> = recordings
        .iter()
        .map(|text| text.replacen(HEADER, &format!("{HEADER},{name}"), 1))
        .collect();
    changed(&recordings, |run, row, cells| cells.push(value(run, row)))
}

#[test]
fn faults_of_the_data_are_told_and_the_rest_is_used() {
    let good = campaign(1..5, faithful);
    // A column in which every cell is this.
    let held = |name: &'static str, cell: &str, told: &'static str| {
        let recordings = with_column(&good, name, |_, _| cell.to_owned());
        (name, recordings, told)
    };
    let cases: Vec<(&str, Vec<String>, &str)> = vec![
        held("brake_torque_nm", "", "all values missing"),
        held("brake_torque_nm", "5", "constant at 5"),
        held("temperature", "", "all values missing"),
        held("temperature", "20.5", "constant at 20.5"),
        (
            "normal_force_n",
            changed(&good, |run, row, cells| {
                if run == 1 && (500..700).contains(&row) {
                    cells[4] = "3900".into();
                }
            }),
            "frozen or clipped",
        ),
        (
            "drag_force_n",
            changed(&good, |_, _, cells| {
                cells[3] = cells[3].parse::<f64>().unwrap().min(2000.0).to_string();
            }),
            "frozen or clipped",
        ),
        (
            "time_s",
            changed(&good, |run, row, cells| {
                if run == 0 && (300..600).contains(&row) {
                    cells.clear();
                }
            }),
            "gap",
        ),
        (
            "drag_force_n",
            changed(&good, |run, row, cells| {
                if run == 2 && row % 97 == 5 {
                    cells[3] = "30000".into();
                }
            }),
            "outliers",
        ),
        (
            "vehicle_speed_m_s",
            changed(&good, |run, row, cells| {
                if run == 2 && row == 400 {
                    cells[2] = "1e308".into();
                }
            }),
            "beyond any measurement",
        ),
        (
            "time_s",
            changed(&good, |_, row, cells| {
                if row % 7 == 3 {
                    cells[0] = "nan".into();
                }
            }),
            "time stamps missing",
        ),
        ("time_s", good[..1].to_vec(), "1 recording"),
    ];
    for (channel, recordings, what) in cases {
        let value = diagnosed(&recordings);
        let told = faults(&value);
        assert!(
            told.iter()
                .any(|(on, says)| on == channel && says.contains(what)),
            "{channel}, {what}: {told:?}"
        );
        assert_ne!(value["verdict"], "undecided", "{channel}, {what}");
    }
}

#[test]
fn recordings_that_hold_nothing_end_undecided_and_say_why() {
    let good = campaign(1..4, faithful);
    let cases = [
        changed(&good, |_, _, cells| cells[1..].fill(String::new())),
        changed(&good, |_, _, cells| cells[0] = String::new()),
        changed(&good, |_, _, cells| cells[1..].fill("0".into())),
        changed(&good, |_, row, cells| {
            if row > 0 {
                cells.clear();
            }
        }),
    ];
    for recordings in cases {
        let value = diagnosed(&recordings);
        assert_eq!(value["verdict"], "undecided");
        assert!(!faults(&value).is_empty());
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_byte() {
    let scratch = bench(&campaign(1..5, lagging));
    let names = names(4);
    let mut found: Vec<Vec<String>> = Vec::new();
    for threads in ["1", "2"] {
        let output = scratch
            .muslip(&arguments(&names, &[]))
            .env("RAYON_NUM_THREADS", threads)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0));
        let files = [
            "found/diagnosis.json",
            "found/model.toml",
            "found/report.html",
        ];
        let mut texts: Vec<String> = files.iter().map(|name| scratch.read(name)).collect();
        texts.push(String::from_utf8(output.stdout).unwrap());
        found.push(texts);
    }
    assert!(
        found[0] == found[1],
        "outputs differ between one thread and two"
    );
}

#[test]
fn json_is_printed_alone_and_is_the_file() {
    let scratch = bench(&campaign(1..3, faithful));
    let printed = scratch.output(&arguments(&names(2), &["--json"]));
    assert_eq!(printed, scratch.read("found/diagnosis.json"));
}

#[test]
fn a_folder_that_cannot_be_made_is_told_before_the_work() {
    let scratch = bench(&campaign(1..2, faithful));
    scratch.write("found", "a file");
    let complaint = scratch.complaint(&arguments(&names(1), &[]));
    assert!(
        complaint.starts_with("found:1:1: cannot be written"),
        "{complaint}"
    );
    assert_eq!(scratch.read("found"), "a file");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn no_campaign_makes_it_panic(seed in any::<u64>(), runs in 1usize..4, rows in 1usize..250) {
        let mut random = Random::seeded(seed);
        let mut wild = |row: usize, column: usize| -> String {
            let choice = random.uniform();
            let usual = [0.01 * row as f64, 60.0, 20.0, 2000.0, 4000.0][column];
            let value = match (choice * 20.0) as u32 {
                0 => return String::new(),
                1 => return "nan".into(),
                2 if column > 0 => 1e308,
                3 if column > 0 => -1e308,
                4 if column > 0 => 0.0,
                5 if column > 0 => f64::INFINITY,
                6 if column > 0 => -usual,
                _ if column == 0 => usual,
                _ => usual * (1.0 + 0.3 * random.normal()),
            };
            value.to_string()
        };
        let recordings: Vec<String> = (0..runs)
            .map(|_| {
                let mut text = format!("{HEADER}\n");
                for row in 0..rows {
                    let cells: Vec<String> = (0..5).map(|column| wild(row, column)).collect();
                    text += &(cells.join(",") + "\n");
                }
                text
            })
            .collect();
        diagnosed(&recordings);
    }
}
