//! Power against the size of an effect at a fixed rate of false alarms.
//!
//! A tool that keeps silent raises no false alarm; here it also finds nothing. Each family has its own threshold on
//! the score: what one null campaign in twenty exceeds.

use crate::judge::case::Case;
use crate::judge::family::{APART, Family, resampled};
use crate::judge::headline::{Better, Headline};
use crate::judge::tally::of;
use crate::share::{Share, percent, quantile};
use crate::table::Table;

/// Rate of false alarms at which power is told.
const RATE: f64 = 0.05;

/// Sizes in sigma after the refit; a bin ends half way to the next, by ratio.
pub const SIZES: [f64; 6] = [0.3, 0.6, 1.0, 1.5, 2.0, 4.0];

/// Power at one size.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    pub size: f64,
    /// Right first and above the threshold, of so many.
    pub found: Share,
    /// The wider of the interval by drawing nulls and singles anew, which knows of the threshold's own error, and of
    /// the exact one of the share, which knows that none of five is not never.
    pub interval: (f64, f64),
}

/// Power of one family.
#[derive(Clone, Debug)]
pub struct Curve {
    pub family: Family,
    pub threshold: f64,
    /// Nulls above the threshold.
    pub alarms: Share,
    /// Sizes that were tried.
    pub points: Vec<Point>,
}

/// Of a null, the strongest evidence that its answer claims for what is not there; of an effect, the evidence of the
/// first name that is right, which nothing named beside it may lend.
fn score(case: &Case) -> f64 {
    let score = |score: f64| if score.is_finite() { score } else { 0.0 };
    if case.stratum == "null" {
        case.named
            .iter()
            .filter(|named| !named.right)
            .map(|named| score(named.score))
            .fold(0.0, f64::max)
    } else {
        case.named
            .iter()
            .find(|named| named.accepted)
            .map_or(0.0, |named| score(named.score))
    }
}

/// The bin of a size.
fn bin(size: f64) -> usize {
    SIZES
        .windows(2)
        .take_while(|pair| size >= (pair[0] * pair[1]).sqrt())
        .count()
}

/// Power against size; none where a family has no nulls or no single effects.
pub fn curve(cases: &[Case], family: Family) -> Option<Curve> {
    let nulls: Vec<f64> = of(cases, "null")
        .filter(|case| family.holds(case))
        .map(score)
        .collect();
    let mut singles: Vec<Vec<(f64, bool)>> = vec![Vec::new(); SIZES.len()];
    for case in of(cases, "single").filter(|case| family.holds(case) && !case.of_the_chain) {
        singles[bin(case.weakest())].push((score(case), case.first_right));
    }
    if nulls.is_empty() || singles.iter().all(Vec::is_empty) {
        return None;
    }
    let threshold = quantile(&nulls, 1.0 - RATE);
    let found = |single: &(f64, bool), threshold: f64| single.1 && single.0 > threshold;
    let points = SIZES
        .into_iter()
        .zip(&singles)
        .filter(|(_, singles)| !singles.is_empty())
        .map(|(size, singles)| {
            let share = Share::count(singles, |single| found(single, threshold));
            let drawn = resampled(&[nulls.len(), singles.len()], |places| {
                let scores: Vec<f64> = places[0].iter().map(|place| nulls[*place]).collect();
                let threshold = quantile(&scores, 1.0 - RATE);
                Share::count(&places[1], |place| found(&singles[**place], threshold)).value()
            });
            let exact = share.interval();
            Point {
                size,
                found: share,
                interval: (drawn.0.min(exact.0), drawn.1.max(exact.1)),
            }
        })
        .collect();
    Some(Curve {
        family,
        threshold,
        alarms: Share::count(&nulls, |score| **score > threshold),
        points,
    })
}

/// Curves of ideal sensors and of chains, where there are any.
pub fn curves(cases: &[Case]) -> Vec<Curve> {
    APART
        .into_iter()
        .filter_map(|family| curve(cases, family))
        .collect()
}

/// Power by size.
pub fn table(cases: &[Case]) -> Table {
    let curves = curves(cases);
    let mut table = Table::new("Power at 5 % of false alarms", &["size, sigma after refit"]);
    for curve in &curves {
        let name = curve.family.name();
        table
            .header
            .extend([name.to_owned(), "95 % interval".to_owned(), "n".to_owned()]);
    }
    for size in SIZES {
        let mut row = vec![format!("{size}")];
        let mut any = false;
        for curve in &curves {
            match curve.points.iter().find(|point| point.size == size) {
                Some(point) => {
                    any = true;
                    row.extend([
                        percent(point.found.value()),
                        format!(
                            "{}..{}",
                            percent(point.interval.0),
                            percent(point.interval.1)
                        ),
                        format!("{}/{}", point.found.hits, point.found.of),
                    ]);
                }
                None => row.extend(["-".to_owned(), "-".to_owned(), "0".to_owned()]),
            }
        }
        if any {
            table.rows.push(row);
        }
    }
    let thresholds: Vec<String> = curves
        .iter()
        .map(|curve| {
            format!(
                "{}: a score (`delta_bic`) of {:.1}, exceeded by {} of {} nulls",
                curve.family.name(),
                curve.threshold,
                curve.alarms.hits,
                curve.alarms.of
            )
        })
        .collect();
    table.note = Some(format!(
        "Single effects whose mechanism is named first with a score above the 95 % quantile of the nulls' ({}). Intervals: nulls and effects drawn anew, and never narrower than the exact one of the share.",
        thresholds.join("; ")
    ));
    table
}

