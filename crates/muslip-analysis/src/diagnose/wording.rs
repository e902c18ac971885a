//! Sentences of a diagnosis, the same in the terminal and in the report.

use crate::wording::capitalised;
use muslip_diagnose::mechanism::Id;
use muslip_diagnose::outcome::{
    BeforeAfter, ChainFinding, Diagnosis, LookedFor, MinimumDetectable, NamedMechanism,
    ReportedParameter, Unexplained, ValueAndStd, Verdict,
};

use crate::wording::{decimals_for, plus_minus};

/// A space at which no line is broken: between a number and its unit.
pub const NO_BREAK: &str = "\u{a0}";

/// A standard deviation that says nothing: unknown, or of a number that stands fast.
fn says_nothing(std: f64) -> bool {
    !(std > 0.0 && std < 1e100)
}

/// A number with a few significant digits.
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 {
            "0".to_owned()
        } else {
            "unknown".to_owned()
        };
    }
    let magnitude = value.abs().log10().floor();
    if !(-5.0..7.0).contains(&magnitude) {
        return format!("{value:.*e}", digits.saturating_sub(1));
    }
    let decimals = (digits as f64 - 1.0 - magnitude).max(0.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// A value with its 1-sigma and its unit; short times are in ms.
#[must_use]
pub fn quantity(value: f64, std: f64, unit: &str) -> String {
    let (value, std, unit) = handy(value, std, unit);
    let number = if says_nothing(std) {
        significant(value, 4)
    } else if decimals_for(std) >= 6 || value.abs().max(std) >= 1e7 {
        format!("{value:.2e} \u{b1} {std:.0e}")
    } else {
        plus_minus(value, std)
    };
    with_unit(number.replace(' ', NO_BREAK), unit)
}

/// As [`quantity`], the 1-sigma apart.
#[must_use]
pub fn quantity_apart(value: f64, std: f64, unit: &str) -> (String, String) {
    let whole = quantity(value, std, unit);
    let (_, _, unit) = handy(value, std, unit);
    match whole.split_once("\u{a0}\u{b1}\u{a0}") {
        Some((number, std)) => (
            with_unit(number.to_owned(), unit),
            format!("\u{b1}{NO_BREAK}{std}"),
        ),
        None => (whole, "uncertainty unknown".to_owned()),
    }
}

fn handy(value: f64, std: f64, unit: &str) -> (f64, f64, &str) {
    match unit {
        "s" if value.abs() < 0.1 && value != 0.0 => (1e3 * value, 1e3 * std, "ms"),
        unit => (value, std, unit),
    }
}

/// A number's text with its unit; the contract's `1` is no unit to print.
#[must_use]
pub fn with_unit(number: String, unit: &str) -> String {
    match unit {
        "" | "1" => number,
        unit => format!("{number}{NO_BREAK}{}", unit.replace(' ', NO_BREAK)),
    }
}

/// A reported parameter: name, value, 1-sigma, unit.
#[must_use]
pub fn figure(figure: &ReportedParameter) -> String {
    format!(
        "{} {}",
        spoken(&figure.name),
        quantity(figure.value, figure.std, &figure.unit)
    )
}

/// A parameter of the base law.
#[must_use]
pub fn estimate(estimate: &ValueAndStd) -> String {
    quantity(estimate.value, estimate.std, "")
}

/// An id or a name as it is said: without underscores.
#[must_use]
pub fn spoken(id: &str) -> String {
    match id.strip_suffix("_per_m_s") {
        Some(start) => format!("{} per m/s", start.replace('_', " ")),
        None => id.replace('_', " "),
    }
}

/// A variable of the contract as it is said, and its unit; a column's header stays as it is.
fn named(variable: &str) -> (&str, &str) {
    match variable {
        "slip" => ("slip", ""),
        "sliding_speed_m_s" => ("sliding speed", "m/s"),
        "vehicle_speed_m_s" => ("vehicle speed", "m/s"),
        "normal_force_n" => ("normal force", "N"),
        "time_s" => ("time", "s"),
        "distance_m" => ("distance run", "m"),
        "wheel_angle_rad" => ("wheel angle", "rad"),
        "slip_rate" => ("slip rate", "1/s"),
        header => (header, ""),
    }
}

/// A variable of the contract as it is said; a column's header stays as it is.
#[must_use]
pub fn variable(name: &str) -> String {
    named(name).0.to_owned()
}

/// A variable with its unit, as an axis has it.
#[must_use]
pub fn axis_label(variable: &str) -> String {
    match named(variable) {
        (name, "") => name.to_owned(),
        (name, unit) => format!("{name} ({unit})"),
    }
}

/// A range of a variable with its unit.
#[must_use]
pub fn range(variable: &str, low: f64, high: f64) -> String {
    with_unit(
        format!("{} to {}", significant(low, 3), significant(high, 3)),
        named(variable).1,
    )
}

/// A probability or a share in percent.
#[must_use]
pub fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    if percent > 99.0 && percent < 100.0 {
        return format!(">99{NO_BREAK}%");
    }
    if percent > 0.0 && percent < 1.0 {
        return format!("<1{NO_BREAK}%");
    }
    format!("{percent:.0}{NO_BREAK}%")
}

