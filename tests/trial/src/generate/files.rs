//! Campaigns on disk.
//!
//! ```text
//! DIR/campaign-0007/           what a user has: rig.toml, run01.csv, run02.csv, ...
//! DIR/fresh/campaign-0007/     fresh01.csv, ... to predict; some without a drag column
//! DIR/sealed/campaign-0007/    truth.json, fresh01.csv with the load cell's reading without noise
//! DIR/sealed.sha256            printed before anything is diagnosed
//! ```

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use rayon::prelude::*;
use sha2::{Digest, Sha256};

use crate::generate::campaign::{Campaign, Recorded, Truth, column_scale};
use crate::draw::Draw;
use crate::generate::rig::BrakeColumn;
use crate::generate::strata::{Request, fulfil, orders};

/// Makes and files all requested campaigns in random order; gives the hash of the sealed truth.
///
/// # Errors
/// Where a file cannot be written, a request is unknown, or no rig can show an ordered effect.
pub fn generate(directory: &Path, requests: &[Request], seed: u64) -> Result<String> {
    let mut all = Vec::new();
    for (index, request) in requests.iter().enumerate() {
        for (number, order) in orders(request, seed)?.into_iter().enumerate() {
            let key = Draw::new(seed, &[1, index as u64, number as u64]).seed();
            all.push((key, order));
        }
    }
    // Names must not tell what a campaign is.
    all.sort_by_key(|(key, _)| *key);
    let first = next_number(directory);
    all.par_iter()
        .enumerate()
        .try_for_each(|(index, (key, order))| -> Result<()> {
            let name = format!("campaign-{:04}", first + index);
            let campaign = fulfil(&name, *key, order)?;
            file(directory, &name, &campaign)
        })?;
    let hash = seal(directory)?;
    fs::write(directory.join("sealed.sha256"), format!("{hash}\n"))?;
    Ok(hash)
}

fn next_number(directory: &Path) -> usize {
    names(directory)
        .ok()
        .and_then(|names| {
            names
                .last()
                .and_then(|name| name.strip_prefix("campaign-")?.parse::<usize>().ok())
        })
        .map_or(0, |last| last + 1)
}

/// Names of the campaigns in a directory, sorted.
pub fn names(directory: &Path) -> Result<Vec<String>> {
    let mut names: Vec<String> = fs::read_dir(directory)
        .with_context(|| format!("cannot list {}", directory.display()))?
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| name.starts_with("campaign-"))
        .collect();
    names.sort();
    Ok(names)
}

/// SHA-256 over every sealed file, names included, in sorted order.
pub fn seal(directory: &Path) -> Result<String> {
    let sealed = directory.join("sealed");
    let mut hash = Sha256::new();
    for name in names(&sealed)? {
        let mut files: Vec<PathBuf> = fs::read_dir(sealed.join(&name))?
            .filter_map(|entry| Some(entry.ok()?.path()))
            .collect();
        files.sort();
        for path in files {
            hash.update(name.as_bytes());
            hash.update(
                path.file_name()
                    .and_then(|name| name.to_str())
                    .unwrap_or("")
                    .as_bytes(),
            );
            hash.update(fs::read(&path)?);
        }
    }
    Ok(hash
        .finalize()
        .iter()
        .fold(String::new(), |mut text, byte| {
            let _ = write!(text, "{byte:02x}");
            text
        }))
}

/// The sealed truth of a campaign.
pub fn truth(directory: &Path, name: &str) -> Result<Truth> {
    let path = directory.join("sealed").join(name).join("truth.json");
    let text =
        fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    serde_json::from_str(&text).with_context(|| format!("{} is no truth file", path.display()))
}

