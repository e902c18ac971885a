//! Files of other programs in the commands: one call, no rig file, foreign names and units.

use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::common::{HEADER, RIG, Scratch, words};

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
    for command in ["estimate", "fit"] {
        let told = scratch.complaint(&[command, BENCH]);
        assert!(told.contains("add --radius METRES"), "{told}");
    }
}

#[test]
fn a_german_csv_is_estimated_and_converted() {
    let scratch = Scratch::new();
    scratch.write("lauf.csv", german());
    let json = scratch.json(&words("estimate --radius 0.31 --json lauf.csv"));
    let peak = json["peak_friction"]["value"].as_f64().unwrap();
    assert!((peak - 0.9).abs() < 0.005, "{json:#}");
    // A fit of all rows at once comes to the same peak.
    let fitted = scratch.json(&words("fit --radius 0.31 --json lauf.csv"));
    let fitted = fitted["peak_friction"]["value"].as_f64().unwrap();
    assert!((fitted - 0.9).abs() < 0.005, "{fitted}");
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
    let rig = format!("{}\n{}", RIG, scratch.read("map.toml"));
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

#[test]
fn a_diagnosis_knows_what_was_measured_less_often_than_it_is_recorded() {
    let scratch = Scratch::with_rig(RIG);
    // The load of the bench's file stands at a quarter of the other channels' rate.
    scratch.output(
        &words("channels --write-map map.toml")
            .into_iter()
            .chain([BENCH])
            .collect::<Vec<_>>(),
    );
    let held = |method: &str| {
        let map = scratch.read("map.toml");
        let of_load = "[channels.normal_force_n]\n";
        let with_method = map.replace(of_load, &format!("{of_load}method = \"{method}\"\n"));
        assert_ne!(map, with_method);
        scratch.write("method.toml", with_method);
        let diagnosis = scratch.json(&[
            "diagnose",
            "--rig",
            "rig.toml",
            "--map",
            "method.toml",
            "--out",
            "found",
            "--json",
            BENCH,
        ]);
        let chain = diagnosis["chain"].as_array().unwrap().clone();
        let of_load = chain
            .iter()
            .filter(|one| one["channel"] == "normal_force_n" && one["finding"] == "held");
        let [found] = of_load.collect::<Vec<_>>()[..] else {
            panic!("{chain:#?}")
        };
        assert!(
            (found["value"].as_f64().unwrap() - 0.01).abs() < 1e-9,
            "{found}"
        );
        assert_eq!(
            (found["unit"].as_str(), found["recording"].as_str()),
            (Some("s"), Some("*"))
        );
        let others = chain.iter().filter(|one| one["finding"] == "held").count();
        assert_eq!(others, 1, "{chain:#?}");
        found["statement"].as_str().unwrap().to_owned()
    };
    assert!(held("linear").contains("straight lines, no measurements"));
    assert!(held("hold").contains("last reading is held"));
}

#[test]
fn a_converted_file_says_the_same_of_resampling_as_its_original() {
    let scratch = Scratch::with_rig(RIG);
    scratch.output(&["channels", "--write-map", "map.toml", BENCH]);
    let map = scratch.read("map.toml");
    assert!(!map.contains("[time]"), "{map}");
    // What a diagnosis says of how its recording was made: of the times of its channels, and of its faults.
    let told = |map: Option<&str>, file: &str| {
        let mut arguments = words("diagnose --rig rig.toml --out found --json");
        arguments.extend(map.into_iter().flat_map(|map| ["--map", map]));
        arguments.push(file);
        let diagnosis = scratch.json(&arguments);
        let of = |list: &str, keys: &[&str]| -> Vec<String> {
            let entries = diagnosis[list].as_array().unwrap().iter();
            let resampled = entries.filter(|one| {
                list != "chain"
                    || ["held", "low_passed"].contains(&one["finding"].as_str().unwrap())
            });
            let mut lines: Vec<String> = resampled
                .map(|one| {
                    keys.iter()
                        .map(|key| format!("{key}: {}; ", one[*key]))
                        .collect()
                })
                .collect();
            lines.sort();
            lines
        };
        let mut all = of(
            "chain",
            &["channel", "finding", "value", "unit", "statement"],
        );
        all.extend(of("data_faults", &["channel", "start_s", "end_s", "what"]));
        all
    };
    scratch.write("as-it-is.toml", map.clone());
    scratch.write("at-100.toml", format!("{map}\n[time]\nrate_hz = 100.0\n"));
    for (map, word) in [("as-it-is.toml", "held"), ("at-100.toml", "low_passed")] {
        let original = told(Some(map), BENCH);
        assert!(
            original
                .iter()
                .any(|line| line.contains(&format!("finding: \"{word}\""))),
            "{original:#?}"
        );
        assert!(
            original
                .iter()
                .any(|line| line.contains("what: \"measured at")),
            "{original:#?}"
        );
        for out in ["run.csv", "run.parquet"] {
            scratch.output(&["convert", "--map", map, "--out", out, BENCH]);
            assert_eq!(told(None, out), original, "{out}, {map}");
            // Through a second conversion, which leaves the times as they are.
            let again = format!("again-{out}");
            scratch.output(&["convert", "--out", &again, out]);
            assert_eq!(told(None, &again), original, "{again}, {map}");
        }
    }
}

#[test]
fn the_fitted_law_is_a_property_file_that_another_tyre_library_reads() {
    let scratch = Scratch::with_rig(RIG);
    scratch.write("lauf.csv", german());
    let text = scratch.output(&words("fit --rig rig.toml --tir tyre.tir lauf.csv"));
    assert!(text.contains("hold the law exactly"), "{text}");
    let json = scratch.json(&words("fit --rig rig.toml --json lauf.csv"));
    let of = |key: &str| json[key]["value"].as_f64().unwrap();
    let law = |slip: f64| {
        let x = slip / of("critical_slip");
        of("peak_friction") * 2.0 * x / (1.0 + x * x)
    };
    let file = scratch.read("tyre.tir");
    let value = |key: &str| -> f64 {
        let line = file.lines().find(|line| line.starts_with(key)).unwrap();
        let value = line.split(['=', '$']).nth(1).unwrap();
        value.trim().parse().unwrap()
    };
    assert!((value("PDX1") - of("peak_friction")).abs() < 1e-12);
    assert!((value("FNOMIN") - 4000.0).abs() < 1e-6 && (value("PCX1") - 2.0).abs() < 1e-9);
    // lumos, which is installed for the tests of formats.
    let Some(python) = std::env::var_os("MUSLIP_FORMATS_PYTHON") else {
        assert!(
            std::env::var_os("CI").is_none(),
            "MUSLIP_FORMATS_PYTHON is not set"
        );
        println!("left out: no other tyre library (cargo xtask formats installs one)");
        return;
    };
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../formats/tyre.py");
    let mut child = Command::new(python)
        .arg(script)
        .arg(scratch.path("tyre.tir"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let slips: Vec<f64> = (0..60).map(|k| 0.005 * f64::from(k)).collect();
    let mut asked = child.stdin.take().unwrap();
    for slip in &slips {
        writeln!(asked, "{slip} 4200").unwrap();
    }
    drop(asked);
    let output = child.wait_with_output().unwrap();
    let forces: Vec<f64> = String::from_utf8(output.stdout)
        .unwrap()
        .lines()
        .map(|line| line.parse().unwrap())
        .collect();
    assert_eq!(forces.len(), slips.len());
    for (slip, force) in slips.iter().zip(forces) {
        // Its own guard against a division by zero moves the force by less than a millionth.
        assert!(
            (force + 4200.0 * law(*slip)).abs() < 4200.0 * 1e-6,
            "{slip}: {force}"
        );
    }
}

#[test]
fn results_are_tables_beside_their_json() {
    let scratch = Scratch::with_rig(RIG);
    scratch.write("lauf.csv", german());
    let json = scratch.json(&words(
        "estimate --rig rig.toml --parquet estimate.parquet --trace trace.parquet --json lauf.csv",
    ));
    let listed = |name: &str| scratch.json(&["channels", name, "--json"]);
    let samples = |listing: &serde_json::Value, name: &str| {
        let channels = listing["channels"].as_array().unwrap();
        let one = channels.iter().find(|one| one["name"] == name);
        one.unwrap_or_else(|| panic!("no {name} in {listing:#}"))["samples"]
            .as_u64()
            .unwrap()
    };
    assert_eq!(
        samples(&listed("estimate.parquet"), "peak_friction.value"),
        1
    );
    let trace = listed("trace.parquet");
    assert_eq!(
        samples(&trace, "peak_friction"),
        json["samples"]["used"].as_u64().unwrap()
    );
    // The trace is a recording of the estimate: the same numbers as the CSV's.
    scratch.output(&words("estimate --rig rig.toml --trace trace.csv lauf.csv"));
    for (out, file) in [("a.csv", "trace.csv"), ("b.csv", "trace.parquet")] {
        scratch.write(
            "map.toml",
            "[channels.time_s]\nunit = \"s\"\n[channels.peak_friction]\n[channels.nis]\n",
        );
        scratch.output(&["convert", "--map", "map.toml", "--out", out, file]);
    }
    let rows = |name: &str| {
        let text = scratch.read(name);
        let rows = text.lines().filter(|line| !line.starts_with('#'));
        rows.map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(rows("a.csv"), rows("b.csv"));
    let diagnosis = scratch.json(&words(
        "diagnose --rig rig.toml --out found --parquet diagnosis.parquet --tir found.tir --json lauf.csv",
    ));
    let table = listed("diagnosis.parquet");
    let entries = |key: &str| diagnosis[key].as_array().unwrap().len() as u64;
    assert!(
        samples(&table, "part")
            >= entries("looked_for") + entries("data_faults") + entries("chain")
    );
    assert!(scratch.read("found.tir").contains("PCX1"));
}

/// Runs the command and answers with the most memory that it ever had, in MiB.
#[cfg(target_os = "linux")]
fn peak_mib(scratch: &Scratch, arguments: &[&str]) -> f64 {
    let mut child = Command::new(env!("CARGO_BIN_EXE_muslip-under-test"))
        .args(arguments)
        .current_dir(scratch.path("."))
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut peak = 0.0_f64;
    loop {
        let status = std::fs::read_to_string(format!("/proc/{}/status", child.id()));
        let text = status.unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kib = line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok());
        peak = peak.max(kib.unwrap_or(0.0) / 1024.0);
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success(), "{arguments:?}");
            return peak;
        }
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_long_file_is_listed_and_converted_in_little_memory() {
    const ROWS: u32 = 2_000_000;
    let scratch = Scratch::new();
    let mut text = String::from(
        "Zeit [s];Raddrehzahl [rad/s];Geschwindigkeit [km/h];Bremskraft [kN];Radlast [kN]\n",
    );
    for k in 0..ROWS {
        use std::fmt::Write as _;
        let (seconds, thousandths) = (k / 1000, k % 1000);
        writeln!(
            text,
            "{seconds}.{thousandths:03};{}.5;72;1.{};4",
            40 + k % 20,
            k % 10
        )
        .unwrap();
    }
    scratch.write("long.csv", text);
    // Its columns alone would be 80 MB.
    let converted = peak_mib(&scratch, &["convert", "--out", "out.csv", "long.csv"]);
    let as_parquet = peak_mib(&scratch, &["convert", "--out", "out.parquet", "long.csv"]);
    let listed = peak_mib(&scratch, &["channels", "long.csv"]);
    println!("{converted:.0} MiB, as Parquet {as_parquet:.0} MiB, listed {listed:.0} MiB");
    assert!(
        converted < 48.0 && listed < 48.0,
        "{converted} {listed} MiB"
    );
    assert!(as_parquet < 64.0, "{as_parquet} MiB");
    let out = scratch.read("out.csv");
    let rows = out.lines().filter(|line| !line.starts_with('#')).count();
    assert_eq!(rows, ROWS as usize + 1);
    assert!(
        out.lines()
            .last()
            .unwrap()
            .starts_with("# normal_force_n: Radlast [kN], N = 1000 × kN; 1000 Hz, kept")
    );
    let listing = scratch.json(&["channels", "--json", "out.parquet"]);
    assert_eq!(
        listing["channels"][4]["samples"].as_u64(),
        Some(ROWS.into())
    );
    // An interrupt in the midst of it: the folder is as it was.
    let before = scratch.files();
    let mut child = Command::new(env!("CARGO_BIN_EXE_muslip-under-test"))
        .args(["convert", "--out", "late.csv", "long.csv"])
        .current_dir(scratch.path("."))
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    while !scratch
        .files()
        .iter()
        .any(|name| name.starts_with(".muslip-"))
    {
        assert!(
            child.try_wait().unwrap().is_none(),
            "done before it was interrupted"
        );
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    let pid = child.id().to_string();
    assert!(
        Command::new("kill")
            .args(["-INT", &pid])
            .status()
            .unwrap()
            .success()
    );
    assert!(!child.wait().unwrap().success());
    assert_eq!(scratch.files(), before);
}
