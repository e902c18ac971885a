//! `model.toml`: the repaired model as a file that people read and `muslip predict` runs.

use std::fs;
use std::path::{Path, PathBuf};

use muslip_diagnose::campaign::Rig;
use muslip_diagnose::correction::Action;
use muslip_diagnose::data::Catalogue;
use muslip_diagnose::mechanism::Context;
use muslip_diagnose::model::TYRE_BASE;
use muslip_diagnose::repaired::{Correction, NoiseModel, Predicting, Repaired, RepairedTerm};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::input_error::{InputError, InputProblem, one_line, quoted};
use crate::rig_file::{LARGEST_RADIUS_M, RigFile, SMALLEST_RADIUS_M};
use crate::toml_file;

/// The only format that there is.
const SCHEMA: &str = "muslip.model/1";

/// What stands above the model in its file; `%` is replaced by a line about this model.
const HEADER: &str = "\
# Repaired model of a braked wheel: the base tyre law, refitted, with what a diagnosis found missing.
#
# %
#
# Expected drag reading of a recording, from its other columns:
#   muslip predict --rig rig.toml --model model.toml --out pred.csv run.csv
# A run of the rig with these mechanisms at work:
#   muslip simulate --rig rig.toml --model model.toml --out run.csv
#
# base_alone and base: logarithms of peak friction and critical slip, then three shares that say how the
# inputs are read between raw and smoothed; base_alone is the law alone (muslip predict --base), base the
# law beside the mechanisms. covariance: of base and the tyre's parameters in the order of this file.
# Numbers have all their digits, so that a prediction can be repeated exactly.

";

/// The text of `model.toml`. `about` is one line on what the model is of.
///
/// # Errors
/// What `toml` answers; a [`Repaired`] holds nothing that it refuses.
pub fn to_text(repaired: &Repaired, about: &str) -> Result<String, toml::ser::Error> {
    let mut text = HEADER.replacen('%', &one_line(about), 1);
    for line in toml::to_string(repaired)?.lines() {
        if line.starts_with("covariance = ") || line.starts_with("dynamics_covariance = ") {
            // A row of the matrix on each line.
            text += &line
                .replace("[[", "[\n  [")
                .replace("], [", "],\n  [")
                .replace("]]", "],\n]");
        } else {
            text += line;
        }
        text.push('\n');
    }
    Ok(text)
}

/// A model file, read and checked.
#[derive(Debug, Clone)]
pub struct ModelFile {
    path: PathBuf,
    text: String,
    /// The model; `muslip predict` can run it.
    pub repaired: Repaired,
}

impl ModelFile {
    /// Reads and checks a model file.
    ///
    /// # Errors
    /// [`InputError`], one line with file, line and column: the file is missing, not UTF-8, not TOML, or
    /// names or holds what this program cannot run.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        Self::parse(path, &toml_file::bytes_of(path)?)
    }

    /// Checks the text of a model file; `path` is only named in errors.
    ///
    /// # Errors
    /// As [`ModelFile::read`].
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, InputError> {
        let text = toml_file::text_of(path, bytes)?;
        let repaired: Repaired = toml_file::parsed(path, text)?;
        if let Some(complaint) = complaint(&repaired) {
            let problem = InputProblem::Model {
                key: complaint.key_text(),
                what: complaint.what,
            };
            let at = place(text, &complaint.key);
            return Err(toml_file::error_at(path, text, at, problem));
        }
        Ok(Self {
            path: path.to_owned(),
            text: text.to_owned(),
            repaired,
        })
    }

    /// The file as the user named it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The text of the file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Whether a rig file is that of the model: what enters a prediction must be equal. Starting values
    /// of the tyre law and declared noise may differ, the model has its own.
    ///
    /// # Errors
    /// [`InputError`] at the key of the rig file that differs.
    pub fn check_rig(&self, rig_path: &Path, rig: &RigFile) -> Result<(), InputError> {
        let found = super::load::rig(rig);
        let expected = &self.repaired.rig;
        let brake = |rig: &Rig| match rig.torque_per_pressure_nm_pa {
            Some(ratio) => ratio.to_string(),
            None => "none".to_owned(),
        };
        let pairs = [
            (
                "wheel.radius_m",
                found.radius_m.to_string(),
                expected.radius_m.to_string(),
            ),
            (
                "wheel.inertia_kg_m2",
                found.wheel_inertia_kg_m2.to_string(),
                expected.wheel_inertia_kg_m2.to_string(),
            ),
            (
                "vehicle.mass_kg",
                found.mass_kg.to_string(),
                expected.mass_kg.to_string(),
            ),
            (
                "brake.torque_per_pressure_nm_pa",
                brake(&found),
                brake(expected),
            ),
        ];
        // A number's text is its shortest exact form, so equal texts are equal numbers.
        let Some((key, found, expected)) = pairs.into_iter().find(|(_, found, made)| found != made)
        else {
            return Ok(());
        };
        let problem = InputProblem::OtherRig {
            key,
            found,
            expected,
        };
        let steps: Vec<Step> = key
            .split('.')
            .map(|name| Step::Name(name.to_owned()))
            .collect();
        let text = fs::read_to_string(rig_path).unwrap_or_default();
        Err(toml_file::error_at(
            rig_path,
            &text,
            place(&text, &steps),
            problem,
        ))
    }
}

