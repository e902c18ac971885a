//! Errors of the estimators over a grid of curves, beside the Cramér-Rao bound.

use muslip::filter::mu_slip::{Estimate, Range};
use muslip_analysis::fit::{Curve, fit_curve};

use super::bound::Bound;
use super::pass::{finished, first_start, second_start};
use super::stream::{frictions, slips};

/// Who estimates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Contender {
    /// The article's filter.
    Filter,
    /// The article's filter once more over the same points, from its own estimate.
    SecondPass,
    /// The batch fit by Levenberg and Marquardt, from the filter's start.
    BatchFit,
}

impl Contender {
    /// All of them, in the order of the tables.
    pub const ALL: [Self; 3] = [Self::Filter, Self::SecondPass, Self::BatchFit];

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Filter => "filter",
            Self::SecondPass => "second pass",
            Self::BatchFit => "batch fit",
        }
    }

    /// As a key.
    pub fn key(self) -> &'static str {
        match self {
            Self::Filter => "filter",
            Self::SecondPass => "second_pass",
            Self::BatchFit => "batch_fit",
        }
    }
}

/// Errors of one quantity over many streams.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accuracy {
    /// Root mean square error, dimensionless.
    pub rmse: f64,
    /// Standard error of that from the finite number of streams.
    pub rmse_standard_error: f64,
    /// Mean error.
    pub bias: f64,
    /// Standard error of that.
    pub bias_standard_error: f64,
}

impl Accuracy {
    fn of(errors: &[f64]) -> Self {
        let count = errors.len() as f64;
        let mean = |power: i32| errors.iter().map(|error| error.powi(power)).sum::<f64>() / count;
        let (bias, square, fourth) = (mean(1), mean(2), mean(4));
        let rmse = square.sqrt();
        Self {
            rmse,
            // The variance of a mean square, carried through its root.
            rmse_standard_error: ((fourth - square * square) / count).sqrt() / (2.0 * rmse),
            bias,
            bias_standard_error: ((square - bias * bias) / count).sqrt(),
        }
    }
}

/// Errors of both quantities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors {
    /// Of peak friction.
    pub peak_friction: Accuracy,
    /// Of critical slip.
    pub critical_slip: Accuracy,
    /// Streams without an estimate, which do not count: an update or a start was refused, or the fit did
    /// not converge.
    pub without_estimate: u64,
}

impl Errors {
    /// Of errors (peak friction, critical slip) stream by stream.
    pub(super) fn of(errors: impl IntoIterator<Item = Option<(f64, f64)>>) -> Self {
        let (mut peak, mut slip, mut without_estimate) = (Vec::new(), Vec::new(), 0);
        for error in errors {
            if let Some(error) = error {
                peak.push(error.0);
                slip.push(error.1);
            } else {
                without_estimate += 1;
            }
        }
        Self {
            peak_friction: Accuracy::of(&peak),
            critical_slip: Accuracy::of(&slip),
            without_estimate,
        }
    }
}

/// One curve of the grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Case {
    truth: Curve,
    range: Range,
}

/// Errors (peak friction, critical slip) of every contender with one stream.
pub(super) type StreamErrors = [Option<(f64, f64)>; Contender::ALL.len()];

/// Peak friction 0.1, 0.35, 0.6, 1.0 by critical slip 0.10, 0.15, 0.20. Filters start for aircraft where
/// the peak is within that range, else for cars.
pub(super) fn grid() -> Vec<Case> {
    let mut cases = Vec::new();
    for peak_friction in [0.1, 0.35, 0.6, 1.0] {
        for critical_slip in [0.10, 0.15, 0.20] {
            cases.push(Case {
                truth: Curve {
                    peak_friction,
                    critical_slip,
                },
                range: if peak_friction <= 0.6 {
                    Range::Aircraft
                } else {
                    Range::Automotive
                },
            });
        }
    }
    cases
}

impl Case {
    /// Runs every contender on the stream of a seed.
    pub(super) fn errors(&self, seed: u64) -> StreamErrors {
        let points = frictions(self.truth, seed);
        let start = first_start(self.range);
        let first = finished(start, &points).ok();
        let second = first.and_then(|first| finished(second_start(first), &points).ok());
        let begin = Curve {
            peak_friction: start.state.peak_friction,
            critical_slip: start.state.critical_slip,
        };
        let fit = fit_curve(&slips(), &points, begin, 100)
            .ok()
            .filter(|fit| fit.converged);
        let of = |estimate: Estimate<f64>| Curve {
            peak_friction: estimate.state.peak_friction,
            critical_slip: estimate.state.critical_slip,
        };
        [first.map(of), second.map(of), fit.map(|fit| fit.curve)].map(|curve| {
            let curve = curve?;
            Some((
                curve.peak_friction - self.truth.peak_friction,
                curve.critical_slip - self.truth.critical_slip,
            ))
        })
    }

    /// Sums the streams up.
    pub(super) fn summarised(&self, streams: &[StreamErrors]) -> Cell {
        let errors = std::array::from_fn(|index| {
            let errors = streams.iter().map(|stream| stream[index]);
            (Contender::ALL[index], Errors::of(errors))
        });
        Cell {
            truth: self.truth,
            range: self.range,
            bound: Bound::of(self.truth),
            errors,
        }
    }
}

/// One curve of the grid with the errors of every contender.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// The true curve.
    pub truth: Curve,
    /// Where the filter and the fit start.
    pub range: Range,
    /// The Cramér-Rao bound.
    pub bound: Bound,
    /// Errors, in the order of [`Contender::ALL`].
    pub errors: [(Contender, Errors); Contender::ALL.len()],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accuracy_is_that_of_a_known_sample() {
        let accuracy = Accuracy::of(&[1.0, -1.0, 3.0, 1.0]);
        assert_eq!(accuracy.bias, 1.0);
        assert!((accuracy.rmse - 3.0_f64.sqrt()).abs() < 1e-15);
        // squares 1, 1, 9, 1 have a variance of 12
        let expected = (12.0_f64 / 4.0).sqrt() / (2.0 * 3.0_f64.sqrt());
        assert!((accuracy.rmse_standard_error - expected).abs() < 1e-15);
        assert!((accuracy.bias_standard_error - (2.0_f64 / 4.0).sqrt()).abs() < 1e-15);
    }

    #[test]
    fn streams_without_an_estimate_are_counted_and_left_out() {
        let errors = Errors::of([Some((0.1, 0.2)), None, Some((-0.1, 0.2))]);
        assert_eq!(errors.without_estimate, 1);
        assert!((errors.peak_friction.rmse - 0.1).abs() < 1e-15);
        assert!((errors.critical_slip.bias - 0.2).abs() < 1e-15);
    }

    #[test]
    fn the_grid_has_twelve_curves_and_starts_cars_from_their_own_range() {
        let grid = grid();
        assert_eq!(grid.len(), 12);
        for case in grid {
            let car = case.truth.peak_friction > 0.6;
            assert_eq!(car, case.range == Range::Automotive);
        }
    }
}
