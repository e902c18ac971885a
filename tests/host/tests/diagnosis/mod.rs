//! Diagnoses put together by hand: what the files and the terminal say of them is tested without the
//! engine, and values that an engine hardly ever gives can be had.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use host_sim::Scenario;
use muslip_diagnose::campaign::Rig;
use muslip_diagnose::mechanism::{Before, Context, Id};
use muslip_diagnose::outcome::{
    Alternative, BeforeAfter, ChainFinding, ChainWord, ChannelNoise, Diagnosis, Evidence, Fault,
    Fit, Interval, LookedFor, MinimumDetectable, NamedMechanism, Recording, Region,
    ReportedParameter, Role, Score, Trace, Unexplained, ValueAndStd, Verdict,
};
use muslip_diagnose::repaired::{
    Correction, Domain, KnownRecording, NoiseModel, Predicting, Repaired, RepairedParameter,
    RepairedTerm,
};
use muslip_recordings::rig_file::RigFile;

use crate::common::complaint;

/// A file of the contract as the repository has it.
pub fn contract(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../docs/contract")
        .join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// A file of the contract as the folder beside the project has it, where that is present. `MUSLIP_SHARED` names
/// the folder where it lies elsewhere.
pub fn shared_contract(name: &str) -> Option<String> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let shared = std::env::var_os("MUSLIP_SHARED").map_or(beside, PathBuf::from);
    std::fs::read_to_string(shared.join("contract").join(name)).ok()
}

/// Asserts that a text is a diagnosis by the contract's schema: the repository's, and the one beside it.
pub fn assert_valid(text: &str) {
    const SCHEMA: &str = "diagnosis.schema.json";
    let value: serde_json::Value = serde_json::from_str(text).expect("diagnosis.json is JSON");
    for schema in [Some(contract(SCHEMA)), shared_contract(SCHEMA)]
        .into_iter()
        .flatten()
    {
        let schema = serde_json::from_str(&schema).expect("the schema is JSON");
        assert_eq!(complaint(schema, &value), None);
    }
}

/// The rig file of [`rig`].
pub const RIG: &str = "\
[wheel]
radius_m = 0.31
inertia_kg_m2 = 1.25

[vehicle]
mass_kg = 1260.0
coasting = true

[tyre]
law = \"rudd\"
peak_friction = 0.75
critical_slip = 0.15

[noise]
drag_force_n = 90.0
";

pub fn rig() -> Rig {
    Rig {
        radius_m: 0.31,
        wheel_inertia_kg_m2: 1.25,
        mass_kg: 1260.0,
        coasting: true,
        torque_per_pressure_nm_pa: None,
        peak_friction: 0.75,
        critical_slip: 0.15,
        law_fixed: false,
        declared_noise: BTreeMap::from([("drag_force_n".to_owned(), 90.0)]),
    }
}

pub fn parameter(name: &str, value: f64, std: f64, unit: &str) -> RepairedParameter {
    RepairedParameter {
        name: name.into(),
        value,
        std,
        unit: unit.into(),
    }
}

