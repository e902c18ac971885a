//! A child process with what it cost: wall time, processor time and peak memory, as the system's own
//! books tell while it runs.

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

/// What a process cost. Processor time and memory are looked up every few milliseconds, so the last of them are missed.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Cost {
    /// Wall time, s.
    pub wall_s: f64,
    /// User and system time, s; zero where the system keeps no such books.
    pub processor_s: f64,
    /// Largest resident set, bytes; zero likewise.
    pub peak_bytes: f64,
}

/// Clock ticks a second in which Linux states processor times to programs (`USER_HZ`, the same on every architecture it runs on here).
const TICKS_PER_S: f64 = 100.0;

/// Runs a command to its end, its words going to a log; the error is what to tell.
pub fn run(
    mut command: Command,
    threads: usize,
    patience: Duration,
    log: &Path,
) -> (Cost, std::result::Result<(), String>) {
    let mut cost = Cost::default();
    let begin = Instant::now();
    let outcome = watch(&mut command, threads, patience, log, &mut cost);
    cost.wall_s = begin.elapsed().as_secs_f64();
    (cost, outcome)
}

fn watch(
    command: &mut Command,
    threads: usize,
    patience: Duration,
    log: &Path,
    cost: &mut Cost,
) -> std::result::Result<(), String> {
    let file = File::create(log).map_err(|e| e.to_string())?;
    let copy = file.try_clone().map_err(|e| e.to_string())?;
    let begin = Instant::now();
    let mut child = command
        .env("RAYON_NUM_THREADS", threads.to_string())
        .stdin(Stdio::null())
        .stdout(Stdio::from(copy))
        .stderr(Stdio::from(file))
        .spawn()
        .map_err(|e| format!("cannot start: {e}"))?;
    loop {
        // Before the child is waited for its books are still there, even after its end.
        look(child.id(), cost);
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
            Ok(None) if begin.elapsed() > patience => {
                let _ = child.kill();
                let _ = child.wait();
                return Err(format!("still busy after {} s", patience.as_secs()));
            }
            Ok(None) => std::thread::sleep(Duration::from_millis(5)),
            Err(error) => return Err(error.to_string()),
        }
    }
}

fn look(process: u32, cost: &mut Cost) {
    if let Ok(text) = fs::read_to_string(format!("/proc/{process}/stat")) {
        // Fields 14 and 15, counted behind the name, which may hold anything but ends with the last bracket.
        let ticks: f64 = text
            .rsplit(')')
            .next()
            .map(|rest| {
                rest.split_whitespace()
                    .skip(11)
                    .take(2)
                    .filter_map(|word| word.parse::<f64>().ok())
                    .sum()
            })
            .unwrap_or(0.0);
        cost.processor_s = cost.processor_s.max(ticks / TICKS_PER_S);
    }
    if let Ok(text) = fs::read_to_string(format!("/proc/{process}/status")) {
        let kilobytes = text
            .lines()
            .find_map(|line| line.strip_prefix("VmHWM:"))
            .and_then(|rest| rest.split_whitespace().next()?.parse::<f64>().ok());
        cost.peak_bytes = cost.peak_bytes.max(1024.0 * kilobytes.unwrap_or(0.0));
    }
}

/// Mean number of busy processes over the last minute, where the system tells.
pub fn load() -> Option<f64> {
    fs::read_to_string("/proc/loadavg")
        .ok()?
        .split_whitespace()
        .next()?
        .parse()
        .ok()
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn time_and_memory_of_a_child_are_told() {
        let directory = tempfile::tempdir().unwrap();
        let mut command = Command::new("sh");
        command.args(["-c", "i=0; while [ $i -lt 300000 ]; do i=$((i+1)); done"]);
        let (cost, outcome) = run(
            command,
            1,
            Duration::from_secs(60),
            &directory.path().join("log"),
        );
        outcome.unwrap();
        assert!(
            cost.processor_s > 0.0 && cost.processor_s < cost.wall_s + 0.1,
            "{cost:?}"
        );
        assert!(cost.peak_bytes > 1e5 && cost.peak_bytes < 1e9, "{cost:?}");
    }

    #[test]
    fn one_that_does_not_end_is_ended() {
        let directory = tempfile::tempdir().unwrap();
        let mut command = Command::new("sleep");
        command.arg("30");
        let (cost, outcome) = run(
            command,
            1,
            Duration::from_millis(100),
            &directory.path().join("log"),
        );
        assert!(outcome.unwrap_err().starts_with("still busy"));
        assert!(cost.wall_s < 5.0);
    }
}
