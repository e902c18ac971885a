//! Nonlinear least squares with residuals whitened by an autoregression, unknowns of each stretch projected out, and
//! uncertainties from the spread over stretches.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::constants::{COARSE_STEP_S, VEHICLE_RANGE_S, WHITENING_ORDER};

/// A balance whose residual depends on a few unknowns.
pub trait Balance: Sync {
    /// Residuals, one vector a stretch.
    fn residual(&self, unknowns: &[f64]) -> Vec<Vec<f64>>;
    /// Residuals from which the slopes are taken that the residuals are weighed by; where the inputs are noisy, of
    /// smoothed ones (instruments), so that the inputs' noise does not pull at the unknowns. The slopes are taken
    /// around `base`.
    fn instrument(&self, base: &[f64], unknowns: &[f64]) -> Option<Vec<Vec<f64>>>;
    /// Columns that each stretch may have any share of (its zero, its drift, ...), constant in the unknowns.
    fn own(&self, unknowns: &[f64]) -> Vec<Vec<Vec<f64>>>;
    /// Steps for derivatives.
    fn steps(&self) -> Vec<f64>;
    /// What is known of the unknowns beforehand: value and standard deviation (infinite: nothing).
    fn prior(&self) -> Vec<(f64, f64)>;
}

/// An estimate.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The unknowns.
    pub unknowns: Vec<f64>,
    /// Their standard deviations.
    pub std: Vec<f64>,
    /// Sum of squares of the whitened residuals.
    pub sum: f64,
    /// Their number.
    pub rows: usize,
}

/// Autoregressive coefficients of residuals by Yule and Walker.
#[must_use]
pub fn autoregression(residual: &[Vec<f64>], order: usize) -> Vec<f64> {
    let mut covariance = vec![0.0; order + 1];
    for block in residual {
        for (lag, sum) in covariance.iter_mut().enumerate() {
            *sum += block
                .iter()
                .zip(block.iter().skip(lag))
                .map(|(a, b)| a * b)
                .sum::<f64>();
        }
    }
    // A grain of white noise keeps exact residuals solvable.
    covariance[0] *= 1.0 + 1e-9;
    let mut coefficients = vec![0.0; order];
    let mut error = covariance[0];
    for k in 0..order {
        if !(error > 0.0) {
            break;
        }
        let mut reflection = covariance[k + 1];
        for j in 0..k {
            reflection -= coefficients[j] * covariance[k - j];
        }
        reflection /= error;
        let old = coefficients.clone();
        coefficients[k] = reflection;
        for j in 0..k {
            coefficients[j] = old[j] - reflection * old[k - 1 - j];
        }
        error *= 1.0 - reflection * reflection;
    }
    coefficients
}

/// Innovations of a series under an autoregression.
#[must_use]
pub fn innovations(series: &[f64], coefficients: &[f64]) -> Vec<f64> {
    (coefficients.len()..series.len())
        .map(|k| {
            series[k]
                - coefficients
                    .iter()
                    .enumerate()
                    .map(|(i, c)| c * series[k - 1 - i])
                    .sum::<f64>()
        })
        .collect()
}