/// A model with two mechanisms and a correction.
pub fn repaired() -> Repaired {
    Repaired {
        schema: "muslip.model/1".into(),
        averaged: 1,
        proof_by_blocks: false,
        rig: rig(),
        late: muslip_diagnose::chain::correct::Lateness::default(),
        proof: Predicting::default(),
        base_alone: vec![0.82_f64.ln(), 0.141_f64.ln(), 0.0, 0.0, 0.0],
        base: vec![0.85_f64.ln(), 0.13_f64.ln(), 0.0, 0.0, 0.0],
        base_unplaced: Vec::new(),
        tyre: vec![
            RepairedTerm {
                id: "force_lag".into(),
                form: String::new(),
                equation: "time_constant d(reading)/dt + reading = drag".into(),
                parameters: vec![parameter("time_constant", 0.1 + 0.2 - 0.29, 1e-4, "s")],
            },
            RepairedTerm {
                id: "load_crosstalk".into(),
                form: String::new(),
                equation: "reading = drag + share * normal_force".into(),
                parameters: vec![parameter("share", 0.02 / 3.0, 0.001, "1")],
            },
        ],
        dynamics: vec![RepairedTerm {
            id: "wheel_inertia".into(),
            form: String::new(),
            equation: "inertia * d(omega)/dt = R * drag - brake_torque".into(),
            parameters: vec![parameter("inertia_error", 0.07, 0.01, "1")],
        }],
        corrections: vec![Correction {
            variable: "vehicle_speed_m_s".into(),
            acts_on: "friction".into(),
            form: String::new(),
            knots: vec![5.0, 15.0, 25.0, 35.0],
            values: vec![0.01, 0.0, -0.02, -0.015],
            harmonics: vec![],
        }],
        covariance: vec![vec![1e-6; 7]; 7],
        dynamics_covariance: vec![vec![1e-4]],
        noise: NoiseModel {
            sigma_n: 91.3,
            share_of_force: 0.004,
            step_s: Some(0.002),
            ..NoiseModel::default()
        },
        domain: Domain {
            ranges: BTreeMap::from([("slip".to_owned(), [-0.01, 0.9])]),
        },
        context: Context {
            radius: 0.31,
            inertia: 1.25,
            mass: 1260.0,
            nominal: [0.75, 0.15],
            mean_load: 4000.0,
            mean_speed: 20.0,
            max_speed: 34.0,
            mean_wheel_speed: 60.0,
            mean_power: 2e4,
            total_work: 7e5,
            mean_brake_power: 1e4,
            dt: 0.002,
            duration: 6.0,
            total_time: 36.0,
            runs: 6,
            distance: 120.0,
            drag_sigma: 90.0,
            max_drag: 3600.0,
            before: vec![
                Before::default(),
                Before {
                    work: 1e5,
                    time: 6.0,
                },
            ],
            ..Context::default()
        },
        recordings: vec![KnownRecording {
            path: "run00.csv".into(),
            first_time_s: 0.0,
            samples: 3000,
            holdout: false,
        }],
    }
}

/// A run with two brake applications, and both models' idea of it.
fn trace(recording: &str, holdout: bool) -> Trace {
    let mut trace = Trace {
        recording: recording.into(),
        holdout,
        ..Trace::default()
    };
    let mut lagged = 0.0;
    let mut random = Random::seeded(1);
    for k in 0..1500_u32 {
        let time = f64::from(k) * 0.004;
        let slip = 0.3 * (time * 1.9).sin().powi(2);
        let drag = 4000.0 * 2.0 * 0.85 * (slip / 0.13) / (1.0 + (slip / 0.13).powi(2));
        lagged += (drag - lagged) * 0.25;
        let noise = 150.0 * (random.uniform() - 0.5);
        trace.time_s.push(time);
        trace.slip.push(slip);
        trace.measured_n.push(lagged + noise);
        trace.before_n.push(drag);
        trace.after_n.push(lagged);
    }
    trace
}

fn interval(
    recording: &str,
    balance: &'static str,
    channel: &str,
    span: [f64; 2],
    z: f64,
) -> Interval {
    Interval {
        recording: recording.into(),
        balance,
        channel: channel.into(),
        start_s: span[0],
        end_s: span[1],
        z,
    }
}

fn looked_for() -> Vec<LookedFor> {
    Id::ALL
        .iter()
        .enumerate()
        .map(|(k, id)| LookedFor {
            id: id.as_str(),
            identifiable: k % 6 != 5,
            minimum_detectable: (k % 6 != 5).then(|| MinimumDetectable {
                name: "share".into(),
                value: 0.004 * (k + 1) as f64,
                unit: if k % 2 == 0 { "1" } else { "s" }.into(),
            }),
        })
        .collect()
}

