//! How fast: six runs of 5,000 samples, and ten million samples, on two threads.
//!
//! The recordings are of this crate's own making: a lagging load cell over slip that cycles, white noise. What
//! they conceal does not matter here, only that there is something to find and to prove.

use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

use crate::draw::Draw;
use crate::generate::tyre::law;
use crate::process::{Cost, load, run};
use crate::table::Table;
use crate::tool::{PATIENCE, Tool};

/// What one size took.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Pace {
    pub what: String,
    pub cost: Cost,
    /// Busy processes before the start, where the system tells.
    pub load: Option<f64>,
    pub complaint: Option<String>,
    /// Bars: wall time in s, peak memory in bytes.
    pub bars: (f64, Option<f64>),
}

const RIG: &str = "[wheel]\nradius_m = 0.3\ninertia_kg_m2 = 1.1\n\n[vehicle]\nmass_kg = 400.0\ncoasting = false\n\n\
                   [tyre]\nlaw = \"rudd\"\npeak_friction = 0.8\ncritical_slip = 0.12\n";

/// Writes one run of so many samples at 1 kHz.
fn write_run(path: &Path, samples: usize, draw: &mut Draw) -> Result<()> {
    let mut file = BufWriter::with_capacity(1 << 20, File::create(path)?);
    writeln!(
        file,
        "time_s,wheel_speed_rad_s,vehicle_speed_m_s,drag_force_n,normal_force_n"
    )?;
    let (dt, lag) = (1e-3, 0.012);
    let (mean_speed, mean_load) = (draw.between(12.0, 28.0), draw.between(2500.0, 4500.0));
    let (period, bounce) = (draw.between(0.7, 1.3), draw.between(1.0, 2.5));
    let mut reading = 0.0;
    let mut white = || draw.normal();
    for k in 0..samples {
        let time = dt * k as f64;
        let speed = mean_speed * (1.0 + 0.15 * (0.11 * time).sin());
        let load = mean_load * (1.0 + 0.12 * (std::f64::consts::TAU * bounce * time).sin());
        let slip = 0.25 * (std::f64::consts::PI * time / period).sin().powi(2);
        let force = load * 0.83 * law(slip / 0.11);
        reading += dt / lag * (force - reading);
        writeln!(
            file,
            "{time:.3},{:.3},{:.4},{:.1},{:.1}",
            speed * (1.0 - slip) / 0.3 + 0.08 * white(),
            speed + 0.01 * white(),
            reading + 40.0 * white(),
            load + 15.0 * white()
        )?;
    }
    file.flush()?;
    Ok(())
}

fn measure(
    tool: &Tool,
    work: &Path,
    what: &str,
    (runs, samples): (usize, usize),
    bars: (f64, Option<f64>),
) -> Result<Pace> {
    fs::create_dir_all(work).with_context(|| format!("cannot make {}", work.display()))?;
    let rig = work.join("rig.toml");
    fs::write(&rig, RIG)?;
    let mut draw = Draw::new(4, &[runs as u64, samples as u64]);
    let mut files: Vec<PathBuf> = Vec::new();
    for number in 0..runs {
        let path = work.join(format!("run{number:02}.csv"));
        write_run(&path, samples, &mut draw)?;
        files.push(path);
    }
    let load = load();
    let mut command = Command::new(&tool.path);
    command
        .arg("diagnose")
        .arg("--rig")
        .arg(&rig)
        .arg("--out")
        .arg(work.join("found"))
        .args(&files);
    let (cost, outcome) = run(command, 2, PATIENCE, &work.join("diagnose.log"));
    for path in files {
        fs::remove_file(&path).with_context(|| format!("cannot remove {}", path.display()))?;
    }
    Ok(Pace {
        what: what.to_owned(),
        cost,
        load,
        complaint: outcome.err(),
        bars,
    })
}

/// Measures six runs, and ten million samples where asked for.
pub fn paces(tool: &Tool, work: &Path, ten_million: bool) -> Result<Vec<Pace>> {
    let mut found = vec![measure(
        tool,
        &work.join("six"),
        "six runs of 5,000 samples",
        (6, 5000),
        (2.0, None),
    )?];
    if ten_million {
        found.push(measure(
            tool,
            &work.join("ten-million"),
            "ten runs of 1,000,000 samples",
            (10, 1_000_000),
            (60.0, Some(1024.0 * 1024.0 * 1024.0)),
        )?);
    }
    Ok(found)
}

/// The table of the pages.
pub fn table(paces: &[Pace]) -> Table {
    let mut table = Table::new(
        "Speed, two threads",
        &[
            "recordings",
            "bar",
            "wall time",
            "processor time",
            "peak memory",
            "busy processes before",
            "met",
        ],
    );
    for pace in paces {
        let gib = 1024.0 * 1024.0 * 1024.0;
        let (wall, memory) = pace.bars;
        let met = pace.complaint.is_none()
            && pace.cost.wall_s <= wall
            && memory.is_none_or(|memory| pace.cost.peak_bytes <= memory);
        table.row([
            pace.what.clone(),
            format!(
                "<= {wall} s{}",
                memory.map_or_else(String::new, |m| format!(", <= {} GiB", m / gib))
            ),
            format!("{:.2} s", pace.cost.wall_s),
            format!("{:.2} s", pace.cost.processor_s),
            format!("{:.2} GiB", pace.cost.peak_bytes / gib),
            pace.load
                .map_or_else(|| "-".to_owned(), |load| format!("{load:.1}")),
            match &pace.complaint {
                Some(complaint) => format!("**missed**: {complaint}"),
                None if met => "met".to_owned(),
                None => "**missed**".to_owned(),
            },
        ]);
    }
    table.note = Some(
        "Wall time means something only where nothing else was busy; processor time is what two threads used together."
            .to_owned(),
    );
    table
}
