//! `muslip rig` on a simulated rig behind a socket: the controller that is flashed, natively.

use std::net::TcpListener;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::common::{RIG, Scratch, number, words};
use muslip_diagnose::campaign::Rig as DeclaredRig;
use muslip_diagnose::mechanism::Context;
use muslip_diagnose::repaired::{Repaired, RepairedParameter, RepairedTerm};
use muslip_record::Parameters;
use muslip_recordings::model_file::to_text;
use pil::native::Native;
use pil::rig::{Rig, Trouble};
use pil::serve::Pace;

/// A rig at 20 m/s, twice as fast as a real one.
struct Server {
    address: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    fn start(trouble: Trouble) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("tcp:{}", listener.local_addr().unwrap());
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let mut target = Native::new().unwrap();
            let mut rig = Rig::rolling("rudd:0.85,0.14", 20.0, 1, &Parameters::default()).unwrap();
            pil::serve::settle(&mut target, &mut rig).unwrap();
            rig.trouble = trouble;
            // One client after the other on the same controller.
            while let Ok((client, _)) = listener.accept() {
                if stopped.load(Ordering::Relaxed) {
                    return;
                }
                let pace = Pace {
                    speed: 2.0,
                    waits: true,
                };
                pil::serve::serve(&mut target, &mut rig, client, pace, &stopped).unwrap();
            }
        });
        Self {
            address,
            stop,
            thread: Some(thread),
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // Wakes the accept.
        let _ = std::net::TcpStream::connect(self.address.trim_start_matches("tcp:"));
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[test]
fn a_ramp_is_recorded_and_the_recording_goes_straight_into_the_estimate() {
    let server = Server::start(Trouble::default());
    let scratch = Scratch::with_rig(RIG);
    let port = server.address.as_str();
    let status = scratch.output(&["rig", "--port", port, "status"]);
    assert!(
        status.contains("Idle") && status.contains("emulated"),
        "{status}"
    );
    let said = scratch.output(&[
        "rig", "--port", port, "run", "--ramp", "0.8", "--cool", "0.2", "--out", "run.csv",
    ]);
    assert!(
        said.contains("peak friction 0.8") && said.contains(" 0 samples missing"),
        "{said}"
    );
    let text = scratch.read("run.csv");
    assert!(text.lines().count() > 800, "{}", text.lines().count());
    assert!(text.contains("brake_demand"));
    assert!(
        said.contains("estimator: efficient, nothing compensated"),
        "{said}"
    );
    agrees(&said, &scratch, "estimate --rig rig.toml run.csv --json");
}

#[test]
fn a_rig_is_recorded_without_arming_it_and_its_means_are_told() {
    let server = Server::start(Trouble::default());
    let scratch = Scratch::with_rig(RIG);
    let port = server.address.as_str();
    let record = ["rig", "--port", port, "record", "--out", "rolling.csv"];
    let said = scratch.output(&[&record[..], &["--seconds", "0.5"]].concat());
    assert!(said.contains("500 rows, 0 samples missing"), "{said}");
    // It rolls freely at the speed at which the simulated rig begins.
    let mean = |name: &str| -> f64 {
        let line = said.lines().find(|line| line.contains(name)).unwrap();
        let mut words = line.split_whitespace();
        words.find_map(|word| word.parse().ok()).unwrap()
    };
    assert!((mean("mean vehicle speed") - 20.0).abs() < 0.1, "{said}");
    assert!(mean("slip of these").abs() < 0.005, "{said}");
    let normal = mean("mean normal force");
    assert!((normal / (420.0 * 9.806_65) - 1.0).abs() < 0.05, "{said}");
    let text = scratch.read("rolling.csv");
    let rows = text
        .lines()
        .filter(|line| line.starts_with(char::is_numeric));
    // Brake demand, the last column: nothing.
    assert!(rows.clone().all(|row| row.ends_with(",0")), "{text}");
    assert_eq!(rows.count(), 500);
    let status = scratch.output(&["rig", "--port", port, "status"]);
    assert!(status.contains("Idle"), "{status}");
    let told = scratch.complaint(&[&record[..], &["--seconds", "0"]].concat());
    assert!(told.contains("must be positive"), "{told}");
}

/// The live estimate and that of the recording are the same but for the noise, which each learns from its own samples.
fn agrees(said: &str, scratch: &Scratch, estimate: &str) -> f64 {
    let (_, line) = said.split_once("peak friction ").unwrap();
    let live: Vec<f64> = line
        .split_whitespace()
        .filter_map(|word| word.parse().ok())
        .take(4)
        .collect();
    let result = scratch.json(&words(estimate));
    let of = |path| number(&result, path);
    for (live, sigma, report) in [
        (live[0], live[1], of("peak_friction.value")),
        (live[2], live[3], of("critical_slip.value")),
    ] {
        // Printed to a thousandth.
        let off = (live - report).abs();
        assert!(off < 0.001 + sigma, "{said}{result:#}");
    }
    assert_eq!(result["estimator"], "efficient");
    live[0]
}

#[test]
fn a_diagnosed_model_is_compensated_live_as_in_the_report() {
    // A drag channel that reads 5 % of the load.
    let server = Server::start(Trouble {
        drag_offset_n: 0.05 * 420.0 * 9.806_65,
        ..Trouble::default()
    });
    let scratch = Scratch::with_rig(RIG);
    let port = server.address.as_str();
    let record = |name| {
        scratch.output(&[
            "rig", "--port", port, "run", "--ramp", "0.8", "--cool", "0.2", "--out", name,
        ])
    };
    let biased = agrees(
        &record("before.csv"),
        &scratch,
        "estimate --rig rig.toml before.csv --json",
    );
    assert!(biased > 0.88, "{biased}");
    let term = |id: &str, form: &str, value| RepairedTerm {
        id: id.into(),
        form: form.into(),
        equation: String::new(),
        parameters: vec![RepairedParameter {
            name: "p".into(),
            value,
            std: 0.0,
            unit: "1".into(),
        }],
    };
    let model = Repaired {
        schema: "muslip.model/1".into(),
        rig: DeclaredRig {
            radius_m: 0.31,
            wheel_inertia_kg_m2: 1.25,
            mass_kg: 420.0,
            torque_per_pressure_nm_pa: Some(0.00032),
            peak_friction: 0.85,
            critical_slip: 0.14,
            ..DeclaredRig::default()
        },
        base_alone: vec![0.0, -2.0, 0.0, 0.0, 0.0],
        base: vec![0.0, -2.0, 0.0, 0.0, 0.0],
        context: Context {
            radius: 0.31,
            inertia: 1.25,
            mass: 420.0,
            nominal: [0.85, 0.14],
            mean_load: 4_119.0,
            mean_speed: 20.0,
            max_speed: 20.0,
            mean_wheel_speed: 64.5,
            mean_power: 1e4,
            dt: 1e-3,
            duration: 6.0,
            total_time: 6.0,
            runs: 1,
            ..Context::default()
        },
        tyre: vec![
            term("load_crosstalk", "", 0.05),
            term("zero_drift", "linear_in_run", 3.0),
        ],
        ..Repaired::default()
    };
    scratch.write("model.toml", to_text(&model, "by hand").unwrap());
    let set = scratch
        .muslip(&["rig", "--port", port, "parameters", "--model", "model.toml"])
        .output()
        .unwrap();
    let said = String::from_utf8(set.stdout).unwrap();
    // The simulated controller has no flash.
    let told = String::from_utf8(set.stderr).unwrap();
    assert!(
        said.contains("compensated: load_crosstalk\n")
            && said.contains("not compensated: zero_drift (linear_in_run): its time counts"),
        "{said}{told}"
    );
    assert!(told.contains("could not be stored"), "{told}");
    let status = scratch.output(&["rig", "--port", port, "status"]);
    assert!(
        status.contains("efficient, compensated: load_crosstalk"),
        "{status}"
    );
    let printed = scratch.output(&["rig", "--port", port, "parameters"]);
    assert!(
        printed.contains("[compensation]\nload_crosstalk = 0.05"),
        "{printed}"
    );
    let said = record("after.csv");
    assert!(said.contains("compensated: load_crosstalk"), "{said}");
    let estimate = "estimate --rig rig.toml --model crosstalk.toml after.csv --json";
    let crosstalk = Repaired {
        tyre: vec![term("load_crosstalk", "", 0.05)],
        ..model
    };
    scratch.write("crosstalk.toml", to_text(&crosstalk, "by hand").unwrap());
    let compensated = agrees(&said, &scratch, estimate);
    assert!((compensated - 0.85).abs() < 0.02, "{compensated}");
}

#[test]
fn killed_while_it_records_it_keeps_every_row_and_the_estimate_takes_the_file() {
    let server = Server::start(Trouble::default());
    let scratch = Scratch::with_rig(RIG);
    let mut child = Command::new(env!("CARGO_BIN_EXE_muslip-under-test"))
        .current_dir(scratch.path(""))
        .args(["rig", "--port", &server.address, "run"])
        .args(["--ramp", "0.2", "--out", "run.csv"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    let rows = || {
        let text = std::fs::read_to_string(scratch.path("run.csv")).unwrap_or_default();
        text.lines()
            .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()))
            .count()
    };
    while rows() < 1_000 {
        assert!(start.elapsed() < Duration::from_secs(60), "{} rows", rows());
        std::thread::sleep(Duration::from_millis(5));
    }
    let seen = rows();
    // SIGKILL: nothing of its own runs any more.
    child.kill().unwrap();
    child.wait().unwrap();
    let text = scratch.read("run.csv");
    assert!(text.ends_with('\n') && rows() >= seen);
    let data: Vec<&str> = text
        .lines()
        .skip_while(|line| !line.starts_with("time_s"))
        .skip(1)
        .collect();
    for (index, line) in data.iter().enumerate() {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        assert_eq!(cells.len(), 6, "{line}");
        // In milliseconds, one after the other.
        assert_eq!((cells[0] * 1e3).round(), index as f64, "{line}");
    }
    let told = scratch.output(&["estimate", "--rig", "rig.toml", "run.csv"]);
    assert!(told.contains("peak friction"), "{told}");
    // A power cut may tear the last row: it is named by its line.
    scratch.write("torn.csv", &text[..text.len() - 20]);
    let told = scratch.complaint(&["estimate", "--rig", "rig.toml", "torn.csv"]);
    assert!(
        told.contains(&format!("torn.csv:{}:", text.lines().count())),
        "{told}"
    );
}

#[test]
fn recordings_go_straight_into_the_diagnosis() {
    let server = Server::start(Trouble::default());
    let scratch = Scratch::with_rig(RIG);
    for name in ["a.csv", "b.csv"] {
        let line = format!(
            "rig --port {} run --ramp 0.8 --applications 2 --cool 0.2 --out {name}",
            server.address
        );
        let said = scratch.output(&words(&line));
        assert!(said.contains(" 0 samples missing"), "{said}");
    }
    scratch.output(&[
        "diagnose", "--rig", "rig.toml", "--out", "found", "a.csv", "b.csv",
    ]);
    let diagnosis: serde_json::Value =
        serde_json::from_str(&scratch.read("found/diagnosis.json")).unwrap();
    assert!(diagnosis["verdict"].is_string(), "{diagnosis:#}");
}

#[test]
fn parameters_are_printed_set_and_refused_by_name() {
    let server = Server::start(Trouble::default());
    let scratch = Scratch::new();
    let port = server.address.as_str();
    let printed = scratch.output(&["rig", "--port", port, "parameters"]);
    assert!(printed.contains("newton_per_code"), "{printed}");
    scratch.write(
        "p.toml",
        printed.replace("friction_std = 0.03", "friction_std = -0.03"),
    );
    let told = scratch.complaint(&["rig", "--port", port, "parameters", "--set", "p.toml"]);
    assert!(
        told.contains("estimator.friction_std is out of range"),
        "{told}"
    );
}

#[test]
fn an_interlock_that_stands_is_named_and_nothing_is_recorded() {
    let server = Server::start(Trouble {
        emergency_stop: [true; 2],
        ..Trouble::default()
    });
    let scratch = Scratch::new();
    let line = format!("rig --port {} run --ramp 0.8 --out run.csv", server.address);
    let told = scratch.complaint(&words(&line));
    assert!(
        told.contains("error: the rig refuses to arm: interlock EmergencyStop"),
        "{told}"
    );
    assert!(!scratch.path("run.csv").exists());
}

#[test]
fn a_port_that_is_not_there_is_one_line() {
    let scratch = Scratch::new();
    for port in [
        "/dev/no-such-port",
        "tcp:127.0.0.1:1",
        "unix:/no/such/socket",
    ] {
        let told = scratch.complaint(&["rig", "--port", port, "status"]);
        assert!(told.starts_with(&format!("error: {port}: ")), "{told}");
    }
}