/// Orthonormal columns that span the given ones.
fn orthonormal(columns: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let mut out: Vec<Vec<f64>> = Vec::new();
    for column in columns {
        let size = dot(&column, &column);
        let mut left = column;
        for _ in 0..2 {
            for other in &out {
                remove(&mut left, other);
            }
        }
        let rest = dot(&left, &left);
        if rest > 1e-10 * size && rest > 0.0 {
            let scale = rest.sqrt().recip();
            out.push(left.iter().map(|x| x * scale).collect());
        }
    }
    out
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn remove(from: &mut [f64], unit: &[f64]) {
    let share = dot(from, unit);
    for (value, unit) in from.iter_mut().zip(unit) {
        *value -= share * unit;
    }
}

/// Filter and projection, held while the unknowns move.
struct Whitener {
    coefficients: Vec<f64>,
    own: Vec<Vec<Vec<f64>>>,
}

impl Whitener {
    fn new(coefficients: Vec<f64>, own: &[Vec<Vec<f64>>]) -> Self {
        let own = own
            .iter()
            .map(|columns| {
                orthonormal(
                    columns
                        .iter()
                        .map(|column| innovations(column, &coefficients))
                        .collect(),
                )
            })
            .collect();
        Self { coefficients, own }
    }

    fn apply(&self, residual: &[Vec<f64>]) -> Vec<Vec<f64>> {
        residual
            .iter()
            .zip(&self.own)
            .map(|(block, own)| {
                let mut white = innovations(block, &self.coefficients);
                for column in own {
                    remove(&mut white, column);
                }
                white
            })
            .collect()
    }
}

fn penalty(unknowns: &[f64], prior: &[(f64, f64)]) -> f64 {
    unknowns
        .iter()
        .zip(prior)
        .map(|(x, (mean, std))| ((x - mean) / std).powi(2))
        .sum()
}

fn sum_of(white: &[Vec<f64>]) -> f64 {
    white.iter().map(|block| dot(block, block)).sum()
}

/// Sum of whitened squares at the unknowns, with a given whitening filter; for scans.
#[must_use]
pub fn scan_value(balance: &impl Balance, unknowns: &[f64], coefficients: &[f64]) -> f64 {
    let whitener = Whitener::new(coefficients.to_vec(), &balance.own(unknowns));
    sum_of(&whitener.apply(&balance.residual(unknowns)))
}

/// Of the delays that a vehicle speed may have, the one at which a balance leaves least, its unknowns as given for each.
#[must_use]
pub fn best_vehicle_delay(
    balance: &impl Balance,
    unknowns: impl Fn(f64) -> Vec<f64> + Sync,
    coefficients: &[f64],
) -> Option<f64> {
    let (first, last) = VEHICLE_RANGE_S;
    let count = ((last - first) / COARSE_STEP_S).round() as usize;
    let scanned: Vec<(f64, f64)> = (0..=count)
        .into_par_iter()
        .map(|k| first + k as f64 * COARSE_STEP_S)
        .map(|delay| (scan_value(balance, &unknowns(delay), coefficients), delay))
        .filter(|(value, _)| value.is_finite())
        .collect();
    let best = scanned.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(best.1)
}

/// Residuals at the unknowns, each stretch's own columns taken out.
#[must_use]
pub fn rest(balance: &impl Balance, unknowns: &[f64]) -> Vec<Vec<f64>> {
    Whitener::new(Vec::new(), &balance.own(unknowns)).apply(&balance.residual(unknowns))
}

/// Innovations' autoregression at the unknowns.
#[must_use]
pub fn colour_of(balance: &impl Balance, unknowns: &[f64]) -> Vec<f64> {
    autoregression(&rest(balance, unknowns), WHITENING_ORDER)
}

/// An estimate refined on, its whitening filter made anew of what it leaves each time.
#[must_use]
pub fn recoloured(balance: &impl Balance, found: Solution, fixed: &[bool]) -> Option<Solution> {
    let mut at = found;
    for _ in 0..3 {
        let colour = colour_of(balance, &at.unknowns);
        at = refine(balance, &at.unknowns, &colour, 4, fixed)?;
    }
    Some(at)
}

/// Gauss-Newton passes at a fixed whitening filter; those unknowns that are `fixed` stay.
#[must_use]
pub fn refine(
    balance: &impl Balance,
    start: &[f64],
    coefficients: &[f64],
    passes: usize,
    fixed: &[bool],
) -> Option<Solution> {
    let prior = balance.prior();
    let steps = balance.steps();
    let free: Vec<usize> = (0..start.len()).filter(|&i| !fixed[i]).collect();
    let mut unknowns = start.to_vec();
    let mut last = None;
    for pass in 0..=passes {
        let whitener = Whitener::new(coefficients.to_vec(), &balance.own(&unknowns));
        let white = whitener.apply(&balance.residual(&unknowns));
        let rows: usize = white.iter().map(Vec::len).sum();
        let sum = sum_of(&white);
        if rows < 4 * (free.len() + 1) || !sum.is_finite() {
            return None;
        }
        let variance = (sum / rows as f64).max(1e-300);
        let slopes = slopes(
            |x| Some(balance.residual(x)),
            &whitener,
            &unknowns,
            &steps,
            &free,
        )?;
        let smooth = self::slopes(
            |x| balance.instrument(&unknowns, x),
            &whitener,
            &unknowns,
            &steps,
            &free,
        );
        let instrumental = smooth.is_some();
        let weights = smooth.as_ref().unwrap_or(&slopes);
        let blocks = block_sums(&white, weights, &slopes, variance);
        let (matrix, vector) = total(&blocks, &unknowns, &prior, &free);
        let inverse = matrix.clone().try_inverse()?;
        let step = &inverse * &vector;
        last = Some(Solution {
            std: spread(&inverse, &blocks, (&unknowns, &prior), &free),
            unknowns: unknowns.clone(),
            sum,
            rows,
        });
        if pass == passes {
            break;
        }
        if instrumental {
            if stepped_shortly(&mut unknowns, step.as_slice(), &steps, &free) < SETTLED {
                return last.map(|estimate| Solution {
                    unknowns,
                    ..estimate
                });
            }
            continue;
        }
        let before = sum / variance + penalty(&unknowns, &prior);
        let value = |x: &[f64]| {
            sum_of(&whitener.apply(&balance.residual(x))) / variance + penalty(x, &prior)
        };
        let gain = match downhill(&unknowns, step.as_slice(), &free, before, value) {
            Some((lower, value)) => {
                unknowns = lower;
                before - value
            }
            None => 0.0,
        };
        if !(gain > 1e-3) && pass + 1 < passes {
            // Converged.
            return last.map(|estimate| Solution {
                unknowns,
                ..estimate
            });
        }
    }
    last
}

/// Takes a step, a long one shortened, for no sum falls along an instrument's way; how long it was asked for, in the
/// steps of the derivatives.
fn stepped_shortly(unknowns: &mut [f64], step: &[f64], steps: &[f64], free: &[usize]) -> f64 {
    let by = || free.iter().zip(step);
    let longest = by()
        .map(|(&i, step)| (step / (LONGEST_STEP * steps[i])).abs())
        .fold(1.0, f64::max);
    for (&i, step) in by() {
        unknowns[i] -= step / longest;
    }
    by().map(|(&i, step)| (step / steps[i]).abs())
        .fold(0.0, f64::max)
}

/// The first place along a step, shortened where need be, at which the value is lower than before; and that value.
fn downhill(
    unknowns: &[f64],
    step: &[f64],
    free: &[usize],
    before: f64,
    value: impl Fn(&[f64]) -> f64,
) -> Option<(Vec<f64>, f64)> {
    let mut share = 1.0;
    for _ in 0..4 {
        let mut trial = unknowns.to_vec();
        for (&i, step) in free.iter().zip(step) {
            trial[i] -= share * step;
        }
        let value = value(&trial);
        if value < before {
            return Some((trial, value));
        }
        share *= 0.4;
    }
    None
}

/// Largest step at which an instrumental pass has settled, in the steps of the derivatives.
const SETTLED: f64 = 0.05;
/// Longest step of an instrumental pass, in the steps of the derivatives.
const LONGEST_STEP: f64 = 40.0;

/// Whitened slopes of a residual in the free unknowns.
fn slopes(
    residual: impl Fn(&[f64]) -> Option<Vec<Vec<f64>>> + Sync,
    whitener: &Whitener,
    unknowns: &[f64],
    steps: &[f64],
    free: &[usize],
) -> Option<Vec<Vec<Vec<f64>>>> {
    let here = whitener.apply(&residual(unknowns)?);
    free.par_iter()
        .map(|&i| {
            let mut moved = unknowns.to_vec();
            moved[i] += steps[i];
            let moved = whitener.apply(&residual(&moved)?);
            Some(
                moved
                    .iter()
                    .zip(&here)
                    .map(|(m, h)| m.iter().zip(h).map(|(m, h)| (m - h) / steps[i]).collect())
                    .collect(),
            )
        })
        .collect()
}

/// A stretch's share of the normal equations: weights by slopes, weights by weights, weights by residuals.
struct Sums {
    slopes: DMatrix<f64>,
    weights: DMatrix<f64>,
    pull: DVector<f64>,
}

fn block_sums(
    white: &[Vec<f64>],
    weights: &[Vec<Vec<f64>>],
    slopes: &[Vec<Vec<f64>>],
    variance: f64,
) -> Vec<Sums> {
    let count = slopes.len();
    (0..white.len())
        .map(|b| Sums {
            slopes: DMatrix::from_fn(count, count, |i, j| {
                dot(&weights[i][b], &slopes[j][b]) / variance
            }),
            weights: DMatrix::from_fn(count, count, |i, j| {
                dot(&weights[i][b], &weights[j][b]) / variance
            }),
            pull: DVector::from_fn(count, |i, _| dot(&weights[i][b], &white[b]) / variance),
        })
        .collect()
}

fn prior_weight(std: f64) -> f64 {
    if std.is_finite() { std.powi(-2) } else { 0.0 }
}

fn total(
    blocks: &[Sums],
    unknowns: &[f64],
    prior: &[(f64, f64)],
    free: &[usize],
) -> (DMatrix<f64>, DVector<f64>) {
    let count = free.len();
    let mut matrix = DMatrix::zeros(count, count);
    let mut vector = DVector::zeros(count);
    for block in blocks {
        matrix += &block.slopes;
        vector += &block.pull;
    }
    for (place, &i) in free.iter().enumerate() {
        let (mean, std) = prior[i];
        matrix[(place, place)] += prior_weight(std);
        vector[place] += prior_weight(std) * (unknowns[i] - mean);
        matrix[(place, place)] *= 1.0 + 1e-12;
    }
    (matrix, vector)
}

/// Standard deviations: the larger of what white residuals allow and what the stretches' own pulls show.
fn spread(
    inverse: &DMatrix<f64>,
    blocks: &[Sums],
    (unknowns, prior): (&[f64], &[(f64, f64)]),
    free: &[usize],
) -> Vec<f64> {
    let count = blocks.len() as f64;
    let size = free.len();
    let (mut white, mut mean) = (DMatrix::zeros(size, size), DVector::zeros(size));
    for block in blocks {
        white += &block.weights;
        mean += &block.pull / count.max(1.0);
    }
    let mut pulls = DMatrix::zeros(size, size);
    for block in blocks {
        let off = &block.pull - &mean;
        pulls += &off * off.transpose();
    }
    pulls *= count / (count - 1.0).max(1.0);
    for (place, &i) in free.iter().enumerate() {
        white[(place, place)] += prior_weight(prior[i].1);
        pulls[(place, place)] += prior_weight(prior[i].1);
    }
    let turned = inverse.transpose();
    let (white, pulls) = (inverse * white * &turned, inverse * pulls * &turned);
    let mut std = vec![0.0; unknowns.len()];
    for (place, &i) in free.iter().enumerate() {
        let white = white[(place, place)].max(0.0);
        let pulls = if count > 1.0 {
            pulls[(place, place)].max(0.0)
        } else {
            4.0 * white
        };
        std[i] = white.max(pulls).sqrt();
    }
    std
}

#[cfg(test)]
mod tests {
    use super::super::toy::white;
    use super::*;

    #[test]
    fn an_autoregression_is_read_off_its_own_series() {
        let mut x = 0.0;
        let series: Vec<f64> = white(1)
            .take(20_000)
            .map(|u| {
                x = 0.8 * x + u;
                x
            })
            .collect();
        let found = autoregression(&[series], 2);
        assert!(
            (found[0] - 0.8).abs() < 0.03 && found[1].abs() < 0.03,
            "{found:?}"
        );
    }
}
