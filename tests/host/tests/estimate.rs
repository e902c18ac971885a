//! `muslip estimate`: the contract's JSON and trace, the verdict, and the truth recovered.

use crate::common::{HEADER, RIG, Scratch, complaint, measured_data, number, recording_of, words};
use serde_json::{Value, json};
use test_support::scenario::article;

const ESTIMATE: &str = "estimate --rig rig.toml --estimator article --json";

fn article_rig() -> String {
    // Friction noise 0.04 under 1000 N.
    format!("{RIG}\n[noise]\ndrag_force_n = 40.0\n")
}

fn article_scratch(seed: u64) -> Scratch {
    let scratch = Scratch::with_rig(&article_rig());
    scratch.write("run.csv", recording_of(article::measurements(seed)));
    scratch
}

fn estimate(scratch: &Scratch, more: &[&str]) -> Value {
    scratch.json(&[&words(ESTIMATE)[..], more, &["run.csv"]].concat())
}

fn trace(scratch: &Scratch, name: &str) -> Vec<Vec<f64>> {
    let text = scratch.read(name);
    let mut lines = text.lines();
    assert_eq!(
        lines.next().unwrap(),
        "time_s,slip,friction,peak_friction,critical_slip,p11,p12,p22,innovation,\
         noise_variance,signal_before,signal_after,nis"
    );
    lines
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect()
}

#[test]
fn json_has_every_field_of_the_contract_with_its_type() {
    let quantity = json!({
        "type": "object",
        "properties": {"value": {"type": "number"}, "std": {"type": "number", "exclusiveMinimum": 0}},
        "required": ["value", "std"]
    });
    let schema = json!({
        "type": "object",
        "properties": {
            "schema": {"const": "muslip.estimate/1"},
            "estimator": {"const": "article"},
            "peak_friction": quantity,
            "critical_slip": quantity,
            "correlation": {"type": "number", "minimum": -1, "maximum": 1},
            "samples": {
                "type": "object",
                "properties": {"used": {"type": "integer"}, "skipped": {"type": "integer"}},
                "required": ["used", "skipped"]
            },
            "consistency": {
                "type": "object",
                "properties": {
                    "mean_nis": {"type": "number"},
                    "nis_low": {"type": "number"},
                    "nis_high": {"type": "number"},
                    "whiteness_p": {"type": "number", "minimum": 0, "maximum": 1},
                    "verdict": {"enum": ["consistent", "conservative", "overconfident"]}
                },
                "required": ["mean_nis", "nis_low", "nis_high", "whiteness_p", "verdict"]
            }
        },
        "required": ["schema", "estimator", "peak_friction", "critical_slip", "correlation", "samples", "consistency"]
    });
    let json = estimate(&article_scratch(1), &[]);
    assert_eq!(complaint(schema, &json), None, "{json}");
}

#[test]
fn the_trace_is_the_article_s_filter_step_by_step() {
    let scratch = article_scratch(7);
    let json = estimate(&scratch, &["--trace", "trace.csv"]);
    let rows = trace(&scratch, "trace.csv");
    assert_eq!(rows.len(), 41);
    // A second transcription of the article's equations, in matrix notation with numeric derivatives.
    let mu = |x: [f64; 2], s: f64| 2.0 * x[0] * s / (x[1] * (1.0 + (s / x[1]).powi(2)));
    let mut x = [0.6, 0.2];
    let mut p = [[0.36, 0.0], [0.0, 0.04]];
    let mut mean_nis = 0.0;
    for row in &rows {
        let [_, s, z, ..] = row[..] else {
            panic!("short row")
        };
        let d = 1e-4;
        let h = [
            (mu([x[0] + d, x[1]], s) - mu([x[0] - d, x[1]], s)) / (2.0 * d),
            (mu([x[0], x[1] + d], s) - mu([x[0], x[1] - d], s)) / (2.0 * d),
        ];
        let second = (mu([x[0], x[1] + d], s) - 2.0 * mu(x, s) + mu([x[0], x[1] - d], s)) / (d * d);
        let cross = (mu([x[0] + d, x[1] + d], s)
            - mu([x[0] + d, x[1] - d], s)
            - mu([x[0] - d, x[1] + d], s)
            + mu([x[0] - d, x[1] - d], s))
            / (4.0 * d * d);
        let r =
            0.12_f64.powi(2) + cross * cross * p[0][0] * p[1][1] + (0.5 * second * p[1][1]).powi(2);
        let g = [
            p[0][0] * h[0] + p[0][1] * h[1],
            p[1][0] * h[0] + p[1][1] * h[1],
        ];
        let signal = h[0] * g[0] + h[1] * g[1];
        let innovation = z - mu(x, s);
        let k = [g[0] / (signal + r), g[1] / (signal + r)];
        for i in 0..2 {
            x[i] += k[i] * innovation;
            for j in 0..2 {
                p[i][j] -= k[i] * g[j];
            }
        }
        let after = signal - signal * signal / (signal + r);
        let nis = innovation * innovation / (signal + r);
        mean_nis += nis / 41.0;
        let expected = [
            x[0], x[1], p[0][0], p[0][1], p[1][1], innovation, r, signal, after, nis,
        ];
        for (found, expected) in row[3..].iter().zip(expected) {
            assert!(
                (found - expected).abs() < 1e-5 * (1.0 + expected.abs()),
                "{row:?}\n{expected:?}"
            );
        }
    }
    let last = rows.last().unwrap();
    assert_eq!(number(&json, "peak_friction.value"), last[3]);
    assert_eq!(number(&json, "critical_slip.value"), last[4]);
    assert_eq!(number(&json, "peak_friction.std"), last[5].sqrt());
    assert_eq!(number(&json, "critical_slip.std"), last[7].sqrt());
    let correlation = last[6] / (last[5] * last[7]).sqrt();
    assert!((number(&json, "correlation") - correlation).abs() < 1e-12);
    assert!((number(&json, "consistency.mean_nis") - mean_nis).abs() < 1e-6);
}

