//! Files of other programs in the commands: one call, no rig file, foreign names and units.

mod common;

use std::path::Path;

use common::{HEADER, Scratch, words};

/// The demo's recording as a bench would have made it: MDF 4, packed, km/h, 1/min, kN, the load at a quarter of the rate.
const BENCH: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../crates/muslip-cli/demo/bench.mf4"
);

/// A German CSV of a tyre of peak friction 0.9 at slip 0.12 under 4 kN, at 72 km/h on a wheel of 0.31 m.
fn german() -> String {
    let mut text = String::from(
        "Prüfstand 4;Halle 2\n\nZeit;Raddrehzahl;Geschwindigkeit;Bremskraft;Radlast\ns;1/min;km/h;kN;kN\n",
    );
    for k in 0..400 {
        let slip = 0.3 * f64::from(k) / 400.0;
        let friction = 2.0 * 0.9 * (slip / 0.12) / (1.0 + (slip / 0.12).powi(2));
        let rpm = 20.0 * (1.0 - slip) / 0.31 * 30.0 / std::f64::consts::PI;
        let row = format!(
            "{:.3};{rpm:.9};72;{:.9};4\n",
            f64::from(k) * 0.01,
            friction * 4.0
        );
        text.push_str(&row.replace('.', ","));
    }
    text
}

#[test]
fn one_command_estimates_from_a_bench_s_file_without_a_rig_file() {
    let scratch = Scratch::new();
    let text = scratch.output(&["estimate", "--radius", "0.31", BENCH]);
    assert!(text.contains("Friction peaks at 0.92"), "{text}");
    assert!(
        text.contains("vehicle_speed_m_s: Geschwindigkeit [km/h]"),
        "{text}"
    );
    assert!(
        text.contains("100 Hz, brought onto 400 Hz (linear); 3 empty"),
        "{text}"
    );
    let told = scratch.complaint(&["estimate", BENCH]);
    assert!(told.contains("add --radius METRES"), "{told}");
}

#[test]
fn a_german_csv_is_estimated_and_converted() {
    let scratch = Scratch::new();
    scratch.write("lauf.csv", german());
    let json = scratch.json(&words("estimate --radius 0.31 --json lauf.csv"));
    let peak = json["peak_friction"]["value"].as_f64().unwrap();
    assert!((peak - 0.9).abs() < 0.005, "{json:#}");
    scratch.output(&words("convert --out run.csv lauf.csv"));
    let text = scratch.read("run.csv");
    assert_eq!(
        text.lines().find(|line| !line.starts_with('#')),
        Some(HEADER)
    );
    assert!(
        text.contains("# drag_force_n: Bremskraft [kN], N = 1000 × kN"),
        "{text}"
    );
    // What was converted is a recording of the contract, and estimates the same.
    let again = scratch.json(&words("estimate --radius 0.31 --json run.csv"));
    assert_eq!(again["peak_friction"], json["peak_friction"]);
    scratch.output(&words("convert --out run.parquet lauf.csv"));
    let parquet = scratch.json(&words("estimate --radius 0.31 --json run.parquet"));
    assert_eq!(parquet["peak_friction"], json["peak_friction"]);
}

#[test]
fn channels_lists_and_writes_a_map_that_finds_them_again() {
    let scratch = Scratch::new();
    let json = scratch.json(&["channels", BENCH, "--json", "--write-map", "map.toml"]);
    assert_eq!(json["schema"], "muslip.channels/1");
    assert_eq!(json["format"], "mdf4");
    assert_eq!(json["start_time"], "2026-03-04T09:15:00.000Z");
    let wheel = json["channels"]
        .as_array()
        .unwrap()
        .iter()
        .find(|channel| channel["name"] == "Raddrehzahl_VL")
        .unwrap();
    assert_eq!(wheel["role"], "wheel_speed_rad_s");
    assert_eq!(
        (wheel["samples"].as_u64(), wheel["rate_hz"].as_f64()),
        (Some(1600), Some(400.0))
    );
    let guessed = scratch.json(&["estimate", "--radius", "0.31", "--json", BENCH]);
    let mapped = scratch.json(&[
        "estimate", "--radius", "0.31", "--json", "--map", "map.toml", BENCH,
    ]);
    assert_eq!(guessed["peak_friction"], mapped["peak_friction"]);
    // The same tables in a rig file.
    let rig = format!("{}\n{}", common::RIG, scratch.read("map.toml"));
    scratch.write("rig.toml", rig);
    let from_rig = scratch.json(&["estimate", "--rig", "rig.toml", "--json", BENCH]);
    assert_eq!(from_rig["peak_friction"], mapped["peak_friction"]);
}

#[test]
fn what_cannot_be_told_is_one_line_with_the_candidates() {
    let scratch = Scratch::new();
    let replaced = |from: &str, to: &str| {
        scratch.write("run.csv", german().replacen(from, to, 1));
        scratch.complaint(&words("estimate --radius 0.31 run.csv"))
    };
    let told = replaced("Geschwindigkeit;Bremskraft", "Geschwindigkeit;Kraft");
    assert!(
        told.contains("drag_force_n is missing") && told.contains("Kraft [kN]"),
        "{told}"
    );
    let told = replaced("s;1/min;km/h;kN;kN", "s;1/min;furlong;kN;kN");
    assert!(told.contains("\"furlong\" is not known"), "{told}");
    let told = replaced("s;1/min;km/h;kN;kN", "s;1/min;km/h;%;kN");
    assert!(told.contains("% of what? give percent_of"), "{told}");
    let told = replaced("s;1/min;km/h;kN;kN", "s;Hz;km/h;kN;kN");
    assert!(told.contains("give teeth"), "{told}");
    let told = replaced("0,010;", "0,000;");
    assert!(told.contains("its time repeats at sample 1"), "{told}");
    let told = replaced("0,010;", "0,010;7;");
    assert!(told.starts_with("run.csv:6:"), "{told}");
    // Two that may be the brake: every command asks, though an estimate needs none; `channels` lists them and the map says how to go on.
    let two_brakes = german()
        .replace("Radlast\n", "Radlast;Bremsdruck VL;Bremsdruck VR\n")
        .replace("kN;kN\n", "kN;kN;bar;bar\n")
        .replace(";4\n", ";4;10;11\n");
    scratch.write("brakes.csv", two_brakes);
    for command in [
        "estimate --radius 0.31 brakes.csv",
        "convert --out out.csv brakes.csv",
    ] {
        let told = scratch.complaint(&words(command));
        assert!(
            told.contains(
                "column brake_pressure_pa may be Bremsdruck VL [bar], Bremsdruck VR [bar]"
            ),
            "{told}"
        );
    }
    let text = scratch.output(&words("channels brakes.csv --write-map map.toml"));
    assert!(text.contains("brake_pressure_pa may be"), "{text}");
    assert!(
        scratch
            .read("map.toml")
            .contains("# column brake_pressure_pa may be")
    );
    scratch.output(&words("estimate --radius 0.31 --map map.toml brakes.csv"));
    // Two wheels: never the first of them.
    scratch.write(
        "map.toml",
        "[channels.wheel_speed_rad_s]\nname = \"Rad*\"\n",
    );
    let told = scratch.complaint(&["convert", "--map", "map.toml", "--out", "out.csv", BENCH]);
    assert!(
        told.contains("fits Raddrehzahl_VL [1/min] (group 0), Radlast_VL [kN] (group 2)"),
        "{told}"
    );
    assert!(!scratch.path("out.csv").exists() && Path::new(BENCH).exists());
}
