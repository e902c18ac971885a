//! `muslip estimate --model`: on runs of the simulated rig with one effect beyond the law, the bias comes
//! and goes. The effects are made here by small Euler steps in the plant and on the load cell's reading,
//! not by the core's equations.

use std::collections::VecDeque;

use crate::common::{HEADER, Scratch, number, words};
use host_sim::{Brake, BrakeProgramme, Contact, Plant, PlantEffect, PlantParameters};
use muslip_diagnose::campaign::Rig;
use muslip_diagnose::mechanism::Context;
use muslip_diagnose::repaired::{NoiseModel, Repaired, RepairedParameter, RepairedTerm};
use muslip_recordings::model_file::to_text;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

const PEAK: f64 = 0.8;
const CRITICAL: f64 = 0.13;
const RADIUS: f64 = 0.31;
const SPEED: f64 = 20.0;
const MEAN_LOAD: f64 = 4000.0;
const DRAG_STD: f64 = 60.0;
const RATE_HZ: f64 = 500.0;
const SUBSTEPS: usize = 20;
const SEEDS: u64 = 6;

const RIG: &str = "\
[wheel]
radius_m = 0.31
inertia_kg_m2 = 1.25
[vehicle]
mass_kg = 420.0
coasting = false
[tyre]
law = \"rudd\"
peak_friction = 0.85
critical_slip = 0.14
[noise]
drag_force_n = 60.0
";

/// From drag, load, time and time step to what the load cell reads.
type Reading = Box<dyn FnMut(f64, f64, f64, f64) -> f64>;

/// What is done to the run, and the mechanism that says so.
struct Case {
    id: &'static str,
    form: &'static str,
    parameters: &'static [(&'static str, f64)],
    true_radius: f64,
    plant: fn() -> Option<Box<dyn PlantEffect>>,
    reading: fn() -> Reading,
}

fn untouched() -> Reading {
    Box::new(|drag, _load, _time, _dt| drag)
}

struct LoadFactor;
impl PlantEffect for LoadFactor {
    fn friction_factor(&self, contact: &Contact) -> f64 {
        (contact.normal_force_n / MEAN_LOAD).powf(-0.3)
    }
}

struct SlidingFactor;
impl PlantEffect for SlidingFactor {
    fn friction_factor(&self, contact: &Contact) -> f64 {
        (-0.03 * (contact.slip_ratio * contact.vehicle_speed_m_s).abs()).exp()
    }
}

/// A tread of 8 kJ/K that cools in 3 s; friction falls by 0.8 % a kelvin.
struct Tread(f64);
impl PlantEffect for Tread {
    fn friction_factor(&self, _contact: &Contact) -> f64 {
        (-0.008 * self.0).exp()
    }
    fn advance(&mut self, contact: &Contact, drag_n: f64, dt_s: f64) {
        let power = drag_n * contact.slip_ratio * contact.vehicle_speed_m_s;
        self.0 += dt_s * (power / 2000.0 - self.0 / 3.0);
    }
}

fn cases() -> Vec<Case> {
    let plain = Case {
        id: "effective_radius",
        form: "constant",
        parameters: &[("radius_error", 0.02)],
        true_radius: 1.02 * RADIUS,
        plant: || None,
        reading: untouched,
    };
    vec![
        Case {
            id: "force_delay",
            form: "",
            parameters: &[("delay", 0.03)],
            true_radius: RADIUS,
            reading: || {
                let mut line = VecDeque::new();
                Box::new(move |drag, _, _, dt| {
                    line.push_back(drag);
                    if line.len() as f64 * dt > 0.03 + 0.5 * dt {
                        line.pop_front().unwrap()
                    } else {
                        line[0]
                    }
                })
            },
            ..plain
        },
        Case {
            id: "force_lag",
            form: "",
            parameters: &[("time_constant", 0.03)],
            true_radius: RADIUS,
            reading: || {
                let mut y = 0.0;
                Box::new(move |drag, _, _, dt| {
                    y += dt / 0.03 * (drag - y);
                    y
                })
            },
            ..plain
        },
        Case {
            id: "zero_drift",
            form: "linear_with_offset",
            parameters: &[("slope", 60.0), ("offset", -90.0)],
            true_radius: RADIUS,
            reading: || Box::new(|drag, _, time, _| drag - 90.0 + 60.0 * time),
            ..plain
        },
        Case {
            id: "load_crosstalk",
            form: "",
            parameters: &[("share", 0.04)],
            true_radius: RADIUS,
            reading: || Box::new(|drag, load, _, _| drag + 0.04 * load),
            ..plain
        },
        Case {
            id: "load_sensitivity",
            form: "peak",
            parameters: &[("load_sensitivity", 0.3)],
            true_radius: RADIUS,
            plant: || Some(Box::new(LoadFactor)),
            ..plain
        },
        Case {
            id: "speed_sensitivity",
            form: "sliding_exponential",
            parameters: &[("friction_change_per_m_s", -0.03)],
            true_radius: RADIUS,
            plant: || Some(Box::new(SlidingFactor)),
            ..plain
        },
        Case {
            id: "relaxation_length",
            form: "force",
            parameters: &[("length", 0.5)],
            true_radius: RADIUS,
            reading: || {
                let mut felt = 0.0;
                Box::new(move |drag, _, _, dt| {
                    felt += dt * SPEED / 0.5 * (drag - felt);
                    felt
                })
            },
            ..plain
        },
        Case {
            id: "thermal_fade",
            form: "linear",
            // theta in s of the mean power 10 kW: 10 kW warms by 5 K a second.
            parameters: &[("sensitivity", 0.008 * 5.0), ("time_constant", 3.0)],
            true_radius: RADIUS,
            plant: || Some(Box::new(Tread(0.0))),
            ..plain
        },
        plain,
    ]
}

