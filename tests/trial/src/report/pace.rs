//! How fast: six runs of 5,000 samples, and ten million samples, on two threads.
//!
//! The recordings are of this crate's own making: a lagging load cell over slip that cycles, white noise. What
//! they conceal does not matter here, only that there is something to find and to prove.

use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};

use crate::draw::Draw;
use crate::generate::tyre::law;
use crate::judge::headline::{Better, Headline, Unit};
use crate::process::{Cost, load, run};
use crate::share::quantile;
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
}

const SIX: &str = "six runs of 5,000 samples";
const TEN_MILLION: &str = "ten runs of 1,000,000 samples";
const GIB: f64 = 1024.0 * 1024.0 * 1024.0;

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
    number: usize,
) -> Result<Pace> {
    fs::create_dir_all(work).with_context(|| format!("cannot make {}", work.display()))?;
    let rig = work.join("rig.toml");
    fs::write(&rig, RIG)?;
    let mut draw = Draw::new(4, &[runs as u64, samples as u64, number as u64]);
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
    })
}

/// Measures so many campaigns of six runs, and ten million samples where asked for.
pub fn paces(tool: &Tool, work: &Path, six: usize, ten_million: bool) -> Result<Vec<Pace>> {
    let mut found = Vec::new();
    for number in 0..six {
        found.push(measure(tool, &work.join("six"), SIX, (6, 5000), number)?);
    }
    if ten_million {
        found.push(measure(
            tool,
            &work.join("ten-million"),
            TEN_MILLION,
            (10, 1_000_000),
            0,
        )?);
    }
    Ok(found)
}

/// The same as a table to print.
///
/// # Errors
/// Recordings that cannot be written, and a diagnosis that fails.
pub fn pace(tool: &Tool, work: &Path, six: usize, ten_million: bool) -> Result<String> {
    let found = paces(tool, work, six, ten_million)?;
    if let Some(complaint) = found.iter().find_map(|pace| pace.complaint.as_ref()) {
        bail!("{complaint}");
    }
    Ok(table(&found).text())
}

/// Wall times and memory beside their bars.
pub fn headlines(paces: &[Pace]) -> Vec<Headline> {
    let times = |what: &str| -> Vec<f64> {
        paces
            .iter()
            .filter(|pace| pace.what == what)
            .map(|pace| {
                if pace.complaint.is_some() {
                    f64::INFINITY
                } else {
                    pace.cost.wall_s
                }
            })
            .collect()
    };
    let seconds = |key: &str, what: String, bar: f64, values: &[f64], at: f64| Headline {
        unit: Unit::Seconds,
        ..Headline::quantile(key, &what, Better::Lower, Some(bar), values, at)
    };
    let six = times(SIX);
    let mut found = vec![
        seconds(
            "pace.median",
            format!("{SIX}, two threads: median"),
            1.5,
            &six,
            0.5,
        ),
        seconds(
            "pace.p95",
            "the same, 95th percentile".into(),
            3.0,
            &six,
            0.95,
        ),
        seconds("pace.worst", "the same, worst".into(), 6.0, &six, 1.0),
    ];
    let long = times(TEN_MILLION);
    if !long.is_empty() {
        found.push(seconds(
            "pace.long",
            format!("{TEN_MILLION}, two threads"),
            60.0,
            &long,
            0.5,
        ));
        let memory = paces
            .iter()
            .filter(|pace| pace.what == TEN_MILLION)
            .map(|pace| pace.cost.peak_bytes / GIB)
            .fold(0.0, f64::max);
        found.push(Headline::number(
            "pace.long_gib",
            "the same, peak memory, GiB",
            Better::Lower,
            Some(1.0),
            (memory, f64::NAN, f64::NAN),
            1,
        ));
    }
    found
}

/// The table of the pages.
pub fn table(paces: &[Pace]) -> Table {
    let mut table = Table::new(
        "Speed, two threads",
        &[
            "recordings",
            "n",
            "wall time, median",
            "processor time, median",
            "peak memory",
            "busy processes before",
        ],
    );
    for what in [SIX, TEN_MILLION] {
        let group: Vec<&Pace> = paces.iter().filter(|pace| pace.what == what).collect();
        if group.is_empty() {
            continue;
        }
        let middle = |value: &dyn Fn(&Pace) -> f64| {
            quantile(
                &group.iter().map(|pace| value(pace)).collect::<Vec<_>>(),
                0.5,
            )
        };
        table.row([
            what.to_owned(),
            group.len().to_string(),
            format!("{:.2} s", middle(&|pace| pace.cost.wall_s)),
            format!("{:.2} s", middle(&|pace| pace.cost.processor_s)),
            format!("{:.2} GiB", middle(&|pace| pace.cost.peak_bytes / GIB)),
            format!("{:.1}", middle(&|pace| pace.load.unwrap_or(f64::NAN))),
        ]);
    }
    table.note = Some(
        "Wall time means something only where nothing else was busy; processor time is what two threads used together."
            .to_owned(),
    );
    table
}
