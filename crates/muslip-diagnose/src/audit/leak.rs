//! Columns that reproduce the drag without the tyre law.

use super::constants::{LEAK_COPIES, LEAK_LEVEL, LEAK_SURE};
use super::finding::{Finding, Word};
use crate::campaign::Run;

fn correlation(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64) {
    let finite = || {
        pairs
            .clone()
            .filter(|(a, b)| a.is_finite() && b.is_finite() && a.abs() < 1e15 && b.abs() < 1e15)
    };
    let count = finite().count().max(1) as f64;
    let (a, b) = finite().fold((0.0, 0.0), |s, p| (s.0 + p.0 / count, s.1 + p.1 / count));
    let (aa, bb, ab) = finite().fold((0.0, 0.0, 0.0), |s, p| {
        (
            s.0 + (p.0 - a).powi(2),
            s.1 + (p.1 - b).powi(2),
            s.2 + (p.0 - a) * (p.1 - b),
        )
    });
    // More than rounding makes of a constant.
    let varies = |square: f64, mean: f64| square > 1e-20 * count * mean * mean && square > 0.0;
    let value = if varies(aa, a) && varies(bb, b) {
        ab / (aa * bb).sqrt()
    } else {
        0.0
    };
    (value, count)
}

/// Third differences: nearly all noise.
fn rough(x: &[f64]) -> impl Iterator<Item = f64> + Clone + '_ {
    x.windows(4).map(|w| w[0] - 3.0 * w[1] + 3.0 * w[2] - w[3])
}

/// Columns that follow the drag to within a thousandth, or nearly so and copy its noise.
#[must_use]
pub fn leaks(runs: &[Run]) -> Vec<Finding> {
    let mut names: Vec<&str> = runs
        .iter()
        .flat_map(|run| run.extra.iter().map(|(name, _)| name.as_str()))
        .collect();
    names.sort_unstable();
    names.dedup();
    names
        .into_iter()
        .filter_map(|name| {
            let both: Vec<(&[f64], &[f64])> = runs
                .iter()
                .filter_map(|run| {
                    let (_, column) = run.extra.iter().find(|(own, _)| own == name)?;
                    (column.len() == run.drag_force_n.len()).then_some((run.drag_force_n.as_slice(), column.as_slice()))
                })
                .collect();
            let (level, count) =
                correlation(both.iter().flat_map(|(a, b)| a.iter().copied().zip(b.iter().copied())));
            let (copied, _) = correlation(both.iter().flat_map(|(a, b)| rough(a).zip(rough(b))));
            let leaks = count > 50.0
                && (level.abs() > LEAK_SURE || (level.abs() > LEAK_LEVEL && copied.abs() > LEAK_COPIES));
            leaks.then(|| {
                Finding {
                    relative_to: "drag_force_n".to_owned(),
                    ..Finding::of(name, Word::Leaks, (level, (1.0 - level * level) / count.sqrt()), "1")
                }
                .saying(format!(
                    "The column {name} reproduces the drag (correlation {level:.4}, of the noise alone {copied:.2}): it explains nothing."
                ))
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_of_the_drag_leaks_and_a_mere_likeness_does_not() {
        let drag: Vec<f64> = (0..500)
            .map(|k| 1000.0 * (f64::from(k) * 0.02).sin() + f64::from((k * 7919) % 101))
            .collect();
        let copy: Vec<f64> = drag.iter().map(|d| 0.001 * d + 2.0).collect();
        let like: Vec<f64> = (0..500).map(|k| (f64::from(k) * 0.021).sin()).collect();
        let run = |extra: Vec<f64>| Run {
            time_s: (0..500).map(f64::from).collect(),
            drag_force_n: drag.clone(),
            extra: vec![("column".to_owned(), extra)],
            ..Run::default()
        };
        assert_eq!(leaks(&[run(copy)]).len(), 1);
        assert!(leaks(&[run(like)]).is_empty());
        assert!(leaks(&[]).is_empty());
    }
}
