//! `muslip predict`.

use std::path::PathBuf;

use clap::Args;
use muslip_diagnose::repaired::Which;

use super::Failure;
use super::terminal::Terminal;
use crate::diagnose::load;
use crate::diagnose::model_file::ModelFile;
use crate::diagnose::predict::{predict, write};
use crate::output::{OutputError, OutputFile};
use crate::recording::Required;
use crate::rig_file::RigFile;

/// Predict the drag reading of a recording from its other columns, by a repaired model.
///
/// Writes time_s,drag_force_n,drag_force_sigma_n,contact_force_n, one row a row of the recording:
/// what the load cell is expected to read (the measuring chain's effects included), its 1-sigma noise,
/// and the force in the contact. The recording's own drag_force_n is never used and may be absent.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
muslip predict --rig rig.toml --model found/model.toml --out pred.csv run7.csv\n  \
muslip predict --rig rig.toml --model found/model.toml --base --out base.csv run7.csv")]
pub(super) struct Arguments {
    /// Rig file (TOML): that of the model; radius, inertia, mass and brake must be equal.
    #[arg(long, value_name = "RIG.toml")]
    rig: PathBuf,
    /// Repaired model, as `diagnose` writes it.
    #[arg(long, value_name = "MODEL.toml")]
    model: PathBuf,
    /// Where the prediction goes.
    #[arg(long, value_name = "PRED.csv")]
    out: PathBuf,
    /// Predict by the unrepaired base law, refitted.
    #[arg(long)]
    base: bool,
    /// The recording (CSV).
    #[arg(value_name = "RUN.csv")]
    recording: PathBuf,
}

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    let rig = RigFile::read(&arguments.rig)?;
    let model = ModelFile::read(&arguments.model)?;
    model.check_rig(&arguments.rig, &rig)?;
    let loaded = load::recording(&arguments.recording, Required::DragOptional)?;
    let which = if arguments.base {
        Which::Base
    } else {
        Which::Repaired
    };
    let prediction = predict(&model, &loaded, which)
        .map_err(|error| Failure::Usage(format!("{}: {error}", arguments.model.display())))?;
    let out = &arguments.out;
    let mut file = OutputFile::create(out)?;
    write(&mut file, &prediction).map_err(|error| OutputError::new(out, error))?;
    file.commit()?;
    let model = if arguments.base {
        "base law"
    } else {
        "repaired model"
    };
    terminal.line(&format!(
        "{}: {} rows predicted by the {model}",
        out.display(),
        prediction.time_s.len()
    ))
}