fn model(case: &Case) -> String {
    let rig = Rig {
        radius_m: RADIUS,
        wheel_inertia_kg_m2: 1.25,
        mass_kg: 420.0,
        coasting: false,
        torque_per_pressure_nm_pa: None,
        peak_friction: 0.85,
        critical_slip: 0.14,
        ..Rig::default()
    };
    let repaired = Repaired {
        schema: "muslip.model/1".into(),
        rig,
        base_alone: vec![0.0, -2.0, 0.0, 0.0, 0.0],
        base: vec![0.0, -2.0, 0.0, 0.0, 0.0],
        tyre: vec![RepairedTerm {
            id: case.id.into(),
            form: case.form.into(),
            equation: String::new(),
            parameters: case
                .parameters
                .iter()
                .map(|&(name, value)| RepairedParameter {
                    name: name.into(),
                    value,
                    std: 0.0,
                    unit: "1".into(),
                })
                .collect(),
        }],
        noise: NoiseModel {
            sigma_n: DRAG_STD,
            ..NoiseModel::default()
        },
        context: Context {
            radius: RADIUS,
            inertia: 1.25,
            mass: 420.0,
            nominal: [0.85, 0.14],
            mean_load: MEAN_LOAD,
            mean_speed: SPEED,
            max_speed: SPEED,
            mean_wheel_speed: SPEED / RADIUS,
            mean_power: 1e4,
            dt: 1.0 / RATE_HZ,
            duration: 6.0,
            total_time: 6.0,
            runs: 1,
            ..Context::default()
        },
        ..Repaired::default()
    };
    to_text(&repaired, "one mechanism, by hand").unwrap()
}

/// Three applications in six seconds under a load that sways.
fn recording(case: &Case, seed: u64) -> String {
    let mut plant = Plant::rolling(
        PlantParameters {
            radius_m: case.true_radius,
            inertia_kg_m2: 1.25,
            mass_kg: 420.0,
            coasting: false,
            law: format!("rudd:{PEAK},{CRITICAL}").parse().unwrap(),
        },
        SPEED,
    );
    if let Some(effect) = (case.plant)() {
        plant.add_effect(effect);
    }
    let mut brake = Brake::new(BrakeProgramme {
        applications: 3,
        period_s: 2.0,
        ramp_nm_s: 1000.0,
        largest_torque_nm: 1500.0,
        skid_slip_ratio: 0.9,
        skid_hold_s: 0.1,
        hydraulic_lag_s: 0.01,
    });
    let mut reading = (case.reading)();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut text = format!("{HEADER}\n");
    let dt = 1.0 / (RATE_HZ * SUBSTEPS as f64);
    for row in 0..3000 {
        for substep in 0..SUBSTEPS {
            let time = plant.state().time_s;
            let load = MEAN_LOAD * (1.0 + 0.25 * (2.3 * time).sin());
            let contact = plant.contact(load);
            let read = reading(plant.drag_n(&contact), load, time, dt);
            if substep == 0 {
                let noise: f64 = StandardNormal.sample(&mut random);
                text += &format!(
                    "{},{},{},{},{load}\n",
                    f64::from(row) / RATE_HZ,
                    contact.wheel_speed_rad_s,
                    contact.vehicle_speed_m_s,
                    read + DRAG_STD * noise
                );
            }
            let torque = brake.step(time, dt, contact.slip_ratio);
            plant.step(dt, torque, load);
        }
    }
    text
}