/// A strength in standard deviations.
#[must_use]
pub fn sigmas(z: f64) -> String {
    if (10.0..1e6).contains(&z.abs()) {
        format!("{z:.0}")
    } else {
        significant(z, 2)
    }
}

/// Words joined as in a sentence: `a`, `a and b`, `a, b and c`.
#[must_use]
pub fn listed(words: &[String]) -> String {
    joined(words, "and")
}

/// Words of which one may hold: `a`, `a or b`, `a, b or c`.
#[must_use]
pub fn either(words: &[String]) -> String {
    joined(words, "or")
}

fn joined(words: &[String], last_but: &str) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} {last_but} {last}", first.join(", ")),
    }
}

fn distinct(words: impl Iterator<Item = String>) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for word in words {
        if !found.contains(&word) {
            found.push(word);
        }
    }
    found
}

/// The verdict, with what was found, in one sentence.
#[must_use]
pub fn verdict_sentence(diagnosis: &Diagnosis) -> String {
    let named = listed(&distinct(diagnosis.mechanisms.iter().map(|m| spoken(m.id))));
    let rest = listed(&distinct(
        diagnosis.unexplained.iter().map(|u| variable(&u.variable)),
    ));
    match diagnosis.verdict {
        Verdict::Consistent => {
            "Consistent: nothing is missing; simulation and recordings agree to within the noise."
                .to_owned()
        }
        Verdict::Explained => {
            format!("Explained: the simulation lacks {named}; with it, only noise remains.")
        }
        Verdict::PartlyExplained => format!(
            "Partly explained: the simulation lacks {named}; the remaining error depends on {rest}."
        ),
        Verdict::Unexplained => format!(
            "Unexplained: a significant error that no known mechanism explains; it depends on {rest}."
        ),
        Verdict::Undecided => {
            "Undecided: the recordings contain no samples to compare with the simulation."
                .to_owned()
        }
    }
}

/// A mechanism in a sentence, with its first parameter.
#[must_use]
pub fn mechanism_sentence(mechanism: &NamedMechanism) -> String {
    let statement = capitalised(mechanism.statement.trim_end_matches('.'));
    let figures = mechanism.parameters.first().map_or(String::new(), figure);
    format!(
        "{statement} ({figures}; confidence {}).",
        percent(mechanism.evidence.confidence)
    )
}

/// Alternatives to a mechanism; empty where the evidence is clear.
#[must_use]
pub fn confusable_sentence(mechanism: &NamedMechanism) -> String {
    if mechanism.confusable_with.is_empty() {
        return String::new();
    }
    let others: Vec<String> = mechanism
        .confusable_with
        .iter()
        .map(|other| format!("{} ({})", spoken(other.id), percent(other.confidence)))
        .collect();
    format!("Could also be {}.", either(&others))
}

/// What no mechanism explains, in a sentence.
#[must_use]
pub fn unexplained_sentence(rest: &Unexplained) -> String {
    let form = if rest.form.is_empty() {
        "no closed form fits, the model has a table".to_owned()
    } else {
        rest.form.clone()
    };
    format!(
        "Unnamed, {} balance: depends on {} ({} of the error, {} sigma): {form}.",
        rest.balance,
        variable(&rest.variable),
        percent(rest.share),
        sigmas(rest.z),
    )
}

/// A finding about the measuring chain, in a sentence with its value.
#[must_use]
pub fn chain_sentence(finding: &ChainFinding) -> String {
    let statement = capitalised(finding.statement.trim_end_matches('.'));
    let figure = quantity(finding.value, finding.std, &finding.unit);
    match finding.recording.as_str() {
        "*" => format!("{statement} ({figure})."),
        recording => format!("{statement} ({figure}; {}).", short_name(recording)),
    }
}

/// How the error of the drag changes; empty where nothing was predicted.
#[must_use]
pub fn gain(score: &BeforeAfter) -> String {
    let (before, after) = (score.before.rmse_n, score.after.rmse_n);
    if !(before > 0.0 && after > 0.0) {
        return String::new();
    }
    let change = 100.0 * (1.0 - after / before);
    let change = if change.abs() < 0.5 {
        "unchanged".to_owned()
    } else if change > 0.0 {
        format!("{change:.0}{NO_BREAK}%{NO_BREAK}less")
    } else {
        format!("{:.0}{NO_BREAK}%{NO_BREAK}more", -change)
    };
    let newtons = |rmse: f64| with_unit(significant(rmse, 3), "N");
    format!("{} -> {} ({change})", newtons(before), newtons(after))
}

