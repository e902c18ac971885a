//! Whether the estimator learns of a diagnosis: estimates of fresh runs with and without the model that
//! `diagnose` wrote, judged by the same run of a rig without the effect.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};
use rayon::prelude::*;
use serde_json::Value;

use crate::draw::Draw;
use crate::generate::campaign::{Order, make_with_twin};
use crate::generate::effect::{Effect, Scale};
use crate::generate::files::recording;
use crate::generate::form::{Form, mechanism};
use crate::generate::instrument::ChainKind;
use crate::generate::rig::Rig;
use crate::generate::tyre::{Contact, curve_scaling};
use crate::share::quantile;
use crate::table::Table;

/// Mechanisms that the estimator can compensate.
const COMPENSATED: [&str; 9] = [
    "effective_radius",
    "force_delay",
    "force_lag",
    "zero_drift",
    "load_crosstalk",
    "load_sensitivity",
    "speed_sensitivity",
    "relaxation_length",
    "thermal_fade",
];

/// Sizes of the effects in sigma after the base was refitted.
const SIZES: [f64; 3] = [1.0, 2.0, 4.0];

/// What to do.
#[derive(Clone, Debug)]
pub struct Compensation {
    /// The tool under trial.
    pub muslip: PathBuf,
    /// Seed of every draw.
    pub seed: u64,
    /// Campaigns of each mechanism.
    pub count: usize,
    /// Which estimator.
    pub estimator: String,
    /// Scratch directory.
    pub work: PathBuf,
}

/// Peak friction and critical slip with their stated standard deviations.
#[derive(Clone, Copy, Debug)]
struct Estimate {
    value: [f64; 2],
    std: [f64; 2],
}

/// One fresh run.
#[derive(Clone, Debug)]
struct Case {
    mechanism: &'static str,
    form: Form,
    size: f64,
    /// What the model compensates.
    compensated: Vec<String>,
    /// Peak friction and critical slip of the concealed tyre.
    truth: [f64; 2],
    /// The same run without the effect.
    reference: Estimate,
    before: Estimate,
    after: Estimate,
}

impl Case {
    /// Error over the reference's stated standard deviation.
    fn sigmas(&self, of: &Estimate, index: usize) -> f64 {
        (of.value[index] - self.reference.value[index]) / self.reference.std[index]
    }
    /// Error in percent.
    fn percent(&self, of: &Estimate, index: usize) -> f64 {
        100.0 * (of.value[index] / self.reference.value[index] - 1.0)
    }
    /// Error against the concealed tyre in percent: what input noise does is in it.
    fn off_truth(&self, of: &Estimate, index: usize) -> f64 {
        100.0 * (of.value[index] / self.truth[index] - 1.0)
    }
    fn named(&self) -> bool {
        self.compensated.iter().any(|id| id == self.mechanism)
    }
}

/// What came out.
pub struct Outcome {
    request: Compensation,
    cases: Vec<Case>,
}

/// Makes campaigns, has them diagnosed, and estimates their fresh runs.
///
/// # Errors
/// Where a file cannot be written, no rig can show an effect, or the tool fails.
pub fn compensation(request: &Compensation) -> Result<Outcome> {
    if request.work.exists() {
        fs::remove_dir_all(&request.work)?;
    }
    let jobs: Vec<(usize, usize)> = (0..COMPENSATED.len())
        .flat_map(|which| (0..request.count).map(move |index| (which, index)))
        .collect();
    let cases: Vec<Vec<Case>> = jobs
        .par_iter()
        .map(|&(which, index)| campaign(request, COMPENSATED[which], which, index))
        .collect::<Result<_>>()?;
    Ok(Outcome {
        request: request.clone(),
        cases: cases.concat(),
    })
}

