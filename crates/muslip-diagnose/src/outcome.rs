//! The result of a diagnosis, as plain data: what the contract's `diagnosis.json` says, and what a report needs.

use std::collections::BTreeMap;

use serde::Serialize;

pub use crate::audit::finding::{Finding as ChainFinding, Word as ChainWord};
use crate::mechanism::Reported;
use crate::number::finite_or_zero;
use crate::repaired::Repaired;
use crate::series::DataFault;

/// The one word of the verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing beyond the noise.
    Consistent,
    /// Named mechanisms account for it; what remains is noise.
    Explained,
    /// Named mechanisms, and something real remains.
    PartlyExplained,
    /// A real mismatch that no mechanism accounts for.
    Unexplained,
    /// The recordings hold nothing usable.
    Undecided,
}

/// What a recording was used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Parameters and choices saw it.
    Fit,
    /// Kept for the proof.
    Holdout,
}

/// A recording and its role.
#[derive(Clone, Debug, Serialize)]
pub struct Recording {
    /// Path as given.
    pub path: String,
    /// Rows.
    pub samples: usize,
    /// Use made of it (a single recording is split by blocks and has the role `fit`).
    pub role: Role,
}

/// Noise of a channel.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelNoise {
    /// Standard deviation found, in the channel's unit.
    pub sigma: f64,
    /// Declared in the rig file.
    pub declared: Option<f64>,
}

/// A value with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ValueAndStd {
    /// Value.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
}

/// A stretch of a recording where the repaired model differs from the base.
#[derive(Clone, Debug, Serialize)]
pub struct Interval {
    /// Path of the recording.
    pub recording: String,
    /// Balance.
    pub balance: &'static str,
    /// Channel that shows it.
    pub channel: String,
    /// Start in s.
    pub start_s: f64,
    /// End in s.
    pub end_s: f64,
    /// Mean difference over the noise of a mean of as many samples.
    pub z: f64,
}

/// A range of a variable in which a mismatch lies.
#[derive(Clone, Debug, Serialize)]
pub struct Region {
    /// Balance.
    pub balance: &'static str,
    /// Variable by the contract's words, or a column's header.
    pub variable: String,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Strength in standard deviations.
    pub z: f64,
    /// Share of the mismatch's energy inside, 0..=1.
    pub share: f64,
}

/// A reported figure of a mechanism.
#[derive(Clone, Debug, Serialize)]
pub struct ReportedParameter {
    /// Name by the contract.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Standard deviation, spread by model form included.
    pub std: f64,
    /// Unit in ASCII.
    pub unit: String,
}

impl ReportedParameter {
    /// Of what a mechanism reports.
    pub(crate) fn new(reported: &Reported<f64>, std: f64) -> Self {
        Self {
            name: reported.name.to_owned(),
            value: finite_or_zero(reported.value),
            std: finite_or_zero(std).max(0.0),
            unit: reported.unit.to_owned(),
        }
    }
}

/// First letter large, full stop at the end.
pub(crate) fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    match letters.next() {
        Some(first) => format!("{}{}.", first.to_uppercase(), letters.as_str()),
        None => String::new(),
    }
}

/// Why a mechanism is believed.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Evidence {
    /// Twice the drop in the criterion when it is left out.
    pub delta_bic: f64,
    /// Gain in log likelihood a sample on unseen runs when it is added, at the noise at which it stands: as fitted, or no
    /// larger than the sensors make plausible where the runs' own differences hide it.
    pub holdout_nll_gain_per_sample: f64,
    /// Posterior probability, 0..=1.
    pub confidence: f64,
}

/// Another mechanism that could be meant.
#[derive(Clone, Debug, Serialize)]
pub struct Alternative {
    /// Its id.
    pub id: &'static str,
    /// Posterior probability, 0..=1.
    pub confidence: f64,
}

/// A named mechanism.
#[derive(Clone, Debug, Serialize)]
pub struct NamedMechanism {
    /// Its id.
    pub id: &'static str,
    /// The balance that it breaks.
    pub balance: &'static str,
    /// One sentence for an engineer.
    pub statement: String,
    /// Its equation.
    pub equation: String,
    /// Figures, the contract's first.
    pub parameters: Vec<ReportedParameter>,
    /// Why it is believed.
    pub evidence: Evidence,
    /// What else it could be.
    pub confusable_with: Vec<Alternative>,
    /// The run that would tell them apart; empty where the evidence is clear.
    pub separating_test: String,
    /// Root mean square of its effect, in standard deviations of the balance's noise.
    pub effect_sigma: f64,
}

