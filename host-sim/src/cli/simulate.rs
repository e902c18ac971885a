//! `muslip simulate`.

use std::path::PathBuf;

use clap::Args;

use super::Failure;
use super::progress::Progress;
use super::terminal::Terminal;
use crate::input_error::one_line;
use crate::output::{OutputError, OutputFile};
use crate::recording::{Channel, RecordingWriter};
use crate::rig_file::RigFile;
use crate::simulate::{RigLaw, RunError, Scenario};

/// Simulate a run of the rig and write the recording.
///
/// The brake is applied several times, each in a hydraulic ramp through the peak to a locked wheel and
/// release. Sensors have the noise of the rig file's [noise]; brake columns are written where it has a
/// [brake]. The same arguments give the same bytes.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
muslip simulate --rig rig.toml --out run.csv\n  \
muslip simulate --rig rig.toml --law burckhardt:wet-asphalt --seed 7 --out run.csv\n  \
muslip simulate --rig rig.toml --law magic-formula:10,1.65,0.9,0.3 --speed 60 --out run.csv")]
pub(super) struct Arguments {
    /// Rig file (TOML).
    #[arg(long, value_name = "RIG.toml")]
    rig: PathBuf,
    /// Where the recording goes.
    #[arg(long, value_name = "RUN.csv")]
    out: PathBuf,
    /// True tyre law: rudd:MUP,SP, burckhardt:SURFACE, burckhardt:C1,C2,C3 or magic-formula:B,C,D,E
    /// [default: the rig file's].
    #[arg(long)]
    law: Option<RigLaw>,
    /// Seed of the sensors' noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Vehicle speed at the start in m/s [default: enough for the whole run].
    #[arg(long, value_name = "M/S", allow_negative_numbers = true)]
    speed: Option<f64>,
    /// Normal force in N [default: the weight of the rig file's mass].
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    normal_force: Option<f64>,
    /// Brake applications.
    #[arg(long, value_name = "N", default_value_t = 3)]
    applications: u32,
    /// Length of the run in s.
    #[arg(
        long,
        value_name = "S",
        allow_negative_numbers = true,
        default_value_t = 4.0
    )]
    duration: f64,
    /// Rows a second.
    #[arg(
        long,
        value_name = "HZ",
        allow_negative_numbers = true,
        default_value_t = 500.0
    )]
    rate_hz: f64,
}

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    let usage = |error: &dyn std::error::Error| Failure::Usage(one_line(&error.to_string()));
    let rig = RigFile::read(&arguments.rig)?;
    let mut scenario = Scenario::usual(rig, arguments.law).map_err(|error| usage(&error))?;
    scenario.seed = arguments.seed;
    scenario.applications = arguments.applications;
    scenario.duration_s = arguments.duration;
    scenario.rate_hz = arguments.rate_hz;
    if let Some(normal_force_n) = arguments.normal_force {
        scenario.normal_force_n = normal_force_n;
    }
    scenario.speed_m_s = arguments
        .speed
        .unwrap_or_else(|| scenario.lasting_speed_m_s());
    scenario.check().map_err(|error| usage(&error))?;

    let out = &arguments.out;
    let written = |error| Failure::from(OutputError::new(out, error));
    let names: Vec<&str> = scenario
        .channels()
        .iter()
        .map(|&channel| Channel::name(channel))
        .collect();
    let file = OutputFile::create(out)?;
    let mut writer = RecordingWriter::new(file, &scenario.origin(), &names).map_err(written)?;
    let mut progress = Progress::new("simulate", scenario.rows());
    let mut rows = 0;
    let outcome = scenario.run(|row| {
        rows += 1;
        if rows % 1024 == 0 {
            progress.done(rows);
        }
        writer.row(row)
    });
    drop(progress);
    outcome.map_err(|error| match error {
        RunError::Write(error) => written(error),
        RunError::Scenario(error) => usage(&error),
    })?;
    writer.into_inner().commit()?;
    terminal.line(&format!(
        "{}: {rows} rows, law {}",
        out.display(),
        scenario.law
    ))
}