fn campaign(
    request: &Compensation,
    id: &'static str,
    which: usize,
    index: usize,
) -> Result<Vec<Case>> {
    let Some(entry) = mechanism(id) else {
        bail!("`{id}` is no mechanism of the vocabulary")
    };
    let form = entry.2[index % entry.2.len()];
    let mut size = SIZES[index / entry.2.len() % SIZES.len()];
    let key = Draw::new(request.seed, &[0xe5, which as u64, index as u64]).seed();
    let name = format!("{id}-{index:03}");
    let mut made = None;
    for attempt in 0..6 {
        let order = Order {
            stratum: "single".into(),
            forms: vec![form],
            strength: vec![size],
            null: None,
            chain: ChainKind::Ideal,
        };
        match make_with_twin(&name, Draw::new(key, &[attempt]).seed(), &order) {
            Ok(campaign) => {
                made = Some(campaign);
                break;
            }
            Err(_) => size *= 0.6,
        }
    }
    let Some((campaign, twin)) = made else {
        bail!("no rig can show {form:?}")
    };
    let folder = request.work.join(&name);
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let truth = &campaign.truth;
    let rig = folder.join("rig.toml");
    fs::write(&rig, truth.rig.file())?;
    let mut diagnose = Command::new(&request.muslip);
    diagnose
        .arg("diagnose")
        .arg("--rig")
        .arg(&rig)
        .arg("--out")
        .arg(&folder);
    for recorded in &campaign.fit {
        let path = folder.join(&recorded.file);
        fs::write(&path, recording(truth, recorded, true))?;
        diagnose.arg(path);
    }
    output(&mut diagnose)?;
    let model = folder.join("model.toml");
    let concealed: Vec<Effect> = truth
        .concealed
        .iter()
        .map(|concealed| concealed.effect.clone())
        .collect();
    campaign
        .fresh
        .iter()
        .zip(&twin)
        .map(|(affected, twin)| {
            let [affected_path, twin_path] =
                [affected, twin].map(|recorded| folder.join(&recorded.file));
            fs::write(&affected_path, recording(truth, affected, true))?;
            fs::write(&twin_path, recording(truth, twin, true))?;
            let (mut reference, _) = estimate(request, &rig, None, &twin_path)?;
            let (before, _) = estimate(request, &rig, None, &affected_path)?;
            let (after, told) = estimate(request, &rig, Some(&model), &affected_path)?;
            let compensated = told["model"]["compensated"]
                .as_array()
                .into_iter()
                .flatten()
                .filter_map(|mechanism| Some(mechanism["id"].as_str()?.to_owned()))
                .collect();
            // Where friction depends on load or speed, the peak is stated for an operation: the truth is
            // taken there.
            let factors = peak_there(&concealed, &truth.rig, &told["model"]["holds_at"]);
            let mut true_peak = [truth.base.peak_friction, truth.base.critical_slip];
            for (index, factor) in factors.into_iter().enumerate() {
                reference.value[index] *= factor;
                true_peak[index] *= factor;
            }
            Ok(Case {
                mechanism: id,
                form,
                size,
                compensated,
                truth: true_peak,
                reference,
                before,
                after,
            })
        })
        .collect()
}

/// Factors on the true peak friction and critical slip at the operation that an estimate says to hold at.
fn peak_there(effects: &[Effect], rig: &Rig, holds_at: &Value) -> [f64; 2] {
    let scale = Scale {
        load: rig.mean_load_n,
        speed: rig.mean_speed_m_s,
        drag: 1.0,
        radius: rig.radius_m,
        inertia: 1.0,
        critical: rig.critical_slip,
        power: 1.0,
        sliding: 1.0,
        distance: 1.0,
        duration: 1.0,
        runs: 1.0,
        clock: 1.0,
        rate_hz: rig.rate_hz,
    };
    let mut factors = [1.0, 1.0];
    for effect in effects {
        if let Some(load) = holds_at["normal_force_n"].as_f64() {
            let contact = Contact {
                load,
                ..Contact::default()
            };
            let (peak, critical) = curve_scaling(effect, &contact, &scale);
            factors[0] *= peak;
            factors[1] *= critical;
        }
        if let (Some(speed), Form::SpeedVehicleLinear) =
            (holds_at["vehicle_speed_m_s"].as_f64(), effect.form)
        {
            factors[0] *= 1.0 - effect.a * (speed / scale.speed - 1.0);
        }
    }
    factors
}

fn estimate(
    request: &Compensation,
    rig: &Path,
    model: Option<&Path>,
    run: &Path,
) -> Result<(Estimate, Value)> {
    let mut command = Command::new(&request.muslip);
    command
        .args(["estimate", "--json", "--range", "automotive", "--estimator"])
        .arg(&request.estimator)
        .arg("--rig")
        .arg(rig);
    if let Some(model) = model {
        command.arg("--model").arg(model);
    }
    let told: Value = serde_json::from_str(&output(command.arg(run))?)?;
    let figure = |name: &str, of: &str| {
        told[name][of]
            .as_f64()
            .with_context(|| format!("no {name}.{of} for {}", run.display()))
    };
    let estimate = Estimate {
        value: [
            figure("peak_friction", "value")?,
            figure("critical_slip", "value")?,
        ],
        std: [
            figure("peak_friction", "std")?,
            figure("critical_slip", "std")?,
        ],
    };
    Ok((estimate, told))
}

