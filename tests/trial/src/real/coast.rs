//! Further checks of the coast-downs: one run left out, and a known force put in.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::Value;

use super::ask::Ask;
use super::recording::{SPEED, TIME, WHEEL};
use super::sets::Loaded;
use super::{Row, figure, told};
use crate::contract::{list, text};

/// A further constant force, N.
const FORCE: f64 = 0.6;
/// A further drag over speed squared, kg/m.
const AIR: f64 = 0.25;

/// Rows beside those of the set itself.
pub(super) fn further(ask: &Ask, loaded: &Loaded, work: &Path) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    let force = |value: &Value| figure(value, "grade_or_drive", "force");
    let whole = ask.diagnose(&loaded.rig, &loaded.paths)?.value;
    for (out, name) in loaded.set.files.iter().enumerate() {
        let mut some = loaded.paths.clone();
        some.remove(out);
        let found = ask.diagnose(&loaded.rig, &some)?.value;
        let mechanisms = list(&found, "mechanisms");
        let good = mechanisms
            .first()
            .is_some_and(|m| text(m, "id") == "grade_or_drive")
            && !mechanisms.iter().any(|m| text(m, "id") == "aero_drag");
        rows.push(Row::new(
            &format!("all but {name}"),
            "`grade_or_drive` first, no `aero_drag`",
            told(&found),
            Some(good),
        ));
    }
    let runs = slowed(loaded, &work.join("coast-with-force"), &|_| FORCE)?;
    let found = ask.diagnose(&loaded.rig, &runs)?.value;
    let pair = (force(&whole), force(&found));
    rows.push(Row::new(
        "coast-downs, 0.6 N more of a constant force",
        "the force of `grade_or_drive` grows by 0.6 N, within 3 of its std",
        match pair {
            (Some(a), Some(b)) => format!("{:.2} N before, {:.2} ± {:.2} N now", a.0, b.0, b.1),
            _ => told(&found),
        },
        Some(matches!(pair, (Some(a), Some(b))
            if (b.0 - a.0 - FORCE).abs() <= 3.0 * a.1.hypot(b.1))),
    ));
    let runs = slowed(loaded, &work.join("coast-with-air"), &|v| AIR * v * v.abs())?;
    let found = ask.diagnose(&loaded.rig, &runs)?.value;
    let coefficient = figure(&found, "aero_drag", "coefficient");
    rows.push(Row::new(
        "coast-downs, 0.25 kg/m times speed squared put in",
        "`aero_drag` named, its coefficient within 3 std (the car's own small share left aside)",
        coefficient.map_or_else(
            || told(&found),
            |(c, s)| format!("{c:.3} ± {s:.3} kg/m; {}", told(&found)),
        ),
        Some(coefficient.is_some_and(|(c, s)| (c - AIR).abs() <= 3.0 * s)),
    ));
    Ok(rows)
}

/// The coast-downs as they would have gone with a further force at each speed.
fn slowed(loaded: &Loaded, folder: &Path, force: &dyn Fn(f64) -> f64) -> Result<Vec<PathBuf>> {
    let mass = loaded.rig_number("mass_kg");
    fs::create_dir_all(folder)?;
    let mut out = Vec::new();
    for (path, run) in loaded.paths.iter().zip(&loaded.runs) {
        let mut run = run.clone();
        let mut lost = 0.0;
        for k in 0..run.len() {
            if k > 0 {
                let step = run.columns[TIME][k] - run.columns[TIME][k - 1];
                lost += force(run.columns[SPEED][k - 1]) / mass * step;
            }
            let before = run.columns[SPEED][k];
            run.columns[SPEED][k] -= lost;
            // The wheel rolls along.
            run.columns[WHEEL][k] *= if before.abs() > 1e-6 {
                run.columns[SPEED][k] / before
            } else {
                1.0
            };
        }
        // What would have stopped by then is cut off.
        let end = run.columns[SPEED].iter().position(|v| *v < 0.3);
        run.truncate(end.unwrap_or(run.len()));
        let target = folder.join(path.file_name().context("a file name")?);
        fs::write(&target, run.text())?;
        out.push(target);
    }
    Ok(out)
}