fn score(rmse_n: f64) -> Score {
    Score {
        rmse_n,
        nll_per_sample: rmse_n.ln() + 1.4189,
        whiteness_p: Some(if rmse_n > 100.0 { 1e-9 } else { 0.37 }),
    }
}

/// A campaign with a lagging load cell, a wheel that is heavier than declared, and something unnamed.
pub fn partly_explained() -> Diagnosis {
    let both = BeforeAfter {
        before: score(143.2),
        after: score(91.0),
    };
    Diagnosis {
        schema: "muslip.diagnosis/1",
        verdict: Verdict::PartlyExplained,
        recordings: (0..6)
            .map(|k| Recording {
                path: format!("campaign/run0{k}.csv"),
                samples: 3000,
                role: if k == 4 { Role::Holdout } else { Role::Fit },
            })
            .collect(),
        noise: BTreeMap::from([(
            "drag_force_n".to_owned(),
            ChannelNoise {
                sigma: 88.1,
                declared: Some(90.0),
            },
        )]),
        base: BTreeMap::from([
            (
                "peak_friction".to_owned(),
                ValueAndStd {
                    value: 0.8421,
                    std: 0.0021,
                },
            ),
            (
                "critical_slip".to_owned(),
                ValueAndStd {
                    value: 0.1412,
                    std: 0.0013,
                },
            ),
        ]),
        r#where: vec![
            interval(
                "campaign/run02.csv",
                "tyre",
                "drag_force_n",
                [1.2, 1.85],
                14.2,
            ),
            interval(
                "campaign/run04.csv",
                "tyre",
                "drag_force_n",
                [0.5, 1.1],
                11.0,
            ),
            interval(
                "campaign/run04.csv",
                "tyre",
                "drag_force_n",
                [2.2, 2.75],
                12.0,
            ),
            interval(
                "campaign/run04.csv",
                "wheel",
                "wheel_speed_rad_s",
                [0.2, 0.3],
                31.0,
            ),
        ],
        regions: vec![
            Region {
                balance: "tyre",
                variable: "slip_rate".into(),
                low: -3.1,
                high: -0.4,
                z: 22.0,
                share: 0.71,
            },
            Region {
                balance: "tyre",
                variable: "slip".into(),
                low: 0.05,
                high: 0.31,
                z: 12.0,
                share: 0.55,
            },
        ],
        mechanisms: vec![
            NamedMechanism {
                id: "force_lag",
                balance: "tyre",
                statement: "the drag channel passes a first-order filter of 10.1 ms".into(),
                equation: "time_constant * d(reading)/dt + reading = drag".into(),
                parameters: vec![ReportedParameter {
                    name: "time_constant".into(),
                    value: 0.0101,
                    std: 0.0004,
                    unit: "s".into(),
                }],
                evidence: Evidence {
                    delta_bic: 812.0,
                    holdout_nll_gain_per_sample: 0.31,
                    confidence: 0.93,
                },
                confusable_with: vec![
                    Alternative {
                        id: "relaxation_length",
                        confidence: 0.05,
                    },
                    Alternative {
                        id: "force_delay",
                        confidence: 0.02,
                    },
                ],
                separating_test:
                    "repeat at half and at twice the speed: a lag in time stays the same, one in \
                                  distance does not"
                        .into(),
                effect_sigma: 1.2,
            },
            NamedMechanism {
                id: "wheel_inertia",
                balance: "wheel",
                statement: "the wheel's inertia is 1.338 kg m2".into(),
                equation: "inertia * d(omega)/dt = R * drag - brake_torque".into(),
                parameters: vec![ReportedParameter {
                    name: "inertia".into(),
                    value: 1.338,
                    std: 0.012,
                    unit: "kg m2".into(),
                }],
                evidence: Evidence {
                    delta_bic: 95.0,
                    holdout_nll_gain_per_sample: 0.02,
                    confidence: 0.996,
                },
                confusable_with: vec![],
                separating_test: String::new(),
                effect_sigma: 0.4,
            },
        ],
        unexplained: vec![Unexplained {
            balance: "tyre",
            variable: "vehicle_speed_m_s".into(),
            form: "friction * (1 - 0.02 (v/20 m/s - 1))".into(),
            z: 9.1,
            share: 0.12,
        }],
        looked_for: looked_for(),
        data_faults: vec![Fault {
            recording: "campaign/run02.csv".into(),
            channel: "normal_force_n".into(),
            start_s: 0.0,
            end_s: 0.1,
            what: "frozen or clipped".into(),
        }],
        chain: vec![],
        fit: Fit {
            fit: both,
            holdout: both,
        },
        caveats: vec!["The vehicle balance could not be judged: a single run coasts.".into()],
        traces: (0..6)
            .map(|k| trace(&format!("campaign/run0{k}.csv"), k == 4))
            .collect(),
        repaired: repaired(),
        found: repaired(),
    }
}

