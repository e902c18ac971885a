//! What `fit` and `estimate` make of each run of measured friction.

use anyhow::Result;
use serde_json::Value;

use super::ask::Ask;
use super::sets::Loaded;
use super::{Row, placebo};
use crate::contract::number;
use crate::generate::tyre::law;
use crate::share::quantile;

/// Peak friction on tape, as read off the recordings to two digits.
const TAPE: (f64, f64) = (0.315, 0.365);
/// Friction on rubber at slip 0.2, likewise, with its scatter.
const RUBBER: (f64, f64, f64) = (0.2, 0.77, 0.03);
/// How near the curve must be to the median friction where the run has its largest slip.
const NEAR: f64 = 0.05;

/// Rows of one run.
pub(super) fn curves(ask: &Ask, loaded: &Loaded, place: usize) -> Result<Vec<Row>> {
    let run = &loaded.runs[place];
    let (slip, friction) = (run.slip_at(loaded.rig_number("radius_m")), run.friction());
    let reached = quantile(&slip, 0.9);
    let near: Vec<f64> = slip
        .iter()
        .zip(&friction)
        .filter(|(s, _)| (*s - reached).abs() < 0.05 * reached)
        .map(|(_, mu)| *mu)
        .collect();
    let measured = quantile(&near, 0.5);
    let name = loaded.set.files[place];
    let mut rows = Vec::new();
    for command in ["fit", "estimate"] {
        let said = ask.object(command, &loaded.rig, &loaded.paths[place])?;
        let value = |key: &str| said.get(key).map_or(f64::NAN, |p| number(p, "value"));
        let (peak, critical) = (value("peak_friction"), value("critical_slip"));
        let curve = |s: f64| peak * law(s / critical);
        let came = if said == Value::Null {
            "no answer".to_owned()
        } else {
            format!("peak {peak:.3} at slip {critical:.3}")
        };
        let row = if name.starts_with("drift") {
            let std = said.get("peak_friction").map_or(0.0, |p| number(p, "std"));
            Row::new(
                &format!("{name}, `{command}`"),
                "peak friction 0.32 to 0.36 on tape, give or take its std",
                came,
                Some(peak + std >= TAPE.0 && peak - std <= TAPE.1),
            )
        } else if reached > RUBBER.0 {
            Row::new(
                &format!("{name}, `{command}`"),
                "friction 0.77 at slip 0.2, within 0.03",
                format!("{came}; {:.3} at slip 0.2", curve(RUBBER.0)),
                Some((curve(RUBBER.0) - RUBBER.1).abs() <= RUBBER.2),
            )
        } else {
            Row::new(
                &format!("{name}, `{command}`"),
                &format!(
                    "friction {measured:.2} at slip {reached:.2}, the largest it has, within {NEAR}"
                ),
                format!("{came}; {:.3} there", curve(reached)),
                Some((curve(reached) - measured).abs() <= NEAR),
            )
        };
        rows.push(row);
    }
    Ok(rows)
}

/// Median friction in bins of slip, for pictures: slip and friction of each bin that holds enough.
pub(super) fn medians(slip: &[f64], friction: &[f64], bins: usize, high: f64) -> Vec<(f64, f64)> {
    (0..bins)
        .filter_map(|bin| {
            let low = high * bin as f64 / bins as f64;
            let inside: Vec<f64> = slip
                .iter()
                .zip(friction)
                .filter(|(s, f)| (low..low + high / bins as f64).contains(*s) && f.is_finite())
                .map(|(_, f)| *f)
                .collect();
            (inside.len() >= 10).then(|| (low + 0.5 * high / bins as f64, quantile(&inside, 0.5)))
        })
        .collect()
}

/// How much of each run's own drag is left in the one that it was given, as a correlation.
pub(super) fn left_of_drag(loaded: &Loaded) -> Vec<f64> {
    placebo::Placebo::DragSwapped
        .apply(&loaded.runs)
        .iter()
        .map(|(k, changed)| {
            correlation(
                &loaded.runs[*k].columns[super::recording::DRAG],
                &changed.columns[super::recording::DRAG],
            )
        })
        .collect()
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().max(1) as f64;
    let (ma, mb) = (a.iter().sum::<f64>() / n, b.iter().sum::<f64>() / n);
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        ab += (x - ma) * (y - mb);
        aa += (x - ma).powi(2);
        bb += (y - mb).powi(2);
    }
    ab / (aa * bb).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_stand_in_the_middle_of_their_bins() {
        let slip: Vec<f64> = (0..100).map(|k| 0.005 + 0.01 * f64::from(k)).collect();
        let friction: Vec<f64> = slip.iter().map(|s| 2.0 * s).collect();
        let found = medians(&slip, &friction, 5, 1.0);
        assert_eq!(found.len(), 5);
        assert!((found[0].0 - 0.1).abs() < 1e-9 && (found[0].1 - 0.2).abs() < 1e-9);
        assert!(medians(&slip, &friction, 20, 1.0).is_empty());
    }
}