fn output(command: &mut Command) -> Result<String> {
    let output = command
        .env("RAYON_NUM_THREADS", "1")
        .output()
        .with_context(|| format!("cannot start {command:?}"))?;
    if !output.status.success() {
        bail!("{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
    Ok(String::from_utf8(output.stdout)?)
}

impl Outcome {
    /// One line a run.
    pub fn lines(&self) -> String {
        self.cases
            .iter()
            .map(|case| {
                format!(
                    "{:18} {:22} {:.2}  mup {:+8.2} -> {:+7.2} sigma ({:+6.2} -> {:+5.2} %)  sp {:+8.2} -> {:+7.2} sigma ({:+6.2} -> {:+5.2} %)  {}\n",
                    case.mechanism,
                    format!("{:?}", case.form),
                    case.size,
                    case.sigmas(&case.before, 0),
                    case.sigmas(&case.after, 0),
                    case.percent(&case.before, 0),
                    case.percent(&case.after, 0),
                    case.sigmas(&case.before, 1),
                    case.sigmas(&case.after, 1),
                    case.percent(&case.before, 1),
                    case.percent(&case.after, 1),
                    case.compensated.join(" "),
                )
            })
            .collect()
    }

    fn table(&self) -> Table {
        let mut table = Table::new(
            "Estimates before and after compensation",
            &[
                "mechanism",
                "fresh runs",
                "compensated as such",
                "mup: median error, %",
                "sp: median error, %",
                "mup: median, 90th percentile, sigma",
                "sp: median, 90th percentile, sigma",
                "mup off the truth, median %",
                "sp off the truth, median %",
            ],
        );
        let mut row = |name: &str, cases: &[&Case]| {
            let absolute = |of: &dyn Fn(&Case) -> f64, at: f64| {
                let values: Vec<f64> = cases.iter().map(|case| of(case).abs()).collect();
                quantile(&values, at)
            };
            let percent = |index| {
                format!(
                    "{:.2} → {:.2}",
                    absolute(&|case| case.percent(&case.before, index), 0.5),
                    absolute(&|case| case.percent(&case.after, index), 0.5)
                )
            };
            let spread = |index| {
                format!(
                    "{:.1}, {:.1} → {:.1}, {:.1}",
                    absolute(&|case| case.sigmas(&case.before, index), 0.5),
                    absolute(&|case| case.sigmas(&case.before, index), 0.9),
                    absolute(&|case| case.sigmas(&case.after, index), 0.5),
                    absolute(&|case| case.sigmas(&case.after, index), 0.9)
                )
            };
            let off_truth = |index| {
                let median = |of: fn(&Case) -> Estimate| {
                    absolute(&|case| case.off_truth(&of(case), index), 0.5)
                };
                format!(
                    "{:.2}; {:.2} → {:.2}",
                    median(|case| case.reference),
                    median(|case| case.before),
                    median(|case| case.after)
                )
            };
            table.row([
                name.to_owned(),
                cases.len().to_string(),
                cases.iter().filter(|case| case.named()).count().to_string(),
                percent(0),
                percent(1),
                spread(0),
                spread(1),
                off_truth(0),
                off_truth(1),
            ]);
        };
        for id in COMPENSATED {
            let cases: Vec<&Case> = self.cases.iter().filter(|c| c.mechanism == id).collect();
            row(id, &cases);
        }
        let all: Vec<&Case> = self.cases.iter().collect();
        row("all", &all);
        let named: Vec<&Case> = self.cases.iter().filter(|case| case.named()).collect();
        row("all that were compensated as such", &named);
        table
    }

    /// The table for a terminal.
    pub fn text(&self) -> String {
        self.table().text()
    }

    /// The page.
    pub fn markdown(&self) -> String {
        let Compensation {
            seed,
            count,
            estimator,
            ..
        } = &self.request;
        format!(
            "# Does the estimator learn of a diagnosis?\n\n\
             Printed by `cargo run --release -p sealed-trial -- compensate --seed {seed} --count {count} --estimator {estimator} --page docs/compensation.md` \
             after `cargo build --release`.\n\n\
             For each mechanism {count} campaigns conceal it, in all the forms of truth and at 1, 2 and 4 sigma that `tests/trial` knows. That crate \
             shares no code and no equations with engine or filter. `muslip diagnose` reads the campaign's runs and writes `model.toml`; \
             `muslip estimate --estimator {estimator}` then estimates fresh runs, without and with `--model`. What is right is the estimate of the *same \
             run without the effect* (same programme, same noise), so that what input noise does to any estimate is on both sides; \
             where friction depends on load or speed it is taken at the operation that the answer states.\n\n\
             Sigma is the standard deviation that the estimator states for that run; half a percent of peak friction is many sigmas of some \
             thousand samples. Each cell: before → after. The last two columns compare with the concealed tyre itself: the run without the effect; \
             before → after. Where compensation filters the slip (delay, lag, relaxation), it takes away noise that biases the run without the effect \
             as well: then it differs from that run and lies nearer to the truth.\n\n{}",
            self.table().markdown()
        )
    }
}
