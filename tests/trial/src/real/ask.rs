//! Calls to the tool, each kept under the hash of the tool, of its arguments and of all that it reads.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::contract::complaints;
use crate::process::run;
use crate::tool::{PATIENCE, Tool};

/// The tool, with a folder for what it answered.
pub(super) struct Ask<'a> {
    pub(super) tool: &'a Tool,
    /// Hash of the program.
    pub(super) program: &'a str,
    pub(super) answers: PathBuf,
}

/// A diagnosis, and the folder that the tool wrote.
#[derive(Clone, Debug, Default)]
pub(super) struct Answer {
    pub(super) value: Value,
    pub(super) folder: PathBuf,
}

impl Ask<'_> {
    /// Diagnoses recordings, or takes up what an earlier call answered.
    pub(super) fn diagnose(&self, rig: &Path, runs: &[PathBuf]) -> Result<Answer> {
        let folder = self.folder("diagnose", rig, runs)?;
        let failed = |why: String, folder: &Path| Answer {
            value: json!({ "verdict": format!("({why})") }),
            folder: folder.to_owned(),
        };
        if !folder.join("done").exists() {
            let mut command = Command::new(&self.tool.path);
            command
                .arg("diagnose")
                .arg("--rig")
                .arg(rig)
                .arg("--out")
                .arg(&folder);
            command.args(&self.tool.diagnose_arguments).args(runs);
            if let Err(why) = run(command, 1, PATIENCE, &folder.join("diagnose.log")).1 {
                return Ok(failed(why, &folder));
            }
            fs::write(folder.join("done"), "")?;
        }
        let value: Value =
            serde_json::from_str(&fs::read_to_string(folder.join("diagnosis.json"))?)?;
        if let Some(complaint) = complaints(&value).into_iter().next() {
            return Ok(failed(complaint, &folder));
        }
        Ok(Answer { value, folder })
    }

    /// Drag of a run as a diagnosis' model predicts it, repaired or not; none where the tool fails.
    pub(super) fn predict(
        &self,
        answer: &Answer,
        rig: &Path,
        fresh: &Path,
        base: bool,
    ) -> Option<Vec<f64>> {
        let name = fresh.file_stem().and_then(|name| name.to_str())?;
        let target = answer.folder.join(format!(
            "{}-{name}.csv",
            if base { "base" } else { "repaired" }
        ));
        self.tool
            .predict(rig, &answer.folder, fresh, &target, base)
            .ok()
    }

    /// What a command says of one run as one JSON object; null where it fails.
    pub(super) fn object(&self, command: &str, rig: &Path, recording: &Path) -> Result<Value> {
        let folder = self.folder(command, rig, &[recording.to_owned()])?;
        let log = folder.join("words.json");
        if !folder.join("done").exists() {
            let mut call = Command::new(&self.tool.path);
            call.args([command, "--json", "--rig"])
                .arg(rig)
                .arg(recording);
            if run(call, 1, PATIENCE, &log).1.is_err() {
                return Ok(Value::Null);
            }
            fs::write(folder.join("done"), "")?;
        }
        Ok(serde_json::from_str(&fs::read_to_string(&log)?).unwrap_or(Value::Null))
    }

    /// Where the answer to one call lies.
    fn folder(&self, command: &str, rig: &Path, runs: &[PathBuf]) -> Result<PathBuf> {
        let mut hash = Sha256::new();
        for part in [self.program, command] {
            hash.update(part.as_bytes());
            hash.update([0]);
        }
        for argument in &self.tool.diagnose_arguments {
            hash.update(argument.as_bytes());
            hash.update([0]);
        }
        for path in std::iter::once(rig).chain(runs.iter().map(PathBuf::as_path)) {
            let name = path.file_name().and_then(|name| name.to_str());
            hash.update(name.unwrap_or("").as_bytes());
            hash.update([0]);
            let bytes =
                fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
            hash.update((bytes.len() as u64).to_le_bytes());
            hash.update(&bytes);
        }
        let key: String = hash
            .finalize()
            .iter()
            .take(10)
            .map(|byte| format!("{byte:02x}"))
            .collect();
        let folder = self.answers.join(key);
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        Ok(folder)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_belongs_to_one_tool_one_rig_and_these_recordings() {
        let directory = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = directory.path().join(name);
            fs::write(&path, text).unwrap();
            path
        };
        let (rig, a) = (write("rig.toml", "r"), write("a.csv", "1"));
        let tool = Tool {
            path: PathBuf::from("none"),
            diagnose_arguments: vec![],
        };
        let folder = |program: &str, command: &str, runs: &[PathBuf]| {
            let ask = Ask {
                tool: &tool,
                program,
                answers: directory.path().join("answers"),
            };
            ask.folder(command, &rig, runs).unwrap()
        };
        let runs = [a.clone()];
        let first = folder("p", "fit", &runs);
        assert_eq!(first, folder("p", "fit", &runs));
        assert_ne!(first, folder("q", "fit", &runs));
        assert_ne!(first, folder("p", "estimate", &runs));
        write("a.csv", "2");
        assert_ne!(first, folder("p", "fit", &runs));
    }
}