/// Nothing found.
pub fn consistent() -> Diagnosis {
    let even = BeforeAfter {
        before: score(88.2),
        after: score(88.2),
    };
    Diagnosis {
        verdict: Verdict::Consistent,
        r#where: vec![],
        regions: vec![],
        mechanisms: vec![],
        unexplained: vec![],
        data_faults: vec![],
        caveats: vec![],
        fit: Fit {
            fit: even,
            holdout: even,
        },
        repaired: Repaired {
            tyre: vec![],
            dynamics: vec![],
            corrections: vec![],
            ..repaired()
        },
        ..partly_explained()
    }
}

/// Everything at its worst: no number finite, no list short, names that try to steer a terminal.
pub fn monstrous() -> Diagnosis {
    let mut diagnosis = partly_explained();
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    for (k, interval) in diagnosis.r#where.iter_mut().enumerate() {
        interval.z = bad[k % 3];
        interval.start_s = bad[(k + 1) % 3];
        interval.recording = "\u{1b}[31mred\n\u{7}.csv".into();
    }
    for region in &mut diagnosis.regions {
        region.low = f64::NEG_INFINITY;
        region.high = f64::NAN;
        region.share = 1.7;
        region.variable = "<script>alert(1)</script>\u{1b}[2J".into();
    }
    for mechanism in &mut diagnosis.mechanisms {
        mechanism.parameters[0].value = f64::NAN;
        mechanism.parameters[0].std = f64::INFINITY;
        mechanism.evidence.delta_bic = f64::INFINITY;
        mechanism.evidence.holdout_nll_gain_per_sample = f64::NAN;
        mechanism.evidence.confidence = f64::NAN;
        mechanism.effect_sigma = f64::NAN;
    }
    let many = diagnosis.mechanisms.clone();
    diagnosis.mechanisms = (0..9).flat_map(|_| many.clone()).collect();
    diagnosis.r#where = (0..80).flat_map(|_| diagnosis.r#where.clone()).collect();
    diagnosis.data_faults = (0..80)
        .flat_map(|_| diagnosis.data_faults.clone())
        .collect();
    for fault in &mut diagnosis.data_faults {
        fault.start_s = f64::NAN;
        fault.what = "x".repeat(400);
    }
    for (k, looked_for) in diagnosis.looked_for.iter_mut().enumerate() {
        if let Some(least) = &mut looked_for.minimum_detectable {
            least.value = bad[k % 3];
        }
    }
    for estimate in diagnosis.base.values_mut() {
        estimate.std = f64::NAN;
    }
    for noise in diagnosis.noise.values_mut() {
        noise.sigma = f64::INFINITY;
        noise.declared = Some(f64::NAN);
    }
    let score = Score {
        rmse_n: f64::INFINITY,
        nll_per_sample: f64::NAN,
        whiteness_p: Some(f64::NAN),
    };
    diagnosis.fit.fit.before = score;
    diagnosis.fit.holdout.after = score;
    for rest in &mut diagnosis.unexplained {
        rest.z = f64::INFINITY;
        rest.share = f64::NAN;
        rest.variable = "\u{1b}]0;title\u{7}".into();
    }
    for trace in &mut diagnosis.traces {
        trace.measured_n[7] = f64::NAN;
        trace.after_n[9] = f64::INFINITY;
        trace.slip[11] = f64::NAN;
    }
    diagnosis
}

