//! Prints what the audit says of every campaign in a folder: `audit FOLDER`, one line a finding, tab-separated.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};
use std::time::Instant;

use muslip_diagnose::audit::audit;
use muslip_diagnose::campaign::{Rig, Run};

/// Value of a key in a rig file; keys are unique but for the sections' noise, which the audit does not use.
fn value(text: &str, key: &str) -> Option<f64> {
    text.lines().find_map(|line| {
        line.strip_prefix(key)?
            .trim_start()
            .strip_prefix('=')?
            .trim()
            .parse()
            .ok()
    })
}

fn rig(path: &Path) -> Rig {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let figure = |key: &str| value(&text, key).unwrap_or(0.0);
    Rig {
        radius_m: figure("radius_m"),
        wheel_inertia_kg_m2: figure("inertia_kg_m2"),
        mass_kg: figure("mass_kg"),
        coasting: text.contains("coasting = true"),
        torque_per_pressure_nm_pa: value(&text, "torque_per_pressure_nm_pa"),
        peak_friction: figure("peak_friction"),
        critical_slip: figure("critical_slip"),
        ..Rig::default()
    }
}

fn run(path: &Path) -> Run {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let header: Vec<&str> = lines.next().unwrap_or("").split(',').collect();
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); header.len()];
    for line in lines {
        for (column, cell) in columns.iter_mut().zip(line.split(',')) {
            column.push(cell.trim().parse().unwrap_or(f64::NAN));
        }
    }
    let mut out = Run {
        name: path
            .file_name()
            .map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
        ..Run::default()
    };
    for (name, column) in header.iter().zip(columns) {
        match *name {
            "time_s" => out.time_s = column,
            "wheel_speed_rad_s" => out.wheel_speed_rad_s = column,
            "vehicle_speed_m_s" => out.vehicle_speed_m_s = column,
            "drag_force_n" => out.drag_force_n = column,
            "normal_force_n" => out.normal_force_n = column,
            "brake_torque_nm" => out.brake_torque_nm = Some(column),
            "brake_pressure_pa" => out.brake_pressure_pa = Some(column),
            other => out.extra.push((other.to_owned(), column)),
        }
    }
    out
}

fn sorted(folder: &Path, prefix: &str) -> Vec<PathBuf> {
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            path.file_name()
                .is_some_and(|n| n.to_string_lossy().starts_with(prefix))
        })
        .collect();
    paths.sort();
    paths
}

fn main() {
    let folder = std::env::args().nth(1).unwrap_or_default();
    for campaign in sorted(Path::new(&folder), "campaign-") {
        let rig = rig(&campaign.join("rig.toml"));
        let runs: Vec<Run> = sorted(&campaign, "run")
            .iter()
            .map(|path| run(path))
            .collect();
        let samples: usize = runs.iter().map(Run::len).sum();
        let name = campaign
            .file_name()
            .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let clock = Instant::now();
        let found = audit(&rig, &runs);
        println!(
            "{name}\ttook\t{}\t{:.4}\t{samples}",
            runs.len(),
            clock.elapsed().as_secs_f64()
        );
        for (what, late) in [
            ("wheel", found.wheel_late),
            ("vehicle", found.vehicle_late),
            ("brake", found.brake_late),
        ] {
            println!("{name}\ttiming\t{what}\t{}\t{}", late.value, late.std);
        }
        for (balance, estimate) in ["vehicle", "wheel", "law"]
            .iter()
            .zip(&found.timings.estimates)
        {
            if let Some(e) = estimate {
                let figures: Vec<String> = e
                    .unknowns
                    .iter()
                    .zip(&e.std)
                    .map(|(x, s)| format!("{x:.5}+-{s:.5}"))
                    .collect();
                println!(
                    "{name}\tbalance\t{balance}\t{}\t{}",
                    figures.join(" "),
                    e.rows
                );
            }
        }
        for f in &found.findings {
            let word = format!("{:?}", f.finding);
            println!(
                "{name}\tfinding\t{}:{word}\t{}\t{}",
                f.channel, f.value, f.std
            );
        }
    }
}
