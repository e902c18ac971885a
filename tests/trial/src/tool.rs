//! The tool under trial, run as a user runs it: by its command line and its files.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::generate::files::read_column;
use crate::process::{Cost, run};

/// Longest that one call may take.
pub const PATIENCE: Duration = Duration::from_secs(600);

/// How to call the tool.
#[derive(Clone, Debug)]
pub struct Tool {
    /// The `muslip` binary.
    pub path: PathBuf,
    /// Further arguments to `diagnose`, for baselines and ablations.
    pub diagnose_arguments: Vec<String>,
}

/// What the tool answered for one campaign.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Answer {
    /// `diagnosis.json`, null where there is none.
    pub diagnosis: Value,
    /// What `diagnose` took on one thread.
    pub cost: Cost,
    /// Samples in the recordings that it read.
    pub samples: usize,
    /// What was wrong with the call or with the file that it wrote.
    pub complaints: Vec<String>,
    /// Predictions of each fresh run: repaired and base.
    pub predictions: Vec<Prediction>,
}

/// Where the predictions of one fresh run lie; no file where the tool failed.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Prediction {
    pub file: String,
    pub repaired: PathBuf,
    pub base: PathBuf,
}

impl Tool {
    /// Why the tool does not take its further arguments at all, if so.
    ///
    /// # Errors
    /// Where the scratch directory cannot be written.
    pub fn refusal(&self, work: &Path) -> Result<Option<String>> {
        fs::create_dir_all(work).with_context(|| format!("cannot make {}", work.display()))?;
        let mut command = Command::new(&self.path);
        command
            .args([
                "diagnose",
                "--rig",
                "/nonexistent/rig.toml",
                "--out",
                "/nonexistent/out",
            ])
            .args(&self.diagnose_arguments)
            .arg("/nonexistent/run.csv");
        let (_, outcome) = run(command, 1, PATIENCE, &work.join("refusal.log"));
        // One that takes the arguments complains of the files that are not there.
        Ok(outcome
            .err()
            .filter(|why| !why.contains("nonexistent"))
            .map(|why| {
                let why = why.split(" For more information").next().unwrap_or("");
                format!("not taken: {why}")
            }))
    }

    /// Diagnoses a campaign and predicts its fresh runs; the sealed truth is not looked at.
    ///
    /// # Errors
    /// Where a directory cannot be read or written; what the tool does wrong is in the answer.
    pub fn answer(&self, campaigns: &Path, name: &str, results: &Path) -> Result<Answer> {
        let open = campaigns.join(name);
        let out = results.join(name);
        if out.exists() {
            fs::remove_dir_all(&out).with_context(|| format!("cannot clear {}", out.display()))?;
        }
        fs::create_dir_all(&out).with_context(|| format!("cannot make {}", out.display()))?;
        let mut answer = Answer::default();
        let runs = recordings(&open)?;
        answer.samples = runs
            .iter()
            .filter_map(|run| fs::read_to_string(run).ok())
            .map(|text| text.lines().count().saturating_sub(1))
            .sum();
        let rig = open.join("rig.toml");
        let mut command = Command::new(&self.path);
        command
            .arg("diagnose")
            .arg("--rig")
            .arg(&rig)
            .arg("--out")
            .arg(&out)
            .args(&self.diagnose_arguments)
            .args(&runs);
        let (cost, outcome) = run(command, 1, PATIENCE, &out.join("diagnose.log"));
        if let Err(complaint) = outcome {
            answer.complaints.push(format!("diagnose: {complaint}"));
        }
        answer.cost = cost;
        match fs::read_to_string(out.join("diagnosis.json"))
            .map_err(|e| e.to_string())
            .and_then(|text| serde_json::from_str::<Value>(&text).map_err(|e| e.to_string()))
        {
            Ok(diagnosis) => {
                answer
                    .complaints
                    .extend(crate::contract::complaints(&diagnosis));
                answer.diagnosis = diagnosis;
            }
            Err(complaint) => answer
                .complaints
                .push(format!("diagnosis.json: {complaint}")),
        }
        for fresh in recordings(&campaigns.join("fresh").join(name))? {
            let file = fresh
                .file_name()
                .and_then(|name| name.to_str())
                .unwrap_or("")
                .to_owned();
            let mut predict = |base: bool| -> PathBuf {
                let target = out.join(format!("{}-{file}", if base { "base" } else { "repaired" }));
                if let Err(complaint) = self.predict(&rig, &out, &fresh, &target, base) {
                    answer
                        .complaints
                        .push(format!("predict {file}: {complaint}"));
                }
                target
            };
            let (repaired, base) = (predict(false), predict(true));
            answer.predictions.push(Prediction {
                file,
                repaired,
                base,
            });
        }
        Ok(answer)
    }

    /// Predicts the drag of a run by the model in `out`, repaired or not, into `target`.
    ///
    /// # Errors
    /// What the tool complained of, or why its answer cannot be read.
    pub fn predict(
        &self,
        rig: &Path,
        out: &Path,
        fresh: &Path,
        target: &Path,
        base: bool,
    ) -> Result<Vec<f64>, String> {
        let mut command = Command::new(&self.path);
        command
            .arg("predict")
            .arg("--rig")
            .arg(rig)
            .arg("--model")
            .arg(out.join("model.toml"))
            .arg("--out")
            .arg(target);
        if base {
            command.arg("--base");
        }
        command.arg(fresh);
        run(command, 1, PATIENCE, &out.join("predict.log")).1?;
        read_column(target, "drag_force_n").map_err(|e| e.to_string())
    }
}

fn recordings(directory: &Path) -> Result<Vec<PathBuf>> {
    let mut found: Vec<PathBuf> = fs::read_dir(directory)
        .with_context(|| format!("cannot list {}", directory.display()))?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "csv"))
        .collect();
    found.sort();
    Ok(found)
}
