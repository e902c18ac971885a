//! What a command knows of the wheel: a rig file, or its radius alone.

use std::path::{Path, PathBuf};

use clap::Args;
use muslip_recordings::rig_file::{LARGEST_RADIUS_M, RigFile, SMALLEST_RADIUS_M};

use super::failure::Failure;

/// `--rig` or `--radius`.
#[derive(Debug, Args)]
pub(super) struct RigOrRadius {
    /// Rig file (TOML).
    #[arg(long, value_name = "RIG.toml")]
    rig: Option<PathBuf>,
    /// Free-rolling radius of the wheel in m, in place of a rig file: slip and friction need nothing else of it.
    #[arg(long, value_name = "METRES", conflicts_with = "rig")]
    radius: Option<f64>,
}

impl RigOrRadius {
    /// What was given; one of the two must be.
    pub(super) fn source(&self) -> Result<RigSource<'_>, Failure> {
        match (&self.rig, self.radius) {
            (Some(path), _) => Ok(RigSource::File(path)),
            (None, Some(radius_m)) => Ok(RigSource::Radius(radius_m)),
            (None, None) => Err(Failure::Usage(
                "the wheel's radius is not known: add --radius METRES (or --rig RIG.toml)".into(),
            )),
        }
    }
}

/// Where the wheel's radius is from.
#[derive(Debug, Clone, Copy)]
pub(super) enum RigSource<'a> {
    /// A rig file.
    File(&'a Path),
    /// `--radius`, in m.
    Radius(f64),
}

impl RigSource<'_> {
    /// Where the rig file is.
    pub(super) fn path(&self) -> Option<&Path> {
        match self {
            Self::File(path) => Some(path),
            Self::Radius(_) => None,
        }
    }

    /// The rig, checked.
    pub(super) fn read(&self) -> Result<RigFile, Failure> {
        match *self {
            Self::File(path) => Ok(RigFile::read(path)?),
            Self::Radius(radius_m)
                if (SMALLEST_RADIUS_M..=LARGEST_RADIUS_M).contains(&radius_m) =>
            {
                Ok(RigFile::of_radius(radius_m))
            }
            Self::Radius(radius_m) => Err(Failure::Usage(format!(
                "--radius {radius_m}: must be between {SMALLEST_RADIUS_M} and {LARGEST_RADIUS_M} m"
            ))),
        }
    }

    /// The option as it was given.
    pub(super) fn words(&self) -> String {
        match self {
            Self::File(path) => format!("--rig {}", path.display()),
            Self::Radius(radius_m) => format!("--radius {radius_m}"),
        }
    }
}
