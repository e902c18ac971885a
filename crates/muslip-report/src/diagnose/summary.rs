//! Summary of a diagnosis for the terminal.

use std::path::Path;

use muslip_analysis::diagnose::wording::{
    chain_sentence, confusable_sentence, either, gain, least, mechanism_sentence, percent, range,
    short_name, sigmas, significant, spoken, stretch, unexplained_sentence, unseen, variable,
    verdict_sentence, with_unit,
};
use muslip_analysis::wording::capitalised;
use muslip_diagnose::outcome::{Diagnosis, Interval, Verdict};
use muslip_recordings::input_error::one_line;

use crate::text::wrapped;

/// Most lines of a summary.
pub const MOST_LINES: usize = 25;
/// Most characters of a line, where the terminal has as many columns.
pub const WIDEST_LINE: usize = 100;

/// Width of the labels at the left.
const LABEL: usize = 9;

/// A summary: the verdict, and everything below it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Summary {
    /// The verdict's lines (one or two).
    pub verdict: Vec<String>,
    /// Whether the reader can be content.
    pub good: bool,
    /// The rest, ready to print.
    pub lines: Vec<String>,
}

/// Writes the summary of a diagnosis in lines of at most `width` characters, which is at least 40; `out` is
/// the folder of its files, whose own line is as long as it must be.
#[must_use]
pub fn summary(diagnosis: &Diagnosis, out: &Path, width: usize) -> Summary {
    let mut verdict = broken(&one_line(&verdict_sentence(diagnosis)), width);
    // A narrow terminal needs more lines for the same words.
    let verdict_lines = if width < WIDEST_LINE { 4 } else { 2 };
    cut(&mut verdict, verdict_lines, width);
    // What is said of every campaign comes first among the caveats, and is least needed here.
    let notes = diagnosis.caveats.iter().rev().cloned().collect();
    let mut sections = [
        Part::new("Chain", 3, chain(diagnosis), width),
        Part::new("Where", 3, places(diagnosis), width),
        Part::new("What", 9 - verdict.len().max(2), findings(diagnosis), width),
        Part::new("Fit", 2, improvement(diagnosis), width),
        Part::new("Next", 2, next(diagnosis), width),
        Part::new("Data", 2, faults(diagnosis), width),
        Part::new("Unseen", 3, unnoticed(diagnosis), width),
        Part::new("Note", 2, notes, width),
    ];
    let explained = explain(diagnosis, width - LABEL);
    // An empty line and the files' come on top.
    share_out(
        &mut sections,
        MOST_LINES - verdict.len() - 2 - usize::from(explained.is_some()),
    );
    let mut lines = vec![String::new()];
    for part in sections {
        for (index, text) in part.lines().iter().enumerate() {
            let label = if index == 0 { part.label } else { "" };
            lines.push(format!("{label:LABEL$}{text}"));
        }
    }
    lines.extend(
        explained
            .iter()
            .map(|text| format!("{:LABEL$}{text}", "Explain")),
    );
    lines.push(format!(
        "{:LABEL$}report.html, diagnosis.json and model.toml in {}",
        "Files",
        one_line(&out.to_string_lossy())
    ));
    Summary {
        verdict,
        good: matches!(diagnosis.verdict, Verdict::Consistent | Verdict::Explained),
        lines,
    }
}

/// What the measuring chain does.
fn chain(diagnosis: &Diagnosis) -> Vec<String> {
    diagnosis.chain.iter().map(chain_sentence).collect()
}

/// The command that says more of what was named, in a line at most.
fn explain(diagnosis: &Diagnosis, width: usize) -> Option<String> {
    let mut command = "muslip explain".to_owned();
    let mut names = diagnosis.mechanisms.iter().map(|named| named.id);
    let first = names.next()?;
    command = format!("{command} {first}");
    for name in names {
        if command.contains(name) || command.len() + 1 + name.len() > width {
            continue;
        }
        command = format!("{command} {name}");
    }
    Some(command)
}

/// A labelled part of the summary.
struct Part {
    label: &'static str,
    body: Vec<String>,
    most: usize,
    /// Characters of a line.
    width: usize,
}

impl Part {
    /// `most`: lines that it has in any case, if it needs them.
    fn new(label: &'static str, most: usize, texts: Vec<String>, width: usize) -> Self {
        let body: Vec<String> = texts
            .iter()
            // Headers and paths come from outside: nothing in them may steer the terminal.
            .flat_map(|text| broken(&one_line(text), width - LABEL))
            .collect();
        let most = most.min(body.len());
        Self {
            label,
            body,
            most,
            width: width - LABEL,
        }
    }

    fn lines(&self) -> Vec<String> {
        let mut lines = self.body.clone();
        cut(&mut lines, self.most, self.width);
        lines
    }
}

/// Gives lines that some parts do not need to those that need more, in their order; where all together need more
/// than there are, the longest give theirs up, the last of them first.
fn share_out(parts: &mut [Part], lines: usize) {
    let needed: usize = parts.iter().map(|part| part.most).sum();
    for _ in lines..needed {
        if let Some(longest) = parts.iter_mut().max_by_key(|part| part.most) {
            longest.most = longest.most.saturating_sub(1).max(1);
        }
    }
    let mut spare = lines.saturating_sub(parts.iter().map(|part| part.most).sum::<usize>());
    for part in parts {
        let more = (part.body.len() - part.most).min(spare);
        part.most += more;
        spare -= more;
    }
}

