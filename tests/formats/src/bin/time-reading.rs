//! Reads every numeric channel of a file, and prints the seconds that took: `time-reading FILE`. Called by times.py.

#![allow(clippy::print_stdout, reason = "what it prints is what it is for")]

use std::path::PathBuf;
use std::time::Instant;

use muslip_formats::SourceFile;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = PathBuf::from(std::env::args_os().nth(1).ok_or("no file is given")?);
    let start = Instant::now();
    let mut file = SourceFile::open(&path)?;
    let channels = file.channels();
    let wanted: Vec<usize> = (0..channels.len())
        .filter(|&k| channels[k].kind.is_number())
        .collect();
    let series = file.read(&wanted)?;
    let seconds = start.elapsed().as_secs_f64();
    let samples: usize = series.iter().map(|one| one.values.len()).sum();
    // What was read is used, so that none of it can be left undone.
    let sum: f64 = series.iter().flat_map(|one| &one.values).sum();
    println!("{seconds} {samples} {sum}");
    Ok(())
}