#[test]
fn the_article_s_filter_is_conservative_at_about_a_tenth() {
    let mut total = 0.0;
    for seed in 0..20 {
        let json = estimate(&article_scratch(seed), &[]);
        assert_eq!(json["consistency"]["verdict"], "conservative", "{json}");
        total += number(&json, "consistency.mean_nis");
    }
    assert!((0.06..0.12).contains(&(total / 20.0)), "{}", total / 20.0);
}

#[test]
fn a_printed_trace_is_the_written_one_and_nothing_else() {
    let scratch = article_scratch(7);
    estimate(&scratch, &["--trace", "t.csv"]);
    let printed = scratch.output(&[
        "estimate",
        "--rig",
        "rig.toml",
        "--estimator",
        "article",
        "--trace",
        "-",
        "run.csv",
    ]);
    assert_eq!(printed, scratch.read("t.csv"));
    let both = [
        "estimate", "--rig", "rig.toml", "--trace", "-", "--json", "run.csv",
    ];
    assert!(scratch.complaint(&both).contains("both write"));
    assert_eq!(scratch.files(), ["rig.toml", "run.csv", "t.csv"]);
}

#[test]
fn the_json_traces_hold_the_csv_s_numbers() {
    let scratch = article_scratch(3);
    for name in ["t.csv", "t.json", "t.jsonl"] {
        estimate(&scratch, &["--trace", name]);
    }
    let rows = trace(&scratch, "t.csv");
    let array: Vec<Value> = serde_json::from_str(&scratch.read("t.json")).unwrap();
    let text = scratch.read("t.jsonl");
    let lines: Vec<Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(array, lines);
    assert_eq!(array.len(), rows.len());
    for (object, row) in array.iter().zip(&rows) {
        let values: Vec<f64> = object
            .as_object()
            .unwrap()
            .values()
            .map(|value| value.as_f64().unwrap())
            .collect();
        // serde_json's reader may be off by a unit in the last place; the texts are the same.
        for (value, cell) in values.iter().zip(row) {
            assert!((value - cell).abs() <= 4e-16 * cell.abs(), "{value} {cell}");
        }
        assert_eq!(values.len(), row.len());
    }
}

#[test]
fn the_range_sets_the_start() {
    let scratch = Scratch::with_rig(&article_rig());
    // One measurement at slip 0 says nothing: what comes out is the start.
    scratch.write("run.csv", recording_of([(0.0, 0.0)]));
    for (range, start) in [("aircraft", 0.6), ("automotive", 1.0)] {
        let json = estimate(&scratch, &["--range", range]);
        assert_eq!(number(&json, "peak_friction.value"), start);
        assert_eq!(number(&json, "peak_friction.std"), start);
        assert_eq!(number(&json, "critical_slip.value"), 0.2);
        assert_eq!(number(&json, "critical_slip.std"), 0.2);
    }
}

