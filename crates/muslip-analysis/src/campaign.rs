//! Many recordings of one rig side by side: which of them stand out.

use std::path::{Path, PathBuf};

use crate::estimate::{EstimateResult, Verdict};

/// Fewest runs among which one can stand out.
const FEWEST: usize = 5;
/// Robust standard scores beyond which a run stands out (B. Iglewicz and D. C. Hoaglin, How to Detect and
/// Handle Outliers, ASQC, 1993).
const FAR: f64 = 3.5;
/// Of a normal distribution, the median absolute deviation times this is the standard deviation.
const SIGMA_PER_MAD: f64 = 1.4826;

/// One recording's estimate, as the campaign needs it.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// The recording as the user named it.
    pub recording: PathBuf,
    /// Its page, relative to the campaign's.
    pub page: String,
    /// Peak friction and its 1-sigma.
    pub peak_friction: (f64, f64),
    /// Critical slip and its 1-sigma.
    pub critical_slip: (f64, f64),
    /// Correlation of the two.
    pub correlation: f64,
    /// Mean normalised innovation squared.
    pub mean_nis: f64,
    /// What that says of the filter.
    pub verdict: Verdict,
    /// Samples used.
    pub used: u64,
}

impl Run {
    /// Takes from an estimate what the campaign needs.
    pub fn of(recording: &Path, page: String, result: &EstimateResult) -> Self {
        let peak = &result.peak;
        Self {
            recording: recording.to_owned(),
            page,
            peak_friction: (peak.peak_friction, peak.peak_friction_std),
            critical_slip: (peak.critical_slip, peak.critical_slip_std),
            correlation: peak.correlation,
            mean_nis: result.consistency.mean_nis,
            verdict: result.consistency.verdict,
            used: result.used,
        }
    }
}

/// A campaign's runs with what stands out.
#[derive(Debug, Clone, PartialEq)]
pub struct Campaign {
    /// The runs in the order given.
    pub runs: Vec<Run>,
    /// For each run, in what it stands out; empty where in nothing.
    pub stands_out: Vec<Vec<&'static str>>,
    /// How many runs are overconfident, where that is most of them.
    pub overconfident: usize,
    /// Median peak friction and the robust standard deviation of the runs about it.
    pub peak_friction: (f64, f64),
    /// The same of the critical slip.
    pub critical_slip: (f64, f64),
}

impl Campaign {
    /// Compares runs with each other.
    pub fn new(runs: Vec<Run>) -> Self {
        let peaks: Vec<(f64, f64)> = runs.iter().map(|run| run.peak_friction).collect();
        let slips: Vec<(f64, f64)> = runs.iter().map(|run| run.critical_slip).collect();
        let (peak_friction, far_in_peak) = outliers(&peaks);
        let (critical_slip, far_in_slip) = outliers(&slips);
        let overconfident = |run: &&Run| run.verdict == Verdict::Overconfident;
        let overconfident = runs.iter().filter(overconfident).count();
        // What most runs are, none of them stands out in.
        let common = overconfident > 1 && 2 * overconfident > runs.len();
        let stands_out = runs
            .iter()
            .zip(far_in_peak.into_iter().zip(far_in_slip))
            .map(|(run, (peak, slip))| {
                let mut words = Vec::new();
                words.extend(peak.then_some("peak friction"));
                words.extend(slip.then_some("critical slip"));
                let inconsistent = !common && run.verdict == Verdict::Overconfident;
                words.extend(inconsistent.then_some("consistency"));
                words
            })
            .collect();
        Self {
            runs,
            stands_out,
            overconfident: if common { overconfident } else { 0 },
            peak_friction,
            critical_slip,
        }
    }

    /// Whether nothing asks for a second look.
    pub fn is_quiet(&self) -> bool {
        self.standing_out() == 0 && self.overconfident == 0
    }

    /// How many runs stand out.
    pub fn standing_out(&self) -> usize {
        self.stands_out
            .iter()
            .filter(|words| !words.is_empty())
            .count()
    }

