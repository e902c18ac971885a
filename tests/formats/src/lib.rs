//! Files that other programs wrote (`write.py`), and what is in them.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};

use muslip_formats::SourceFile;
use serde_json::Value;

/// The folder that `write.py` filled; `None`, with the reason printed, where there is none and none must be.
///
/// # Panics
/// Where there is none although there must be: in CI.
#[must_use]
pub fn folder() -> Option<PathBuf> {
    let folder = std::env::var_os("MUSLIP_FORMATS_FILES").map(PathBuf::from);
    let must = std::env::var_os("CI").is_some();
    match folder {
        Some(folder) => Some(folder),
        None => {
            assert!(
                !must,
                "MUSLIP_FORMATS_FILES is not set: cargo xtask formats writes the files"
            );
            println!("left out: no files of other programs (cargo xtask formats writes them)");
            None
        }
    }
}

/// Files with what they hold, in order.
///
/// # Panics
/// Where the folder cannot be read.
#[must_use]
pub fn files(folder: &Path) -> Vec<(PathBuf, Value)> {
    let mut all: Vec<(PathBuf, Value)> = std::fs::read_dir(folder)
        .unwrap_or_else(|error| unreadable(folder, &error))
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| {
            path.extension()
                .is_some_and(|extension| extension == "json")
        })
        .map(|path| {
            let text = std::fs::read_to_string(&path).unwrap_or_default();
            (
                path.with_extension(""),
                serde_json::from_str(&text).unwrap_or_default(),
            )
        })
        .collect();
    all.sort_by(|(a, _), (b, _)| a.cmp(b));
    all
}

/// Largest difference, relative to the value.
const TOLERANCE: f64 = 1e-12;

fn same(read: f64, written: f64) -> bool {
    (read.is_nan() && written.is_nan())
        || (read - written).abs() <= TOLERANCE * written.abs().max(1e-300)
}

fn numbers(list: &Value) -> Option<Vec<f64>> {
    let list = list.as_array()?;
    Some(
        list.iter()
            .map(|value| value.as_f64().unwrap_or(f64::NAN))
            .collect(),
    )
}

/// What became of the channels of a file.
#[derive(Debug, Clone, Default)]
pub struct Judged {
    /// Channels whose every value was read as written.
    pub read: usize,
    /// Channels that were refused, with the reason.
    pub refused: Vec<String>,
    /// What is wrong, line by line.
    pub wrong: Vec<String>,
}

/// Reads a file and holds it against what is in it. A channel that is refused with a reason is no wrong value; only in files of others may there be
/// such.
#[must_use]
pub fn judged(path: &Path, written: &Value) -> Judged {
    let of_others = written["faults"].is_null();
    let mut judged = Judged::default();
    let out = &mut judged.wrong;
    let mut file = match SourceFile::open(path) {
        Ok(file) => file,
        // A file that holds nothing for us may be refused.
        Err(error) => {
            let empty = written["channels"].as_array().is_some_and(Vec::is_empty);
            if of_others {
                judged.refused.push(error.to_string());
            } else if !empty {
                judged.wrong.push(error.to_string());
            }
            return judged;
        }
    };
    let channels = file.channels().to_vec();
    for wanted in written["channels"].as_array().into_iter().flatten() {
        let (group, name) = (
            wanted["group"].as_str().unwrap_or(""),
            wanted["name"].as_str().unwrap_or(""),
        );
        let Some(at) = channels
            .iter()
            .position(|channel| channel.group == group && channel.name == name)
        else {
            // What others' files hold in forms that are not listed at all is refused without a word.
            if of_others && !file.faults().is_empty() {
                judged.refused.push(file.faults().join("; "));
            } else {
                out.push(format!("{group}/{name} is not listed"));
            }
            continue;
        };
        let before = out.len();
        let unit = wanted["unit"].as_str().unwrap_or("");
        if !unit.is_empty() && channels[at].unit != unit {
            out.push(format!(
                "{group}/{name}: unit {:?} instead of {unit:?}",
                channels[at].unit
            ));
        }
        let series = match file.read(&[at]).map(|mut series| series.pop()) {
            Ok(Some(series)) => series,
            Ok(None) => continue,
            Err(error) if of_others => {
                judged.refused.push(error.to_string());
                continue;
            }
            Err(error) => {
                out.push(error.to_string());
                continue;
            }
        };
        let values = numbers(&wanted["values"]).unwrap_or_default();
        if series.values.len() != values.len() {
            out.push(format!(
                "{group}/{name}: {} samples read, {} written",
                series.values.len(),
                values.len()
            ));
            continue;
        }
        let invalid: Vec<usize> = series
            .invalid
            .iter()
            .flatten()
            .enumerate()
            .filter(|(_, invalid)| **invalid)
            .map(|(k, _)| k)
            .collect();
        let wanted_invalid: Vec<usize> = wanted["invalid"]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(Value::as_u64)
            .map(|k| k as usize)
            .collect();
        if invalid != wanted_invalid {
            out.push(format!(
                "{group}/{name}: invalid {invalid:?} instead of {wanted_invalid:?}"
            ));
        }
        if let Some(k) = (0..values.len()).find(|&k| !same(series.values[k], values[k])) {
            out.push(format!(
                "{group}/{name}: {} instead of {} at {k}",
                series.values[k], values[k]
            ));
        }
        if let Some(times) = numbers(&wanted["times"]) {
            let read = series.time_s.as_deref().cloned().unwrap_or_default();
            if read.len() != times.len() {
                out.push(format!(
                    "{group}/{name}: {} time stamps read, {} written",
                    read.len(),
                    times.len()
                ));
            } else if let Some(k) = (0..times.len())
                .find(|&k| (read[k] - times[k]).abs() > 1e-12 * times[k].abs().max(1.0))
            {
                out.push(format!(
                    "{group}/{name}: time {} instead of {} at {k}",
                    read[k], times[k]
                ));
            }
        }
        judged.read += usize::from(out.len() == before);
    }
    for refused in written["refused"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(Value::as_str)
    {
        let at = channels.iter().position(|channel| channel.name == refused);
        match at.map(|at| file.read(&[at])) {
            Some(Ok(_)) => out.push(format!("{refused} should have been refused")),
            Some(Err(error)) if error.to_string().contains(refused) => {}
            Some(Err(error)) => out.push(format!("{refused} is not named: {error}")),
            None => out.push(format!("{refused} is not listed")),
        }
    }
    match written["faults"].as_bool() {
        Some(true) if file.faults().is_empty() => out.push("no fault is told".to_owned()),
        Some(false) if !file.faults().is_empty() => {
            out.push(format!("faults: {:?}", file.faults()))
        }
        _ => {}
    }
    judged
}

/// Where a file is from, by its name.
#[must_use]
pub fn origin(name: &str) -> &'static str {
    let origins = [
        ("scenario-", "npTDMS, generators of its tests"),
        ("daqmx-", "npTDMS, generators of its tests of DAQmx"),
        ("matlab-", "scipy, its test files"),
        ("shipped-nptdms-", "npTDMS, loggers' files of its tests"),
        ("shipped-h5py-", "h5py, its test files"),
        ("shipped-pyarrow-", "pyarrow, its test files"),
    ];
    let of = origins.iter().find(|(start, _)| name.starts_with(start));
    of.map_or("written for these tests", |(_, origin)| origin)
}

#[expect(clippy::panic, reason = "of tests alone")]
fn unreadable(path: &Path, error: &std::io::Error) -> ! {
    panic!("{}: {error}", path.display())
}
