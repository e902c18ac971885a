//! Measured recordings: what is known to come out of them, and real noise with an effect put in.
//!
//! Two sorts of data, neither copied into the project:
//!
//! - `dart-coastdown`: a scale car that coasts down. As it is, and with a further force put in by integrating it
//!   into the measured speed.
//! - `dart-friction`: the same car's friction against slip. As it is; and as the source of real inputs and real
//!   noise. For these the force is the two-parameter law at the measured slip, then the effect, then noise: what another measured run scatters about its own mean over
//!   two seconds, played backwards, so that it has its real size, colour and tails and nothing to do with the inputs.
//!   In half of the campaigns the law is driven by the slip as recorded, so that the inputs are exact; in the other
//!   half by its centred mean over 0.3 s, so that the slip as recorded has whatever it does faster than that as an
//!   error, which no delay and no lag explains.

mod injected;
mod recording;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::contract::{complaints, list, number, text};
use crate::generate::files::read_column;
use crate::process::run;
use crate::report::trial::Trial;
use crate::table::Table;
use crate::tool::{PATIENCE, Tool};

use injected::injected;
use recording::Recording;

/// Mass of the scale car in kg, as its rig file says.
const MASS: f64 = 1.67;

/// Everything measured: what is known, then real noise with an effect put in.
pub fn trial(trial: &Trial, work: &Path, program: &str) -> Result<Vec<Table>> {
    let (coast, friction) = (
        trial.data.join("dart-coastdown"),
        trial.data.join("dart-friction"),
    );
    if !coast.is_dir() || !friction.is_dir() {
        let mut table = Table::new("Measured recordings", &["what"]);
        table.row([format!("none at {}: not tried", trial.data.display())]);
        return Ok(vec![table]);
    }
    let answers = work.join(format!("answers-{program}"));
    let mut known = Table::new(
        "Measured recordings, as they are",
        &["recordings", "what must come out", "what came out", "holds"],
    );
    coast_downs(&trial.tool, &coast, &answers, &mut known)?;
    frictions(&trial.tool, &friction, &answers, &mut known)?;
    let injected = injected(trial, &friction, work, &answers)?;
    Ok(vec![known, injected])
}

/// Diagnoses recordings, or takes up what an earlier call answered.
fn diagnosis(tool: &Tool, rig: &Path, runs: &[PathBuf], out: &Path) -> Result<Value> {
    let kept = out.join("diagnosis.json");
    if !out.join("done").exists() {
        fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
        let mut command = Command::new(&tool.path);
        command
            .arg("diagnose")
            .arg("--rig")
            .arg(rig)
            .arg("--out")
            .arg(out);
        command.args(&tool.diagnose_arguments).args(runs);
        if let Err(why) = run(command, 1, PATIENCE, &out.join("diagnose.log")).1 {
            return Ok(serde_json::json!({ "verdict": format!("({why})") }));
        }
        fs::write(out.join("done"), "")?;
    }
    let value: Value = serde_json::from_str(&fs::read_to_string(&kept)?)?;
    if let Some(complaint) = complaints(&value).into_iter().next() {
        return Ok(serde_json::json!({ "verdict": format!("({complaint})") }));
    }
    Ok(value)
}

fn told(diagnosis: &Value) -> String {
    let named: Vec<String> = list(diagnosis, "mechanisms")
        .iter()
        .map(|m| {
            format!(
                "{} {:.2}",
                text(m, "id"),
                m.get("evidence")
                    .map_or(f64::NAN, |e| number(e, "confidence"))
            )
        })
        .collect();
    let left: Vec<&str> = list(diagnosis, "unexplained")
        .iter()
        .map(|left| text(left, "variable"))
        .collect();
    let mut said = text(diagnosis, "verdict").to_owned();
    if !named.is_empty() {
        let _ = write!(said, ": {}", named.join(", "));
    }
    if !left.is_empty() {
        let _ = write!(said, "; left: {}", left.join(", "));
    }
    said
}

fn holds(yes: bool) -> String {
    if yes { "yes" } else { "**no**" }.to_owned()
}

