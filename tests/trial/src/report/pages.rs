//! The pages of a trial: what is read first, and the long tables beside it.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result};

use crate::judge::case::Case;
use crate::judge::cause::{shortfalls, symptom};
use crate::judge::headline::Headline;
use crate::judge::score::Report;
use crate::judge::{
    bars, calibration, certainty, coverage, power, prediction, rivals, tally, uniform,
};
use crate::report::pace::{self, Pace};
use crate::report::plots;
use crate::report::seal::voids;
use crate::table::Table;

/// The engine that this one took the place of.
const EARLIER: &str = "the engine of commit 6b77987";

/// What the pages tell beside the judged campaigns.
pub struct Telling<'a> {
    pub introduction: String,
    pub figures: &'a [Headline],
    /// Cases that count, and those of void forms.
    pub valid: &'a [Case],
    pub void: &'a [Case],
    pub report: &'a Report,
    pub rival: Option<&'a Rival>,
    pub paces: &'a [Pace],
    /// What people found out about single cases: campaign's number and the cause.
    pub notes: &'a [(String, String)],
}

/// An earlier engine on the same files.
pub struct Rival {
    /// It was tried on every n-th campaign.
    pub every: usize,
    pub cases: Vec<Case>,
    pub paces: Vec<Pace>,
}

impl Rival {
    /// Those of the tool's cases that the earlier engine was tried on: another set of files is another test.
    fn same(&self, cases: &[Case]) -> Vec<Case> {
        let tried = |case: &&Case| self.cases.iter().any(|own| own.campaign == case.campaign);
        cases.iter().filter(tried).cloned().collect()
    }
}

/// Writes `trials.md`, and long tables and pictures into `trials/` beside it.
pub fn write(directory: &Path, telling: &Telling<'_>) -> Result<()> {
    let beside = directory.join("trials");
    fs::create_dir_all(&beside).with_context(|| format!("cannot make {}", beside.display()))?;
    let put = |name: &Path, text: String| {
        fs::write(name, text).with_context(|| format!("cannot write {}", name.display()))
    };
    plots::reliability(telling.valid, &beside.join("reliability.svg"))?;
    plots::power(telling.valid, &beside.join("power.svg"))?;
    plots::uniformity(telling.valid, &beside.join("null-p-values.svg"))?;
    put(&directory.join("trials.md"), front(telling))?;
    put(
        &beside.join("confusion.md"),
        format!(
            "# What was named for what\n\nPart of the [sealed trial](../trials.md).\n\n{}",
            tally::confusion(telling.valid).markdown()
        ),
    )?;
    if let Some(rival) = telling.rival {
        put(&beside.join("earlier.md"), beside_earlier(telling, rival))?;
    }
    put(&beside.join("cases.csv"), cases_csv(&telling.report.cases))?;
    put(
        &beside.join("parameters.csv"),
        parameters_csv(&telling.report.cases),
    )?;
    Ok(())
}

fn front(telling: &Telling<'_>) -> String {
    let cases = telling.valid;
    let mut text = telling.introduction.clone();
    add(
        &mut text,
        vec![
            bars::table("Figures and bars", telling.figures),
            pace::table(telling.paces),
            void_table(telling),
            shortfalls(cases),
            tally::nulls(cases),
            tally::chains(cases),
            tally::strengths(cases),
        ],
    );
    text.push_str("![Share of effects found against their size, at one false alarm in twenty](trials/power.svg)\n\n");
    add(&mut text, vec![power::table(cases), uniform::table(cases)]);
    text.push_str("![Null p-values by family of chain](trials/null-p-values.svg)\n\n");
    text.push_str(
        "![Of the calls at a confidence, how many were right](trials/reliability.svg)\n\n",
    );
    add(
        &mut text,
        vec![
            calibration::table(cases),
            coverage::table(cases),
            prediction::table(cases),
        ],
    );
    add(
        &mut text,
        vec![
            tally::mechanisms(cases),
            tally::outside(cases),
            methods(telling),
        ],
    );
    text.push_str("## Long tables\n\n- [Confusion matrix](trials/confusion.md)\n");
    if telling.rival.is_some() {
        text.push_str("- [Figures beside the earlier engine's](trials/earlier.md)\n");
    }
    text.push_str(
        "- [Every campaign](trials/cases.csv)\n\
         - [Every parameter](trials/parameters.csv)\n\n\
         ## The twenty worst cases\n\n\
         Most embarrassing first. What went wrong is read off the files by the scorer; a line behind \"cause\" was found out by hand.\n\n",
    );
    for case in tally::worst(cases, 20) {
        let _ = write!(text, "```text\n{}\n```\n\n{}", case.line(), symptom(case));
        text.push('.');
        for (_, note) in telling
            .notes
            .iter()
            .filter(|(name, _)| *name == case.campaign)
        {
            let _ = write!(text, " Cause: {note}");
        }
        text.push_str("\n\n");
    }
    text
}

/// The tool beside an earlier engine and the textbook.
fn methods(telling: &Telling<'_>) -> Table {
    let counts: Vec<_> = telling
        .report
        .baselines
        .iter()
        .filter(|(truth, _)| {
            telling
                .valid
                .iter()
                .any(|case| case.campaign == truth.campaign)
        })
        .cloned()
        .collect();
    let Some(rival) = telling.rival else {
        return rivals::baselines(telling.valid, &counts, &[]);
    };
    let every = rival.every;
    let same = rival.same(telling.valid);
    let own = format!("muslip diagnose, every {every}th campaign");
    let other = format!("{EARLIER}, every {every}th campaign");
    let others: [(&str, &[Case]); 2] = [(&own, &same), (&other, &rival.cases)];
    let mut table = rivals::baselines(telling.valid, &counts, &others);
    table.title =
        format!("Methods on the same files, an earlier engine on every {every}th campaign of them");
    table
}

