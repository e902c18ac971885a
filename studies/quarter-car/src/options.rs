//! How much of the study is computed.

/// How much is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StudyOptions {
    /// Seed of the first stop; the others follow it.
    pub seed: u64,
    /// Stops of each row of the comparison.
    pub stops: u64,
    /// Draws of the Monte Carlo.
    pub draws: u64,
}

impl Default for StudyOptions {
    fn default() -> Self {
        Self {
            seed: 700_001,
            stops: 20,
            draws: 200,
        }
    }
}

impl StudyOptions {
    /// The command that computes the same.
    pub fn command(&self) -> String {
        format!(
            "cargo run -p study-quarter-car --release -- --seed {} --stops {} --draws {}",
            self.seed, self.stops, self.draws
        )
    }
}
