//! `model.toml` and `muslip predict`.

use std::path::Path;

use crate::common::Scratch;
use crate::diagnosis::{HEADER, RIG, campaign, repaired};
use muslip_diagnose::campaign::Run;
use muslip_diagnose::repaired::Which;
use muslip_recordings::model_file::{ModelFile, to_text};
use proptest::prelude::*;

const PREDICT: [&str; 8] = [
    "predict",
    "--rig",
    "rig.toml",
    "--model",
    "model.toml",
    "--out",
    "pred.csv",
    "run.csv",
];

fn model_text() -> String {
    to_text(&repaired(), "a model put together by hand").unwrap()
}

fn bench() -> Scratch {
    let scratch = Scratch::with_rig(RIG);
    scratch.write("model.toml", model_text());
    scratch
}

fn recording() -> String {
    campaign(1..2, |_| Box::new(|_, drag| drag)).remove(0)
}

/// The columns of a prediction; every cell but a time must be a finite number.
fn prediction(scratch: &Scratch) -> Vec<[f64; 4]> {
    let text = scratch.read("pred.csv");
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some("time_s,drag_force_n,drag_force_sigma_n,contact_force_n")
    );
    lines
        .map(|line| {
            let cells: Vec<f64> = line
                .split(',')
                .map(|cell| cell.parse().unwrap_or(f64::NAN))
                .collect();
            let row: [f64; 4] = cells.try_into().unwrap();
            assert!(row[1..].iter().all(|v| v.is_finite()), "{line}");
            assert!(row[2] > 0.0, "{line}");
            row
        })
        .collect()
}

/// A recording with one cell of every row changed.
fn with_cells(text: &str, change: impl Fn(usize, &mut Vec<String>)) -> String {
    text.lines()
        .enumerate()
        .map(|(row, line)| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            if row > 0 {
                change(row - 1, &mut cells);
            }
            cells.join(",") + "\n"
        })
        .collect()
}

#[test]
fn a_prediction_has_a_row_for_each_row_and_never_looks_at_the_drag() {
    let scratch = bench();
    let text = recording();
    let rows = text.lines().count() - 1;
    scratch.write("run.csv", &text);
    let told = scratch.output(&PREDICT);
    assert_eq!(
        told,
        format!("pred.csv: {rows} rows predicted by the repaired model\n")
    );
    let seen = prediction(&scratch);
    assert_eq!(seen.len(), rows);
    scratch.write(
        "run.csv",
        with_cells(&text, |_, cells| cells[3] = "1e6".into()),
    );
    scratch.output(&PREDICT);
    assert_eq!(prediction(&scratch), seen);
    // Without the column.
    let without: String = text
        .lines()
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            format!("{},{},{},{}\n", cells[0], cells[1], cells[2], cells[4])
        })
        .collect();
    scratch.write("run.csv", without);
    scratch.output(&PREDICT);
    assert_eq!(prediction(&scratch), seen);
}

#[test]
fn the_file_holds_the_library_s_numbers_with_all_their_digits() {
    let scratch = bench();
    let text = recording();
    scratch.write("run.csv", &text);
    let cells: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    let column = |k: usize| cells.iter().map(|row| row[k]).collect::<Vec<f64>>();
    let run = Run {
        name: "run.csv".into(),
        time_s: column(0),
        wheel_speed_rad_s: column(1),
        vehicle_speed_m_s: column(2),
        normal_force_n: column(4),
        ..Run::default()
    };
    for (which, flag) in [(Which::Repaired, None), (Which::Base, Some("--base"))] {
        let arguments: Vec<&str> = PREDICT.into_iter().chain(flag).collect();
        scratch.output(&arguments);
        let expected = repaired().predict(&run, which).unwrap();
        for (k, row) in prediction(&scratch).iter().enumerate() {
            let own = [
                expected.time_s[k],
                expected.drag_force_n[k],
                expected.drag_force_sigma_n[k],
                expected.contact_force_n[k],
            ];
            assert_eq!(*row, own, "row {k}");
        }
    }
}