/// One step on the way to a value.
#[derive(Debug, Clone, PartialEq)]
enum Step {
    Name(String),
    Index(usize),
}

/// The byte at which a value stands; where the way ends early, that of what was found last.
fn place(text: &str, way: &[Step]) -> usize {
    let Ok(table) = DeTable::parse(text) else {
        return 0;
    };
    let mut at = 0;
    let mut here: Option<&Spanned<DeValue<'_>>> = None;
    for step in way {
        let next = match (here.map(Spanned::get_ref), step) {
            (None, Step::Name(name)) => table.get_ref().get(name.as_str()),
            (Some(DeValue::Table(inner)), Step::Name(name)) => inner.get(name.as_str()),
            (Some(DeValue::Array(inner)), Step::Index(index)) => inner.get(*index),
            _ => None,
        };
        let Some(next) = next else { break };
        at = next.span().start;
        here = Some(next);
    }
    at
}

struct Complaint {
    key: Vec<Step>,
    what: String,
}

impl Complaint {
    fn key_text(&self) -> String {
        let mut text = String::new();
        for step in &self.key {
            match step {
                Step::Name(name) if text.is_empty() => text.push_str(name),
                Step::Name(name) => {
                    text.push('.');
                    text.push_str(name);
                }
                Step::Index(index) => text.push_str(&format!("[{index}]")),
            }
        }
        text
    }
}

macro_rules! way {
    ($($step:expr),*) => { vec![$(Step::from($step)),*] };
}

impl From<&str> for Step {
    fn from(name: &str) -> Self {
        Self::Name(name.to_owned())
    }
}

impl From<usize> for Step {
    fn from(index: usize) -> Self {
        Self::Index(index)
    }
}

/// The first thing in a model that cannot be run.
fn complaint(model: &Repaired) -> Option<Complaint> {
    if model.schema != SCHEMA {
        let what = format!("{} is not \"{SCHEMA}\"", quoted(&model.schema));
        return Some(Complaint {
            key: way!["schema"],
            what,
        });
    }
    rig_complaint(&model.rig)
        .or_else(|| base_complaint("base_alone", &model.base_alone))
        .or_else(|| base_complaint("base", &model.base))
        .or_else(|| terms_complaint("tyre", &model.tyre, &model.context))
        .or_else(|| terms_complaint("dynamics", &model.dynamics, &model.context))
        .or_else(|| corrections_complaint(&model.corrections))
        .or_else(|| proof_complaint(model))
        .or_else(|| noise_complaint(&model.noise))
        .or_else(|| context_complaint(&model.context))
}