/// What no mechanism explains.
#[derive(Clone, Debug, Serialize)]
pub struct Unexplained {
    /// Balance.
    pub balance: &'static str,
    /// Variable by the contract's words, or a column's header.
    pub variable: String,
    /// Short form; empty where none holds out of sample.
    pub form: String,
    /// Strength in standard deviations.
    pub z: f64,
    /// Share of the mismatch.
    pub share: f64,
}

/// Smallest effect that could have been seen.
#[derive(Clone, Debug, Serialize)]
pub struct MinimumDetectable {
    /// Name of the figure.
    pub name: String,
    /// Its smallest detectable value.
    pub value: f64,
    /// Unit.
    pub unit: String,
}

/// A mechanism that was looked for.
#[derive(Clone, Debug, Serialize)]
pub struct LookedFor {
    /// Its id.
    pub id: &'static str,
    /// Whether these recordings could have shown it at all.
    pub identifiable: bool,
    /// The smallest effect that they could have shown.
    pub minimum_detectable: Option<MinimumDetectable>,
}

/// How well a model predicts the drag.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Score {
    /// Root mean square error in N.
    pub rmse_n: f64,
    /// Negative log likelihood a sample.
    pub nll_per_sample: f64,
    /// Probability of so much structure in the innovations by chance.
    pub whiteness_p: Option<f64>,
}

/// Before and after the repair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct BeforeAfter {
    /// Base law, refitted.
    pub before: Score,
    /// Repaired model.
    pub after: Score,
}

/// The proof.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Fit {
    /// On the data that were fitted.
    pub fit: BeforeAfter,
    /// On data that no parameter and no choice saw.
    pub holdout: BeforeAfter,
}

/// A fault of the data.
#[derive(Clone, Debug, Serialize)]
pub struct Fault {
    /// Path of the recording.
    pub recording: String,
    /// Column.
    pub channel: String,
    /// Start in s.
    pub start_s: f64,
    /// End in s.
    pub end_s: f64,
    /// What is wrong.
    pub what: String,
}

impl From<&DataFault> for Fault {
    fn from(fault: &DataFault) -> Self {
        Self {
            recording: fault.recording.clone(),
            channel: fault.channel.clone(),
            start_s: finite_or_zero(fault.start_s),
            end_s: finite_or_zero(fault.end_s),
            what: fault.what.clone(),
        }
    }
}

/// One run for a plot: what was measured and what the two models say, thinned to a readable number of points.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// Path of the recording.
    pub recording: String,
    /// Whether it was held out.
    pub holdout: bool,
    /// Time in s.
    pub time_s: Vec<f64>,
    /// Slip.
    pub slip: Vec<f64>,
    /// Measured drag in N.
    pub measured_n: Vec<f64>,
    /// Base law, refitted, in N.
    pub before_n: Vec<f64>,
    /// Repaired model in N.
    pub after_n: Vec<f64>,
}

/// Everything that a diagnosis says.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// `muslip.diagnosis/1`.
    pub schema: &'static str,
    /// The verdict.
    pub verdict: Verdict,
    /// Recordings and their roles.
    pub recordings: Vec<Recording>,
    /// Noise by channel.
    pub noise: BTreeMap<String, ChannelNoise>,
    /// The base law's parameters, refitted alone.
    pub base: BTreeMap<String, ValueAndStd>,
    /// Where the repaired model differs from the base.
    pub r#where: Vec<Interval>,
    /// In which operating regions.
    pub regions: Vec<Region>,
    /// Named mechanisms, strongest first.
    pub mechanisms: Vec<NamedMechanism>,
    /// What remains.
    pub unexplained: Vec<Unexplained>,
    /// What was looked for.
    pub looked_for: Vec<LookedFor>,
    /// What is wrong with the data.
    pub data_faults: Vec<Fault>,
    /// What the measuring chain does, found without or beside any physics.
    pub chain: Vec<ChainFinding>,
    /// The proof.
    pub fit: Fit,
    /// What could not be judged, and why: one sentence each.
    pub caveats: Vec<String>,
    /// Runs for plots; part of no file.
    #[serde(skip)]
    pub traces: Vec<Trace>,
    /// The repaired model; a file of its own. The base where what was named predicts unseen runs no better.
    #[serde(skip)]
    pub repaired: Repaired,
    /// The model with all that was named, whether it predicts better or not; part of no file.
    #[serde(skip)]
    pub found: Repaired,
}
