//! How fresh runs were predicted: the gain above the floor, and whether the stated band holds.

use std::path::Path;

use anyhow::{Context, Result};
use serde::Serialize;

use crate::baseline::record::read as read_run;
use crate::generate::campaign::Truth;
use crate::generate::files::read_column;
use crate::generate::measure::{Base, base_drag, refit};
use crate::tool::Answer;

/// How a fresh run was predicted, in mean squared errors (N²) against the noise-free reading.
#[derive(Clone, Debug, Serialize)]
pub struct GainCase {
    pub file: String,
    pub repaired: f64,
    pub base: f64,
    pub floor: f64,
    pub floor_best: f64,
    /// Share of the oracle's gain above the floor; absent where the base is as good as the floor.
    pub share: Option<f64>,
    /// The same with the floor of an oracle that smooths its inputs.
    pub share_of_best: Option<f64>,
    /// Repaired worse than base by over 1 % of its mean squared error.
    pub worse: bool,
    /// The base worse than plain least squares of the law on the raw channels by over 1 %.
    pub base_worse: bool,
    /// Where the run stands in the campaign's order: `first`, `middle` or `last`.
    pub place: String,
    /// Scored samples whose written, noisy reading lies within the 90 % band of the repaired prediction, of so many.
    pub in_band: (usize, usize),
    /// Mean interval score of that band, and of one around the base as wide as its residuals' RMS makes it, N; none
    /// where nothing is scored.
    pub band_score: Option<(f64, f64)>,
}

/// Nine in ten normal errors lie within so many standard deviations.
const HALF_BAND: f64 = 1.645;

/// A run's written readings, which bands are for, and which samples count.
struct Band<'a> {
    written: &'a [f64],
    scored: &'a [f64],
}

impl Band<'_> {
    /// Error and standard deviation of each sample that counts; not a number where the prediction or its deviation is
    /// missing, as all are where their number is not that of the readings.
    fn errors(&self, predicted: &[f64], sigma: &[f64]) -> impl Iterator<Item = (f64, f64)> {
        let at = |values: &[f64], index: usize| {
            if values.len() == self.written.len() {
                values[index]
            } else {
                f64::NAN
            }
        };
        let told: Vec<(f64, f64)> = (0..self.written.len().min(self.scored.len()))
            .filter(|index| self.scored[*index] > 0.5 && self.written[*index].is_finite())
            .map(|index| (self.written[index] - at(predicted, index), at(sigma, index)))
            .collect();
        told.into_iter()
    }

    /// Samples whose written, noisy reading lies within the 90 % band, of so many: nine in ten where the stated
    /// deviations are right. What is missing holds nothing.
    fn holds(&self, predicted: &[f64], sigma: &[f64]) -> (usize, usize) {
        self.errors(predicted, sigma)
            .fold((0, 0), |(hits, of), (error, sigma)| {
                (hits + usize::from(error.abs() <= HALF_BAND * sigma), of + 1)
            })
    }

    /// RMS of what the prediction misses of the written reading.
    fn rms(&self, predicted: &[f64]) -> f64 {
        let (sum, count) = self
            .errors(predicted, &[])
            .filter(|(error, _)| error.is_finite())
            .fold((0.0, 0.0), |(sum, count), (error, _)| {
                (sum + error * error, count + 1.0)
            });
        (sum / count).sqrt()
    }

    /// Mean interval score of the 90 % band: its width, and twenty times what lies outside (Gneiting and Raftery, J. Am.
    /// Stat. Assoc. 102 (2007), 359-378, equation 43). A band that is not stated is none: of no width.
    fn score(&self, predicted: &[f64], sigma: &[f64]) -> Option<f64> {
        let (sum, count) =
            self.errors(predicted, sigma)
                .fold((0.0, 0.0), |(sum, count), (error, sigma)| {
                    let half = HALF_BAND
                        * if sigma.is_finite() {
                            sigma.max(0.0)
                        } else {
                            0.0
                        };
                    let missed = if error.is_finite() {
                        (error.abs() - half).max(0.0)
                    } else {
                        f64::INFINITY
                    };
                    (sum + 2.0 * half + 20.0 * missed, count + 1.0)
                });
        (count > 0.0).then_some(sum / count)
    }
}

/// Plain least squares of the law on the raw channels of the fitted runs.
fn least_squares(campaigns: &Path, truth: &Truth) -> Result<Base> {
    let mut runs = Vec::new();
    for number in 1.. {
        let path = campaigns
            .join(&truth.campaign)
            .join(format!("run{number:02}.csv"));
        if !path.exists() {
            break;
        }
        runs.push(read_run(&path, &truth.rig)?);
    }
    Ok(refit(&truth.rig, &runs))
}

/// A fresh run's drag by the law alone.
fn plain_base(campaigns: &Path, truth: &Truth, file: &str, base: Base) -> Option<Vec<f64>> {
    let path = campaigns.join("fresh").join(&truth.campaign).join(file);
    let run = read_run(&path, &truth.rig).ok()?;
    Some(
        (0..run.time.len())
            .map(|index| base_drag(&truth.rig, base, &run, index))
            .collect(),
    )
}

