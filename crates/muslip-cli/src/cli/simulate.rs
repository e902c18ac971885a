//! `muslip simulate`.

use std::path::{Path, PathBuf};

use clap::Args;
use host_sim::{ModelRunError, ReplayError, RigLaw, RunError, Scenario, replay};
use muslip_recordings::input_error::one_line;
use muslip_recordings::load;
use muslip_recordings::model_file::ModelFile;
use muslip_recordings::output::{OutputError, OutputFile};
use muslip_recordings::recording::{Channel, RecordingWriter, Required};
use muslip_recordings::rig_file::{self, RigFile};

use super::failure::Failure;
use super::mapping::Mapping;
use super::progress::Progress;
use super::terminal::Terminal;

/// Simulate a run of the rig and write the recording.
///
/// The brake is applied several times, each in a hydraulic ramp through the peak to a locked wheel and
/// release. Sensors have the noise of the rig file's [noise]; brake columns are written where it has a
/// [brake]. The same arguments give the same bytes.
///
/// With --model the run follows a repaired model of `diagnose`: base law, mechanisms and correction tables
/// give the drag, the mechanisms of wheel and vehicle act on them, and the sensors have the model's noise.
/// With --inputs all columns but the drag are taken from a recording; with --no-noise the drag is then the
/// prediction of `predict`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
muslip simulate --rig rig.toml --out run.csv\n  \
muslip simulate --rig rig.toml --law burckhardt:wet-asphalt --seed 7 --out run.csv\n  \
muslip simulate --rig rig.toml --law magic-formula:10,1.65,0.9,0.3 --speed 60 --out run.csv\n  \
muslip simulate --model found/model.toml --seed 7 --out run.csv\n  \
muslip simulate --model found/model.toml --inputs run3.csv --no-noise --out replayed.csv")]
pub(super) struct Arguments {
    /// Rig file (TOML); not needed with --model, which contains the rig.
    #[arg(long, value_name = "RIG.toml", required_unless_present = "model")]
    rig: Option<PathBuf>,
    /// Repaired model to simulate, as `diagnose` writes it.
    #[arg(long, value_name = "MODEL.toml", conflicts_with = "law")]
    model: Option<PathBuf>,
    /// Recording to take the inputs from; needs --model.
    #[arg(long, value_name = "RUN.csv", requires = "model",
        conflicts_with_all = ["speed", "normal_force", "applications", "duration", "rate_hz"])]
    inputs: Option<PathBuf>,
    #[command(flatten)]
    mapping: Mapping,
    /// Simulate sensors without noise.
    #[arg(long)]
    no_noise: bool,
    /// File for the recording.
    #[arg(long, value_name = "RUN.csv")]
    out: PathBuf,
    /// True tyre law: rudd:MUP,SP, burckhardt:SURFACE, burckhardt:C1,C2,C3 or magic-formula:B,C,D,E
    /// [default: the rig file's].
    #[arg(long)]
    law: Option<RigLaw>,
    /// Seed of the sensor noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Vehicle speed at the start in m/s [default: enough for the whole run; with --model the largest in
    /// its recordings].
    #[arg(long, value_name = "M/S", allow_negative_numbers = true)]
    speed: Option<f64>,
    /// Normal force in N [default: the weight of the rig file's mass; with --model the mean of
    /// its recordings].
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
    /// Rows per second [default: 500; with --model the rate of its recordings].
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    rate_hz: Option<f64>,
}

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    let rig = match &arguments.rig {
        Some(path) => Some(RigFile::read(path)?),
        None => None,
    };
    match (&arguments.model, rig) {
        (Some(path), rig) => {
            let model = ModelFile::read(path)?;
            if let (Some(path), Some(rig)) = (&arguments.rig, &rig) {
                model.check_rig(path, rig)?;
            }
            match &arguments.inputs {
                Some(inputs) => replayed(arguments, &model, inputs, terminal),
                None => under_model(arguments, &model, rig, terminal),
            }
        }
        (None, Some(rig)) => under_law(arguments, rig, terminal),
        // clap asks for one of the two.
        (None, None) => Err(Failure::Usage("--rig or --model is needed".into())),
    }
}

/// A scenario that cannot be simulated.
fn usage(error: &dyn std::error::Error) -> Failure {
    Failure::Usage(one_line(&error.to_string()))
}

impl Arguments {
    /// The scenario with what the command line says of it.
    fn apply(&self, scenario: &mut Scenario) {
        scenario.seed = self.seed;
        scenario.applications = self.applications;
        scenario.duration_s = self.duration;
        if let Some(rate_hz) = self.rate_hz {
            scenario.rate_hz = rate_hz;
        }
        if let Some(normal_force_n) = self.normal_force {
            scenario.normal_force_n = normal_force_n;
        }
    }
}