/// Where the mismatch lies: a line a balance, the strongest first, and the two strongest regions.
fn places(diagnosis: &Diagnosis) -> Vec<String> {
    let mut balances: Vec<(&str, Vec<&Interval>)> = Vec::new();
    for interval in &diagnosis.r#where {
        match balances
            .iter_mut()
            .find(|(balance, _)| *balance == interval.balance)
        {
            Some((_, intervals)) => intervals.push(interval),
            None => balances.push((interval.balance, vec![interval])),
        }
    }
    let strongest = |intervals: &[&Interval]| {
        intervals
            .iter()
            .map(|i| i.z)
            .fold(f64::NEG_INFINITY, f64::max)
    };
    balances.sort_by(|a, b| strongest(&b.1).total_cmp(&strongest(&a.1)));
    let mut texts: Vec<String> = balances
        .iter()
        .filter_map(|(balance, intervals)| {
            let strongest = intervals.iter().max_by(|a, b| a.z.total_cmp(&b.z))?;
            let total: f64 = intervals.iter().map(|i| i.end_s - i.start_s).sum();
            let count = match intervals.len() {
                1 => "1 interval".to_owned(),
                many => format!("{many} intervals"),
            };
            Some(format!(
                "{} balance, {}: {count}, {} s in total; strongest {} {} ({}).",
                capitalised(balance),
                strongest.channel,
                significant(total, 3),
                short_name(&strongest.recording),
                stretch(strongest.start_s, strongest.end_s),
                with_unit(sigmas(strongest.z), "sigma"),
            ))
        })
        .collect();
    let regions: Vec<String> = diagnosis
        .regions
        .iter()
        .take(2)
        .map(|region| {
            let values = range(&region.variable, region.low, region.high);
            format!(
                "{} of the error at {} {values}",
                percent(region.share),
                variable(&region.variable)
            )
        })
        .collect();
    if !regions.is_empty() {
        texts.push(format!("{}.", regions.join("; ")));
    }
    texts
}

fn findings(diagnosis: &Diagnosis) -> Vec<String> {
    let mut texts = Vec::new();
    for mechanism in &diagnosis.mechanisms {
        texts.push(format!(
            "{} {}",
            mechanism_sentence(mechanism),
            confusable_sentence(mechanism)
        ));
    }
    texts.extend(diagnosis.unexplained.iter().map(unexplained_sentence));
    texts
}

fn improvement(diagnosis: &Diagnosis) -> Vec<String> {
    let (holdout, fit) = (gain(&diagnosis.fit.holdout), gain(&diagnosis.fit.fit));
    if diagnosis.verdict == Verdict::Consistent {
        // There is no repair to compare with.
        let error = diagnosis.fit.fit.before.rmse_n;
        return if error > 0.0 {
            vec![format!(
                "Drag RMSE {} N: noise alone.",
                significant(error, 3)
            )]
        } else {
            Vec::new()
        };
    }
    match (holdout.is_empty(), fit.is_empty()) {
        (false, _) => vec![format!(
            "Drag RMSE on held-out data {holdout}; on fitted data {fit}."
        )],
        (true, false) => vec![format!(
            "Drag RMSE on fitted data {fit}; nothing was held out."
        )],
        (true, true) => Vec::new(),
    }
}

fn next(diagnosis: &Diagnosis) -> Vec<String> {
    let mut tests: Vec<String> = Vec::new();
    for mechanism in &diagnosis.mechanisms {
        let test = capitalised(mechanism.separating_test.trim().trim_end_matches('.'));
        if !test.is_empty() && !tests.contains(&test) {
            tests.push(test);
        }
    }
    tests.into_iter().map(|test| test + ".").collect()
}

fn faults(diagnosis: &Diagnosis) -> Vec<String> {
    diagnosis
        .data_faults
        .iter()
        .map(|fault| {
            format!(
                "{} {} {}: {}.",
                short_name(&fault.recording),
                fault.channel,
                stretch(fault.start_s, fault.end_s),
                fault.what.trim_end_matches('.')
            )
        })
        .collect()
}

fn unnoticed(diagnosis: &Diagnosis) -> Vec<String> {
    let (hidden, visible) = unseen(diagnosis);
    let mut texts = Vec::new();
    if hidden.len() == diagnosis.looked_for.len() && !hidden.is_empty() {
        texts.push("These recordings cannot show any of the mechanisms.".to_owned());
    } else if !hidden.is_empty() {
        let ids: Vec<String> = hidden.iter().map(|entry| spoken(entry.id)).collect();
        texts.push(format!("These recordings cannot show {}.", either(&ids)));
    }
    if !visible.is_empty() {
        let most = if diagnosis.verdict == Verdict::Consistent {
            8
        } else {
            5
        };
        let effects: Vec<String> = visible
            .iter()
            .take(most)
            .map(|(entry, effect)| format!("{} {}", spoken(entry.id), least(effect)))
            .collect();
        texts.push(format!("Smallest detectable: {}.", effects.join(", ")));
    }
    texts
}

/// Keeps the first lines, and says so where there were more.
fn cut(lines: &mut Vec<String>, most: usize, width: usize) {
    const MORE: &str = " ... (more in the report)";
    if lines.len() <= most {
        return;
    }
    lines.truncate(most);
    if let Some(last) = lines.last_mut() {
        let room = width.saturating_sub(MORE.chars().count());
        let mut text: String = last.chars().take(room).collect();
        if last.chars().count() > room
            && let Some(space) = text.rfind(' ')
        {
            text.truncate(space);
        }
        *last = text.trim_end_matches([',', ';', '.', ' ']).to_owned() + MORE;
    }
}

/// Lines of at most `width` characters, whatever it takes: a longer word is cut.
fn broken(text: &str, width: usize) -> Vec<String> {
    let mut lines = wrapped(text, width);
    for line in &mut lines {
        if line.chars().count() > width {
            let kept = line.chars().take(width.saturating_sub(3));
            *line = kept.collect::<String>() + "...";
        }
    }
    lines.retain(|line| !line.is_empty());
    lines
}
