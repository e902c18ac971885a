//! Quantisation: a channel whose values lie on a lattice.

use super::constants::{LATTICE_COHERENCE, LATTICE_DECIMALS, LATTICE_VALUES};

/// Step between the values of a channel and its standard deviation, in the channel's unit; none where its values lie on no
/// lattice coarser than the decimals that it is written with.
#[must_use]
pub fn step_of(value: &[f64]) -> Option<(f64, f64)> {
    let mut differences: Vec<f64> = value
        .windows(2)
        .map(|w| (w[1] - w[0]).abs())
        .filter(|d| *d > 0.0 && d.is_finite())
        .take(LATTICE_VALUES)
        .collect();
    if differences.len() < 20 {
        return None;
    }
    differences.sort_by(f64::total_cmp);
    let decimals = decimals_of(value);
    let coarse: Vec<f64> = differences
        .iter()
        .copied()
        .filter(|d| *d > LATTICE_DECIMALS * decimals)
        .collect();
    // What is left out must be a lattice point written differently, not half of the channel.
    if coarse.len() < 20 {
        return None;
    }
    let smallest = coarse[coarse.len() / 50];
    let near: Vec<f64> = coarse
        .iter()
        .copied()
        .filter(|d| (0.75..1.4).contains(&(d / smallest)))
        .collect();
    let mut step = near.iter().sum::<f64>() / near.len() as f64;
    // From the smallest multiples to larger ones, as the step becomes known better.
    for most in [1.5, 3.5, 8.5, 20.5] {
        let (mut top, mut bottom) = (0.0, 0.0);
        for d in coarse.iter().filter(|d| **d < most * step) {
            let count = (d / step).round();
            top += d * count;
            bottom += count * count;
        }
        if bottom > 0.0 {
            step = top / bottom;
        }
    }
    let coherence = coarse
        .iter()
        .filter(|d| **d < 20.5 * step)
        .map(|d| (core::f64::consts::TAU * d / step).cos())
        .sum::<f64>()
        / coarse.iter().filter(|d| **d < 20.5 * step).count().max(1) as f64;
    (step > LATTICE_DECIMALS * decimals && coherence > LATTICE_COHERENCE).then_some((
        step,
        (decimals / step).max(1e-4) * step / (coarse.len() as f64).sqrt(),
    ))
}

/// The last decimal that a column is written with; zeros and values that repeat the one before do not tell.
fn decimals_of(value: &[f64]) -> f64 {
    let value: Vec<f64> = value
        .windows(2)
        .filter(|w| w[1] != w[0] && w[1] != 0.0)
        .map(|w| w[1])
        .collect();
    let mut unit = 1.0;
    for _ in 0..9 {
        let whole = value.iter().filter(|x| x.is_finite()).take(200).all(|x| {
            (x / unit - (x / unit).round()).abs() < 1e-5 * (x / unit).abs().max(1.0) * 1e-3 + 1e-6
        });
        if whole {
            return unit;
        }
        unit *= 0.1;
    }
    0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantised_ramp_shows_its_step_and_a_plain_one_none() {
        let plain: Vec<f64> = (0..3000)
            .map(|k| 20.0 + (f64::from(k) * 0.37).sin() * 1.234_567 + f64::from(k) * 0.0013)
            .collect();
        assert!(step_of(&plain).is_none());
        let coarse: Vec<f64> = plain.iter().map(|x| (x / 0.13).round() * 0.13).collect();
        let (step, _) = step_of(&coarse).unwrap();
        assert!((step - 0.13).abs() < 1e-6, "{step}");
        assert!(step_of(&[1.0; 100]).is_none());
        assert!(step_of(&[]).is_none());
    }
}
