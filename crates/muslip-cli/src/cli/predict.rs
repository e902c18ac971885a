//! `muslip predict`.

use std::path::{Path, PathBuf};

use clap::Args;
use muslip_analysis::diagnose::predict::{predict, write};
use muslip_diagnose::proof::Proof;
use muslip_diagnose::repaired::{RepairedError, Which};
use muslip_recordings::load;
use muslip_recordings::model_file::ModelFile;
use muslip_recordings::output::{OutputError, OutputFile};
use muslip_recordings::recording::Required;
use muslip_recordings::rig_file::RigFile;
use serde::Serialize;

use super::failure::Failure;
use super::mapping::Mapping;
use super::terminal::Terminal;

/// Predict the drag reading of a recording from its other columns with a repaired model.
///
/// Writes time_s,drag_force_n,drag_force_sigma_n,contact_force_n, one row per row of the
/// recording: the expected reading of the load cell (with the effects of the measuring chain), its 1-sigma
/// noise, and the force in the contact. The recording's own drag_force_n is not used and may be absent.
///
/// With --score the drag predicted by the base law and by the repaired model is compared with the recorded
/// one. For all recordings that the model was fitted to, the scores equal `fit` in diagnosis.json to within
/// rounding.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
muslip predict --rig rig.toml --model found/model.toml --out pred.csv run7.csv\n  \
muslip predict --rig rig.toml --model found/model.toml --base --out base.csv run7.csv\n  \
muslip predict --rig rig.toml --model found/model.toml --score run1.csv run2.csv run3.csv")]
pub(super) struct Arguments {
    /// Rig file (TOML); radius, inertia, mass and brake must equal the model's.
    #[arg(long, value_name = "RIG.toml")]
    rig: PathBuf,
    #[command(flatten)]
    mapping: Mapping,
    /// Repaired model, as `diagnose` writes it.
    #[arg(long, value_name = "MODEL.toml")]
    model: PathBuf,
    /// File for the prediction.
    #[arg(long, value_name = "PRED.csv", required_unless_present = "score")]
    out: Option<PathBuf>,
    /// Predict with the refitted base law instead of the repaired model.
    #[arg(long)]
    base: bool,
    /// Print how well both models predict these recordings, as one JSON object and nothing else: root mean
    /// square error, negative log likelihood per sample and whiteness, for fitted, held-out and new
    /// recordings.
    #[arg(long, conflicts_with_all = ["out", "base"])]
    score: bool,
    /// The recording (CSV, or any format that `muslip channels` lists); several with --score.
    #[arg(value_name = "RUN.csv", required = true)]
    recordings: Vec<PathBuf>,
}

/// What `--score` prints.
#[derive(Serialize)]
struct Score<'a> {
    schema: &'static str,
    model: String,
    recordings: &'a [PathBuf],
    #[serde(flatten)]
    proof: Proof,
}

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    let rig = RigFile::read(&arguments.rig)?;
    let model = ModelFile::read(&arguments.model)?;
    model.check_rig(&arguments.rig, &rig)?;
    let map = arguments.mapping.chosen(Some(&arguments.rig))?;
    let unusable =
        |error: RepairedError| Failure::Usage(format!("{}: {error}", arguments.model.display()));
    if arguments.score {
        let runs = arguments
            .recordings
            .iter()
            .map(|path| {
                load::recording_mapped(path, Required::DragIncluded, map.as_ref())
                    .map(|loaded| loaded.run)
            })
            .collect::<Result<Vec<_>, _>>()?;
        let score = Score {
            schema: "muslip.score/1",
            model: arguments.model.display().to_string(),
            recordings: &arguments.recordings,
            proof: model.repaired.prove(&runs).map_err(unusable)?,
        };
        let text = serde_json::to_string_pretty(&score)
            .map_err(|error| Failure::Internal(error.to_string()))?;
        return terminal.line(&text);
    }
    let [recording] = arguments.recordings.as_slice() else {
        return Err(Failure::Usage(
            "give one recording, or --score for several".into(),
        ));
    };
    let out: &Path = arguments.out.as_deref().unwrap_or(Path::new(""));
    let loaded = load::recording_mapped(recording, Required::DragOptional, map.as_ref())?;
    let which = if arguments.base {
        Which::Base
    } else {
        Which::Repaired
    };
    let prediction = predict(&model, &loaded, which).map_err(unusable)?;
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