/// How the fresh runs were predicted.
pub fn gains(campaigns: &Path, truth: &Truth, answer: &Answer) -> Result<Vec<GainCase>> {
    let mut cases = Vec::new();
    let least_squares = least_squares(campaigns, truth)?;
    for fresh in &truth.fresh {
        let sealed = campaigns
            .join("sealed")
            .join(&truth.campaign)
            .join(&fresh.file);
        let reading = read_column(&sealed, "drag_force_n").context("sealed reading")?;
        let scored = read_column(&sealed, "scored")?;
        let Some(prediction) = answer
            .predictions
            .iter()
            .find(|prediction| prediction.file == fresh.file)
        else {
            continue;
        };
        let error = |predicted: &[f64]| -> f64 {
            if predicted.len() != reading.len() {
                return f64::INFINITY;
            }
            let mut sum = 0.0;
            let mut count = 0.0;
            for ((predicted, reading), scored) in predicted.iter().zip(&reading).zip(&scored) {
                if *scored > 0.5 {
                    sum += if predicted.is_finite() {
                        (predicted - reading).powi(2)
                    } else {
                        f64::INFINITY
                    };
                    count += 1.0;
                }
            }
            if count > 0.0 { sum / count } else { f64::NAN }
        };
        let predicted = |path: &Path| read_column(path, "drag_force_n").unwrap_or_default();
        let plain = plain_base(campaigns, truth, &fresh.file, least_squares)
            .map(|predicted| error(&predicted));
        let written = read_column(&sealed, "written_drag_force_n")?;
        let sigma = read_column(&prediction.repaired, "drag_force_sigma_n").unwrap_or_default();
        let band = Band {
            written: &written,
            scored: &scored,
        };
        let repaired_drag = predicted(&prediction.repaired);
        let in_band = band.holds(&repaired_drag, &sigma);
        let base_drag = predicted(&prediction.base);
        let base_sigma = vec![band.rms(&base_drag); written.len()];
        let band_score = band
            .score(&repaired_drag, &sigma)
            .zip(band.score(&base_drag, &base_sigma));
        let (repaired, base) = (error(&repaired_drag), error(&base_drag));
        let share = |floor: f64| {
            (fresh.gain_scored && base > 1.25 * floor && base.is_finite())
                .then(|| 1.0 - (repaired - floor) / (base - floor))
        };
        cases.push(GainCase {
            file: fresh.file.clone(),
            repaired,
            base,
            floor: fresh.floor,
            floor_best: fresh.floor_best,
            share: share(fresh.floor),
            share_of_best: share(fresh.floor_best),
            worse: repaired.is_nan() || repaired > 1.01 * base,
            base_worse: plain.is_some_and(|plain| base > 1.01 * plain),
            place: fresh.place.clone(),
            in_band,
            band_score,
        });
    }
    Ok(cases)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::Draw;

    #[test]
    fn a_band_that_is_not_stated_holds_nothing() {
        let (written, scored) = ([1.0, 2.0, f64::NAN, 4.0, 9.0], [1.0, 1.0, 1.0, 1.0, 0.0]);
        let band = Band {
            written: &written,
            scored: &scored,
        };
        let predicted = [1.1, 2.5, 3.0, 4.0, 5.0];
        assert_eq!(band.holds(&predicted, &[0.1; 5]), (2, 3));
        assert_eq!(band.holds(&predicted, &[]), (0, 3), "no column");
        assert_eq!(band.holds(&predicted, &[9.0; 4]), (0, 3), "a row too few");
        assert_eq!(band.holds(&[1.0], &[9.0; 5]), (0, 3));
        assert_eq!(band.holds(&predicted, &[f64::NAN; 5]), (0, 3));
        assert!(band.score(&[], &[1.0; 5]).is_some_and(f64::is_infinite));
        // Errors of 0.1, 0.5 and 0, twenty times each.
        assert!((band.score(&predicted, &[]).unwrap() - 20.0 * 0.6 / 3.0).abs() < 1e-9);
    }

    #[test]
    fn the_interval_score_is_least_for_the_true_band() {
        let mut draw = Draw::new(8, &[]);
        let written: Vec<f64> = (0..20_000).map(|_| draw.normal()).collect();
        let scored = vec![1.0; written.len()];
        let band = Band {
            written: &written,
            scored: &scored,
        };
        let predicted = vec![0.0; written.len()];
        let score = |sigma: f64| band.score(&predicted, &vec![sigma; written.len()]).unwrap();
        // 2 phi(1.645) / 0.05 of a standard deviation.
        assert!((score(1.0) - 4.125).abs() < 0.05);
        assert!(score(1.0) < score(0.8) && score(1.0) < score(1.25));
        assert!((band.rms(&predicted) - 1.0).abs() < 0.02);
        let (hits, of) = band.holds(&predicted, &vec![1.0; written.len()]);
        assert!((hits as f64 / of as f64 - 0.9).abs() < 0.01);
    }
}