#[test]
fn rows_that_are_no_measurement_are_skipped_and_counted_by_reason() {
    let scratch = Scratch::with_rig(&article_rig());
    let good = |time: f64| format!("{time},90,30,200,1000\n");
    let mut text = format!("{HEADER}\n");
    for index in 0..20 {
        text += &good(0.01 * f64::from(index));
    }
    for bad in [
        "1,90,30,,1000",
        "2,nan,30,200,1000",
        "3,90,inf,200,1000",
        ",90,30,200,1000",
        "4,1,0.49,200,1000",
        "5,1,-30,200,1000",
        "6,90,30,200,19.9",
        "7,90,30,200,-1000",
        "8,103,30,200,1000",
        "9,-6,30,200,1000",
        "10,90,30,1e308,1000",
    ] {
        text += &format!("{bad}\n");
    }
    // At the limits all is well: 0.5 m/s, 2 % of the median normal force, a slip of -0.05 and 1.05.
    for fine in [
        "11,1.6,0.5,200,1000",
        "12,90,30,4,20",
        "13,101.5,30,200,1000",
        "14,-4.8,30,200,1000",
    ] {
        text += &format!("{fine}\n");
    }
    scratch.write("run.csv", text);
    let json = estimate(&scratch, &[]);
    let samples = &json["samples"];
    assert_eq!(samples["used"], 24, "{samples}");
    assert_eq!(samples["skipped"], 11, "{samples}");
    assert_eq!(samples["skipped_not_finite"], 4, "{samples}");
    assert_eq!(samples["skipped_low_speed"], 2, "{samples}");
    assert_eq!(samples["skipped_low_normal_force"], 2, "{samples}");
    assert_eq!(samples["skipped_slip_out_of_range"], 2, "{samples}");
    assert_eq!(samples["skipped_refused"], 1, "{samples}");
}

#[test]
fn without_a_usable_sample_there_is_one_line_and_status_2() {
    let scratch = Scratch::with_rig(&article_rig());
    scratch.write(
        "run.csv",
        format!("{HEADER}\n0,1,0.1,200,1000\n1,,30,200,1000\n"),
    );
    assert_eq!(
        scratch.complaint(&[&words(ESTIMATE)[..], &["--trace", "t.csv", "run.csv"]].concat()),
        "run.csv:1:1: no usable sample: 1 missing or not finite, 1 vehicle speed too low"
    );
    assert_eq!(scratch.files(), ["rig.toml", "run.csv"]);
}

#[test]
fn wild_values_never_make_the_json_anything_but_numbers() {
    let scratch = Scratch::with_rig(&article_rig());
    for wild in ["1e308", "-1e308", "1e155", "inf", "nan", "1e-308"] {
        for column in 0..5 {
            let mut text = recording_of(article::measurements(1));
            let mut cells = ["0.405", "90", "30", "200", "1000"];
            cells[column] = wild;
            // In the time column these go back.
            if column == 0 && ["-1e308", "1e-308"].contains(&wild) {
                continue;
            }
            text += &format!("{}\n", cells.join(","));
            scratch.write("run.csv", text);
            let json = estimate(&scratch, &["--trace", "t.csv", "--report", "r.html"]);
            for path in [
                "peak_friction.value",
                "peak_friction.std",
                "critical_slip.value",
                "critical_slip.std",
                "correlation",
                "consistency.mean_nis",
                "consistency.whiteness_p",
            ] {
                assert!(
                    number(&json, path).is_finite(),
                    "{wild} in {column}: {json}"
                );
            }
            assert!(!scratch.read("t.csv").contains("NaN"));
        }
    }
}

#[test]
fn noise_that_is_not_declared_is_estimated_from_the_recording() {
    let mut found = 0.0;
    for seed in 0..20 {
        let scratch = Scratch::with_rig(RIG);
        scratch.write("run.csv", recording_of(article::measurements(seed)));
        let json = estimate(&scratch, &[]);
        assert_eq!(json["noise"]["source"], "estimated");
        found += number(&json, "noise.friction") / 20.0;
    }
    assert!((0.032..0.048).contains(&found), "{found}");
}

