//! How much better the repaired model predicts: a section of the report.

use muslip_analysis::diagnose::wording::{estimate, significant, spoken, with_unit};
use muslip_diagnose::outcome::{Diagnosis, Role, Score, ValueAndStd};

use super::blocks::{section, table};
use crate::page::{Block, Section};

pub(super) fn proof(diagnosis: &Diagnosis) -> Section {
    let fit = &diagnosis.fit;
    let scores = [
        ("fitted data, base law", &fit.fit.before),
        ("fitted data, repaired model", &fit.fit.after),
        ("held-out data, base law", &fit.holdout.before),
        ("held-out data, repaired model", &fit.holdout.after),
    ];
    let rows: Vec<_> = scores
        .into_iter()
        .filter(|(_, score)| **score != Score::default())
        .map(|(name, score)| {
            [
                name.to_owned(),
                format!("{} N", significant(score.rmse_n, 4)),
                significant(score.nll_per_sample, 4),
                score
                    .whiteness_p
                    .map_or_else(|| "not tested".to_owned(), probability),
            ]
        })
        .collect();
    let mut blocks = Vec::new();
    if !rows.is_empty() {
        blocks.push(table(
            [
                "drag predicted on",
                "RMSE",
                "negative log likelihood per sample",
                "whiteness p",
            ],
            rows,
        ));
        let proof = if diagnosis.recordings.iter().any(|r| r.role == Role::Holdout) {
            "Held-out recordings were used neither to fit a parameter nor to choose a mechanism."
        } else {
            "Held-out blocks of the recording were used neither to fit a parameter nor to choose a mechanism."
        };
        let whiteness = "Whiteness p: probability of as much correlation in white errors; a small value means \
                         that structure remains in the errors.";
        blocks.push(Block::Paragraph(
            if fit.holdout.before == Score::default() {
                whiteness.to_owned()
            } else {
                format!("{proof} {whiteness}")
            },
        ));
    }
    let mut rows: Vec<[String; 3]> = base_in_order(diagnosis)
        .map(|(name, value)| {
            let (name, of) = match name.strip_prefix("repaired_") {
                Some(name) => (name, "1-sigma, law beside the mechanisms"),
                None => (name, "1-sigma, law alone"),
            };
            [spoken(name), estimate(value), of.to_owned()]
        })
        .collect();
    rows.extend(diagnosis.noise.iter().map(|(channel, noise)| {
        let declared = match noise.declared {
            Some(declared) => {
                let declared = with_unit(significant(declared, 3), channel_unit(channel));
                format!("1-sigma; declared {declared}")
            }
            None => "1-sigma; none declared".to_owned(),
        };
        [
            format!("noise of {channel}"),
            with_unit(significant(noise.sigma, 3), channel_unit(channel)),
            declared,
        ]
    }));
    if !rows.is_empty() {
        blocks.push(table(["base law and noise", "found", "uncertainty"], rows));
    }
    section("How much better", blocks)
}

/// The unit that a channel's name ends with.
fn channel_unit(channel: &str) -> &'static str {
    [
        ("_rad_s", "rad/s"),
        ("_m_s", "m/s"),
        ("_nm", "N m"),
        ("_pa", "Pa"),
        ("_n", "N"),
    ]
    .into_iter()
    .find(|(ending, _)| channel.ends_with(ending))
    .map_or("", |(_, unit)| unit)
}

/// The law's parameters: alone before repaired, the peak before its slip.
fn base_in_order(diagnosis: &Diagnosis) -> impl Iterator<Item = (&str, &ValueAndStd)> {
    let mut rows: Vec<(&str, &ValueAndStd)> = diagnosis
        .base
        .iter()
        .map(|(name, value)| (name.as_str(), value))
        .collect();
    rows.sort_by_key(|(name, _)| {
        (
            name.starts_with("repaired_"),
            !name.ends_with("peak_friction"),
        )
    });
    rows.into_iter()
}

fn probability(p: f64) -> String {
    if p < 0.001 {
        "<0.001".to_owned()
    } else {
        format!("{p:.3}")
    }
}
