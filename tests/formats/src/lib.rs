//! Files that other programs wrote (`write.py`), and what is in them.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};

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

#[expect(clippy::panic, reason = "of tests alone")]
fn unreadable(path: &Path, error: &std::io::Error) -> ! {
    panic!("{}: {error}", path.display())
}