#[test]
fn rows_with_missing_inputs_are_predicted_too() {
    let scratch = bench();
    let text = recording();
    let rows = text.lines().count() - 1;
    scratch.write("run.csv", &text);
    scratch.output(&PREDICT);
    let whole = prediction(&scratch);
    let holes = with_cells(&text, |row, cells| {
        if row % 50 == 7 {
            cells[1 + row % 2] = String::new();
        }
        if row % 90 == 11 {
            cells[4] = "nan".into();
        }
        if row % 400 == 13 {
            cells[0] = String::new();
        }
        if (600..620).contains(&row) {
            cells[2] = String::new();
        }
    });
    scratch.write("run.csv", holes);
    scratch.output(&PREDICT);
    let found = prediction(&scratch);
    assert_eq!(found.len(), rows);
    let largest = whole.iter().map(|row| row[1]).fold(0.0, f64::max);
    for (row, (a, b)) in whole.iter().zip(&found).enumerate() {
        assert_eq!(b[0].is_nan(), row % 400 == 13, "row {row}");
        let near_the_long_gap = (500..720).contains(&row);
        assert!(
            near_the_long_gap || (a[1] - b[1]).abs() < 0.25 * largest,
            "row {row}: {} {}",
            a[1],
            b[1]
        );
    }
    // Nothing at all.
    scratch.write(
        "run.csv",
        with_cells(&text, |_, cells| cells[1..].fill(String::new())),
    );
    scratch.output(&PREDICT);
    assert_eq!(prediction(&scratch).len(), rows);
}

#[test]
fn another_sampling_rate_gives_the_same_drag() {
    let scratch = bench();
    let text = recording();
    scratch.write("run.csv", &text);
    scratch.output(&PREDICT);
    let whole = prediction(&scratch);
    let thinned: String = text
        .lines()
        .enumerate()
        .filter(|(row, _)| *row == 0 || row % 2 == 1)
        .map(|(_, line)| format!("{line}\n"))
        .collect();
    scratch.write("run.csv", thinned);
    scratch.output(&PREDICT);
    let found = prediction(&scratch);
    assert_eq!(found.len(), whole.len().div_ceil(2));
    let square: f64 = found
        .iter()
        .zip(whole.iter().step_by(2))
        .map(|(a, b)| {
            assert_eq!(a[0], b[0]);
            (a[1] - b[1]).powi(2)
        })
        .sum();
    let rms = (square / found.len() as f64).sqrt();
    let largest = whole.iter().map(|row| row[1]).fold(0.0, f64::max);
    assert!(rms < 0.05 * largest, "{rms} of {largest}");
}

#[test]
fn a_broken_model_is_named_with_its_place() {
    let scratch = bench();
    scratch.write("run.csv", recording());
    let text = model_text();
    for (from, to, expected) in [
        ("[rig]", "[rig", "unclosed table, expected `]`"),
        (
            "radius_m = 0.31",
            "radius = 0.31",
            "missing field `radius_m`",
        ),
        (
            "radius_m = 0.31",
            "radius_m = -0.31",
            "rig.radius_m: -0.31 is not between",
        ),
        (
            "muslip.model/1",
            "muslip.model/9",
            "schema: \"muslip.model/9\" is not \"muslip.model/1\"",
        ),
        (
            "id = \"force_lag\"",
            "id = \"warp\"",
            "tyre[0].id: unknown mechanism \"warp\"",
        ),
        (
            "form = \"\"",
            "form = \"odd\"",
            "tyre[0].form: \"odd\" is not a form of force_lag",
        ),
        (
            "share_of_force = 0.004",
            "share_of_force = -1.0",
            "noise.share_of_force: -1 is not a standard",
        ),
        (
            "acts_on = \"friction\"",
            "acts_on = \"hope\"",
            "corrections[0].acts_on: \"hope\" cannot be corrected",
        ),
        (
            "knots = [5.0, 15.0",
            "knots = [5.0, 5.0",
            "corrections[0].knots: not finite and increasing",
        ),
        (
            "mean_load = 4000.0",
            "mean_load = nan",
            "context.mean_load: NaN is not finite and positive",
        ),
    ] {
        let broken = text.replacen(from, to, 1);
        assert_ne!(broken, text, "{from}");
        scratch.write("model.toml", &broken);
        let complaint = scratch.complaint(&PREDICT);
        let line = broken.lines().position(|line| line.contains(to)).unwrap() + 1;
        assert!(complaint.contains(expected), "{complaint}");
        if !expected.contains("missing") {
            assert!(
                complaint.starts_with(&format!("model.toml:{line}:")),
                "{complaint}"
            );
        }
        assert!(!scratch.path("pred.csv").exists());
    }
}

