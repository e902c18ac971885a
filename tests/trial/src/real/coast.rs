//! Further checks of the coast-downs: one run left out, and a known force put in.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::Value;

use super::ask::Ask;
use super::recording::{Recording, SPEED, TIME, WHEEL};
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
    let own = loaded.rig_number("mass_kg") * own_air(&loaded.runs);
    rows.push(Row::new(
        "coast-downs, 0.25 kg/m times speed squared put in",
        &format!(
            "`aero_drag` named, its coefficient within 3 std of {:.3} kg/m: what was put in, and {own:.3} by which least \
             squares has the car slow with speed squared as it is",
            AIR + own
        ),
        coefficient.map_or_else(
            || told(&found),
            |(c, s)| format!("{c:.3} ± {s:.3} kg/m; {}", told(&found)),
        ),
        Some(coefficient.is_some_and(|(c, s)| (c - AIR - own).abs() <= 3.0 * s)),
    ));
    Ok(rows)
}

/// The deceleration over speed squared in 1/m with which the car slows as it is, beside a constant one: least squares of the
/// speeds in level form, each run's first speed free. Not all of it need be the air's.
fn own_air(runs: &[Recording]) -> f64 {
    let (mut xx, mut xz, mut zz, mut xy, mut zy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for run in runs {
        let (time, speed) = (&run.columns[TIME], &run.columns[SPEED]);
        let mut squares = vec![0.0; run.len()];
        for k in 1..run.len() {
            let mean = 0.5 * (speed[k] + speed[k - 1]);
            squares[k] = squares[k - 1] + mean * mean.abs() * (time[k] - time[k - 1]);
        }
        let centred = |x: &[f64]| -> Vec<f64> {
            let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
            x.iter().map(|x| x - mean).collect()
        };
        let (time, squares, speed) = (centred(time), centred(&squares), centred(speed));
        for ((x, z), y) in time.iter().zip(&squares).zip(&speed) {
            (xx, xz, zz) = (xx + x * x, xz + x * z, zz + z * z);
            (xy, zy) = (xy - x * y, zy - z * y);
        }
    }
    (xx * zy - xz * xy) / (xx * zz - xz * xz)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_slows_with_speed_squared_is_told_from_a_constant() {
        // dv/dt = -(a + b v^2): v = sqrt(a/b) tan(c - sqrt(ab) t).
        let (a, b) = (1.1_f64, 0.08_f64);
        let run = |first: f64| {
            let c = (first * (b / a).sqrt()).atan();
            let time: Vec<f64> = (0..100).map(|k| f64::from(k) * 0.01).collect();
            let speed = |t: &f64| (a / b).sqrt() * (c - (a * b).sqrt() * t).tan();
            let mut columns: [Vec<f64>; 5] = Default::default();
            columns[SPEED] = time.iter().map(speed).collect();
            columns[TIME] = time;
            Recording {
                columns,
                others: Vec::new(),
            }
        };
        let found = own_air(&[run(1.6), run(3.4), run(1.9)]);
        assert!((found - b).abs() < 1e-4, "{found}");
    }
}
