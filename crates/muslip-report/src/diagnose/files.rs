//! The files of a diagnosis: made together or not at all.

use std::io::Write as _;
use std::path::Path;

use muslip_analysis::diagnose::wording::verdict_sentence;
use muslip_analysis::diagnose::{job, json};
use muslip_diagnose::outcome::Diagnosis;
use muslip_recordings::load::Campaign;
use muslip_recordings::model_file;
use muslip_recordings::output::{OutputError, OutputFile, create_folder};

use super::page;
use super::views::{Kept, Views};
use crate::page::ReportError;

/// Names of the files, in the order in which they appear.
pub const FILES: [&str; 3] = ["diagnosis.json", "model.toml", "report.html"];

/// Files that could not be made.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The folder or a file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The report could not be drawn.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// The diagnosis could not be put into words for machines.
    #[error("the diagnosis could not be written as text: {0}")]
    Text(String),
}

/// Runs the engine on a campaign, which is given up to it but for what the report shows.
#[must_use]
pub fn diagnosed(campaign: Campaign, progress: &(dyn Fn(f64, &str) + Sync)) -> (Diagnosis, Views) {
    let kept = Kept::of(&campaign.runs);
    let diagnosis = job::run(campaign, progress);
    let views = Views::of(&diagnosis, &kept);
    (diagnosis, views)
}

/// Makes the folder, and finds out whether it can be written, before the work is done.
///
/// # Errors
/// [`OutputError`] naming the folder or the file.
pub fn prepare_folder(out: &Path) -> Result<(), OutputError> {
    create_folder(out)?;
    for name in FILES {
        // Dropped without a commit, it leaves no trace.
        drop(OutputFile::create(&out.join(name))?);
    }
    Ok(())
}

/// Writes the files of a diagnosis: all of them are complete before the first takes its name. `command`
/// is what made them. Returns the text of `diagnosis.json`.
///
/// # Errors
/// [`WriteError`]; files that were there before are then still what they were.
pub fn write(
    out: &Path,
    diagnosis: &Diagnosis,
    views: &Views,
    command: &str,
) -> Result<String, WriteError> {
    let text = json::to_text(diagnosis).map_err(|error| WriteError::Text(error.to_string()))?;
    let model = model_file::to_text(&diagnosis.repaired, &verdict_sentence(diagnosis))
        .map_err(|error| WriteError::Text(error.to_string()))?;
    let report = page::report(diagnosis, views, command).to_html()?;
    create_folder(out)?;
    let mut files = Vec::with_capacity(FILES.len());
    for (name, contents) in FILES.into_iter().zip([&text, &model, &report]) {
        let path = out.join(name);
        let mut file = OutputFile::create(&path)?;
        file.write_all(contents.as_bytes())
            .and_then(|()| file.flush())
            .map_err(|error| OutputError::new(&path, error))?;
        files.push(file);
    }
    for file in files {
        file.commit()?;
    }
    Ok(text)
}
