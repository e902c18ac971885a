//! Damaged files: no panic, no abort, no more memory than 2 GiB, and one line for what is wrong.
//!
//! 10,000 damaged files a format; `MUSLIP_MUTATIONS=10000000` for more.

#![allow(clippy::unwrap_used, clippy::panic, reason = "of tests alone")]

use std::fs;
use std::io::{Seek, Write};
use std::path::{Path, PathBuf};

use formats_tests::{files, folder};
use muslip_formats::convert::convert;
use muslip_formats::listing::listed;
use muslip_formats::{SourceFile, quiet_panics, roles};

/// Largest file that is damaged: small ones have more of their bytes in headers.
const LARGEST_BYTES: u64 = 120_000;
/// Most memory that the process may ever have had, in KiB.
const MOST_KIB: u64 = 2 << 20;

/// Numbers without a pattern that matters here (Marsaglia's xorshift64).
struct Dice(u64);

impl Dice {
    fn throw(&mut self, sides: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % sides.max(1) as u64) as usize
    }
}

fn damaged(whole: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    match dice.throw(8) {
        0 => bytes.truncate(dice.throw(whole.len())),
        1 => {
            let (from, to, count) = (
                dice.throw(whole.len()),
                dice.throw(whole.len()),
                dice.throw(64),
            );
            let piece: Vec<u8> = whole.iter().skip(from).take(count).copied().collect();
            for (k, byte) in piece.into_iter().enumerate() {
                if let Some(target) = bytes.get_mut(to + k) {
                    *target = byte;
                }
            }
        }
        2 => {
            // A number of eight bytes that claims much.
            let claims = [
                u64::MAX,
                u64::MAX >> 1,
                1 << 40,
                1 << 31,
                u64::from(u32::MAX),
                0,
            ];
            let claim = claims[dice.throw(claims.len())].to_le_bytes();
            let at = dice.throw(whole.len());
            for (k, byte) in claim
                .into_iter()
                .take(if dice.throw(2) == 0 { 4 } else { 8 })
                .enumerate()
            {
                if let Some(target) = bytes.get_mut(at + k) {
                    *target = byte;
                }
            }
        }
        _ => {
            for _ in 0..=dice.throw(12) {
                // Half of them near the start or the end, where the headers are.
                let near = 1024.min(whole.len());
                let at = match dice.throw(4) {
                    0 => dice.throw(near),
                    1 => whole.len() - 1 - dice.throw(near),
                    _ => dice.throw(whole.len()),
                };
                bytes[at] = if dice.throw(2) == 0 {
                    dice.throw(256) as u8
                } else {
                    bytes[at] ^ (1 << dice.throw(8))
                };
            }
        }
    }
    bytes
}

/// Peak of the process's memory in KiB.
fn peak_kib() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.split_whitespace().next())
        .and_then(|kib| kib.parse().ok())
        .unwrap_or(0)
}

/// Opens, lists and converts a damaged file, as the commands do.
fn went_through(path: &Path, bytes: &[u8]) -> Result<(), String> {
    let mut file = fs::File::options()
        .read(true)
        .write(true)
        .create(true)
        .truncate(true)
        .open(path)
        .unwrap();
    file.write_all(bytes).unwrap();
    file.rewind().unwrap();
    let whole = |error: muslip_formats::FormatError| {
        let text = error.to_string();
        if text.lines().count() == 1
            && text.starts_with(&path.display().to_string())
            && text.len() > path.as_os_str().len() + 8
        {
            Ok(())
        } else {
            Err(format!(
                "not one line with file, place and reason: {text:?}"
            ))
        }
    };
    let mut source = match SourceFile::of_file(path, file) {
        Ok(source) => source,
        Err(error) => return whole(error),
    };
    let guess = roles::guess(source.channels());
    let _ = listed(&mut source, &guess, &mut |_| {});
    match convert(&mut source, None) {
        Ok(_) => Ok(()),
        Err(error) => whole(error),
    }
}

fn mutate(format: &str, of_format: impl Fn(&str) -> bool) {
    let Some(folder) = folder() else { return };
    quiet_panics();
    let count: usize = std::env::var("MUSLIP_MUTATIONS")
        .ok()
        .and_then(|count| count.parse().ok())
        .unwrap_or(10_000);
    let wholes: Vec<(PathBuf, Vec<u8>)> = files(&folder)
        .into_iter()
        .map(|(path, _)| path)
        .filter(|path| of_format(&path.file_name().unwrap_or_default().to_string_lossy()))
        .filter(|path| {
            fs::metadata(path).is_ok_and(|metadata| (1..=LARGEST_BYTES).contains(&metadata.len()))
        })
        .map(|path| (path.clone(), fs::read(&path).unwrap()))
        .collect();
    assert!(
        !wholes.is_empty(),
        "no file of {format} in {}",
        folder.display()
    );
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join(format!("damaged.{format}"));
    let mut dice = Dice(0x9e37_79b9_7f4a_7c15);
    for k in 0..count {
        let (name, whole) = &wholes[k % wholes.len()];
        let bytes = damaged(whole, &mut dice);
        // An abort leaves the file that it was.
        if let Err(told) = went_through(&path, &bytes) {
            panic!("{} damaged the {k}th time: {told}", name.display());
        }
    }
    let peak = peak_kib();
    println!(
        "{format}: {count} damaged files of {}, peak {} MiB",
        wholes.len(),
        peak >> 10
    );
    assert!(peak < MOST_KIB, "{peak} KiB");
}

#[test]
fn csv() {
    mutate("csv", |name| name.ends_with(".csv"));
}

#[test]
fn mdf3() {
    mutate("mdf", |name| name.ends_with(".mdf"));
}

#[test]
fn mdf4() {
    mutate("mf4", |name| name.ends_with(".mf4"));
}

#[test]
fn tdms() {
    mutate("tdms", |name| name.ends_with(".tdms"));
}

#[test]
fn mat() {
    mutate("mat", |name| name.ends_with(".mat") && !name.contains("73"));
}

#[test]
fn hdf5() {
    mutate("h5", |name| name.ends_with(".h5") || name.contains("v73"));
}

#[test]
fn parquet() {
    mutate("parquet", |name| name.ends_with(".parquet"));
}

#[test]
fn arrow() {
    mutate("feather", |name| name.ends_with(".feather"));
}
