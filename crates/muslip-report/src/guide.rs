//! The field guide: what the descriptors of the mechanisms say, for a terminal, a report and `docs/mechanisms.md`.

use std::fmt::Write as _;

use host_sim::{ModelRunError, RunError, Scenario, ScenarioError};
use muslip_analysis::diagnose::wording::{listed, spoken};
use muslip_analysis::wording::capitalised;
use muslip_diagnose::campaign::Run;
use muslip_diagnose::data::Data;
use muslip_diagnose::mechanism::{Compensation, Id, Stage};
use muslip_diagnose::repaired::{Repaired, RepairedError, RepairedParameter, RepairedTerm, Which};
use muslip_recordings::load;
use muslip_recordings::rig_file::{Brake, RigFile, Tyre, Vehicle, Wheel};

use crate::diagnose::effects;
use crate::figure::Figure;

/// A line of a section.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// What it is about.
    pub label: &'static str,
    /// What is said.
    pub text: String,
    /// The mechanism that it is about, where that is another one.
    pub about: Option<Id>,
}

/// A section of the guide.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Section {
    /// The mechanism.
    pub id: Id,
    /// Its name as it is said, the first letter large.
    pub title: String,
    /// Its physics in two sentences.
    pub physics: &'static str,
    /// The rest.
    pub rows: Vec<Row>,
}

/// Label of an equation.
const EQUATION: &str = "equation";
/// Label of one of what the mechanism is mistaken for: where it says clearly more, the mechanism is refuted.
const COUNTER_FORM: &str = "refuted by";

/// The guide's section of a mechanism.
#[must_use]
pub fn section(id: Id) -> Section {
    let mut rows = Vec::new();
    let mut row = |label, text: String, about| rows.push(Row { label, text, about });
    row("left out", id.what().to_owned(), None);
    let entries = id.entries();
    for (label, counter) in [(EQUATION, false), (COUNTER_FORM, true)] {
        let mut equations: Vec<&str> = Vec::new();
        for entry in entries.iter().filter(|e| e.facts().counter_form == counter) {
            if !equations.contains(&entry.equation()) {
                equations.push(entry.equation());
            }
        }
        for equation in equations {
            row(label, equation.to_owned(), None);
        }
    }
    let mut physics = "";
    if let Some(guide) = id.guide() {
        physics = guide.physics;
        let touches: Vec<&str> = guide.touches.iter().map(|b| b.as_str()).collect();
        let touches: Vec<String> = touches.into_iter().map(str::to_owned).collect();
        let balances = if touches.len() == 1 {
            "balance"
        } else {
            "balances"
        };
        row("sits in", guide.kind.as_str().to_owned(), None);
        row("shows in", format!("{} {balances}", listed(&touches)), None);
        row("sign", guide.sign.as_str().to_owned(), None);
        row("memory", guide.memory.as_str().to_owned(), None);
        for alias in id.aliases() {
            row(
                "mistaken for",
                format!(
                    "{}: {} To tell: {}",
                    spoken(alias.with.as_str()),
                    alias.why,
                    alias.run
                ),
                Some(alias.with),
            );
        }
        row("relevant from", guide.smallest.to_owned(), None);
        let estimator = match guide.compensation {
            Compensation::By(how) => format!("muslip estimate --model {how}"),
            Compensation::Not(why) => format!("not compensated by muslip estimate --model: {why}"),
        };
        row("estimator", estimator, None);
        row("on a fresh run", guide.carried.to_owned(), None);
    }
    Section {
        id,
        title: capitalised(&spoken(id.as_str())),
        physics,
        rows,
    }
}

/// The mechanism of a word as people write it: blanks and hyphens are underscores, capitals are small.
#[must_use]
pub fn named(word: &str) -> Option<Id> {
    Id::parse(&normal(word))
}

fn normal(word: &str) -> String {
    word.trim().to_lowercase().replace([' ', '-'], "_")
}

/// Mechanisms that a word may have been meant for, the nearest first.
#[must_use]
pub fn near(word: &str) -> Vec<Id> {
    let word = normal(word);
    let mut found: Vec<(usize, Id)> = Id::ALL
        .iter()
        .filter_map(|&id| {
            let known = id.as_str();
            let distance = edits(&word, known);
            let part = word.len() > 2 && (known.contains(&word) || word.contains(known));
            let near = distance <= 2.max(known.len() / 4);
            (near || part).then_some((distance, id))
        })
        .collect();
    found.sort_by_key(|(distance, _)| *distance);
    found.truncate(4);
    found.into_iter().map(|(_, id)| id).collect()
}

