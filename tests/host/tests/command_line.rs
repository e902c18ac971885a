//! The `muslip` command as a person and a script meet it: help, words, statuses, files.

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{HEADER, RIG, Scratch, recording_of};
use test_support::scenario::article;

const SUBCOMMANDS: [&str; 11] = [
    "rig",
    "estimate",
    "campaign",
    "channels",
    "convert",
    "fit",
    "diagnose",
    "predict",
    "simulate",
    "demo",
    "completions",
];

fn scratch() -> Scratch {
    let scratch = Scratch::with_rig(&format!("{RIG}\n[noise]\ndrag_force_n = 40.0\n"));
    scratch.write("run.csv", recording_of(article::measurements(1)));
    scratch
}

#[test]
fn help_of_every_subcommand_is_as_committed_and_has_examples() {
    let scratch = Scratch::new();
    for subcommand in SUBCOMMANDS {
        let help = scratch.output(&[subcommand, "--help"]);
        assert!(help.contains("Example"), "{subcommand}");
        insta::assert_snapshot!(format!("help_{subcommand}"), help);
    }
    let help = scratch.output(&["--help"]);
    for subcommand in SUBCOMMANDS {
        assert!(help.contains(subcommand), "{help}");
    }
}

#[test]
fn version_is_the_package_s() {
    let version = Scratch::new().output(&["--version"]);
    assert_eq!(version, format!("muslip {}\n", env!("CARGO_PKG_VERSION")));
}

#[test]
fn words_of_an_estimate_are_as_committed() {
    let scratch = scratch();
    insta::assert_snapshot!(
        "estimate_words",
        scratch.output(&[
            "estimate", "--rig", "rig.toml", "--trace", "t.csv", "--report", "r.html", "run.csv"
        ])
    );
    assert_eq!(scratch.files(), ["r.html", "rig.toml", "run.csv", "t.csv"]);
}

#[test]
fn words_of_a_fit_are_as_committed() {
    let scratch = scratch();
    scratch.write("again.csv", recording_of(article::measurements(2)));
    insta::assert_snapshot!(
        "fit_words",
        scratch.output(&["fit", "--rig", "rig.toml", "run.csv", "again.csv"])
    );
}

#[test]
fn the_demo_writes_its_files_and_says_where_and_how() {
    let scratch = Scratch::new();
    insta::assert_snapshot!("demo_words", scratch.output(&["demo"]));
    let report = scratch.read("muslip-demo/report.html");
    assert!(report.contains("Friction peaks at") && report.contains("player-curve"));
    assert!(scratch.read("muslip-demo/trace.csv").lines().count() > 1000);
    assert!(
        scratch
            .read("muslip-demo/found/report.html")
            .contains("id=\"figure-1\"")
    );
    // The command that it prints works as printed.
    let words = scratch.output(&["demo"]);
    let command = words
        .lines()
        .find_map(|line| line.strip_prefix("  muslip "))
        .unwrap();
    scratch.output(&command.split(' ').collect::<Vec<_>>());
    // Without the true curve, which only the demo knows.
    assert!(report.contains("true curve"));
    assert!(!scratch.read("report.html").contains("true curve"));
}

#[test]
fn bad_usage_is_one_line_and_status_2() {
    let scratch = scratch();
    for (arguments, part) in [
        (&[][..], "a subcommand is needed"),
        (&["fly"], "unrecognized subcommand 'fly'"),
        (&["estimate"], "<RUN.csv>"),
        (&["estimate", "run.csv"], "add --radius METRES"),
        (&["estimate", "--rig", "rig.toml"], "<RUN.csv>"),
        (
            &["estimate", "--rigg", "rig.toml", "run.csv"],
            "unexpected argument '--rigg'",
        ),
        (
            &[
                "estimate", "--rig", "rig.toml", "--range", "moon", "run.csv",
            ],
            "possible values: aircraft, automotive",
        ),
        (
            &[
                "fit",
                "--rig",
                "rig.toml",
                "--max-iterations",
                "-1",
                "run.csv",
            ],
            "-1",
        ),
        (&["fit", "--rig", "rig.toml"], "<RUN.csv>"),
        (&["completions", "tcsh"], "tcsh"),
    ] {
        let complaint = scratch.complaint(arguments);
        assert!(complaint.contains(part), "{complaint}");
    }
}