/// A reported figure and its standard deviation.
fn figure(diagnosis: &Value, id: &str, name: &str) -> Option<(f64, f64)> {
    let mechanism = list(diagnosis, "mechanisms")
        .iter()
        .find(|mechanism| text(mechanism, "id") == id)?;
    let parameter = list(mechanism, "parameters")
        .iter()
        .find(|parameter| text(parameter, "name") == name)?;
    Some((number(parameter, "value"), number(parameter, "std")))
}

fn coast_downs(tool: &Tool, folder: &Path, answers: &Path, table: &mut Table) -> Result<()> {
    let rig = folder.join("rig.toml");
    let all: Vec<PathBuf> = (1..=6)
        .map(|n| folder.join(format!("coast{n}.csv")))
        .collect();
    let whole = diagnosis(tool, &rig, &all, &answers.join("coast"))?;
    let first = list(&whole, "mechanisms")
        .first()
        .map_or("", |m| text(m, "id"));
    let mut row = |what: &str, must: &str, came: String, yes: bool| {
        table.row([what.to_owned(), must.to_owned(), came, holds(yes)]);
    };
    row(
        "six coast-downs",
        "the vehicle balance is flagged",
        told(&whole),
        list(&whole, "where")
            .iter()
            .any(|w| text(w, "balance") == "vehicle"),
    );
    row(
        "",
        "`grade_or_drive` first",
        first.to_owned(),
        first == "grade_or_drive",
    );
    let force = figure(&whole, "grade_or_drive", "force");
    row(
        "",
        "its force 1.1 to 1.3 m/s² times the mass: 1.84 to 2.17 N, give or take its own std",
        force.map_or_else(
            || "no force".to_owned(),
            |(f, s)| format!("{f:.2} ± {s:.2} N"),
        ),
        force.is_some_and(|(f, s)| f + s >= 1.1 * MASS && f - s <= 1.3 * MASS),
    );
    let aero = list(&whole, "mechanisms")
        .iter()
        .any(|m| text(m, "id") == "aero_drag");
    row(
        "",
        "`aero_drag` not claimed",
        if aero { "claimed" } else { "not claimed" }.to_owned(),
        !aero,
    );
    for left_out in 0..6 {
        let some: Vec<PathBuf> = (0..6)
            .filter(|n| *n != left_out)
            .map(|n| all[n].clone())
            .collect();
        let found = diagnosis(
            tool,
            &rig,
            &some,
            &answers.join(format!("coast-without-{}", left_out + 1)),
        )?;
        let mechanisms = list(&found, "mechanisms");
        row(
            &format!("all but coast{}", left_out + 1),
            "`grade_or_drive` first, no `aero_drag`",
            told(&found),
            mechanisms
                .first()
                .is_some_and(|m| text(m, "id") == "grade_or_drive")
                && !mechanisms.iter().any(|m| text(m, "id") == "aero_drag"),
        );
    }
    // A further constant force: the figure must rise by it, whatever else slows the car.
    const FORCE: f64 = 0.6;
    const DRAG: f64 = 0.25;
    let constant = slowed(&all, answers, "coast-with-force", &|_| FORCE)?;
    let found = diagnosis(tool, &rig, &constant, &answers.join("coast-with-force"))?;
    let after = figure(&found, "grade_or_drive", "force");
    row(
        "six coast-downs, 0.6 N more of a constant force",
        "the force of `grade_or_drive` grows by 0.6 N, within 3 of its std",
        match (force, after) {
            (Some(a), Some(b)) => format!("{:.2} N before, {:.2} ± {:.2} N now", a.0, b.0, b.1),
            _ => told(&found),
        },
        matches!((force, after), (Some(a), Some(b)) if (b.0 - a.0 - FORCE).abs() <= 3.0 * a.1.hypot(b.1)),
    );
    let air = slowed(&all, answers, "coast-with-air", &|v| DRAG * v * v.abs())?;
    let found = diagnosis(tool, &rig, &air, &answers.join("coast-with-air"))?;
    let coefficient = figure(&found, "aero_drag", "coefficient");
    row(
        "six coast-downs, drag of 0.25 kg/m times speed squared put in",
        "`aero_drag` named, its coefficient within 3 std (the car's own small share left aside)",
        coefficient.map_or_else(
            || told(&found),
            |(c, s)| format!("{c:.3} ± {s:.3} kg/m; {}", told(&found)),
        ),
        coefficient.is_some_and(|(c, s)| (c - DRAG).abs() <= 3.0 * s),
    );
    Ok(())
}

