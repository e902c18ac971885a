//! The instruction counts, and the modelled cycles, that the filters are held to.

use std::collections::BTreeMap;
use std::fs;

use anyhow::{Context, Result, bail, ensure};

use super::process::root;

const BUDGETS: &str = ".ci/cycles.toml";
const SHARES: &str = ".ci/budgets.toml";
/// Core cycles from one sample to the next: 168 MHz at 1 kHz.
const CYCLES_PER_SAMPLE: u64 = 168_000;

/// Lines of `name = number`.
fn figures(text: &str) -> Result<BTreeMap<String, u64>> {
    Ok(toml::from_str(text)?)
}

/// Percent of a sample that the live innovations may take at their worst.
pub fn sample_percent() -> Result<u64> {
    figures(&fs::read_to_string(root().join(SHARES))?)?
        .remove("innovations_percent")
        .with_context(|| format!("{SHARES} has no innovations_percent"))
}

/// A sample's cycles in percent of all between two samples at 1 kHz.
pub fn percent_of_sample(cycles: i64) -> f64 {
    100.0 * cycles as f64 / CYCLES_PER_SAMPLE as f64
}

/// The worst call of a candidate against its share of a sample.
pub fn check_sample(name: &str, most_cycles: i64, percent: u64) -> Result<()> {
    let share = percent_of_sample(most_cycles);
    ensure!(
        share <= percent as f64,
        "{name}: {most_cycles} cycles at the worst are {share:.1} % of the {CYCLES_PER_SAMPLE} of a sample at 1 kHz, over the {percent} % of {SHARES}"
    );
    println!(
        "{name}: {most_cycles} cycles at the worst, {share:.1} % of a sample, of at most {percent} %"
    );
    Ok(())
}

/// Counts against the file of budgets: equal, or an error that names all that are not.
///
/// Counts are exact, so that a budget that is too wide is as wrong as one that is exceeded: it would hide
/// the next change.
pub fn check(counts: &[(String, u64)]) -> Result<()> {
    let budgets = figures(&fs::read_to_string(root().join(BUDGETS))?)?;
    compare(counts, &budgets)?;
    for (name, count) in counts {
        println!("{name}: {count}, as budgeted");
    }
    // A check that never fails proves nothing: none of these may pass it.
    for (name, _) in counts {
        for wrong in tampered(&budgets, name) {
            ensure!(
                compare(counts, &wrong).is_err(),
                "the check does not see a wrong budget of {name}"
            );
        }
    }
    Ok(())
}

/// The budgets with one of them an instruction lower, an instruction higher, or missing.
fn tampered(budgets: &BTreeMap<String, u64>, name: &str) -> [BTreeMap<String, u64>; 3] {
    let mut all = [budgets.clone(), budgets.clone(), budgets.clone()];
    let [lower, higher, missing] = &mut all;
    lower.entry(name.to_owned()).and_modify(|count| *count -= 1);
    higher
        .entry(name.to_owned())
        .and_modify(|count| *count += 1);
    missing.remove(name);
    all
}

fn compare(counts: &[(String, u64)], budgets: &BTreeMap<String, u64>) -> Result<()> {
    let off: Vec<String> = counts
        .iter()
        .filter_map(|(name, count)| match budgets.get(name) {
            Some(budget) if budget == count => None,
            Some(budget) => Some(format!("{name} = {count}  # and not {budget}")),
            None => Some(format!("{name} = {count}  # has no budget")),
        })
        .collect();
    if !off.is_empty() {
        bail!(
            "counts of 41 updates differ from {BUDGETS}; a commit that changes a budget says why:\n{}",
            off.join("\n")
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{check_sample, compare, figures, tampered};

    #[test]
    fn a_sample_over_its_share_is_refused_and_one_at_it_is_not() {
        check_sample("innovations", 16_800, 10).unwrap();
        let message = check_sample("innovations", 16_801, 10)
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("16801 cycles") && message.contains("10 %"),
            "{message}"
        );
    }

    #[test]
    fn a_count_that_is_not_its_budget_is_named() {
        let budgets = figures("article = 2624\nefficient = 20000\n").unwrap();
        let counts = [
            ("article".to_owned(), 2624),
            ("efficient".to_owned(), 20_000),
        ];
        compare(&counts, &budgets).unwrap();
        for wrong in tampered(&budgets, "efficient") {
            let message = compare(&counts, &wrong).unwrap_err().to_string();
            assert!(message.contains("efficient = 20000") && !message.contains("article = "));
        }
    }
}