fn file(directory: &Path, name: &str, campaign: &Campaign) -> Result<()> {
    let open = directory.join(name);
    let fresh = directory.join("fresh").join(name);
    let sealed = directory.join("sealed").join(name);
    for path in [&open, &fresh, &sealed] {
        fs::create_dir_all(path).with_context(|| format!("cannot make {}", path.display()))?;
    }
    let truth = &campaign.truth;
    fs::write(open.join("rig.toml"), truth.rig.file())?;
    for recorded in &campaign.fit {
        fs::write(open.join(&recorded.file), recording(truth, recorded, true))?;
    }
    for (recorded, told) in campaign.fresh.iter().zip(&truth.fresh) {
        fs::write(
            fresh.join(&recorded.file),
            recording(truth, recorded, told.drag_column),
        )?;
        fs::write(sealed.join(&recorded.file), reading(recorded, truth))?;
    }
    let mut text = serde_json::to_string_pretty(truth)?;
    text.push('\n');
    fs::write(sealed.join("truth.json"), text)?;
    Ok(())
}

fn reading(recorded: &Recorded, truth: &Truth) -> String {
    let mut text = String::from("time_s,drag_force_n,written_drag_force_n,scored\n");
    let clean = &recorded.clean;
    for i in 0..clean.time.len() {
        let scored = u8::from(crate::generate::measure::usable(&truth.rig, clean, i));
        let _ = writeln!(
            text,
            "{:.6},{:.6},{:.6},{scored}",
            clean.time[i], recorded.reading[i], recorded.written.drag[i]
        );
    }
    text
}

/// A recorded run as the file that a user would have: some loggers put remarks on top, some have the columns in an
/// order of their own.
pub fn recording(truth: &Truth, recorded: &Recorded, with_drag: bool) -> String {
    let (rig, column) = (&truth.rig, truth.column.as_deref());
    let mut habit = Draw::new(truth.seed, &[0x1066e5]);
    let (remarks, own_order) = (habit.chance(0.15), habit.chance(0.2));
    let written = &recorded.written;
    let s = &rig.sigmas;
    let decimals = |sigma: f64| (2.0 - sigma.log10()).ceil().clamp(0.0, 9.0) as usize;
    let mut columns: Vec<(&str, &[f64], usize)> = vec![
        (
            "wheel_speed_rad_s",
            &written.wheel,
            decimals(s.wheel_speed_rad_s),
        ),
        (
            "vehicle_speed_m_s",
            &written.speed,
            decimals(s.vehicle_speed_m_s),
        ),
    ];
    if with_drag {
        columns.push(("drag_force_n", &written.drag, decimals(s.drag_force_n)));
    }
    columns.push(("normal_force_n", &written.load, decimals(s.normal_force_n)));
    match rig.brake {
        BrakeColumn::None => {}
        BrakeColumn::Torque => columns.push((
            "brake_torque_nm",
            &written.brake,
            decimals(s.brake_torque_nm),
        )),
        BrakeColumn::Pressure => columns.push(("brake_pressure_pa", &written.brake, 0)),
    }
    let scaled: Vec<f64>;
    if let Some(name) = column {
        let (centre, span) = column_scale(name);
        scaled = written
            .column
            .iter()
            .map(|value| centre + span * value)
            .collect();
        columns.push((name, &scaled, decimals(0.01 * span)));
    }
    let mut text = String::with_capacity(written.time.len() * columns.len() * 10);
    if own_order {
        columns.rotate_left(2);
    }
    if remarks {
        let _ = writeln!(text, "# recorded at {} Hz", rig.rate_hz);
    }
    text.push_str("time_s");
    for (name, _, _) in &columns {
        text.push(',');
        text.push_str(name);
    }
    text.push('\n');
    for i in 0..written.time.len() {
        let _ = write!(text, "{:.6}", written.time[i]);
        for (_, values, decimals) in &columns {
            if values[i].is_finite() {
                let _ = write!(text, ",{:.*}", decimals, values[i]);
            } else {
                text.push(',');
            }
        }
        text.push('\n');
    }
    text
}

/// One column of a comma separated file.
pub fn read_column(path: &Path, header: &str) -> Result<Vec<f64>> {
    let text =
        fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let place = lines
        .next()
        .and_then(|line| line.split(',').position(|name| name.trim() == header));
    let Some(place) = place else {
        bail!("{} has no column {header}", path.display())
    };
    Ok(lines
        .map(|line| {
            line.split(',')
                .nth(place)
                .and_then(|cell| cell.trim().parse().ok())
                .unwrap_or(f64::NAN)
        })
        .collect())
}