    /// The answer in a sentence.
    pub fn verdict(&self) -> String {
        let runs = match self.runs.len() {
            1 => "1 run".to_owned(),
            many => format!("{many} runs"),
        };
        let median = format!(
            "{runs}: friction peaks at {} (median), at a slip of {}.",
            crate::wording::plus_minus(self.peak_friction.0, self.peak_friction.1),
            crate::wording::plus_minus(self.critical_slip.0, self.critical_slip.1)
        );
        let standing_out = match (self.standing_out(), self.runs.len()) {
            (0, ..FEWEST) => String::new(),
            (0, _) => " None stands out.".to_owned(),
            (1, _) => " One stands out.".to_owned(),
            (many, _) => format!(" {many} stand out."),
        };
        let common = match self.overconfident {
            0 => String::new(),
            many => format!(
                " In {many} the measurements scatter more than the uncertainty allows: the model lacks something \
                 that they have in common."
            ),
        };
        format!("{median}{standing_out}{common}")
    }
}

/// Median and robust standard deviation of values, and which of them lie far off for that and for their own
/// uncertainty.
fn outliers(values: &[(f64, f64)]) -> ((f64, f64), Vec<bool>) {
    let centre = median(values.iter().map(|value| value.0).collect());
    let distances = values.iter().map(|value| (value.0 - centre).abs());
    let spread = SIGMA_PER_MAD * median(distances.collect());
    let far = values
        .iter()
        .map(|(value, std)| {
            values.len() >= FEWEST && (value - centre).abs() > FAR * spread.hypot(*std)
        })
        .collect();
    ((centre, spread), far)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    let at = |index: usize| values.get(index).copied().unwrap_or(f64::NAN);
    if values.len().is_multiple_of(2) {
        0.5 * (at(middle.wrapping_sub(1)) + at(middle))
    } else {
        at(middle)
    }
}

/// Names of the recordings' pages: after the recording, each once, none of them the campaign's own.
pub fn page_names(recordings: &[PathBuf]) -> Vec<String> {
    let mut names: Vec<String> = vec!["index.html".to_owned()];
    for recording in recordings {
        let stem = recording.file_stem().unwrap_or_default().to_string_lossy();
        // Only letters that are the same in a file's name and in a link to it.
        let plain: String = stem
            .chars()
            .map(|letter| match letter {
                'a'..='z' | 'A'..='Z' | '0'..='9' | '-' | '_' | '.' => letter,
                _ => '_',
            })
            .collect();
        let name = (1..)
            .map(|number| match number {
                1 => format!("{plain}.html"),
                number => format!("{plain}-{number}.html"),
            })
            .find(|name| !names.iter().any(|taken| taken.eq_ignore_ascii_case(name)));
        names.extend(name);
    }
    names.remove(0);
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(peak_friction: f64, verdict: Verdict) -> Run {
        Run {
            recording: "r.csv".into(),
            page: "r.html".into(),
            peak_friction: (peak_friction, 0.01),
            critical_slip: (0.15, 0.01),
            correlation: 0.5,
            mean_nis: 1.0,
            verdict,
            used: 100,
        }
    }

    #[test]
    fn a_run_far_from_the_others_stands_out_and_a_vague_one_does_not() {
        let values = [0.80, 0.81, 0.79, 0.80, 0.82, 0.60];
        let mut runs: Vec<Run> = values.map(|peak| run(peak, Verdict::Consistent)).into();
        let campaign = Campaign::new(runs.clone());
        assert_eq!(campaign.stands_out[5], ["peak friction"]);
        assert_eq!(campaign.standing_out(), 1);
        runs[5].peak_friction.1 = 0.1;
        assert_eq!(Campaign::new(runs.clone()).standing_out(), 0);
        runs[5].verdict = Verdict::Overconfident;
        assert_eq!(Campaign::new(runs.clone()).stands_out[5], ["consistency"]);
        // What is true of most of them tells none apart, and is said.
        for run in &mut runs[1..] {
            run.verdict = Verdict::Overconfident;
        }
        let common = Campaign::new(runs.clone());
        assert_eq!((common.standing_out(), common.overconfident), (0, 5));
        assert!(!common.is_quiet() && common.verdict().contains("In 5 the measurements scatter"));
        // Too few to tell.
        runs.drain(..3);
        runs[2] = run(0.2, Verdict::Consistent);
        assert_eq!(Campaign::new(runs).standing_out(), 0);
    }

    #[test]
    fn pages_have_names_that_are_links_and_differ() {
        let recordings = ["a/run 1.csv", "b/run_1.csv", "index.csv", "c/\u{e9}<x>.csv"];
        let names = page_names(&recordings.map(PathBuf::from));
        assert_eq!(
            names,
            ["run_1.html", "run_1-2.html", "index-2.html", "__x_.html"]
        );
    }
}