fn not_positive(table: &str, key: &str, value: f64) -> Option<Complaint> {
    (!(value > 0.0 && value.is_finite())).then(|| Complaint {
        key: way![table, key],
        what: format!("{value} is not finite and positive"),
    })
}

fn rig_complaint(rig: &Rig) -> Option<Complaint> {
    if !(SMALLEST_RADIUS_M..=LARGEST_RADIUS_M).contains(&rig.radius_m) {
        return Some(Complaint {
            key: way!["rig", "radius_m"],
            what: format!("{} is not between 0.005 and 2 m", rig.radius_m),
        });
    }
    [
        ("wheel_inertia_kg_m2", rig.wheel_inertia_kg_m2),
        ("mass_kg", rig.mass_kg),
        (
            "torque_per_pressure_nm_pa",
            rig.torque_per_pressure_nm_pa.unwrap_or(1.0),
        ),
        ("peak_friction", rig.peak_friction),
        ("critical_slip", rig.critical_slip),
    ]
    .into_iter()
    .find_map(|(key, value)| not_positive("rig", key, value))
}

fn base_complaint(key: &str, base: &[f64]) -> Option<Complaint> {
    if base.len() != TYRE_BASE {
        return Some(Complaint {
            key: way![key],
            what: format!("{} numbers where {TYRE_BASE} are needed", base.len()),
        });
    }
    // The first two are logarithms: their exponentials must be numbers too.
    let index = base
        .iter()
        .position(|v| v.abs().partial_cmp(&100.0).is_none_or(|o| o.is_gt()))?;
    Some(Complaint {
        key: way![key, index],
        what: format!("{} is not a usable value", base[index]),
    })
}

fn terms_complaint(table: &str, terms: &[RepairedTerm], context: &Context) -> Option<Complaint> {
    let catalogue = Catalogue::default();
    for (index, term) in terms.iter().enumerate() {
        let known = catalogue
            .entries()
            .iter()
            .find(|entry| entry.id().as_str() == term.id && entry.form() == term.form);
        let Some(known) = known else {
            let of_that_name = catalogue
                .entries()
                .iter()
                .any(|entry| entry.id().as_str() == term.id);
            return Some(if of_that_name {
                Complaint {
                    key: way![table, index, "form"],
                    what: format!("{} is not a form of {}", quoted(&term.form), term.id),
                }
            } else {
                Complaint {
                    key: way![table, index, "id"],
                    what: format!("unknown mechanism {}", quoted(&term.id)),
                }
            });
        };
        let (expected, found) = (known.parameters(context).len(), term.parameters.len());
        if expected != found {
            return Some(Complaint {
                key: way![table, index, "parameters"],
                what: format!("{} takes {expected} parameters, not {found}", term.id),
            });
        }
        let broken = term.parameters.iter().position(|p| !p.value.is_finite());
        if let Some(at) = broken {
            return Some(Complaint {
                key: way![table, index, "parameters", at, "value"],
                what: format!("{} is not finite", term.parameters[at].value),
            });
        }
    }
    None
}

fn noise_complaint(noise: &NoiseModel) -> Option<Complaint> {
    let size = |value: &f64| (0.0..=f64::MAX).contains(value);
    let complain = |key: Vec<Step>, value: f64| {
        Some(Complaint {
            key,
            what: format!("{value} is not a standard deviation"),
        })
    };
    for (key, value) in [
        ("sigma_n", noise.sigma_n),
        ("share_of_force", noise.share_of_force),
    ] {
        if !size(&value) {
            return complain(way!["noise", key], value);
        }
    }
    for (name, value) in &noise.channels {
        if !size(value) {
            return complain(way!["noise", "channels", name.as_str()], *value);
        }
    }
    let likelihood = noise.likelihood.as_ref()?;
    let sigma = likelihood.innovation_sigma;
    if !(size(&sigma) && sigma > 0.0) {
        return complain(way!["noise", "likelihood", "innovation_sigma"], sigma);
    }
    let parts = likelihood.size.parts;
    let mut all = parts
        .iter()
        .chain([&likelihood.size.least, &likelihood.size.typical]);
    if !all.all(size) {
        let key = way!["noise", "likelihood", "size"];
        return Some(Complaint {
            key,
            what: "a variance is negative or not finite".to_owned(),
        });
    }
    if !likelihood.colour.iter().all(|a| a.is_finite()) {
        let key = way!["noise", "likelihood", "colour"];
        return Some(Complaint {
            key,
            what: "not all finite".to_owned(),
        });
    }
    None
}