/// Every figure of a trial, in the order in which it is read.
pub fn figures(cases: &[Case], paces: &[Pace], measured: &[Headline]) -> Vec<Headline> {
    let mut found = bars::figures(cases);
    found.extend(certainty(cases));
    found.extend(measured.iter().cloned());
    found.extend(pace::headlines(paces));
    found
}

/// Figures beside those of an earlier engine.
fn beside_earlier(telling: &Telling<'_>, rival: &Rival) -> String {
    let own = figures(&rival.same(telling.valid), telling.paces, &[]);
    let earlier = figures(&rival.cases, &rival.paces, &[]);
    format!(
        "# Figures beside the earlier engine's\n\nPart of the [sealed trial](../trials.md): both engines on every {}th of its campaigns, judged \
         alike. Few campaigns: the intervals are wide, and the figures of the whole trial, and of measured recordings, are this engine's alone.\n\n{}",
        rival.every,
        bars::beside(EARLIER, &own, &earlier).markdown()
    )
}

/// Appends the tables that have rows.
fn add(text: &mut String, tables: Vec<Table>) {
    for table in tables.iter().filter(|table| !table.rows.is_empty()) {
        text.push_str(&table.markdown());
    }
}

/// Forms that no figure counts, the rule that was made for each, and what they would have given.
fn void_table(telling: &Telling<'_>) -> Table {
    let mut table = Table::new(
        "Void forms",
        &["form", "rule that was made for it", "campaigns", "right"],
    );
    for void in voids() {
        let group: Vec<&Case> = telling
            .void
            .iter()
            .filter(|case| void.holds(case))
            .collect();
        let right = group.iter().filter(|case| !case.failed()).count();
        table.row([
            void.form.clone(),
            void.why,
            group.len().to_string(),
            right.to_string(),
        ]);
    }
    table.note = Some(
        "The engine has a rule that was made after the form was seen in a trial: figures from it prove nothing and are left out of all others."
            .to_owned(),
    );
    table
}

fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

fn cases_csv(cases: &[Case]) -> String {
    let mut text = String::from(
        "campaign,stratum,wheel_sensor,vehicle_sensor,kind,concealed,forms,size_sigma,verdict,named,confidence,left,first_right,in_set,f1,honest,variable_right,iou,gain_shares,worse,processor_s,samples,what_went_wrong\n",
    );
    let join = |items: Vec<String>| items.join(";");
    for case in cases {
        let cells = [
            case.campaign.clone(),
            case.stratum.clone(),
            case.wheel_sensor.clone(),
            case.vehicle_sensor.clone(),
            case.kind.clone(),
            join(case.truth.clone()),
            join(case.forms.clone()),
            join(case.strength.iter().map(|s| format!("{s:.2}")).collect()),
            case.verdict.clone(),
            join(case.named.iter().map(|n| n.id.clone()).collect()),
            join(
                case.named
                    .iter()
                    .map(|n| format!("{:.3}", n.confidence))
                    .collect(),
            ),
            join(case.unexplained.clone()),
            case.first_right.to_string(),
            case.in_set.to_string(),
            format!("{:.2}", case.f1),
            case.honest.to_string(),
            case.variable_right
                .map_or_else(String::new, |right| right.to_string()),
            case.iou.map_or_else(String::new, |iou| format!("{iou:.3}")),
            join(
                case.gains
                    .iter()
                    .map(|g| {
                        g.share
                            .map_or_else(|| "-".to_owned(), |s| format!("{s:.3}"))
                    })
                    .collect(),
            ),
            case.gains.iter().filter(|g| g.worse).count().to_string(),
            format!("{:.1}", case.processor_s),
            case.samples.to_string(),
            if case.failed() {
                symptom(case)
            } else {
                String::new()
            },
        ];
        let line: Vec<String> = cells.iter().map(|cell| quoted(cell)).collect();
        text.push_str(&line.join(","));
        text.push('\n');
    }
    text
}

fn parameters_csv(cases: &[Case]) -> String {
    let mut text = String::from("campaign,form,mechanism,parameter,truth,reported,std,pull\n");
    for case in cases {
        for figure in &case.figures {
            let _ = writeln!(
                text,
                "{},{},{},{},{:.6e},{:.6e},{:.3e},{:.2}",
                case.campaign,
                case.forms.join(";"),
                figure.mechanism,
                figure.name,
                figure.truth,
                figure.value,
                figure.std,
                figure.pull
            );
        }
    }
    text
}

/// Reads notes: one line a case, `campaign-0042: text`; lines that start with # are remarks. They hold for one
/// sealed truth only, whose hash the first line names; those of another are none.
pub fn notes(path: &Path, hash: &str) -> Vec<(String, String)> {
    let Ok(text) = fs::read_to_string(path) else {
        return Vec::new();
    };
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    if lines.next().map(str::trim) != Some(hash) {
        return Vec::new();
    }
    lines
        .filter_map(|line| {
            let (name, note) = line.split_once(':')?;
            Some((name.trim().to_owned(), note.trim().to_owned()))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_hold_for_their_own_truth_only() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("causes.txt");
        fs::write(
            &path,
            "# read by hand\nabc\ncampaign-0007: a dead zone: no lag\n",
        )
        .unwrap();
        assert_eq!(
            notes(&path, "abc"),
            [("campaign-0007".to_owned(), "a dead zone: no lag".to_owned())]
        );
        assert!(notes(&path, "abd").is_empty());
        assert!(notes(&directory.path().join("none"), "abc").is_empty());
    }
}
