//! The table and the list that are printed.

use std::fmt::Write;

use super::budget::percent_of_sample;
use super::candidate::{Candidate, Core};
use super::trace::Cost;

type Row = (Candidate, Cost);

/// One campaign's figures of the peers: instructions and modelled cycles an update.
const CAMPAIGN: [(&str, f64, f64); 4] = [
    ("nalgebra", 90.0, 146.0),
    ("kfilter", 125.0, 190.0),
    ("adskalman", 146.0, 254.0),
    ("minikalman", 172.0, 238.0),
];

/// A markdown table with the bars beside the figures; what fills a sample may take `percent` of it.
pub fn markdown(rows: &[Row], percent: u64) -> String {
    let mut table = String::from(
        "| candidate | core | opt | instructions, mean and most | cycles, mean and most | text, bytes | stack, bytes | final mup, sp in millionths | bar and figure |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for (candidate, cost) in rows {
        let name = if candidate.long {
            format!("{}, {} samples", candidate.name, cost.calls)
        } else {
            candidate.name.to_owned()
        };
        let _ = writeln!(
            table,
            "| {name} | {} | {} | {:.1}, {} | {:.1}, {} | {} | {} | {} | {} |",
            candidate.core.name(),
            candidate.opt,
            cost.mean_instructions(),
            cost.most_instructions,
            cost.mean_cycles(),
            cost.most_cycles,
            cost.text_bytes,
            cost.stack_bytes,
            cost.answer,
            bars(rows, candidate, cost, percent).join("; ")
        );
    }
    table
}

/// `at most` a bar, and whether the figure meets it.
fn at_most(what: &str, bar: f64, figure: f64, digits: usize) -> String {
    let verdict = if figure <= bar { "met" } else { "missed" };
    format!("{what} at most {bar}: {figure:.digits$}, {verdict}")
}

fn bars(rows: &[Row], candidate: &Candidate, cost: &Cost, percent: u64) -> Vec<String> {
    if candidate.core != Core::M4F || candidate.opt != "3" {
        return Vec::new();
    }
    let cycles_of = |name: &'static str| {
        rows.iter()
            .find(|(other, _)| *other == Candidate::on(name, Core::M4F, "3"))
            .map_or(f64::NAN, |(_, cost)| cost.mean_cycles())
    };
    let cycles = cost.mean_cycles();
    match candidate.name {
        "article" => vec![
            at_most("instructions", 66.0, cost.mean_instructions(), 0),
            at_most("cycles", 95.0, cycles, 0),
            at_most("over nalgebra's", 0.65, cycles / cycles_of("nalgebra"), 2),
            at_most("over minikalman's", 0.4, cycles / cycles_of("minikalman"), 2),
        ],
        "article_checked" => {
            let lean = cycles_of("article");
            vec![at_most("cycles over the lean update's", 1.3, cycles / lean, 3)]
        }
        "efficient" => {
            let lean = cycles_of("article");
            vec![
                at_most("mean cycles over the lean update's", 2.5, cycles / lean, 2),
                format!("worst over it {:.2}", cost.most_cycles as f64 / lean),
            ]
        }
        "innovations" => {
            let share = percent_of_sample(cost.most_cycles);
            vec![at_most("worst in % of 168000 cycles", percent as f64, share, 1)]
        }
        name => CAMPAIGN
            .iter()
            .find(|(peer, _, _)| *peer == name)
            .map(|(_, instructions, campaign)| {
                // Slower than the campaign's would be measured unfairly; faster is not.
                let over = 100.0 * (cycles / campaign - 1.0);
                let verdict = if over <= 5.0 { "met" } else { "missed" };
                format!(
                    "campaign {instructions}, {campaign}; cycles at most 5 % over it: {over:+.1} %, {verdict}"
                )
            })
            .into_iter()
            .collect(),
    }
}

/// A JSON list, one object a candidate; the figures of the long run stand in the object of the short one.
pub fn json(rows: &[Row]) -> String {
    let objects: Vec<String> = rows
        .iter()
        .filter(|(candidate, _)| !candidate.long)
        .map(|row| object(rows, row))
        .collect();
    format!("[{}]", objects.join(",\n "))
}

fn object(rows: &[Row], (candidate, cost): &Row) -> String {
    let mut object = format!(
        "{{\"name\": \"{}\", \"target\": \"{}\", \"opt\": \"{}\", \"instructions\": {:.3}, \"cycles\": {:.3}, \"most_instructions\": {}, \"most_cycles\": {}, \"text_bytes\": {}, \"stack_bytes\": {}",
        candidate.name,
        candidate.core.name(),
        candidate.opt,
        cost.mean_instructions(),
        cost.mean_cycles(),
        cost.most_instructions,
        cost.most_cycles,
        cost.text_bytes,
        cost.stack_bytes
    );
    let same = Candidate {
        long: true,
        ..*candidate
    };
    if let Some((_, long)) = rows.iter().find(|(other, _)| *other == same) {
        let _ = write!(
            object,
            ", \"long_samples\": {}, \"long_instructions\": {:.3}, \"long_cycles\": {:.3}, \"long_most_cycles\": {}",
            long.calls,
            long.mean_instructions(),
            long.mean_cycles(),
            long.most_cycles
        );
    }
    object.push('}');
    object
}
