//! Each run of a set predicted from the others: the repaired model must do no worse than the base.

use anyhow::Result;

use super::ask::Ask;
use super::fold::Fold;
use super::placebo::OF_SPEEDS;
use super::recording::DRAG;
use super::sets::{Loaded, confidence};
use super::told;
use crate::contract::{list, text};

/// Mean squared difference where both are known; not a number where that is less than half of the run.
fn mean_square(predicted: Option<Vec<f64>>, drag: &[f64]) -> f64 {
    let squares: Vec<f64> = predicted
        .unwrap_or_default()
        .iter()
        .zip(drag)
        .map(|(p, d)| (p - d).powi(2))
        .filter(|x| x.is_finite())
        .collect();
    if 2 * squares.len() < drag.len() || drag.is_empty() {
        return f64::NAN;
    }
    squares.iter().sum::<f64>() / squares.len() as f64
}

/// Leaves out one run, has the others diagnosed, and predicts it.
pub(super) fn fold(ask: &Ask, loaded: &Loaded, out: usize) -> Result<Fold> {
    let seen: Vec<_> = (0..loaded.paths.len())
        .filter(|k| *k != out)
        .map(|k| loaded.paths[k].clone())
        .collect();
    let answer = ask.diagnose(&loaded.rig, &seen)?;
    let (fresh, drag) = (&loaded.paths[out], &loaded.runs[out].columns[DRAG]);
    let error = |base: bool| mean_square(ask.predict(&answer, &loaded.rig, fresh, base), drag);
    Ok(Fold {
        run: loaded.set.files[out].to_owned(),
        told: told(&answer.value),
        repaired: error(false),
        base: error(true),
        sure: list(&answer.value, "mechanisms")
            .iter()
            .filter(|m| {
                text(m, "balance") == "tyre"
                    && !OF_SPEEDS.contains(&text(m, "id"))
                    && confidence(m) > 0.5
            })
            .count(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_of_less_than_half_of_a_run_has_no_mean_square() {
        assert!(
            (mean_square(Some(vec![1.0, f64::NAN, 3.0]), &[0.0, 0.0, 3.0]) - 0.5).abs() < 1e-12
        );
        assert!(mean_square(Some(vec![1.0]), &[0.0, 0.0, 3.0]).is_nan());
        assert!(mean_square(None, &[0.0]).is_nan());
    }
}
