//! What keeps a reported figure honest: seeds that nobody has developed against, and forms that no rule was made for.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};

use crate::judge::case::Case;

/// What a seed is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SeedUse {
    /// Below 1000: to develop against, as often as one likes.
    Development,
    /// 1000 to 1999: continuous integration's own.
    Integration,
    /// 20,000 and more: reported once.
    Reported,
}

/// What a seed is for; none between the ranges.
pub fn seed_use(seed: u64) -> Option<SeedUse> {
    match seed {
        0..1000 => Some(SeedUse::Development),
        1000..2000 => Some(SeedUse::Integration),
        20_000.. => Some(SeedUse::Reported),
        _ => None,
    }
}

/// Enters a reported seed into the ledger, or refuses one that another tool was reported on.
///
/// # Errors
/// Where the ledger cannot be read or written, or the seed was used for another tool.
pub fn enter(ledger: &Path, seed: u64, tool: &str, commit: &str) -> Result<()> {
    let mut text = if ledger.exists() {
        fs::read_to_string(ledger).with_context(|| format!("cannot read {}", ledger.display()))?
    } else {
        "# Seeds of reported figures, each with the tool that it was used for: seed, SHA-256, commit.\n\
         # A seed that stands here has been seen: another tool takes a fresh one.\n"
            .to_owned()
    };
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let mut words = line.split_whitespace();
        if words.next().and_then(|word| word.parse::<u64>().ok()) != Some(seed) {
            continue;
        }
        let before = words.next().unwrap_or("");
        if before == tool {
            return Ok(());
        }
        bail!(
            "seed {seed} was reported on for tool {before}: what was learnt from it may be in this one; take a fresh seed"
        );
    }
    let _ = writeln!(text, "{seed} {tool} {commit}");
    fs::write(ledger, text).with_context(|| format!("cannot write {}", ledger.display()))
}

/// A form that a rule of the engine was made for after it was seen, so that figures from it prove nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Void {
    pub form: String,
    /// The rule, and the commit that added it.
    pub why: String,
}

impl Void {
    /// Whether a case shows it: by a concealed form, by the one effect of a chain, or by a sensor of a real chain.
    pub fn holds(&self, case: &Case) -> bool {
        case.forms.contains(&self.form)
            || case.stratum == "chain" && case.kind == self.form
            || case.real_chain && [&case.wheel_sensor, &case.vehicle_sensor].contains(&&self.form)
    }
}

/// The forms that are void: `form: rule (commit)`, one a line. A form is one of a concealed effect, an effect of the chain
/// alone, or a sort of sensor.
pub fn voids() -> Vec<Void> {
    parse(include_str!("../../void.txt"))
}

fn parse(text: &str) -> Vec<Void> {
    text.lines()
        .filter(|line| !line.trim_start().starts_with('#'))
        .filter_map(|line| {
            let (form, why) = line.split_once(':')?;
            Some(Void {
                form: form.trim().to_owned(),
                why: why.trim().to_owned(),
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::form::{OUTSIDE, VOCABULARY};
    use crate::generate::instrument::finding::FINDING_KINDS;
    use crate::judge::family::toy;

    const SENSORS: [&str; 7] = [
        "tone_ring",
        "counts",
        "tacho",
        "gps",
        "optical",
        "fifth_wheel",
        "drum_encoder",
    ];

    #[test]
    fn seeds_are_for_one_use() {
        assert_eq!(seed_use(41), Some(SeedUse::Development));
        assert_eq!(seed_use(1500), Some(SeedUse::Integration));
        assert_eq!(seed_use(20_271), Some(SeedUse::Reported));
        assert_eq!(seed_use(5000), None);
    }

    #[test]
    fn a_reported_seed_is_refused_to_another_tool() {
        let folder = tempfile::tempdir().unwrap();
        let ledger = folder.path().join("ledger.txt");
        enter(&ledger, 20_300, "aa", "c1").unwrap();
        enter(&ledger, 20_300, "aa", "c1").unwrap();
        let refused = enter(&ledger, 20_300, "bb", "c2").unwrap_err();
        assert!(refused.to_string().contains("fresh seed"));
        enter(&ledger, 20_301, "bb", "c2").unwrap();
        let text = fs::read_to_string(&ledger).unwrap();
        assert_eq!(
            text.lines().filter(|line| !line.starts_with('#')).count(),
            2
        );
    }

    #[test]
    fn forms_effects_of_a_chain_and_sensors_can_be_void() {
        let void = |form: &str| Void {
            form: form.into(),
            why: String::new(),
        };
        let mut chain = toy::case("chain", false);
        chain.kind = "leaking_column".into();
        assert!(void("leaking_column").holds(&chain) && !void("ideal").holds(&chain));
        let mut null = toy::case("null", true);
        null.kind = "real_chain".into();
        null.vehicle_sensor = "gps".into();
        assert!(void("gps").holds(&null));
        assert!(
            !void("real_chain").holds(&null),
            "a sort of null is no form"
        );
    }

    #[test]
    fn every_void_form_is_a_form_of_the_generator() {
        let words: Vec<String> = VOCABULARY
            .iter()
            .flat_map(|entry| entry.2.iter())
            .chain(OUTSIDE.iter().map(|entry| &entry.0))
            .filter_map(|form| serde_json::to_value(form).ok()?.as_str().map(str::to_owned))
            .chain(FINDING_KINDS.into_iter().map(|kind| kind.word()))
            .chain(SENSORS.iter().map(|word| (*word).to_owned()))
            .collect();
        for void in voids() {
            assert!(words.contains(&void.form), "{} is no form", void.form);
            assert!(void.why.len() > 10, "{}: which rule?", void.form);
        }
    }
}
