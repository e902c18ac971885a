//! What one stream of noise shows of the article's statements about its own.

use muslip::filter::mu_slip::{Covariance, Estimate, Range};
use muslip_analysis::fit::{Curve, fit_curve};

use super::pass::{self, Step, first_start, second_start};
use super::stream::{TRUTH, frictions, slips};
use super::yardstick::Errors;

/// The article's filter and regression on the article's curve with one seed's noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArticleStream {
    /// Where the filter ends; none where it refused.
    pub first: Option<Estimate<f64>>,
    /// Where the second pass ends, for each way to start it.
    pub second: [Option<Estimate<f64>>; SecondStart::ALL.len()],
    /// Along the first pass.
    pub course: Option<Course>,
    /// The batch fit from (0.6, 0.2).
    pub regression: Option<Regression>,
}

/// How a second pass starts. The state is the one that the first ended with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SecondStart {
    /// Each standard deviation as large as the state, the rule of the first start.
    LikeTheFirst,
    /// With the covariance that the first pass started with.
    FirstStart,
    /// With the covariance that the first pass ended with: every point counts twice.
    FirstEnd,
}

impl SecondStart {
    /// All of them; the first is what the tables call the second pass.
    pub const ALL: [Self; 3] = [Self::LikeTheFirst, Self::FirstStart, Self::FirstEnd];

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::LikeTheFirst => "standard deviations as large as the state",
            Self::FirstStart => "the first pass's at its start",
            Self::FirstEnd => "the first pass's at its end",
        }
    }

    fn estimate(self, first: Estimate<f64>) -> Estimate<f64> {
        let covariance: Covariance<f64> = match self {
            Self::LikeTheFirst => return second_start(first),
            Self::FirstStart => Range::Aircraft.initial_covariance(),
            Self::FirstEnd => first.covariance,
        };
        Estimate {
            state: first.state,
            covariance,
        }
    }
}

/// What the article reads off its figures, along one pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Course {
    /// Root of the largest pseudonoise.
    pub largest_pseudonoise_std: f64,
    /// Root of the largest noise variance: pseudonoise and measurement.
    pub largest_noise_std: f64,
    /// Slip at which the pseudonoise is largest.
    pub pseudonoise_peak_slip: f64,
    /// Slip at which its variance has fallen to half of that; none where it never does.
    pub pseudonoise_half_slip: Option<f64>,
    /// True where the correlation of the states is first positive, then negative to the end.
    pub correlation_turns_once: bool,
    /// Slip at which the correlation first turns negative.
    pub correlation_zero_slip: Option<f64>,
    /// Variance of critical slip at a slip of 0.15 over that at 0.05.
    pub critical_slip_variance_ratio: f64,
}

/// A batch fit with the steps that led to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Regression {
    /// Where it ends.
    pub curve: Curve,
    /// After one iteration.
    pub after_one: Curve,
    /// After two.
    pub after_two: Curve,
    /// Iterations until nothing more is to be gained.
    pub iterations: usize,
}

impl ArticleStream {
    /// The stream of a seed.
    pub fn of(seed: u64) -> Self {
        let points = frictions(TRUTH, seed);
        let steps = pass::traced(first_start(Range::Aircraft), &points).ok();
        let first = steps
            .as_ref()
            .and_then(|steps| steps.last())
            .map(|step| step.estimate);
        let second = SecondStart::ALL.map(|start| {
            let start = start.estimate(first?);
            pass::finished(start, &points).ok()
        });
        Self {
            first,
            second,
            course: steps.as_deref().and_then(Course::of),
            regression: Regression::of(&points),
        }
    }
}

impl Regression {
    fn of(points: &[f64]) -> Option<Self> {
        let start = Curve {
            peak_friction: 0.6,
            critical_slip: 0.2,
        };
        let fit = fit_curve(&slips(), points, start, 100).ok()?;
        let after = |iterations: usize| fit.trajectory.get(iterations).copied();
        fit.converged.then_some(Self {
            curve: fit.curve,
            after_one: after(1).unwrap_or(fit.curve),
            after_two: after(2).unwrap_or(fit.curve),
            iterations: fit.iterations,
        })
    }
}