/// The smallest detectable effect.
#[must_use]
pub fn least(least: &MinimumDetectable) -> String {
    let (value, _, unit) = handy(least.value, 0.0, &least.unit);
    with_unit(significant(value, 2), unit)
}

/// Mechanisms that were looked for and not named: first those that cannot be identified, then those that can,
/// with their smallest detectable effect, the largest against its practical importance first.
#[must_use]
pub fn unseen(diagnosis: &Diagnosis) -> (Vec<&LookedFor>, Vec<(&LookedFor, &MinimumDetectable)>) {
    let not_named = |looked_for: &&LookedFor| {
        !diagnosis
            .mechanisms
            .iter()
            .any(|named| named.id == looked_for.id)
    };
    let looked_for = diagnosis.looked_for.iter().filter(not_named);
    let (visible, hidden): (Vec<_>, Vec<_>) = looked_for.partition(|entry| entry.identifiable);
    let mut visible: Vec<_> = visible
        .into_iter()
        .filter_map(|entry| Some((entry, entry.minimum_detectable.as_ref()?)))
        .collect();
    let worry = |(entry, least): &(&LookedFor, &MinimumDetectable)| {
        least.value.abs() / matters_from(diagnosis, entry.id)
    };
    visible.sort_by(|a, b| worry(b).total_cmp(&worry(a)));
    (hidden, visible)
}

/// Size of a mechanism's first parameter from which it matters in practice; only sorts a list.
fn matters_from(diagnosis: &Diagnosis, id: &str) -> f64 {
    let guide = Id::parse(id).and_then(Id::guide);
    let size = guide.map_or(0.0, |guide| {
        (guide.smallest_size)(&diagnosis.repaired.context)
    });
    if size > 0.0 { size } else { 1.0 }
}

/// The last part of a recording's path, which is how people call it.
#[must_use]
pub fn short_name(path: &str) -> &str {
    path.rsplit(['/', '\\'])
        .next()
        .filter(|name| !name.is_empty())
        .unwrap_or(path)
}

/// A stretch of time.
#[must_use]
pub fn stretch(start_s: f64, end_s: f64) -> String {
    let number = |time_s: f64| {
        if time_s.abs() < 1e6 {
            format!("{time_s:.2}")
        } else {
            significant(time_s, 6)
        }
    };
    let text = if end_s > start_s {
        format!("{} to {}", number(start_s), number(end_s))
    } else {
        number(start_s)
    };
    with_unit(text.replace(' ', NO_BREAK), "s")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_as_long_as_they_deserve() {
        assert_eq!(significant(0.012345, 2), "0.012");
        assert_eq!(significant(12345.6, 3), "12346");
        assert_eq!(significant(3.2e-9, 2), "3.2e-9");
        assert_eq!(significant(0.5, 4), "0.5");
        assert_eq!(significant(100.0, 2), "100");
        assert_eq!(significant(f64::NAN, 2), "unknown");
        assert_eq!(
            quantity(0.2513, 0.0041, "m"),
            "0.251\u{a0}\u{b1}\u{a0}0.004\u{a0}m"
        );
        assert_eq!(quantity(0.2513, f64::MAX, "1"), "0.2513");
        assert_eq!(
            quantity(0.00797, 0.00025, "s"),
            "7.97\u{a0}\u{b1}\u{a0}0.25\u{a0}ms"
        );
        assert_eq!(
            quantity(3.21e-8, 2.2e-9, "1/Pa"),
            "3.21e-8\u{a0}\u{b1}\u{a0}2e-9\u{a0}1/Pa"
        );
    }

    #[test]
    fn shares_never_claim_certainty_that_is_not_there() {
        assert_eq!(percent(0.9996), ">99\u{a0}%");
        assert_eq!(percent(0.004), "<1\u{a0}%");
        assert_eq!(percent(0.71), "71\u{a0}%");
        assert_eq!([percent(0.0), percent(1.0)], ["0\u{a0}%", "100\u{a0}%"]);
    }

    #[test]
    fn a_list_reads_like_a_sentence() {
        let words =
            |count: usize| vec!["a".to_owned(), "b".to_owned(), "c".to_owned()][..count].to_vec();
        assert_eq!(listed(&words(1)), "a");
        assert_eq!(listed(&words(2)), "a and b");
        assert_eq!(listed(&words(3)), "a, b and c");
        assert_eq!(either(&words(3)), "a, b or c");
    }
}