/// The coast-downs as they would have gone with a further force at each speed.
fn slowed(
    runs: &[PathBuf],
    answers: &Path,
    name: &str,
    force: &dyn Fn(f64) -> f64,
) -> Result<Vec<PathBuf>> {
    let folder = answers.join(format!("{name}-recordings"));
    fs::create_dir_all(&folder)?;
    let mut out = Vec::new();
    for path in runs {
        let mut recording = Recording::read(path)?;
        let [time, wheel, speed, _, _] = &mut recording.columns;
        let mut lost = 0.0;
        for k in 0..time.len() {
            if k > 0 {
                lost += force(speed[k - 1]) / MASS * (time[k] - time[k - 1]);
            }
            let before = speed[k];
            speed[k] -= lost;
            // The wheel rolls along.
            wheel[k] *= if before.abs() > 1e-6 {
                speed[k] / before
            } else {
                1.0
            };
        }
        // What would have stopped by then is cut off.
        let end = speed.iter().position(|v| *v < 0.3).unwrap_or(speed.len());
        for column in &mut recording.columns {
            column.truncate(end);
        }
        let target = folder.join(path.file_name().context("a file name")?);
        fs::write(&target, recording.text())?;
        out.push(target);
    }
    Ok(out)
}

fn frictions(tool: &Tool, folder: &Path, answers: &Path, table: &mut Table) -> Result<()> {
    let rig = folder.join("rig.toml");
    let circle: Vec<PathBuf> = (1..=8)
        .map(|n| folder.join(format!("circle{n:02}.csv")))
        .collect();
    let tape: Vec<PathBuf> = [9, 10]
        .map(|n| folder.join(format!("drift{n:02}.csv")))
        .to_vec();
    let all: Vec<PathBuf> = circle.iter().chain(&tape).cloned().collect();
    let found = diagnosis(tool, &rig, &all, &answers.join("friction-all"))?;
    let verdict = text(&found, "verdict");
    table.row([
        "circles on rubber and drifts on tape together".to_owned(),
        "one pair of parameters does not fit them: says so; of the cause nobody knows".to_owned(),
        told(&found),
        holds(matches!(
            verdict,
            "explained" | "partly_explained" | "unexplained"
        )),
    ]);
    for (name, runs) in [("circles on rubber", &circle), ("drifts on tape", &tape)] {
        let found = diagnosis(tool, &rig, runs, &answers.join(name.replace(' ', "-")))?;
        table.row([
            name.to_owned(),
            "nobody knows".to_owned(),
            told(&found),
            "-".to_owned(),
        ]);
    }
    for fresh in [3usize, 7] {
        let seen: Vec<PathBuf> = (0..8)
            .filter(|n| *n != fresh)
            .map(|n| circle[n].clone())
            .collect();
        let out = answers.join(format!("circles-without-{}", fresh + 1));
        diagnosis(tool, &rig, &seen, &out)?;
        let drag = read_column(&circle[fresh], "drag_force_n")?;
        let error = |base: bool| -> Option<f64> {
            let target = out.join(if base { "base.csv" } else { "repaired.csv" });
            let predicted = tool
                .predict(&rig, &out, &circle[fresh], &target, base)
                .ok()?;
            let squares: Vec<f64> = predicted
                .iter()
                .zip(&drag)
                .map(|(p, d)| (p - d).powi(2))
                .filter(|x| x.is_finite())
                .collect();
            (2 * squares.len() > drag.len())
                .then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
        };
        let (repaired, base) = (error(false), error(true));
        table.row([
            format!("circle{:02}, from the seven others", fresh + 1),
            "predicted no worse than by the base".to_owned(),
            match (repaired, base) {
                (Some(r), Some(b)) => format!("RMS error {r:.2} N, base {b:.2} N"),
                _ => "no prediction".to_owned(),
            },
            holds(matches!((repaired, base), (Some(r), Some(b)) if r <= 1.01 * b)),
        ]);
    }
    Ok(())
}
