//! `--map`, which every command has that reads recordings.

use std::path::{Path, PathBuf};

use clap::Args;
use muslip_formats::map::Map;
use muslip_recordings::map_file;

use super::failure::Failure;

/// How channels become columns.
#[derive(Debug, Args)]
pub(super) struct Mapping {
    /// Map of channels (TOML), for recordings with other columns than the contract's: `muslip channels FILE --write-map MAP.toml` writes one.
    /// Default: [channels] of the rig file; without it, channels are guessed from their names and units.
    #[arg(long, value_name = "MAP.toml")]
    pub(super) map: Option<PathBuf>,
}

impl Mapping {
    /// The map that recordings are read by.
    pub(super) fn chosen(&self, rig: Option<&Path>) -> Result<Option<Map>, Failure> {
        Ok(map_file::chosen(self.map.as_deref(), rig)?)
    }

    /// The option as it was given, with a space after it.
    pub(super) fn words(&self) -> String {
        self.map
            .as_ref()
            .map_or(String::new(), |map| format!("--map {} ", map.display()))
    }
}
