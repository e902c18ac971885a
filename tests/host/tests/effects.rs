//! Pictures of what mechanisms do, of runs in which the model is true: simulated by the plant, whose equations the
//! engine's balances do not share.

use std::path::PathBuf;

use crate::common::Scratch;
use crate::diagnosis::{RIG, parameter, partly_explained, repaired};
use muslip_diagnose::campaign::Run;
use muslip_diagnose::outcome::Diagnosis;
use muslip_diagnose::repaired::{Repaired, RepairedTerm};
use muslip_recordings::load;
use muslip_recordings::model_file::to_text;
use muslip_report::diagnose::effects::effects;

/// A mechanism: its id, its form, and name, value and unit of each parameter.
type Case = (
    &'static str,
    &'static str,
    &'static [(&'static str, f64, &'static str)],
);

/// Mechanisms of wheel and vehicle.
const DYNAMICS: [Case; 9] = [
    ("aero_drag", "", &[("coefficient", 1.1, "kg/m")]),
    ("grade_or_drive", "", &[("force", -600.0, "N")]),
    ("vehicle_inertia", "", &[("mass_error", 0.2, "1")]),
    ("bearing_drag", "constant", &[("torque", 40.0, "N m")]),
    ("wheel_inertia", "", &[("inertia_error", 0.5, "1")]),
    (
        "brake_fade",
        "",
        &[("sensitivity", 0.2, "1/s"), ("time_constant", 3.0, "s")],
    ),
    ("brake_lag", "", &[("time_constant", 0.03, "s")]),
    ("force_gain", "", &[("gain_error", 0.1, "1")]),
    (
        "force_gain",
        "bent",
        &[("gain_error", 0.1, "1"), ("bend", 0.04, "1")],
    ),
];

/// The base law and one mechanism of wheel or vehicle.
fn model((id, form, parameters): Case) -> Repaired {
    let mut model = repaired();
    model.rig.torque_per_pressure_nm_pa = Some(3.2e-4);
    model.tyre.clear();
    model.corrections.clear();
    model.covariance = vec![vec![1e-6; 5]; 5];
    model.dynamics_covariance = vec![vec![1e-4; parameters.len()]; parameters.len()];
    model.dynamics = vec![RepairedTerm {
        id: id.into(),
        form: form.into(),
        equation: String::new(),
        parameters: parameters
            .iter()
            .map(|(name, value, unit)| parameter(name, *value, 0.0, unit))
            .collect(),
    }];
    model
}

/// A run in which a model is true, as sensors without noise read it.
fn run_under(model: &Repaired) -> Run {
    let brake = "[brake]\ntorque_per_pressure_nm_pa = 3.2e-4\n";
    let scratch = Scratch::with_rig(&format!("{RIG}\n{brake}"));
    scratch.write("model.toml", to_text(model, "true").unwrap());
    scratch.output(&[
        "simulate",
        "--model",
        "model.toml",
        "--no-noise",
        "--out",
        "run.csv",
    ]);
    let recordings: [PathBuf; 1] = [scratch.path("run.csv")];
    let campaign = load::campaign(&scratch.path("rig.toml"), &recordings, &|_| ()).unwrap();
    campaign.runs.into_iter().next().unwrap()
}

#[test]
fn a_balance_lacks_what_its_mechanism_supplies() {
    for case in DYNAMICS {
        let id = case.0;
        let model = model(case);
        let run = run_under(&model);
        let imbalance = model.imbalance(&run, 0).unwrap().unwrap();
        let (mut left, mut whole, mut count) = (0.0, 0.0, 0);
        for stretch in &imbalance.stretches {
            for block in stretch.chunks(25) {
                let mean = |of: fn(&muslip_diagnose::imbalance::Instant) -> f64| {
                    block.iter().map(of).sum::<f64>() / block.len() as f64
                };
                let (lacking, supplied) = (mean(|i| i.lacking), mean(|i| i.supplied));
                left += (lacking - supplied).powi(2);
                whole += supplied.powi(2);
                count += 1;
            }
        }
        assert!(count > 20 && whole > 0.0, "{id}: {count} blocks");
        let share = (left / whole).sqrt();
        assert!(share < 0.1, "{id}: {share:.3} of the effect is not there");
    }
}

#[test]
fn every_mechanism_has_a_picture() {
    let pictured = |model: Repaired, runs: &[Run]| -> Vec<(String, usize)> {
        let diagnosis = Diagnosis {
            found: model,
            ..partly_explained()
        };
        effects(&diagnosis, runs)
            .into_iter()
            .map(|effect| (effect.id, effect.figures.len()))
            .collect()
    };
    for case in DYNAMICS {
        let model = model(case);
        let run = run_under(&model);
        let remembers = case.0.starts_with("brake_");
        let figures = if remembers { 2 } else { 1 };
        assert_eq!(pictured(model, &[run]), [(case.0.to_owned(), figures)]);
    }
    let model = Repaired {
        dynamics: Vec::new(),
        ..repaired()
    };
    let run = run_under(&model);
    assert_eq!(
        pictured(model.clone(), &[run]),
        [
            ("force_lag".to_owned(), 2),
            ("load_crosstalk".to_owned(), 2)
        ]
    );
    // Without a recording there is nothing to show, and nothing fails.
    assert!(
        pictured(model, &[])
            .iter()
            .all(|(_, figures)| *figures == 0)
    );
}