#[test]
fn a_model_of_another_rig_is_refused_at_the_key_that_differs() {
    let scratch = bench();
    scratch.write("run.csv", recording());
    for (from, to, expected) in [
        (
            "radius_m = 0.31",
            "radius_m = 0.32",
            "rig.toml:2:12: wheel.radius_m = 0.32: the model was made for a rig with 0.31",
        ),
        (
            "mass_kg = 1260.0",
            "mass_kg = 420",
            "rig.toml:6:11: vehicle.mass_kg = 420: the model was made for a rig with 1260",
        ),
        (
            "[tyre]",
            "[brake]\ntorque_per_pressure_nm_pa = 3e-4\n[tyre]",
            "rig.toml:10:29: brake.torque_per_pressure_nm_pa = 0.0003: the model was made for a rig with none",
        ),
    ] {
        scratch.write("rig.toml", RIG.replace(from, to));
        assert_eq!(scratch.complaint(&PREDICT), expected);
    }
    // Starting values and declared noise are the model's own business.
    scratch.write(
        "rig.toml",
        RIG.replace("0.75", "0.9").replace("90.0", "10.0"),
    );
    scratch.output(&PREDICT);
}

#[test]
fn a_prediction_that_fails_leaves_the_older_one() {
    let scratch = bench();
    scratch.write("pred.csv", "old\n");
    scratch.write("run.csv", format!("{HEADER}\n0,1,2,3,4\n0,1,2,3,4\n"));
    let complaint = scratch.complaint(&PREDICT);
    assert!(
        complaint.starts_with("run.csv:3:1: time_s repeats"),
        "{complaint}"
    );
    assert_eq!(scratch.read("pred.csv"), "old\n");
    assert_eq!(
        scratch.files(),
        ["model.toml", "pred.csv", "rig.toml", "run.csv"]
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn a_damaged_model_is_refused_in_one_line_or_predicts(
        at in any::<prop::sample::Index>(),
        with in "[0-9a-z\\[\\]=\"\\.\\-\n#]{0,3}",
        cut in 0usize..12,
    ) {
        let text = model_text();
        let start = at.index(text.len());
        let end = (start + cut).min(text.len());
        let damaged = format!("{}{with}{}", &text[..start], &text[end..]);
        match ModelFile::parse(Path::new("model.toml"), damaged.as_bytes()) {
            Err(error) => prop_assert_eq!(error.to_string().lines().count(), 1),
            Ok(model) => {
                let run = Run {
                    name: "run.csv".into(),
                    time_s: (0..40).map(|k| f64::from(k) * 0.01).collect(),
                    wheel_speed_rad_s: (0..40).map(|k| 60.0 - f64::from(k)).collect(),
                    vehicle_speed_m_s: vec![20.0; 40],
                    normal_force_n: vec![4000.0; 40],
                    ..Run::default()
                };
                if let Ok(prediction) = model.repaired.predict(&run, Which::Repaired) {
                    prop_assert!(prediction.drag_force_n.iter().all(|f| f.is_finite()));
                }
            }
        }
    }
}
