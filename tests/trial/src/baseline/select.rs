//! Forward selection by BIC among linear signatures, and Ljung and Box's test.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// A candidate: a mechanism and the columns that stand for it.
pub type Candidate = (&'static str, Vec<Vec<f64>>);

/// A residual, the columns that are in from the start, and the candidates.
#[derive(Clone, Debug, Default)]
pub struct Problem {
    pub residual: Vec<f64>,
    pub given: Vec<Vec<f64>>,
    pub candidates: Vec<Candidate>,
}

impl Problem {
    /// One more sample; left out where a channel says nothing. Candidates stand in the same order in all samples.
    pub fn push(&mut self, residual: f64, given: &[f64], row: &[(&'static str, &[f64])]) {
        if self.candidates.is_empty() {
            self.given = vec![Vec::new(); given.len()];
            self.candidates = row
                .iter()
                .map(|(id, values)| (*id, vec![Vec::new(); values.len()]))
                .collect();
        }
        let known = |values: &[f64]| values.iter().all(|value| value.is_finite());
        if !(residual.is_finite() && known(given) && row.iter().all(|(_, values)| known(values))) {
            return;
        }
        self.residual.push(residual);
        for (column, value) in self.given.iter_mut().zip(given) {
            column.push(*value);
        }
        for ((_, columns), (_, values)) in self.candidates.iter_mut().zip(row) {
            for (column, value) in columns.iter_mut().zip(*values) {
                column.push(*value);
            }
        }
    }
}

/// What was chosen, and what alone would have been.
#[derive(Clone, Debug)]
pub struct Selection {
    /// Mechanism and BIC gain, in the order of choice.
    pub chosen: Vec<(&'static str, f64)>,
    pub best: (&'static str, f64),
}

/// A pivot below this share of a column's own square has nothing left to say.
const TINY: f64 = 1e-6;

/// Forward selection by BIC, every sample counted as independent.
pub fn select(problem: &Problem) -> Selection {
    let Problem {
        residual,
        given,
        candidates,
    } = problem;
    let n = residual.len() as f64;
    let mut columns: Vec<&[f64]> = given.iter().map(Vec::as_slice).collect();
    let mut places = Vec::new();
    for (_, group) in candidates {
        places.push(columns.len()..columns.len() + group.len());
        columns.extend(group.iter().map(Vec::as_slice));
    }
    columns.push(residual);
    let mut gram = correlations(&columns);
    for place in 0..given.len() {
        if gram[place][place] > TINY {
            sweep(&mut gram, place);
        }
    }
    let last = columns.len() - 1;
    let mut found = Selection {
        chosen: Vec::new(),
        best: ("", f64::NEG_INFINITY),
    };
    let mut taken = vec![false; candidates.len()];
    loop {
        let error = gram[last][last];
        // An exact fit leaves nothing to explain, and its logarithm nothing but rounding.
        if error.is_nan() || error < 1e-20 {
            break;
        }
        let mut step: Option<(usize, f64)> = None;
        for (index, place) in places.iter().enumerate() {
            if taken[index] {
                continue;
            }
            let mut trial = gram.clone();
            let mut used = 0.0;
            for place in place.clone() {
                if trial[place][place] > TINY {
                    sweep(&mut trial, place);
                    used += 1.0;
                }
            }
            let gain = n * (error / trial[last][last].max(1e-20)).ln() - used * n.ln();
            if used > 0.0 && step.is_none_or(|step| gain > step.1) {
                step = Some((index, gain));
            }
        }
        let Some((index, gain)) = step else { break };
        if found.best.0.is_empty() {
            found.best = (candidates[index].0, gain);
        }
        if gain <= 0.0 || found.chosen.len() >= 12 {
            break;
        }
        taken[index] = true;
        for place in places[index].clone() {
            if gram[place][place] > TINY {
                sweep(&mut gram, place);
            }
        }
        found.chosen.push((candidates[index].0, gain));
    }
    found
}

/// Products of all columns, each in units of its own root mean square.
fn correlations(columns: &[&[f64]]) -> Vec<Vec<f64>> {
    let scaled: Vec<Vec<f64>> = columns
        .iter()
        .map(|column| {
            let length = column.iter().map(|v| v * v).sum::<f64>().sqrt();
            let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
            column.iter().map(|value| value * scale).collect()
        })
        .collect();
    let mut gram = vec![vec![0.0; columns.len()]; columns.len()];
    for a in 0..columns.len() {
        for b in 0..=a {
            let sum: f64 = scaled[a].iter().zip(&scaled[b]).map(|(x, y)| x * y).sum();
            gram[a][b] = sum;
            gram[b][a] = sum;
        }
    }
    gram
}

/// Goodnight's sweep: takes one column into the regression.
fn sweep(matrix: &mut [Vec<f64>], pivot: usize) {
    let d = matrix[pivot][pivot];
    let row = matrix[pivot].clone();
    for (index, line) in matrix.iter_mut().enumerate() {
        if index == pivot {
            continue;
        }
        let factor = line[pivot] / d;
        for (value, above) in line.iter_mut().zip(&row) {
            *value -= factor * above;
        }
        line[pivot] = -factor;
    }
    for value in &mut matrix[pivot] {
        *value /= d;
    }
    matrix[pivot][pivot] = 1.0 / d;
}

/// P value of Ljung and Box's statistic; not a number of fewer values than lags.
pub fn ljung_box(values: &[f64], lags: usize) -> f64 {
    if values.len() <= lags {
        return f64::NAN;
    }
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    let statistic: f64 = (1..=lags)
        .map(|lag| {
            let r: f64 = values
                .iter()
                .zip(&values[lag..])
                .map(|(a, b)| (a - mean) * (b - mean))
                .sum::<f64>()
                / variance;
            r * r / (n - lag as f64)
        })
        .sum::<f64>()
        * n
        * (n + 2.0);
    ChiSquared::new(lags as f64).map_or(f64::NAN, |chi| 1.0 - chi.cdf(statistic))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::Draw;

    #[test]
    fn selection_takes_what_the_residual_is_made_of_and_nothing_else() {
        let mut draw = Draw::new(1, &[]);
        let mut noise = || (0..2000).map(|_| draw.normal()).collect::<Vec<f64>>();
        let (a, b, c, e) = (noise(), noise(), noise(), noise());
        let found = select(&Problem {
            residual: (0..2000).map(|i| 0.5 * a[i] + 3.0 * b[i] + e[i]).collect(),
            given: vec![c],
            candidates: vec![
                ("aero_drag", vec![a]),
                ("run_out", vec![b]),
                ("zero_drift", vec![noise()]),
            ],
        });
        let names: Vec<&str> = found.chosen.iter().map(|chosen| chosen.0).collect();
        assert_eq!(names, ["run_out", "aero_drag"]);
        assert_eq!(found.best.0, "run_out");
    }

    #[test]
    fn whiteness_is_kept_by_white_noise_and_broken_by_colour() {
        let mut draw = Draw::new(2, &[]);
        let white: Vec<f64> = (0..3000).map(|_| draw.normal()).collect();
        assert!(ljung_box(&white, 20) > 0.01);
        let mut state = 0.0;
        let coloured: Vec<f64> = white
            .iter()
            .map(|w| {
                state = 0.3 * state + w;
                state
            })
            .collect();
        assert!(ljung_box(&coloured, 20) < 1e-6);
    }
}