#[test]
fn a_bad_rig_file_is_told_with_its_line_and_column() {
    let scratch = scratch();
    for (rig, expected) in [
        (
            RIG.replace("0.31", "310"),
            "rig.toml:2:12: wheel.radius_m = 310: must be between 0.005 and 2 m",
        ),
        (
            RIG.replace("= 1.25", "= -1.25"),
            "rig.toml:3:17: wheel.inertia_kg_m2 = -1.25: must be finite and positive",
        ),
        (
            RIG.replace("mass_kg = 420.0", ""),
            "rig.toml:5:1: missing field `mass_kg`",
        ),
        (
            RIG.replace("\"rudd\"", "\"brush\""),
            "rig.toml:13:7: tyre.law = \"brush\": unknown tyre law (known: \"rudd\")",
        ),
    ] {
        scratch.write("rig.toml", rig);
        for command in ["estimate", "fit"] {
            assert_eq!(
                scratch.complaint(&[command, "--rig", "rig.toml", "run.csv"]),
                expected
            );
        }
        let simulate = ["simulate", "--rig", "rig.toml", "--out", "out.csv"];
        assert_eq!(scratch.complaint(&simulate), expected);
    }
    assert_eq!(
        scratch.complaint(&["fit", "--rig", "no.toml", "run.csv"]),
        "no.toml:1:1: cannot be read: no such file or directory"
    );
    assert_eq!(scratch.files(), ["rig.toml", "run.csv"]);
}

#[test]
fn a_malformed_recording_leaves_outputs_as_they_were() {
    let scratch = scratch();
    scratch.write(
        "bad.csv",
        format!("{HEADER}\n0,90,30,200,1000\n0.01,90,30,200\n"),
    );
    scratch.write("old.html", "old");
    let complaint = scratch.complaint(&[
        "estimate", "--rig", "rig.toml", "--trace", "new.csv", "--report", "old.html", "bad.csv",
    ]);
    assert_eq!(complaint, "bad.csv:3:15: 4 cells where the header has 5");
    assert_eq!(
        scratch.files(),
        ["bad.csv", "old.html", "rig.toml", "run.csv"]
    );
    assert_eq!(scratch.read("old.html"), "old");
}

#[test]
fn an_output_that_cannot_be_written_is_told_and_nothing_is_left() {
    let scratch = scratch();
    for (flag, command) in [("--trace", "estimate"), ("--report", "estimate")] {
        let complaint = scratch.complaint(&[
            command,
            "--rig",
            "rig.toml",
            flag,
            "no/where.csv",
            "run.csv",
        ]);
        assert_eq!(
            complaint,
            "no/where.csv:1:1: cannot be written: no such file or directory"
        );
    }
    assert_eq!(
        scratch.complaint(&["simulate", "--rig", "rig.toml", "--out", "no/where.csv"]),
        "no/where.csv:1:1: cannot be written: no such file or directory"
    );
    assert_eq!(scratch.files(), ["rig.toml", "run.csv"]);
}

