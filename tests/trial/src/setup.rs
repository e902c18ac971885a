//! What a trial is made with.

use std::path::PathBuf;

use crate::tool::Tool;

/// The small trial's share of the whole.
const SMALL: f64 = 0.1;

/// What a trial is made with.
#[derive(Clone, Debug)]
pub struct Trial {
    /// The tool under trial.
    pub tool: Tool,
    /// An earlier engine, tried on a part of the same files.
    pub rival: Option<PathBuf>,
    /// Commit that the tool was built from, where it was built from one and nothing else.
    pub commit: Option<String>,
    /// Seed of every draw: below 1000 to develop, 1000 to 1999 for continuous integration, from 20,000 to report.
    pub seed: u64,
    /// A tenth of the campaigns, held against the ratchet.
    pub small: bool,
    /// Write the ratchet anew instead of holding against it.
    pub bless: bool,
    /// Campaigns of each stratum, as a share of the full trial's.
    pub scale: f64,
    /// Scratch directory for campaigns and answers; what is there of the same trial is not made again.
    pub work: PathBuf,
    /// Directory of `trials.md`, left alone where absent.
    pub pages: Option<PathBuf>,
    /// Measured recordings, `dart-coastdown` and `dart-friction` in it.
    pub data: PathBuf,
    /// Campaigns at the same time.
    pub jobs: usize,
    /// Ten million samples are diagnosed too, which takes gigabytes of disk and of memory.
    pub ten_million: bool,
}

impl Trial {
    /// Campaigns of each stratum, as a share of the full trial's.
    pub fn scale(&self) -> f64 {
        if self.small { SMALL } else { self.scale }
    }
}