/// A lag of the drag channel of 10 ms, which is not in the simulation.
pub fn lagging(_: u64) -> Box<dyn FnMut(f64, f64) -> f64> {
    let mut state = 0.0;
    Box::new(move |dt, drag| {
        state += (drag - state) * (1.0 - (-dt / 0.010).exp());
        state
    })
}

/// A campaign on the simulated rig: a recording a seed, each with the drag channel's readings passed
/// through `chain` (time step in s, reading in N).
pub fn campaign(
    seeds: std::ops::Range<u64>,
    mut chain: impl FnMut(u64) -> Box<dyn FnMut(f64, f64) -> f64>,
) -> Vec<String> {
    let rig = RigFile::parse(Path::new("rig.toml"), RIG.as_bytes()).unwrap();
    seeds
        .map(|seed| {
            let mut scenario =
                Scenario::usual(rig.clone(), Some("rudd:0.85,0.13".parse().unwrap())).unwrap();
            scenario.seed = seed;
            scenario.normal_force_n = 3600.0 + 150.0 * seed as f64;
            scenario.speed_m_s = 24.0 + 1.5 * seed as f64;
            scenario.applications = 4;
            scenario.duration_s = 3.0;
            let mut chain = chain(seed);
            let mut noise = Random::seeded(seed);
            let mut text = format!("{HEADER}\n");
            scenario
                .run(|row| {
                    let [time, omega, v, drag, load] = *row else {
                        panic!("{row:?}")
                    };
                    // The rig's own noise is white on the drag; the reading's comes after the chain.
                    let reading = chain(1.0 / 500.0, drag) + 90.0 * noise.normal();
                    text += &format!(
                        "{time},{},{},{reading},{}\n",
                        omega + 0.1 * noise.normal(),
                        v + 0.02 * noise.normal(),
                        load + 20.0 * noise.normal()
                    );
                    Ok(())
                })
                .unwrap();
            text
        })
        .collect()
}

/// The header of a recording's required columns.
pub const HEADER: &str = "time_s,wheel_speed_rad_s,vehicle_speed_m_s,drag_force_n,normal_force_n";

/// A small generator of reproducible noise.
pub struct Random(u64);

impl Random {
    pub fn seeded(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// Uniform in 0..1 (xorshift64*).
    pub fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Standard normal (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// A diagnosis to which the measuring chain's findings are added: for one recording and for all.
pub fn with_chain(diagnosis: Diagnosis) -> Diagnosis {
    let finding = |recording: &str, channel: &str, finding, value, std, unit: &str, said: &str| {
        ChainFinding {
            recording: recording.into(),
            channel: channel.into(),
            relative_to: String::new(),
            finding,
            value,
            std,
            unit: unit.into(),
            statement: said.into(),
        }
    };
    Diagnosis {
        chain: vec![
            finding(
                "*",
                "vehicle_speed_m_s",
                ChainWord::Late,
                0.066,
                0.004,
                "s",
                "the vehicle speed comes 66 ms later than the drag",
            ),
            finding(
                "campaign/run02.csv",
                "wheel_speed_rad_s",
                ChainWord::ColouredNoise,
                0.12,
                f64::NAN,
                "rad/s",
                "the wheel speed's noise is correlated over 30 ms",
            ),
        ],
        ..diagnosis
    }
}
