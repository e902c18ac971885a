//! The tool under trial, run as a user runs it: by its command line and its files.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Longest that one call may take.
const PATIENCE: Duration = Duration::from_secs(180);

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
    /// Seconds that `diagnose` took on one thread.
    pub seconds: f64,
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
        let begin = Instant::now();
        match call(command, &out.join("diagnose.log")) {
            Ok(()) => {}
            Err(complaint) => answer.complaints.push(format!("diagnose: {complaint}")),
        }
        answer.seconds = begin.elapsed().as_secs_f64();
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
                let mut command = Command::new(&self.path);
                command
                    .arg("predict")
                    .arg("--rig")
                    .arg(&rig)
                    .arg("--model")
                    .arg(out.join("model.toml"))
                    .arg("--out")
                    .arg(&target);
                if base {
                    command.arg("--base");
                }
                command.arg(&fresh);
                let answered = call(command, &out.join("predict.log")).and_then(|()| {
                    crate::files::read_column(&target, "drag_force_n").map_err(|e| e.to_string())
                });
                if let Err(complaint) = answered {
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

/// Runs a command on one thread, its words going to a log; the error is what to tell.
fn call(mut command: Command, log: &Path) -> std::result::Result<(), String> {
    let file = File::create(log).map_err(|e| e.to_string())?;
    let copy = file.try_clone().map_err(|e| e.to_string())?;
    let mut child = command
        .env("RAYON_NUM_THREADS", "1")
        .stdin(Stdio::null())
        .stdout(Stdio::from(copy))
        .stderr(Stdio::from(file))
        .spawn()
        .map_err(|e| format!("cannot start: {e}"))?;
    let begin = Instant::now();
    loop {
        match child.try_wait() {
            Ok(Some(status)) if status.success() => return Ok(()),
            Ok(Some(status)) => {
                let words = fs::read_to_string(log).unwrap_or_default();
                let line = words
                    .lines()
                    .rfind(|line| !line.trim().is_empty())
                    .unwrap_or("")
                    .to_owned();
                return Err(format!("{status}: {line}"));
            }
            Ok(None) if begin.elapsed() > PATIENCE => {
                let _ = child.kill();
                let _ = child.wait();
                return Err(format!("still busy after {} s", PATIENCE.as_secs()));
            }
            Ok(None) => std::thread::sleep(Duration::from_millis(4)),
            Err(error) => return Err(error.to_string()),
        }
    }
}