/// Letters to insert, drop or change (Levenshtein 1966) on the way from one word to another.
fn edits(from: &str, to: &str) -> usize {
    let to: Vec<char> = to.chars().collect();
    let mut row: Vec<usize> = (0..=to.len()).collect();
    for (i, a) in from.chars().enumerate() {
        let mut diagonal = i;
        if let Some(first) = row.first_mut() {
            *first = i + 1;
        }
        for (j, b) in to.iter().enumerate() {
            let change = diagonal + usize::from(a != *b);
            diagonal = row[j + 1];
            row[j + 1] = change.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[to.len()]
}

/// Where the pictures of [`markdown`] lie beside it.
pub const PICTURES: &str = "mechanisms";

/// `docs/mechanisms.md`.
#[must_use]
pub fn markdown() -> String {
    let mut page = String::from(
        "# What a simulation may leave out\n\n\
         The vocabulary of `muslip diagnose`, written by `cargo xtask mechanisms` from what each mechanism's file in\n\
         `crates/muslip-diagnose/src/mechanism` says of itself. `muslip explain NAME` prints a section in the terminal.\n\
         Pictures: a simulated braking run of a wheel of 0.31 m under 420 kg, with and without the effect; for wheel and\n\
         vehicle, what their balance lacks and what the mechanism supplies.\n\n\
         | name | balance | what was left out |\n| --- | --- | --- |\n",
    );
    for id in Id::ALL {
        // Writing to a string cannot fail.
        let _ = writeln!(
            page,
            "| [`{0}`](#{0}) | {1} | {2} |",
            id.as_str(),
            id.balance().as_str(),
            id.what()
        );
    }
    for &id in Id::ALL {
        let word = id.as_str();
        let section = section(id);
        let _ = write!(
            page,
            "\n## `{word}`\n\n{}\n\n![{}]({PICTURES}/{word}.svg)\n\n",
            section.physics, section.title
        );
        for row in section.rows {
            let text = match (row.label, row.about) {
                (EQUATION | COUNTER_FORM, _) => format!("`{}`", row.text),
                (_, Some(about)) => {
                    let said = spoken(about.as_str());
                    let rest = row.text.strip_prefix(&said).unwrap_or(&row.text);
                    format!("[{said}](#{}){rest}", about.as_str())
                }
                _ => row.text,
            };
            let _ = writeln!(page, "- **{}**: {text}", row.label);
        }
    }
    page
}

/// Pictures that could not be made.
#[derive(Debug, thiserror::Error)]
pub enum GuideError {
    /// The guide's scenario has no sense.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The guide's run cannot be made.
    #[error("the guide's run: {0}")]
    Run(#[from] RunError),
    /// The guide's run cannot be made under a mechanism.
    #[error("the guide's run: {0}")]
    Model(#[from] ModelRunError),
    /// A mechanism's example cannot be run.
    #[error("an example of the guide: {0}")]
    Example(#[from] RepairedError),
    /// A mechanism has no picture.
    #[error("nothing to be seen of {0}")]
    Nothing(&'static str),
}

/// The guide's rig: a wheel of a small car on a trailer, without noise.
fn rig() -> RigFile {
    RigFile {
        wheel: Wheel {
            radius_m: 0.31,
            inertia_kg_m2: 1.25,
        },
        vehicle: Vehicle {
            mass_kg: 420.0,
            coasting: true,
        },
        brake: Some(Brake {
            torque_per_pressure_nm_pa: 3.2e-4,
        }),
        tyre: Tyre {
            peak_friction: 0.85,
            critical_slip: 0.14,
            fixed: false,
        },
        noise: Default::default(),
    }
}

fn run_of(scenario: &Scenario, rows: &[Vec<f64>]) -> Run {
    use muslip_recordings::recording::Channel;
    let column = |wanted: Channel| -> Vec<f64> {
        let place = scenario.channels().iter().position(|c| *c == wanted);
        place.map_or_else(Vec::new, |at| rows.iter().map(|row| row[at]).collect())
    };
    Run {
        name: "the guide's run".into(),
        time_s: column(Channel::Time),
        wheel_speed_rad_s: column(Channel::WheelSpeed),
        vehicle_speed_m_s: column(Channel::VehicleSpeed),
        drag_force_n: column(Channel::DragForce),
        normal_force_n: column(Channel::NormalForce),
        brake_torque_nm: Some(column(Channel::BrakeTorque)),
        brake_pressure_pa: Some(column(Channel::BrakePressure)),
        ..Run::default()
    }
}

/// Share of the normal force by which it swings in the guide's run, and how often a second: what depends on load
/// must show.
const SWING: (f64, f64) = (0.25, 0.8);

/// A picture of each mechanism's effect on a run.
///
/// # Errors
/// [`GuideError`]; a test holds that there is none.
pub fn pictures() -> Result<Vec<(Id, Figure)>, GuideError> {
    let scenario = Scenario::usual(rig(), None)?;
    let mut rows = Vec::new();
    scenario.run(|row| {
        rows.push(row.to_vec());
        Ok(())
    })?;
    let mut run = run_of(&scenario, &rows);
    let engine_rig = load::rig(&scenario.rig);
    let plain = Repaired {
        schema: "muslip.model/1".into(),
        averaged: 1,
        base: vec![
            scenario.rig.tyre.peak_friction.ln(),
            scenario.rig.tyre.critical_slip.ln(),
            0.0,
            0.0,
            0.0,
        ],
        context: Data::new(&engine_rig, core::slice::from_ref(&run)).context,
        rig: engine_rig,
        ..Repaired::default()
    };
    for (force, time) in run.normal_force_n.iter_mut().zip(&run.time_s) {
        *force *= 1.0 + SWING.0 * (std::f64::consts::TAU * SWING.1 * time).sin();
    }
    Id::ALL
        .iter()
        .map(|&id| Ok((id, picture(id, &plain, &run, &scenario)?)))
        .collect()
}

fn picture(id: Id, plain: &Repaired, run: &Run, scenario: &Scenario) -> Result<Figure, GuideError> {
    let word = id.as_str();
    let nothing = GuideError::Nothing(word);
    let Some(example) = id.guide().map(|guide| guide.example) else {
        return Err(nothing);
    };
    let entries = id.entries();
    let Some(entry) = entries.iter().find(|entry| entry.form() == example.form) else {
        return Err(nothing);
    };
    let parameters = entry.parameters(&plain.context);
    let values = example.parameters.iter();
    let term = RepairedTerm {
        id: word.into(),
        form: example.form.into(),
        equation: entry.equation().into(),
        parameters: parameters
            .iter()
            .zip(values)
            .map(|(parameter, value)| RepairedParameter {
                name: parameter.name.clone(),
                value: *value,
                std: 0.0,
                unit: parameter.unit.into(),
            })
            .collect(),
    };
    let mut model = plain.clone();
    let mut run = run.clone();
    if entry.stage() < Stage::Vehicle {
        model.tyre.push(term);
        run.drag_force_n = model.predict(&run, Which::Repaired)?.drag_force_n;
    } else {
        model.dynamics.push(term);
        let rows = scenario.run_model(&model, false, |_| ())?;
        run = run_of(scenario, &rows);
    }
    effects::of_first(&model, &run).ok_or(nothing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_is_found_however_it_is_written_and_near_ones_are_offered() {
        assert_eq!(named("Thermal fade"), Some(Id::ThermalFade));
        assert_eq!(named("brake-lag"), Some(Id::BrakeLag));
        assert_eq!(named("lag"), None);
        assert_eq!(near("termal_fade").first(), Some(&Id::ThermalFade));
        assert!(near("lag").contains(&Id::ForceLag) && near("lag").contains(&Id::BrakeLag));
        assert!(near("xyzzyx").is_empty());
    }

    #[test]
    fn edits_are_counted() {
        assert_eq!(edits("", "abc"), 3);
        assert_eq!(edits("kitten", "sitting"), 3);
        assert_eq!(edits("same", "same"), 0);
    }

    #[test]
    fn every_section_says_what_a_reader_wants_to_know() {
        for &id in Id::ALL {
            let section = section(id);
            assert!(!section.physics.is_empty());
            for label in [
                "left out",
                "equation",
                "sits in",
                "shows in",
                "sign",
                "memory",
                "mistaken for",
                "relevant from",
                "estimator",
                "on a fresh run",
            ] {
                let rows = section.rows.iter().filter(|row| row.label == label);
                assert!(rows.clone().count() > 0, "{label} of {}", id.as_str());
                assert!(rows.clone().all(|row| row.text.len() > 3), "{label}");
            }
        }
    }
}