impl Course {
    fn of(steps: &[Step]) -> Option<Self> {
        let of = |value: fn(&Step) -> f64| -> Vec<(f64, f64)> {
            steps
                .iter()
                .map(|step| (step.fusion.slip_ratio, value(step)))
                .collect()
        };
        let pseudonoise = of(|step| step.fusion.pseudonoise_variance);
        let noise = of(|step| step.fusion.noise_variance);
        let correlation = of(|step| step.estimate.covariance.correlation());
        let variance = of(|step| step.estimate.covariance.p11);

        let (peak_at, largest) = largest(&pseudonoise)?;
        let (_, (_, largest_noise)) = self::largest(&noise)?;
        let half = 0.5 * largest.1;
        let falling = pseudonoise.get(peak_at..)?;
        // Free rolling tells nothing of the curve: the correlation stays exactly zero there.
        let turning: Vec<(f64, f64)> = correlation
            .into_iter()
            .skip_while(|point| point.1 == 0.0)
            .collect();
        let positive = turning.iter().take_while(|point| point.1 > 0.0).count();
        let rest = turning.get(positive..)?;
        Some(Self {
            largest_pseudonoise_std: largest.1.sqrt(),
            largest_noise_std: largest_noise.sqrt(),
            pseudonoise_peak_slip: largest.0,
            pseudonoise_half_slip: falls_through(falling, half),
            correlation_turns_once: positive > 0
                && !rest.is_empty()
                && rest.iter().all(|point| point.1 < 0.0),
            correlation_zero_slip: falls_through(&turning, 0.0),
            critical_slip_variance_ratio: at(&variance, 0.15)? / at(&variance, 0.05)?,
        })
    }
}

/// Index and point (x, y) with the largest y.
fn largest(points: &[(f64, f64)]) -> Option<(usize, (f64, f64))> {
    points
        .iter()
        .copied()
        .enumerate()
        .max_by(|(_, a), (_, b)| a.1.total_cmp(&b.1))
}

/// The x at which y first falls to a level, linear between the points.
fn falls_through(points: &[(f64, f64)], level: f64) -> Option<f64> {
    points
        .windows(2)
        .find_map(|pair| match pair {
            [before, after] if before.1 > level && after.1 <= level => Some((*before, *after)),
            _ => None,
        })
        .map(|((x0, y0), (x1, y1))| x0 + (x1 - x0) * (y0 - level) / (y0 - y1))
}

/// y at an x, linear between the points.
fn at(points: &[(f64, f64)], x: f64) -> Option<f64> {
    points.windows(2).find_map(|pair| match pair {
        [(x0, y0), (x1, y1)] if *x0 <= x && x <= *x1 => Some(y0 + (y1 - y0) * (x - x0) / (x1 - x0)),
        _ => None,
    })
}

/// Errors of the second pass for each way to start it.
pub(super) fn second_starts(streams: &[ArticleStream]) -> Vec<(SecondStart, Errors)> {
    SecondStart::ALL
        .into_iter()
        .enumerate()
        .map(|(index, start)| {
            let errors = streams.iter().map(|stream| {
                let state = stream.second[index]?.state;
                Some((
                    state.peak_friction - TRUTH.peak_friction,
                    state.critical_slip - TRUTH.critical_slip,
                ))
            });
            (start, Errors::of(errors))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossings_and_values_lie_between_the_points() {
        let points = [(0.0, 1.0), (1.0, 3.0), (2.0, -1.0), (3.0, -2.0)];
        assert_eq!(falls_through(&points, 0.0), Some(1.75));
        assert_eq!(falls_through(&points, 5.0), None);
        assert_eq!(at(&points, 0.5), Some(2.0));
        assert_eq!(at(&points, 4.0), None);
        assert_eq!(largest(&points), Some((1, (1.0, 3.0))));
    }
}
