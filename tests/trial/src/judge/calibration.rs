//! Whether confidence is a probability: of the calls made at 0.9, nine in ten should be right.

use crate::judge::case::Case;
use crate::judge::family::{Family, families, resampled};
use crate::judge::headline::{Better, Headline};
use crate::share::Share;
use crate::table::Table;

/// Edges of the bins of confidence; the last holds 1 too.
const EDGES: [f64; 8] = [0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0];

/// Calls made at about the same confidence.
#[derive(Clone, Copy, Debug)]
pub struct Bin {
    pub low: f64,
    pub high: f64,
    /// Mean confidence.
    pub said: f64,
    pub right: Share,
}

/// Brier's score and Murphy's parts of it: score = reliability - resolution + uncertainty, but for what the bins blur.
#[derive(Clone, Copy, Debug)]
pub struct Brier {
    pub score: f64,
    /// 95 % interval, whole campaigns drawn anew: calls in one campaign stand or fall together.
    pub interval: (f64, f64),
    pub reliability: f64,
    pub resolution: f64,
    pub uncertainty: f64,
    pub calls: usize,
}

fn calls(case: &Case) -> impl Iterator<Item = (f64, bool)> {
    case.named
        .iter()
        .map(|named| (named.confidence, named.right))
        .filter(|call| call.0.is_finite())
}

/// The bins that hold calls.
pub fn bins(cases: &[Case], family: Family) -> Vec<Bin> {
    let calls: Vec<(f64, bool)> = family.of(cases).flat_map(calls).collect();
    EDGES
        .windows(2)
        .filter_map(|pair| {
            let (low, high) = (pair[0], pair[1]);
            let group: Vec<&(f64, bool)> = calls
                .iter()
                .filter(|call| call.0 >= low && (call.0 < high || high == 1.0))
                .collect();
            (!group.is_empty()).then(|| Bin {
                low,
                high,
                said: group.iter().map(|call| call.0).sum::<f64>() / group.len() as f64,
                right: Share::count(group, |call| call.1),
            })
        })
        .collect()
}

/// Brier's score of the calls; none where there are none.
pub fn brier(cases: &[Case], family: Family) -> Option<Brier> {
    let campaigns: Vec<(f64, f64)> = family
        .of(cases)
        .map(|case| {
            calls(case).fold((0.0, 0.0), |(sum, count), (said, right)| {
                (
                    sum + (said - f64::from(u8::from(right))).powi(2),
                    count + 1.0,
                )
            })
        })
        .collect();
    let over = |places: &mut dyn Iterator<Item = usize>| {
        let (sum, count) = places.fold((0.0, 0.0), |(sum, count), place| {
            (sum + campaigns[place].0, count + campaigns[place].1)
        });
        sum / count
    };
    let bins = bins(cases, family);
    let count: usize = bins.iter().map(|bin| bin.right.of).sum();
    if count == 0 {
        return None;
    }
    let base = bins.iter().map(|bin| bin.right.hits).sum::<usize>() as f64 / count as f64;
    let weighted = |part: &dyn Fn(&Bin) -> f64| {
        bins.iter()
            .map(|bin| bin.right.of as f64 * part(bin))
            .sum::<f64>()
            / count as f64
    };
    Some(Brier {
        score: over(&mut (0..campaigns.len())),
        interval: resampled(&[campaigns.len()], |places| {
            over(&mut places[0].iter().copied())
        }),
        reliability: weighted(&|bin| (bin.said - bin.right.value()).powi(2)),
        resolution: weighted(&|bin| (bin.right.value() - base).powi(2)),
        uncertainty: base * (1.0 - base),
        calls: count,
    })
}

/// Of the calls made at a confidence, how many were right.
pub fn table(cases: &[Case]) -> Table {
    let mut table = Table::new(
        "Calibration of confidence",
        &[
            "sensors",
            "confidence",
            "said",
            "right",
            "95 % interval",
            "n",
        ],
    );
    let mut note = String::new();
    for family in families(cases) {
        for bin in bins(cases, family) {
            let [value, interval, n] = bin.right.cells();
            table.row([
                family.name().to_owned(),
                format!("{:.2}..{:.2}", bin.low, bin.high),
                format!("{:.3}", bin.said),
                value,
                interval,
                n,
            ]);
        }
        if let Some(brier) = brier(cases, family) {
            note.push_str(&format!(
                "Brier score, {}: {:.4} ({:.4}..{:.4}, campaigns drawn anew), of it {:.4} unreliability, less {:.4} resolution, from {:.4} of not knowing. ",
                family.name(),
                brier.score,
                brier.interval.0,
                brier.interval.1,
                brier.reliability,
                brier.resolution,
                brier.uncertainty,
            ));
        }
    }
    table.note = (!note.is_empty()).then(|| note.trim_end().to_owned());
    table
}

/// The figures for the bars and the ratchet.
pub fn headlines(cases: &[Case]) -> Vec<Headline> {
    use Better::{Higher, Lower};
    let mut all = Vec::new();
    for family in families(cases) {
        let brier = brier(cases, family);
        all.push(Headline::number(
            &family.key("confidence.brier"),
            &family.what("Brier score of confidence"),
            Lower,
            None,
            brier.map_or((f64::NAN, f64::NAN, f64::NAN), |brier| {
                (brier.score, brier.interval.0, brier.interval.1)
            }),
            brier.map_or(0, |brier| brier.calls),
        ));
        all.push(Headline::share(
            &family.key("confidence.right_at_0.9"),
            &family.what("calls at 0.9 or more: right"),
            Higher,
            Some(0.9),
            Share::count(
                family
                    .of(cases)
                    .flat_map(calls)
                    .filter(|call| call.0 >= 0.9),
                |call| call.1,
            ),
        ));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::family::toy;

    fn told(confidence: &[(f64, bool)]) -> Case {
        let mut case = toy::case("single", false);
        case.named = confidence
            .iter()
            .map(|(said, right)| toy::named(*said, 1.0, *right))
            .collect();
        case
    }

    #[test]
    fn brier_and_its_parts_of_a_toy_set() {
        // Nine right and one wrong at 0.9, one wrong at 0.6: (9 * 0.01 + 0.81 + 0.36) / 11.
        let mut cases = vec![told(&[(0.9, true)]); 9];
        cases.push(told(&[(0.9, false), (0.6, false)]));
        let brier = brier(&cases, Family::Together).unwrap();
        assert!((brier.score - 1.26 / 11.0).abs() < 1e-12);
        let whole = brier.reliability - brier.resolution + brier.uncertainty;
        assert!((brier.score - whole).abs() < 1e-12);
        // Without the tenth campaign, in 35 % of the draws, all are right: 0.01. In 7 % of the draws it is there three
        // times of ten or more, in 1.3 % more often: (7 * 0.01 + 3 * 1.17) / 13.
        assert!((brier.interval.0 - 0.01).abs() < 1e-9);
        assert!((brier.interval.1 - 3.58 / 13.0).abs() < 0.02);
    }

    #[test]
    fn bins_hold_their_edges_and_skip_what_is_no_number() {
        let cases = [told(&[
            (0.5, true),
            (0.69, false),
            (1.0, true),
            (f64::NAN, true),
        ])];
        let bins = bins(&cases, Family::Ideal);
        assert_eq!(bins.len(), 2);
        assert_eq!(
            (bins[0].low, bins[0].right.hits, bins[0].right.of),
            (0.5, 1, 2)
        );
        assert_eq!((bins[1].low, bins[1].right.of), (0.99, 1));
        assert!(brier(&cases, Family::Chains).is_none());
    }
}