#[test]
fn the_truth_lies_within_the_claimed_uncertainty_on_the_simulated_rig() {
    // Only the drag is noisy, so that the filter's picture of the noise is true.
    let scratch = Scratch::with_rig(&format!("{RIG}\n[noise]\ndrag_force_n = 90.0\n"));
    let mut squares = [0.0; 2];
    for seed in 1..=20 {
        let seed = seed.to_string();
        scratch.output(&[
            "simulate", "--rig", "rig.toml", "--seed", &seed, "--out", "run.csv",
        ]);
        let json = estimate(&scratch, &["--range", "automotive"]);
        for (square, (name, truth)) in squares
            .iter_mut()
            .zip([("peak_friction", 0.85), ("critical_slip", 0.14)])
        {
            let error = number(&json, &format!("{name}.value")) - truth;
            let std = number(&json, &format!("{name}.std"));
            assert!(error.abs() < 3.0 * std, "{name}: {error} at {std}");
            *square += (error / std).powi(2) / 20.0;
        }
    }
    // Three times the sigma and pseudonoise: the claim is too wide, never too narrow.
    assert!(squares.iter().all(|square| *square < 1.0), "{squares:?}");
}

#[test]
fn a_curve_of_another_shape_shows_in_the_innovations() {
    let scratch = Scratch::with_rig(&format!("{RIG}\n[noise]\ndrag_force_n = 90.0\n"));
    let mut p_values = Vec::new();
    for law in ["rudd:0.85,0.14", "burckhardt:dry-asphalt"] {
        scratch.output(&[
            "simulate", "--rig", "rig.toml", "--law", law, "--out", "run.csv",
        ]);
        let json = estimate(&scratch, &["--range", "automotive"]);
        p_values.push(number(&json, "consistency.whiteness_p"));
    }
    assert!(p_values[0] > 0.01 && p_values[1] < 1e-6, "{p_values:?}");
}

#[test]
fn an_uncertainty_that_is_not_borne_out_is_told_with_the_answer() {
    let scratch = Scratch::with_rig(&format!("{RIG}\n[noise]\ndrag_force_n = 4.0\n"));
    // Ten times the declared noise.
    scratch.write("run.csv", recording_of(article::measurements(1)));
    assert_eq!(
        estimate(&scratch, &[])["consistency"]["verdict"],
        "overconfident"
    );
    let mut command = scratch.muslip(&["estimate", "--rig", "rig.toml", "run.csv"]);
    let words = command.env_remove("COLUMNS").output().unwrap().stdout;
    assert!(
        String::from_utf8(words)
            .unwrap()
            .lines()
            .next()
            .unwrap()
            .ends_with("scatter more than this uncertainty allows.")
    );
}

#[test]
fn measured_recordings_give_curves_of_a_tyre() {
    let Some(folder) = measured_data("dart-friction") else {
        return;
    };
    let rig = folder.join("rig.toml");
    let scratch = Scratch::new();
    let mut estimates = 0;
    for (name, friction, slip) in [
        ("circle01", 0.55..0.85, 0.08..0.25),
        ("circle08", 0.5..0.85, 0.08..0.25),
        ("drift09", 0.30..0.42, 0.2..0.8),
        ("drift10", 0.30..0.42, 0.2..0.8),
    ] {
        let run = folder.join(format!("{name}.csv"));
        let json = scratch.json(
            &[
                &[
                    "estimate",
                    "--json",
                    "--rig",
                    rig.to_str().unwrap(),
                    "--range",
                    "automotive",
                ][..],
                &[run.to_str().unwrap()],
            ]
            .concat(),
        );
        let peak = number(&json, "peak_friction.value");
        let at = number(&json, "critical_slip.value");
        assert!(
            friction.contains(&peak) && slip.contains(&at),
            "{name}: {peak} at {at}"
        );
        estimates += 1;
    }
    assert_eq!(estimates, 4);
}

#[test]
fn the_efficient_estimator_is_the_default_and_believes_its_own_noise() {
    let mut consistent = 0;
    for seed in 0..20 {
        let scratch = article_scratch(seed);
        let json = scratch.json(&["estimate", "--rig", "rig.toml", "--json", "run.csv"]);
        assert_eq!(json["estimator"], "efficient");
        let article = estimate(&scratch, &[]);
        let std = |of: &Value| number(of, "peak_friction.std");
        assert!(std(&json) < 0.6 * std(&article));
        let off = (number(&json, "peak_friction.value") - article::PEAK_FRICTION) / std(&json);
        assert!(off.abs() < 4.5, "{seed}: {off}");
        consistent += u32::from(json["consistency"]["verdict"] == "consistent");
    }
    assert!(consistent >= 16, "{consistent} of 20");
}