/// A run with a tyre law.
fn under_law(
    arguments: &Arguments,
    mut rig: RigFile,
    terminal: &mut Terminal,
) -> Result<(), Failure> {
    if arguments.no_noise {
        rig.noise.clear();
    }
    let mut scenario = Scenario::usual(rig, arguments.law).map_err(|error| usage(&error))?;
    arguments.apply(&mut scenario);
    scenario.speed_m_s = arguments
        .speed
        .unwrap_or_else(|| scenario.lasting_speed_m_s());
    scenario.check().map_err(|error| usage(&error))?;

    let out = &arguments.out;
    let written = |error| Failure::from(OutputError::new(out, error));
    let names = names(&scenario);
    let file = OutputFile::create(out)?;
    let mut origin = scenario.origin();
    if arguments.no_noise {
        origin.iter_mut().for_each(|line| *line += " --no-noise");
    }
    let mut writer = RecordingWriter::new(file, &origin, &names).map_err(written)?;
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

fn names(scenario: &Scenario) -> Vec<&'static str> {
    scenario
        .channels()
        .iter()
        .map(|&channel| Channel::name(channel))
        .collect()
}

/// A run in which a repaired model is true.
fn under_model(
    arguments: &Arguments,
    model: &ModelFile,
    rig: Option<RigFile>,
    terminal: &mut Terminal,
) -> Result<(), Failure> {
    let repaired = &model.repaired;
    let rig = rig.unwrap_or_else(|| rig_file::of_engine(&repaired.rig));
    let mut scenario = Scenario::of_model(rig, repaired).map_err(|error| usage(&error))?;
    arguments.apply(&mut scenario);
    if let Some(speed_m_s) = arguments.speed {
        scenario.speed_m_s = speed_m_s;
    }
    let out = &arguments.out;
    let file = OutputFile::create(out)?;
    let mut progress = Progress::new("simulate", scenario.rows());
    let rows = scenario
        .run_model(repaired, !arguments.no_noise, |rows| progress.done(rows))
        .map_err(|error| match error {
            ModelRunError::Scenario(error) => usage(&error),
            error => of_file(model.path(), &error),
        })?;
    drop(progress);
    let origin = format!(
        "simulated: muslip simulate --model {} --seed {} --speed {} --normal-force {} --applications {} --duration {} --rate-hz {}{}",
        model.path().display(),
        scenario.seed,
        scenario.speed_m_s,
        scenario.normal_force_n,
        scenario.applications,
        scenario.duration_s,
        scenario.rate_hz,
        if arguments.no_noise {
            " --no-noise"
        } else {
            ""
        }
    );
    write_exactly(file, out, origin, &names(&scenario), rows.iter().cloned())?;
    let columns: Vec<&str> = repaired
        .corrections
        .iter()
        .filter_map(|correction| correction.variable.strip_prefix("column:"))
        .collect();
    let left_out = if columns.is_empty() {
        String::new()
    } else {
        format!(
            "; without its dependence on {}: give a recording with that column as --inputs",
            columns.join(", ")
        )
    };
    terminal.line(&format!(
        "{}: {} rows simulated with the repaired model{left_out}",
        out.display(),
        rows.len()
    ))
}

/// A recording's inputs under a repaired model.
fn replayed(
    arguments: &Arguments,
    model: &ModelFile,
    inputs: &Path,
    terminal: &mut Terminal,
) -> Result<(), Failure> {
    let loaded = load::recording_mapped(
        inputs,
        Required::DragOptional,
        arguments.mapping.chosen(arguments.rig.as_deref())?.as_ref(),
    )?;
    let seed = (!arguments.no_noise).then_some(arguments.seed);
    let replay = replay(model, &loaded, seed).map_err(|error| match error {
        ReplayError::Model(error) => of_file(model.path(), &error),
        error @ ReplayError::Outside(_) => of_file(inputs, &error),
    })?;
    let origin = format!(
        "simulated: muslip simulate --model {} --inputs {} {}",
        model.path().display(),
        inputs.display(),
        seed.map_or("--no-noise".to_owned(), |seed| format!("--seed {seed}"))
    );
    let names: Vec<&str> = replay.names.iter().map(String::as_str).collect();
    let count = replay.columns.first().map_or(0, Vec::len);
    let rows = (0..count).map(|row| replay.columns.iter().map(|column| column[row]).collect());
    let out = &arguments.out;
    write_exactly(OutputFile::create(out)?, out, origin, &names, rows)?;
    let outside = match replay.outside {
        0 => String::new(),
        rows => format!("; {rows} of them extrapolated, outside the model's domain"),
    };
    terminal.line(&format!(
        "{}: {count} rows of {} simulated with the repaired model{outside}",
        out.display(),
        inputs.display()
    ))
}

fn of_file(path: &Path, error: &dyn std::error::Error) -> Failure {
    Failure::Usage(one_line(&format!("{}: {error}", path.display())))
}

/// Writes a recording with all digits: `predict` must find in it what the model was given.
fn write_exactly(
    file: OutputFile,
    out: &Path,
    origin: String,
    names: &[&str],
    rows: impl Iterator<Item = Vec<f64>>,
) -> Result<(), Failure> {
    let written = |error| Failure::from(OutputError::new(out, error));
    let mut writer = RecordingWriter::new(file, &[origin], names)
        .map_err(written)?
        .exact();
    for row in rows {
        writer.row(&row).map_err(written)?;
    }
    writer.into_inner().commit()?;
    Ok(())
}
