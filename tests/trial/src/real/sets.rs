//! The measured sets, and what must come out of each.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::Value;

use super::fold::Fold;
use super::placebo::{self, Placebo, leaks};
use super::recording::Recording;
use super::{figure, told};
use crate::contract::{list, number, text};

/// What must come out of a diagnosis.
#[derive(Clone, Copy, Debug)]
pub(super) enum Expect {
    /// One of these verdicts.
    Verdict(&'static [&'static str]),
    /// Undecided or unexplained; where the delay of a speed is named, explained or partly explained, as the contract
    /// then has it.
    Unsolved,
    NothingNamed,
    /// Nothing named but the delay of a speed, which the contract asks for where the residuals show it.
    NoPhysics,
    /// Nothing of the tyre balance is named but these.
    TyreOnly(&'static [&'static str]),
    /// This balance is flagged.
    Flagged(&'static str),
    First(&'static str),
    Absent(&'static str),
    /// A parameter of a mechanism lies between, give or take its std.
    Figure(&'static str, &'static str, f64, f64, &'static str),
    /// Vehicle speed is later than wheel speed by as much, s.
    SpeedLate(f64, f64),
    /// The rolling radius lies between, m.
    Radius(f64, f64),
    /// This column is said to leak.
    Leaks(&'static str),
    /// This column has a part in the drag; by itself it need not show it.
    MayLeak(&'static str),
    /// A fault of this channel, over half a run at least, in every run.
    Useless(&'static str),
    /// The speeds of this run disagree.
    SpeedsDisagree(&'static str),
    /// The speed is said to be too low.
    TooSlow,
    /// What is surer than a half improves unseen runs.
    SureHelps,
    /// Nobody knows.
    Unknown,
}

/// A measured set.
#[derive(Clone, Copy, Debug)]
pub(super) struct Set {
    pub(super) name: &'static str,
    /// Name of its picture.
    pub(super) key: &'static str,
    pub(super) folder: &'static str,
    pub(super) files: &'static [&'static str],
    pub(super) expects: &'static [Expect],
    pub(super) placebos: &'static [Placebo],
    pub(super) folds: bool,
}

use Expect::{
    Absent, Figure, First, Flagged, Leaks, MayLeak, NoPhysics, NothingNamed, Radius, SpeedLate,
    SpeedsDisagree, SureHelps, TooSlow, TyreOnly, Unknown, Unsolved, Useless, Verdict,
};

const VEHICLE: &str = "vehicle_speed_m_s";
const WHEEL: &str = "wheel_speed_rad_s";
/// Names that say of a speed channel only that it is late.
const SPEED_DELAYS: [&str; 2] = ["vehicle_speed_delay", "wheel_speed_delay"];

/// The car's mass times 1.1 and 1.3 m/s².
const COAST: (f64, f64) = (1.1 * 1.67, 1.3 * 1.67);
const LATERAL: &str = "lateral_m_s2";
const LONGITUDINAL: &str = "longitudinal_m_s2";

/// Every measured set.
pub(super) const SETS: [Set; 7] = [
    Set {
        name: "coast-downs",
        key: "coast-downs",
        folder: "dart-coastdown",
        files: &["coast1", "coast2", "coast3", "coast4", "coast5", "coast6"],
        expects: &[
            Flagged("vehicle"),
            First("grade_or_drive"),
            Figure("grade_or_drive", "force", COAST.0, COAST.1, "N"),
            Absent("aero_drag"),
        ],
        placebos: &placebo::ALL,
        folds: true,
    },
    Set {
        name: "circles on rubber",
        key: "circles",
        folder: "dart-friction",
        files: &[
            "circle01", "circle02", "circle03", "circle04", "circle05", "circle06", "circle07",
            "circle08",
        ],
        expects: &[Unknown, SureHelps, Leaks(LATERAL), MayLeak(LONGITUDINAL)],
        placebos: &placebo::ALL,
        folds: true,
    },
    Set {
        name: "drifts on tape",
        key: "drifts",
        folder: "dart-friction",
        files: &["drift09", "drift10"],
        expects: &[Unknown, MayLeak(LATERAL), MayLeak(LONGITUDINAL)],
        placebos: &placebo::ALL,
        folds: true,
    },
    Set {
        name: "circles and drifts",
        key: "circles-and-drifts",
        folder: "dart-friction",
        files: &[
            "circle01", "circle02", "circle03", "circle04", "circle05", "circle06", "circle07",
            "circle08", "drift09", "drift10",
        ],
        expects: &[
            Verdict(&["explained", "partly_explained", "unexplained"]),
            SureHelps,
        ],
        placebos: &placebo::ALL,
        folds: true,
    },
    Set {
        name: "road car",
        key: "road-car",
        folder: "rav4-drive",
        files: &["run1"],
        expects: &[
            SpeedLate(0.06, 0.10),
            Radius(0.352, 0.354),
            TyreOnly(&["vehicle_speed_delay", "effective_radius"]),
        ],
        placebos: &placebo::ALL,
        folds: true,
    },
    Set {
        name: "slides indoors",
        key: "slides",
        folder: "f110-slides",
        files: &["DS1", "DS2", "DS3", "DS4", "DS5"],
        expects: &[
            Unsolved,
            NoPhysics,
            Useless("drag_force_n"),
            SpeedLate(0.04, 0.08),
            SpeedsDisagree("DS4"),
        ],
        placebos: &placebo::ALL,
        folds: true,
    },
    Set {
        name: "rock",
        key: "rock",
        folder: "rock-friction",
        files: &["velstep4"],
        expects: &[
            Verdict(&["undecided", "unexplained"]),
            NothingNamed,
            TooSlow,
        ],
        placebos: &placebo::ALL,
        folds: true,
    },
];

/// What a small study looks at: the sets of a few thousand samples whole, and the four shortest circles.
pub(super) fn small() -> Vec<Set> {
    SETS.into_iter()
        .filter(|set| set.key != "circles-and-drifts")
        .map(|set| match set.key {
            "circles" => Set {
                name: "four circles",
                files: &["circle03", "circle04", "circle05", "circle07"],
                expects: &[Leaks(LATERAL)],
                placebos: &[Placebo::Reversed, Placebo::DragSwapped],
                folds: false,
                ..set
            },
            _ => set,
        })
        .collect()
}

/// A set as read.
pub(super) struct Loaded {
    pub(super) set: Set,
    pub(super) rig: PathBuf,
    pub(super) rig_text: String,
    pub(super) paths: Vec<PathBuf>,
    pub(super) runs: Vec<Recording>,
}

impl Loaded {
    pub(super) fn read(set: Set, data: &Path) -> Result<Loaded> {
        let folder = data.join(set.folder);
        let rig = folder.join("rig.toml");
        let rig_text =
            fs::read_to_string(&rig).with_context(|| format!("cannot read {}", rig.display()))?;
        let paths: Vec<PathBuf> = set
            .files
            .iter()
            .map(|name| folder.join(format!("{name}.csv")))
            .collect();
        let runs = paths
            .iter()
            .map(|path| Recording::read(path))
            .collect::<Result<_>>()?;
        Ok(Loaded {
            set,
            rig,
            rig_text,
            paths,
            runs,
        })
    }

    /// A number of the rig file.
    pub(super) fn rig_number(&self, key: &str) -> f64 {
        self.rig_text
            .lines()
            .filter_map(|line| line.split_once('='))
            .find(|(name, _)| name.trim() == key)
            .and_then(|(_, rest)| rest.split('#').next()?.trim().parse().ok())
            .unwrap_or(f64::NAN)
    }

    pub(super) fn samples(&self) -> usize {
        self.runs.iter().map(Recording::len).sum()
    }

    /// Why no run can be left out and predicted.
    pub(super) fn no_folds(&self) -> Option<&'static str> {
        if !self.runs.iter().any(Recording::has_drag) {
            Some("the drag is zero: nothing to predict")
        } else if self.runs.len() < 3 {
            Some("fewer than three runs")
        } else if !self.set.folds {
            Some("not in a small study")
        } else {
            None
        }
    }
}

/// A mechanism's confidence.
pub(super) fn confidence(mechanism: &Value) -> f64 {
    mechanism
        .get("evidence")
        .map_or(f64::NAN, |e| number(e, "confidence"))
}

/// By how much vehicle speed is said to be later than wheel speed, s: the difference of what is said of both against
/// the analogue channels, or what is said of one against the other.
fn speed_late(diagnosis: &Value) -> Option<f64> {
    let mean = |channel: &str| -> Option<f64> {
        let found: Vec<f64> = list(diagnosis, "chain")
            .iter()
            .filter(|f| text(f, "finding") == "late" && text(f, "channel") == channel)
            .map(|f| number(f, "value"))
            .collect();
        (!found.is_empty()).then(|| found.iter().sum::<f64>() / found.len() as f64)
    };
    match (mean(VEHICLE), mean(WHEEL)) {
        (None, None) => None,
        (vehicle, wheel) => Some(vehicle.unwrap_or(0.0) - wheel.unwrap_or(0.0)),
    }
}

/// The radius that was found: as a mechanism, or as a scale of one speed against the other in the chain.
///
/// A scale is reading over truth, as the contract has it of `force_gain`. Which speed it is of is the tool's choice,
/// and that decides which way it goes. Both true, the speeds obey `v = R·omega`. With the nominal radius taken for
/// true, a vehicle speed that reads `s` times too much has `v = s·nominal·omega`, so `R = nominal·s`; a wheel speed that
/// does has `omega = s·v/nominal`, so `R = nominal/s`. A scale against a third channel says nothing of the radius.
fn radius(diagnosis: &Value, nominal: f64) -> Option<f64> {
    if let Some((radius, _)) = figure(diagnosis, "effective_radius", "radius") {
        return Some(radius);
    }
    list(diagnosis, "chain")
        .iter()
        .filter(|f| text(f, "finding") == "scale")
        .find_map(|f| {
            let scale = number(f, "value");
            match (text(f, "channel"), text(f, "relative_to")) {
                (VEHICLE, "" | WHEEL) => Some(nominal * scale),
                (WHEEL, "" | VEHICLE) => Some(nominal / scale),
                _ => None,
            }
        })
}

/// Whether a fault says that the speed is too low to be used: one of a speed channel, or of a run as a whole (no
/// channel, or its time), which then has to say that it is the speed.
fn too_slow(fault: &Value) -> bool {
    let what = text(fault, "what").to_lowercase();
    let has = |words: &[&str]| words.iter().any(|word| what.contains(word));
    let of_speed = match text(fault, "channel") {
        VEHICLE | WHEEL => true,
        "" | "*" | "time_s" => has(&["speed", "m/s", "standstill"]),
        _ => false,
    };
    let low = has(&[
        "slow",
        "below",
        "too low",
        "minimum",
        "standstill",
        "0.5 m/s",
    ]);
    // A channel can be noisy or sampled below some bound as well.
    of_speed && low && !has(&["noise", "sampl"])
}

/// Whether all that is named is the delay of a speed.
fn only_speed_delays(mechanisms: &[Value]) -> bool {
    mechanisms
        .iter()
        .all(|m| SPEED_DELAYS.contains(&text(m, "id")))
}

impl Expect {
    /// What must come out, in words.
    pub(super) fn must(self) -> String {
        match self {
            Verdict(words) => format!("verdict {}", words.join(" or ")),
            Unsolved => "verdict undecided or unexplained; beside a named delay of a speed also explained or \
                         partly_explained"
                .to_owned(),
            NothingNamed => "nothing named".to_owned(),
            NoPhysics => "no physics named (the delay of a speed is none)".to_owned(),
            TyreOnly(ids) => format!("nothing of the tyre named but {}", quoted(ids)),
            Flagged(balance) => format!("the {balance} balance flagged"),
            First(id) => format!("`{id}` first"),
            Absent(id) => format!("`{id}` not claimed"),
            Figure(id, name, low, high, unit) => {
                format!("{name} of `{id}` {low:.2} to {high:.2} {unit}, give or take its std")
            }
            SpeedLate(low, high) => {
                format!("`chain`: vehicle speed later than the wheel's by {low:.2} to {high:.2} s")
            }
            Radius(low, high) => format!("a rolling radius of {low} to {high} m"),
            Leaks(column) => format!("`chain`: `{column}` leaks, the force was made from it"),
            MayLeak(column) => {
                format!("`chain`: `{column}` leaks; a part of the force, hardly like it by itself")
            }
            Useless(channel) => format!("`data_faults`: `{channel}` is of no use, in every run"),
            SpeedsDisagree(run) => format!("the two speeds of {run} disagree by a quarter"),
            TooSlow => "the speed is too low, said as the reason".to_owned(),
            SureHelps => "what is surer than 0.5 improves unseen runs".to_owned(),
            Unknown => "nobody knows".to_owned(),
        }
    }

    /// What came out, and whether it holds; none where nobody knows.
    pub(super) fn judge(
        self,
        loaded: &Loaded,
        diagnosis: &Value,
        folds: &[Fold],
    ) -> (String, Option<bool>) {
        let mechanisms = list(diagnosis, "mechanisms");
        let named = |id: &str| mechanisms.iter().any(|m| text(m, "id") == id);
        let ids = || {
            let all: Vec<&str> = mechanisms.iter().map(|m| text(m, "id")).collect();
            if all.is_empty() {
                "nothing named".to_owned()
            } else {
                all.join(", ")
            }
        };
        // A tool that gave no diagnosis meets nothing.
        if text(diagnosis, "verdict").starts_with('(') {
            return (told(diagnosis), Some(false));
        }
        match self {
            Verdict(words) => {
                let verdict = text(diagnosis, "verdict");
                (told(diagnosis), Some(words.contains(&verdict)))
            }
            Unsolved => {
                let allowed: &[&str] = if mechanisms.is_empty() {
                    &["undecided", "unexplained"]
                } else {
                    &["explained", "partly_explained"]
                };
                let good = allowed.contains(&text(diagnosis, "verdict"));
                (told(diagnosis), Some(good && only_speed_delays(mechanisms)))
            }
            NothingNamed => (ids(), Some(mechanisms.is_empty())),
            NoPhysics => (ids(), Some(only_speed_delays(mechanisms))),
            TyreOnly(allowed) => {
                let others = mechanisms
                    .iter()
                    .filter(|m| text(m, "balance") == "tyre" && !allowed.contains(&text(m, "id")))
                    .count();
                (told(diagnosis), Some(others == 0))
            }
            Flagged(balance) => (
                told(diagnosis),
                Some(
                    list(diagnosis, "where")
                        .iter()
                        .any(|w| text(w, "balance") == balance),
                ),
            ),
            First(id) => {
                let first = mechanisms.first().map_or("", |m| text(m, "id"));
                (ids(), Some(first == id))
            }
            Absent(id) => {
                let said = if named(id) { "claimed" } else { "not claimed" };
                (said.to_owned(), Some(!named(id)))
            }
            Figure(id, name, low, high, unit) => match figure(diagnosis, id, name) {
                Some((value, std)) => (
                    format!("{value:.2} ± {std:.2} {unit}"),
                    Some(value + std >= low && value - std <= high),
                ),
                None => ("no figure".to_owned(), Some(false)),
            },
            SpeedLate(low, high) => match speed_late(diagnosis) {
                Some(late) => (format!("{late:.3} s"), Some((low..=high).contains(&late))),
                None => ("nothing said".to_owned(), Some(false)),
            },
            Radius(low, high) => match radius(diagnosis, loaded.rig_number("radius_m")) {
                Some(found) => (format!("{found:.4} m"), Some((low..=high).contains(&found))),
                None => ("no radius".to_owned(), Some(false)),
            },
            Leaks(column) => (leak(diagnosis, column), Some(leaks(diagnosis, column))),
            MayLeak(column) => (leak(diagnosis, column), None),
            Useless(channel) => {
                let faulty = |path: &Path, run: &Recording| {
                    list(diagnosis, "data_faults").iter().find(|fault| {
                        text(fault, "channel") == channel
                            && same_file(text(fault, "recording"), path)
                            && 2.0 * (number(fault, "end_s") - number(fault, "start_s"))
                                >= run.duration()
                    })
                };
                let found: Vec<&Value> = loaded
                    .paths
                    .iter()
                    .zip(&loaded.runs)
                    .filter_map(|(path, run)| faulty(path, run))
                    .collect();
                let said = found.first().map_or("", |fault| text(fault, "what"));
                (
                    format!("{} of {} runs: {said}", found.len(), loaded.runs.len()),
                    Some(found.len() == loaded.runs.len()),
                )
            }
            SpeedsDisagree(run) => {
                let speeds = |entry: &Value| {
                    text(entry, "recording").contains(run)
                        && text(entry, "channel").contains("speed")
                };
                let scale = list(diagnosis, "chain")
                    .iter()
                    .find(|f| speeds(f) && text(f, "finding") == "scale")
                    .map(|f| text(f, "statement"));
                let fault = list(diagnosis, "data_faults")
                    .iter()
                    .filter(|f| speeds(f))
                    .map(|f| text(f, "what"))
                    .find(|what| {
                        ["disagree", "differ", "scale", "radius", "ratio"]
                            .iter()
                            .any(|word| what.contains(word))
                    });
                match scale.or(fault) {
                    Some(said) => (said.to_owned(), Some(true)),
                    None => (format!("nothing said of {run}"), Some(false)),
                }
            }
            TooSlow => {
                let said = list(diagnosis, "data_faults")
                    .iter()
                    .find(|fault| too_slow(fault))
                    .map(|fault| text(fault, "what"));
                (
                    said.unwrap_or("nothing said of too low a speed").to_owned(),
                    Some(said.is_some()),
                )
            }
            SureHelps => sure_helps(mechanisms, folds),
            Unknown => (told(diagnosis), None),
        }
    }
}

/// Names above a half: those of the set have a gain on held-out runs, and where runs left out were predicted with such
/// names, the error is 2 % less.
fn sure_helps(mechanisms: &[Value], folds: &[Fold]) -> (String, Option<bool>) {
    let mut said = Vec::new();
    let mut good = true;
    for mechanism in mechanisms.iter().filter(|m| confidence(m) > 0.5) {
        let gain = mechanism
            .get("evidence")
            .map_or(f64::NAN, |e| number(e, "holdout_nll_gain_per_sample"));
        good &= gain > 0.0;
        said.push(format!(
            "{} gains {gain:.2} a sample",
            text(mechanism, "id")
        ));
    }
    let sure: Vec<&Fold> = folds.iter().filter(|fold| fold.sure > 0).collect();
    let helped = sure
        .iter()
        .filter(|fold| fold.ratio() <= 0.98 * 0.98)
        .count();
    good &= helped == sure.len();
    said.push(format!(
        "{} of {} folds with such names are 2 % better",
        helped,
        sure.len()
    ));
    (said.join("; "), Some(good))
}

fn leak(diagnosis: &Value, column: &str) -> String {
    if leaks(diagnosis, column) {
        "said".to_owned()
    } else if list(diagnosis, "unexplained")
        .iter()
        .any(|left| text(left, "variable") == column)
    {
        "not said; the column is what remains depends on".to_owned()
    } else {
        "not said".to_owned()
    }
}

/// Whether a recording named in a diagnosis is this file; with or without its folder.
fn same_file(named: &str, path: &Path) -> bool {
    Path::new(named).file_name() == path.file_name()
}

fn quoted(ids: &[&str]) -> String {
    let ids: Vec<String> = ids.iter().map(|id| format!("`{id}`")).collect();
    ids.join(" or ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_delay_is_a_difference_of_two_channels() {
        let late = |entries: &[(&str, f64)]| {
            let chain: Vec<Value> = entries
                .iter()
                .map(|(c, v)| json!({"finding": "late", "channel": c, "value": v}))
                .collect();
            speed_late(&json!({ "chain": chain }))
        };
        assert!((late(&[(VEHICLE, 0.11), (WHEEL, 0.03)]).unwrap() - 0.08).abs() < 1e-12);
        assert_eq!(late(&[(WHEEL, -0.08)]), Some(0.08));
        assert_eq!(late(&[]), None);
    }

    #[test]
    fn the_channel_decides_which_way_a_scale_goes() {
        let found = |channel: &str, relative_to: &str, scale: f64| {
            let finding = json!({"finding": "scale", "channel": channel, "value": scale,
                                 "relative_to": relative_to});
            radius(&json!({ "chain": [finding] }), 0.35)
        };
        let near =
            |found: Option<f64>, radius: f64| found.is_some_and(|r| (r - radius).abs() < 1e-9);
        let large = 353.0 / 350.0;
        assert!(near(found(VEHICLE, WHEEL, large), 0.353));
        assert!(near(found(WHEEL, "", 1.0 / large), 0.353));
        // The wrong way round is the wrong radius.
        assert!(!near(found(WHEEL, VEHICLE, large), 0.353));
        assert!(!near(found(VEHICLE, "", 1.0 / large), 0.353));
        // A scale against something else, or of something else, is none of the radius.
        assert_eq!(found(VEHICLE, "gnss_ublox_speed_m_s", large), None);
        assert_eq!(found("gnss_ublox_speed_m_s", WHEEL, large), None);
        // Reading over truth, played through: a wheel of 0.353 m at 10 m/s, read as if it had 0.35 m.
        let (v, omega) = (10.0, 10.0 / 0.353);
        assert!(near(found(VEHICLE, WHEEL, v / (0.35 * omega)), 0.353));
        assert!(near(found(WHEEL, VEHICLE, omega / (v / 0.35)), 0.353));
    }

    #[test]
    fn a_speed_that_is_too_low_has_to_be_told_as_that() {
        let said = |channel: &str, what: &str| too_slow(&json!({"channel": channel, "what": what}));
        assert!(said(VEHICLE, "below the smallest usable speed of 0.5 m/s"));
        assert!(said(VEHICLE, "Too slow throughout"));
        assert!(said(WHEEL, "the wheel is at standstill"));
        assert!(said("", "no speed above the minimum"));
        assert!(said("time_s", "speed under 0.5 m/s in the whole run"));
        for (channel, what) in [
            (VEHICLE, "the speed channel is frozen"),
            (VEHICLE, "speed: 49 values missing"),
            (VEHICLE, "noise below the declared"),
            (WHEEL, "sampled too slowly"),
            ("time_s", "gap of 0.500 s"),
            ("time_s", "fewer rows than the minimum"),
            ("normal_force_n", "speed below 0.5 m/s"),
        ] {
            assert!(!said(channel, what), "{channel}: {what}");
        }
    }

    #[test]
    fn the_delay_of_a_speed_is_no_physics() {
        let loaded = bare(SETS[5]);
        let judged = |expect: Expect, verdict: &str, ids: &[&str]| {
            let named: Vec<Value> = ids.iter().map(|id| json!({ "id": id })).collect();
            let said = json!({"verdict": verdict, "mechanisms": named});
            expect.judge(&loaded, &said, &[]).1.unwrap()
        };
        for ids in [
            &[][..],
            &["vehicle_speed_delay"],
            &["wheel_speed_delay", "vehicle_speed_delay"],
        ] {
            assert!(judged(NoPhysics, "", ids));
            // The verdict has to go with the names.
            for verdict in ["undecided", "unexplained"] {
                assert_eq!(judged(Unsolved, verdict, ids), ids.is_empty());
            }
            for verdict in ["explained", "partly_explained"] {
                assert_eq!(judged(Unsolved, verdict, ids), !ids.is_empty());
            }
            assert!(!judged(Unsolved, "consistent", ids));
        }
        for ids in [&["force_delay"][..], &["vehicle_speed_delay", "run_out"]] {
            assert!(!judged(NoPhysics, "", ids));
            assert!(!judged(Unsolved, "explained", ids));
        }
        assert!(!judged(NothingNamed, "", &["vehicle_speed_delay"]));
    }

    /// A set without recordings.
    fn bare(set: Set) -> Loaded {
        Loaded {
            set,
            rig: PathBuf::new(),
            rig_text: "[wheel]\nradius_m = 0.3 # m\n".to_owned(),
            paths: vec![],
            runs: vec![],
        }
    }

    #[test]
    fn sure_names_must_help_wherever_they_were_given() {
        let name = |confidence: f64, gain: f64| {
            json!({"id": "force_lag",
                   "evidence": {"confidence": confidence, "holdout_nll_gain_per_sample": gain}})
        };
        let fold = |sure: usize, repaired: f64| Fold {
            sure,
            repaired,
            base: 1.0,
            ..Fold::default()
        };
        assert_eq!(sure_helps(&[name(0.9, 1.0)], &[fold(1, 0.5)]).1, Some(true));
        assert_eq!(sure_helps(&[name(0.9, -1.0)], &[]).1, Some(false));
        assert_eq!(
            sure_helps(&[name(0.4, -1.0)], &[fold(0, 2.0)]).1,
            Some(true)
        );
        assert_eq!(sure_helps(&[], &[fold(1, 0.99)]).1, Some(false));
    }

    #[test]
    fn a_tool_without_an_answer_meets_nothing() {
        let loaded = bare(SETS[6]);
        assert!((loaded.rig_number("radius_m") - 0.3).abs() < 1e-12);
        let failed = json!({"verdict": "(exit status: 2)"});
        assert_eq!(NothingNamed.judge(&loaded, &failed, &[]).1, Some(false));
        let undecided = json!({"verdict": "undecided", "mechanisms": []});
        assert_eq!(NothingNamed.judge(&loaded, &undecided, &[]).1, Some(true));
        assert_eq!(TooSlow.judge(&loaded, &undecided, &[]).1, Some(false));
    }

    #[test]
    fn a_small_study_is_a_part_of_the_whole() {
        for set in small() {
            assert!(SETS.iter().any(|whole| whole.folder == set.folder
                && set.files.iter().all(|f| whole.files.contains(f))));
        }
    }
}