fn corrections_complaint(corrections: &[Correction]) -> Option<Complaint> {
    for (index, correction) in corrections.iter().enumerate() {
        let complain = |key: &str, what: String| {
            Some(Complaint {
                key: way!["corrections", index, key],
                what,
            })
        };
        if Action::parse(&correction.acts_on).is_none() {
            return complain(
                "acts_on",
                format!("{} cannot be corrected", quoted(&correction.acts_on)),
            );
        }
        let (knots, values) = (&correction.knots, &correction.values);
        if knots.len() != values.len() {
            return complain(
                "values",
                format!("{} values at {} knots", values.len(), knots.len()),
            );
        }
        if !knots.iter().all(|k| k.is_finite()) || !knots.windows(2).all(|pair| pair[0] < pair[1]) {
            return complain("knots", "not finite and increasing".to_owned());
        }
        if !values.iter().all(|v| v.is_finite()) {
            return complain("values", "not all finite".to_owned());
        }
        if !correction.harmonics.iter().flatten().all(|v| v.is_finite()) {
            return complain("harmonics", "not all finite".to_owned());
        }
    }
    None
}

/// The first thing that cannot be run in the model that the proof is by, where there is one.
fn proof_complaint(model: &Repaired) -> Option<Complaint> {
    let proof = &model.proof;
    if *proof == Predicting::default() {
        return None;
    }
    let complaint = base_complaint("base_alone", &proof.base_alone)
        .or_else(|| base_complaint("base", &proof.base))
        .or_else(|| terms_complaint("tyre", &proof.tyre, &model.context))
        .or_else(|| corrections_complaint(&proof.corrections))?;
    let mut key = way!["proof"];
    key.extend(complaint.key);
    Some(Complaint { key, ..complaint })
}

fn context_complaint(context: &Context) -> Option<Complaint> {
    let positive = [
        ("radius", context.radius),
        ("inertia", context.inertia),
        ("mass", context.mass),
        ("mean_load", context.mean_load),
        ("mean_speed", context.mean_speed),
        ("max_speed", context.max_speed),
        ("mean_wheel_speed", context.mean_wheel_speed),
        ("dt", context.dt),
        ("duration", context.duration),
        ("total_time", context.total_time),
    ];
    let finite = [
        ("mean_power", context.mean_power),
        ("total_work", context.total_work),
        ("mean_brake_power", context.mean_brake_power),
        ("distance", context.distance),
        ("first_time", context.first_time),
        ("drag_sigma", context.drag_sigma),
        ("slip_sigma", context.slip_sigma),
        ("max_drag", context.max_drag),
    ];
    positive
        .into_iter()
        .find_map(|(key, value)| not_positive("context", key, value))
        .or_else(|| {
            let nominal = context
                .nominal
                .iter()
                .position(|v| !(*v > 0.0 && v.is_finite()))?;
            Some(Complaint {
                key: way!["context", "nominal", nominal],
                what: format!("{} is not finite and positive", context.nominal[nominal]),
            })
        })
        .or_else(|| {
            let (key, value) = finite.into_iter().find(|(_, value)| !value.is_finite())?;
            Some(Complaint {
                key: way!["context", key],
                what: format!("{value} is not finite"),
            })
        })
        .or_else(|| {
            let before = &context.before;
            let at = before.iter().position(|b| !(b.work + b.time).is_finite())?;
            Some(Complaint {
                key: way!["context", "before", at],
                what: "not finite".to_owned(),
            })
        })
}