/// The figures for the bars and the ratchet.
pub fn headlines(cases: &[Case]) -> Vec<Headline> {
    curves(cases)
        .iter()
        .flat_map(|curve| {
            curve.points.iter().map(|point| {
                let mut headline = Headline::share(
                    &format!("power.{}{}", point.size, curve.family.suffix()),
                    &format!(
                        "power at {} sigma and 5 % of false alarms, {}",
                        point.size,
                        curve.family.name()
                    ),
                    Better::Higher,
                    None,
                    point.found,
                );
                (headline.low, headline.high) = point.interval;
                headline
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::family::toy;

    fn single(size: f64, score: f64, first_right: bool) -> Case {
        let mut case = toy::case("single", false);
        case.strength = vec![size];
        case.first_right = first_right;
        case.named = vec![toy::named(0.9, score, first_right)];
        case
    }

    #[test]
    fn the_threshold_is_what_one_null_in_twenty_exceeds() {
        // Scores 0, 1, .. 100: the 95 % quantile is 95, and five lie above it.
        let mut cases: Vec<Case> = (0..=100)
            .map(|score| {
                let mut case = toy::case("null", false);
                case.named = vec![
                    toy::named(0.9, f64::from(score), false),
                    toy::named(0.9, 1e6, true),
                    toy::named(0.9, f64::NAN, false),
                ];
                case
            })
            .collect();
        // Found; under the threshold; above it with a wrong name; found at another size.
        cases.extend([
            single(1.1, 96.0, true),
            single(1.1, 94.0, true),
            single(1.1, 300.0, false),
            single(4.0, 300.0, true),
        ]);
        let curve = curve(&cases, Family::Ideal).unwrap();
        assert!((curve.threshold - 95.0).abs() < 1e-9);
        assert_eq!((curve.alarms.hits, curve.alarms.of), (5, 101));
        let told: Vec<(f64, usize, usize)> = curve
            .points
            .iter()
            .map(|point| (point.size, point.found.hits, point.found.of))
            .collect();
        assert_eq!(told, [(1.0, 1, 3), (4.0, 1, 1)]);
        assert!(curve.points[0].interval.0 < 0.1 && curve.points[0].interval.1 > 0.9);
        let keys: Vec<String> = headlines(&cases).into_iter().map(|h| h.key).collect();
        assert_eq!(keys, ["power.1.ideal", "power.4.ideal"]);
        assert!(super::curve(&cases, Family::Chains).is_none());
    }

    #[test]
    fn another_names_evidence_does_not_help() {
        let mut cases: Vec<Case> = (0..=20)
            .map(|score| {
                let mut case = toy::case("null", false);
                case.named = vec![toy::named(0.9, f64::from(score), false)];
                case
            })
            .collect();
        // Right first on thin evidence, beside a strong name: one that is false, one that is true of the chain.
        let mut beside = toy::named(0.9, 500.0, true);
        beside.accepted = false;
        for other in [toy::named(0.9, 500.0, false), beside] {
            let mut case = single(1.0, 5.0, true);
            case.named.push(other);
            cases.push(case);
        }
        let found = |cases: &[Case]| curve(cases, Family::Ideal).unwrap().points[0].found.hits;
        assert_eq!(found(&cases), 0);
        cases.push(single(1.0, 50.0, true));
        assert_eq!(found(&cases), 1);
        // What the chain has as well is judged apart.
        cases.last_mut().unwrap().of_the_chain = true;
        assert_eq!(found(&cases), 0);
    }

    #[test]
    fn silence_buys_no_power() {
        let mut cases = vec![toy::case("null", true); 40];
        cases.extend(vec![toy::case("single", true); 5]);
        for case in &mut cases {
            case.strength = vec![2.0];
        }
        let curve = curve(&cases, Family::Chains).unwrap();
        assert_eq!((curve.alarms.hits, curve.points[0].found.hits), (0, 0));
    }

    #[test]
    fn bins_end_half_way_by_ratio() {
        assert_eq!(
            [0.1, 0.3, 0.42, 0.43, 0.6, 1.0, 1.7, 1.74, 2.8, 2.9, 40.0].map(bin),
            [0, 0, 0, 1, 1, 2, 3, 4, 4, 5, 5]
        );
    }
}