#[test]
fn compensation_takes_the_bias_away() {
    println!("mean error over the stated sigma, {SEEDS} seeds: mup, sp, without -> with the model");
    for case in cases() {
        let scratch = Scratch::with_rig(RIG);
        scratch.write("model.toml", model(&case));
        let mut bias = [[0.0_f64; 2]; 2];
        for seed in 0..SEEDS {
            scratch.write("run.csv", recording(&case, seed));
            for (with, bias) in bias.iter_mut().enumerate() {
                let mut arguments = words("estimate --rig rig.toml --estimator article --json");
                if with == 1 {
                    arguments.extend(["--model", "model.toml"]);
                }
                arguments.push("run.csv");
                let told = scratch.json(&arguments);
                if with == 1 {
                    assert_eq!(told["model"]["compensated"][0]["id"], case.id);
                    assert_eq!(
                        told["model"]["not_compensated"].as_array().unwrap().len(),
                        0
                    );
                }
                for (bias, (name, truth)) in bias
                    .iter_mut()
                    .zip([("peak_friction", PEAK), ("critical_slip", CRITICAL)])
                {
                    let error = number(&told, &format!("{name}.value")) - truth;
                    *bias += error / number(&told, &format!("{name}.std")) / SEEDS as f64;
                }
            }
        }
        let [before, after] = bias;
        println!(
            "{:18} {:+6.2} {:+6.2} -> {:+5.2} {:+5.2}",
            case.id, before[0], before[1], after[0], after[1]
        );
        let size = |bias: [f64; 2]| bias[0].abs().max(bias[1].abs());
        assert!(
            size(before) > 2.0,
            "{}: no bias to take away: {before:?}",
            case.id
        );
        // Six seeds of a filter that takes three times the noise: the mean has a sigma of 0.14.
        assert!(size(after) < 0.5, "{}: {after:?}", case.id);
    }
}

#[test]
fn the_efficient_estimator_compensates_too_but_for_filtered_forces() {
    for case in cases() {
        let scratch = Scratch::with_rig(RIG);
        scratch.write("model.toml", model(&case));
        scratch.write("run.csv", recording(&case, 1));
        let plain = words("estimate --rig rig.toml --model model.toml --json run.csv");
        let told = scratch.json(&plain);
        if case.id == "force_lag" || case.form == "force" {
            assert_eq!(told["estimator"], "article");
            let complaint =
                scratch.complaint(&[&plain[..], &["--estimator", "efficient"]].concat());
            assert!(complaint.contains("low-pass filter"), "{complaint}");
            continue;
        }
        assert_eq!(told["estimator"], "efficient");
        for (name, truth) in [("peak_friction", PEAK), ("critical_slip", CRITICAL)] {
            let error = number(&told, &format!("{name}.value")) - truth;
            let sigmas = error / number(&told, &format!("{name}.std"));
            assert!(sigmas.abs() < 4.0, "{}: {name} {sigmas}", case.id);
        }
    }
}

#[test]
fn what_cannot_be_compensated_is_named_and_nothing_else_changes() {
    let case = &cases()[3];
    let scratch = Scratch::with_rig(RIG);
    scratch.write("run.csv", recording(case, 1));
    let text = model(case)
        .replace("load_crosstalk", "force_saturation")
        .replace("share\"", "limit\"")
        .replace("value = 0.04", "value = 2500.0");
    scratch.write("model.toml", text);
    let plain = scratch.json(&words("estimate --rig rig.toml --json run.csv"));
    let told = scratch.json(&words(
        "estimate --rig rig.toml --model model.toml --json run.csv",
    ));
    assert_eq!(
        told["model"]["not_compensated"][0]["id"],
        "force_saturation"
    );
    assert_eq!(told["peak_friction"], plain["peak_friction"]);
    assert_eq!(told["critical_slip"], plain["critical_slip"]);
    let said = scratch.output(&words("estimate --rig rig.toml --model model.toml run.csv"));
    assert!(said.contains("Not compensated: force_saturation"), "{said}");
}

#[test]
fn a_model_of_another_rig_or_none_at_all_is_refused_in_one_line() {
    let case = &cases()[3];
    let scratch = Scratch::with_rig(&RIG.replace("0.31", "0.33"));
    scratch.write("run.csv", recording(case, 1));
    scratch.write("model.toml", model(case));
    let call = words("estimate --rig rig.toml --model model.toml run.csv");
    assert!(
        scratch
            .complaint(&call)
            .starts_with("rig.toml:2:12: wheel.radius_m")
    );
    scratch.write("model.toml", "nonsense");
    assert!(scratch.complaint(&call).starts_with("model.toml:1:"));
}