#[test]
fn a_killed_command_leaves_no_half_written_file_under_the_final_name() {
    let scratch = scratch();
    scratch.write("out.csv", "old");
    let mut child = Command::new(env!("CARGO_BIN_EXE_muslip-under-test"))
        .current_dir(scratch.path(""))
        .args([
            "simulate",
            "--rig",
            "rig.toml",
            "--duration",
            "100000",
            "--out",
            "out.csv",
        ])
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    // Wait until it is writing.
    let started = Instant::now();
    let writing = |scratch: &Scratch| {
        scratch.files().iter().any(|name| {
            name.ends_with(".tmp") && std::fs::metadata(scratch.path(name)).unwrap().len() > 0
        })
    };
    while !writing(&scratch) {
        assert!(
            started.elapsed() < Duration::from_secs(30),
            "nothing is written"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(scratch.read("out.csv"), "old");
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_ends_the_command_quietly() {
    let scratch = scratch();
    for arguments in [
        &["completions", "bash"][..],
        &["estimate", "--rig", "rig.toml", "run.csv"],
        &["estimate", "--help"],
        &["--version"],
    ] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_muslip-under-test"))
            .current_dir(scratch.path(""))
            .args(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let complaint = String::from_utf8_lossy(&output.stderr);
        assert_eq!(
            (output.status.code(), &*complaint),
            (Some(0), ""),
            "{arguments:?}"
        );
    }
}

#[test]
fn colours_are_for_terminals_and_no_color_forbids_them() {
    let scratch = scratch();
    let arguments = ["estimate", "--rig", "rig.toml", "run.csv"];
    let stdout = |variable: &str| {
        let output = scratch
            .muslip(&arguments)
            .env(variable, "1")
            .output()
            .unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    assert!(!scratch.output(&arguments).contains('\u{1b}'));
    assert!(stdout("CLICOLOR_FORCE").contains('\u{1b}'));
    assert!(!stdout("NO_COLOR").contains('\u{1b}'));
}

#[test]
fn completions_know_every_subcommand() {
    let scratch = Scratch::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = scratch.output(&["completions", shell]);
        for subcommand in SUBCOMMANDS {
            assert!(script.contains(subcommand), "{shell}: {subcommand}");
        }
    }
}

#[test]
fn json_goes_to_a_file_by_redirection_and_words_stay_out_of_it() {
    let scratch = scratch();
    let json = scratch.json(&[
        "estimate", "--rig", "rig.toml", "--json", "--trace", "t.csv", "--report", "r.html",
        "run.csv",
    ]);
    assert_eq!(json["schema"], "muslip.estimate/1");
}

#[test]
fn a_report_of_a_hostile_name_holds_no_markup_of_it() {
    let scratch = scratch();
    let name = "<img src=x onerror=alert(1)>.csv";
    scratch.write(name, scratch.read("run.csv"));
    scratch.output(&["estimate", "--rig", "rig.toml", "--report", "r.html", name]);
    let page = scratch.read("r.html");
    assert!(!page.contains("<img") && page.contains("img src=x"));
}

#[test]
fn the_same_figures_are_written_for_a_document() {
    let scratch = scratch();
    for (format, start) in [("svg", b"<svg xmlns".as_slice()), ("png", b"\x89PNG")] {
        scratch.output(&[
            "estimate", "--rig", "rig.toml", "--report", "r.html", "--format", format, "run.csv",
        ]);
        for name in ["curve", "ellipse", "figure-1-variances", "innovations"] {
            let path = scratch.path(&format!("r-figures/{name}.{format}"));
            assert!(std::fs::read(path).unwrap().starts_with(start), "{name}");
        }
    }
    let complaint = scratch.complaint(&[
        "estimate", "--rig", "rig.toml", "--format", "svg", "run.csv",
    ]);
    assert!(complaint.contains("--report"), "{complaint}");
}

#[test]
fn a_page_of_five_thousand_samples_stays_below_two_megabytes() {
    let scratch = scratch();
    let mut text = String::from(HEADER);
    for step in 0..5000 {
        let time = f64::from(step) * 0.002;
        let slip = f64::from(step % 500) / 500.0;
        let friction = 0.105 * slip / (0.0225 + slip * slip) + 0.01 * f64::from(step % 7);
        text += &format!(
            "\n{time:.4},{:.5},30,{:.3},1000",
            100.0 * (1.0 - slip),
            1000.0 * friction
        );
    }
    scratch.write("long.csv", text + "\n");
    scratch.output(&[
        "estimate", "--rig", "rig.toml", "--report", "r.html", "long.csv",
    ]);
    let bytes = scratch.read("r.html").len();
    assert!((100_000..2_000_000).contains(&bytes), "{bytes}");
}

#[test]
fn no_line_is_longer_than_the_terminal_has_columns() {
    let scratch = scratch();
    scratch.write("other.csv", recording_of(article::measurements(2)));
    let commands: [&[&str]; 3] = [
        &["estimate", "--rig", "rig.toml", "run.csv"],
        &["fit", "--rig", "rig.toml", "run.csv"],
        &[
            "campaign",
            "--rig",
            "rig.toml",
            "--out",
            "all",
            "run.csv",
            "other.csv",
        ],
    ];
    for columns in [60, 80] {
        for arguments in commands {
            let mut command = scratch.muslip(arguments);
            let output = command
                .env("COLUMNS", columns.to_string())
                .output()
                .unwrap();
            let told = String::from_utf8(output.stdout).unwrap();
            assert!(told.lines().count() > 3, "{told}");
            for line in told.lines() {
                assert!(line.chars().count() <= columns, "{columns}: {line}");
            }
        }
    }
}

#[test]
fn a_campaign_with_a_bad_recording_leaves_nothing_behind() {
    let scratch = scratch();
    scratch.write("bad.csv", "time_s\nx\n");
    let files = scratch.files();
    let campaign = ["campaign", "--rig", "rig.toml", "--out", "all", "run.csv"];
    let complaint = scratch.complaint(&[&campaign[..], &["bad.csv"]].concat());
    assert!(complaint.starts_with("bad.csv:1:"), "{complaint}");
    assert_eq!(scratch.files(), files);
    scratch.output(&campaign);
    let index = scratch.read("all/index.html");
    assert!(index.contains("run.html"));
    // What was there stays as it was.
    scratch.complaint(&[&campaign[..], &["bad.csv"]].concat());
    assert_eq!(scratch.read("all/index.html"), index);
}
