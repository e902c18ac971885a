//! Levenberg and Marquardt's method on the two-parameter law.
//!
//! Source: D. W. Marquardt, "An Algorithm for Least-Squares Estimation of Nonlinear Parameters" (1963),
//! with the damping of H. B. Nielsen, "Damping Parameter in Marquardt's Method" (IMM-REP-1999-05). The
//! unknowns are mup and ln sp, so that no step leaves sp > 0; the covariance is stated for mup and sp
//! themselves.

/// A curve of the two-parameter law mu(s) = 2 mup s sp / (sp^2 + s^2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curve {
    /// Friction at the peak, mup.
    pub peak_friction: f64,
    /// Slip at the peak, sp > 0.
    pub critical_slip: f64,
}

impl Curve {
    /// Friction at a slip.
    pub fn friction(&self, slip_ratio: f64) -> f64 {
        self.peak_friction * unit_friction(slip_ratio, self.critical_slip)
    }

    /// Derivatives of friction at a slip with respect to (mup, sp).
    pub fn gradient(&self, slip_ratio: f64) -> (f64, f64) {
        (
            unit_friction(slip_ratio, self.critical_slip),
            self.peak_friction * unit_slope(slip_ratio, self.critical_slip),
        )
    }
}

/// Friction of the law with mup = 1, which is also its derivative with respect to mup.
fn unit_friction(slip_ratio: f64, critical_slip: f64) -> f64 {
    2.0 * slip_ratio * critical_slip / (critical_slip * critical_slip + slip_ratio * slip_ratio)
}

/// Derivative of [`unit_friction`] with respect to sp: 2 s (s^2 - sp^2)/(sp^2 + s^2)^2.
fn unit_slope(slip_ratio: f64, critical_slip: f64) -> f64 {
    let (s2, sp2) = (slip_ratio * slip_ratio, critical_slip * critical_slip);
    2.0 * slip_ratio * (s2 - sp2) / ((sp2 + s2) * (sp2 + s2))
}

/// The outcome of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveFit {
    /// The fitted curve.
    pub curve: Curve,
    /// Covariance s^2 (J'J)^-1 of (mup, sp) as (P11, P12, P22), with s^2 the residuals' sum of squares
    /// over n - 2.
    pub covariance: (f64, f64, f64),
    /// Steps that the method accepted.
    pub iterations: usize,
    /// True where the method stopped because nothing more is to be gained; false where the limit of
    /// iterations ended it.
    pub converged: bool,
    /// Root mean square of the friction residuals.
    pub rmse_friction: f64,
    /// The start, and the curve after every accepted step.
    pub trajectory: Vec<Curve>,
}

impl CurveFit {
    /// 1-sigma of mup.
    pub fn peak_friction_std(&self) -> f64 {
        self.covariance.0.sqrt()
    }

    /// 1-sigma of sp.
    pub fn critical_slip_std(&self) -> f64 {
        self.covariance.2.sqrt()
    }

    /// Correlation of mup and sp.
    pub fn correlation(&self) -> f64 {
        let (p11, p12, p22) = self.covariance;
        let scale = (p11 * p22).sqrt();
        if scale > 0.0 {
            (p12 / scale).clamp(-1.0, 1.0)
        } else {
            0.0
        }
    }
}

/// Why there is no fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FitError {
    /// Two parameters and their noise need three points.
    #[error("{0} usable samples: a fit needs at least 3")]
    TooFewPoints(usize),
    /// Slips and frictions must come in pairs.
    #[error("{slips} slips for {frictions} frictions")]
    Unpaired {
        /// Number of slips.
        slips: usize,
        /// Number of frictions.
        frictions: usize,
    },
    /// A start outside the law's range, or points that are not finite.
    #[error("a start or a point is not finite, or the start is not positive")]
    NonFinite,
    /// The points do not hold both parameters (no friction, or all at one slip).
    #[error("the samples do not determine the curve: they need friction at several slips")]
    Undetermined,
}

/// Fits the two-parameter law to points of friction against slip, all of one weight.
///
/// `slips` and `frictions` are dimensionless and of one length; `start` is where the method begins
/// ([`robust_start`] finds one). An iteration is an accepted step.
///
/// # Errors
/// [`FitError`]; a fit that runs into `maximum_iterations` is no error but not `converged`.
pub fn fit_curve(
    slips: &[f64],
    frictions: &[f64],
    start: Curve,
    maximum_iterations: usize,
) -> Result<CurveFit, FitError> {
    let points = slips.len();
    if points != frictions.len() {
        return Err(FitError::Unpaired {
            slips: points,
            frictions: frictions.len(),
        });
    }
    if points < 3 {
        return Err(FitError::TooFewPoints(points));
    }
    let sound_start = start.peak_friction.is_finite()
        && start.critical_slip.is_finite()
        && start.critical_slip > 0.0;
    if !sound_start {
        return Err(FitError::NonFinite);
    }
    if frictions.iter().all(|&friction| friction == 0.0) {
        return Err(FitError::Undetermined);
    }
    let (trajectory, converged) = descend(slips, frictions, start, maximum_iterations);
    let curve = trajectory.last().copied().unwrap_or(start);
    let usable = curve.peak_friction.is_finite()
        && curve.critical_slip.is_finite()
        && curve.critical_slip > 0.0;
    if !usable {
        return Err(FitError::Undetermined);
    }
    let (sum_of_squares, covariance) = covariance(slips, frictions, curve)?;
    Ok(CurveFit {
        curve,
        covariance,
        iterations: trajectory.len().saturating_sub(1),
        converged,
        rmse_friction: (sum_of_squares / points as f64).sqrt(),
        trajectory,
    })
}

/// Sum of squared residuals and s^2 (J'J)^-1 for (mup, sp).
fn covariance(
    slips: &[f64],
    frictions: &[f64],
    curve: Curve,
) -> Result<(f64, (f64, f64, f64)), FitError> {
    let (mut sum, mut j11, mut j12, mut j22) = (0.0, 0.0, 0.0, 0.0);
    for (&slip, &friction) in slips.iter().zip(frictions) {
        let (by_peak, by_slip) = curve.gradient(slip);
        let residual = friction - curve.peak_friction * by_peak;
        sum += residual * residual;
        j11 += by_peak * by_peak;
        j12 += by_peak * by_slip;
        j22 += by_slip * by_slip;
    }
    if !sum.is_finite() {
        return Err(FitError::NonFinite);
    }
    let determinant = j11 * j22 - j12 * j12;
    // Beyond a correlation of 1 - 1e-12 the difference is rounding, not information; so is an effect of
    // sp that is a millionth of the friction's.
    let by_log_slip = j22 * curve.critical_slip.powi(2);
    let determined = determinant > 1e-12 * j11 * j22
        && by_log_slip > 1e-12 * j11 * curve.peak_friction.powi(2)
        && j11 > 0.0
        && j22 > 0.0;
    if !determined {
        return Err(FitError::Undetermined);
    }
    let scale = sum / (slips.len() - 2) as f64 / determinant;
    Ok((sum, (scale * j22, -scale * j12, scale * j11)))
}

/// A start for [`fit_curve`] that needs no guess: for each sp of a geometric grid from 0.01 to 1 the
/// best mup is linear least squares; the pair with the smallest sum of squares wins.
pub fn robust_start(slips: &[f64], frictions: &[f64]) -> Curve {
    const CANDIDATES: usize = 25;
    let sp = |index: usize| 0.01 * 100f64.powf(index as f64 / (CANDIDATES - 1) as f64);
    // Sums of unit friction squared and of unit friction times friction, for every candidate.
    let mut sums = [(0.0, 0.0); CANDIDATES];
    for (&slip, &friction) in slips.iter().zip(frictions) {
        for (index, (squared, crossed)) in sums.iter_mut().enumerate() {
            let unit = unit_friction(slip, sp(index));
            *squared += unit * unit;
            *crossed += unit * friction;
        }
    }
    let mut best = Curve {
        peak_friction: 0.6,
        critical_slip: 0.2,
    };
    let mut largest_gain = 0.0;
    for (index, (squared, crossed)) in sums.into_iter().enumerate() {
        // What fitting this candidate takes off the sum of squares.
        let gain = crossed * crossed / squared;
        if gain.is_finite() && gain > largest_gain {
            largest_gain = gain;
            best = Curve {
                peak_friction: crossed / squared,
                critical_slip: sp(index),
            };
        }
    }
    best
}

/// Sum of squared residuals at a curve, and with respect to (mup, ln sp) the normal matrix J'J as
/// (11, 12, 22) and the gradient J'r.
struct Squares {
    sum: f64,
    normal: (f64, f64, f64),
    gradient: (f64, f64),
}

impl Squares {
    fn at(curve: Curve, slips: &[f64], frictions: &[f64]) -> Self {
        let mut squares = Self {
            sum: 0.0,
            normal: (0.0, 0.0, 0.0),
            gradient: (0.0, 0.0),
        };
        for (&slip, &friction) in slips.iter().zip(frictions) {
            let (by_peak, by_slip) = curve.gradient(slip);
            // d/d(ln sp) = sp d/d(sp)
            let by_log_slip = curve.critical_slip * by_slip;
            let residual = friction - curve.peak_friction * by_peak;
            squares.sum += residual * residual;
            squares.normal.0 += by_peak * by_peak;
            squares.normal.1 += by_peak * by_log_slip;
            squares.normal.2 += by_log_slip * by_log_slip;
            squares.gradient.0 += by_peak * residual;
            squares.gradient.1 += by_log_slip * residual;
        }
        squares
    }

    /// The step of (mup, ln sp) that solves (J'J + damping diag(J'J)) step = J'r, and by how much it
    /// lowers the sum if residuals are straight lines.
    fn step(&self, damping: f64) -> ((f64, f64), f64) {
        let ((n11, n12, n22), (g1, g2)) = (self.normal, self.gradient);
        let (d1, d2) = (damping * n11, damping * n22);
        let determinant = (n11 + d1) * (n22 + d2) - n12 * n12;
        let by_peak = ((n22 + d2) * g1 - n12 * g2) / determinant;
        let by_log_slip = ((n11 + d1) * g2 - n12 * g1) / determinant;
        let gain = by_peak * (d1 * by_peak + g1) + by_log_slip * (d2 * by_log_slip + g2);
        ((by_peak, by_log_slip), gain)
    }
}

/// The start and the curve after every accepted step, and whether the last is a minimum as far as f64
/// can tell.
fn descend(
    slips: &[f64],
    frictions: &[f64],
    start: Curve,
    maximum_iterations: usize,
) -> (Vec<Curve>, bool) {
    // What MINPACK takes: a sum that would fall by less than this part, twice over, is at its least.
    const LEAST_GAIN: f64 = 30.0 * f64::EPSILON;
    // From this damping on a step is below the rounding of the curve.
    const LARGEST_DAMPING: f64 = 1e16;
    let (mut damping, mut growth) = (1e-3, 2.0);
    let mut trajectory = vec![start];
    let mut curve = start;
    let mut squares = Squares::at(curve, slips, frictions);
    loop {
        let ((by_peak, by_log_slip), expected) = squares.step(damping);
        // At zero residuals nothing is left to expect; undetermined points have no step.
        let worth_it = expected > LEAST_GAIN * squares.sum;
        if !worth_it {
            return (trajectory, expected.is_finite());
        }
        if trajectory.len() > maximum_iterations {
            return (trajectory, false);
        }
        let next = Curve {
            peak_friction: curve.peak_friction + by_peak,
            critical_slip: curve.critical_slip * by_log_slip.exp(),
        };
        let at_next = Squares::at(next, slips, frictions);
        let gained = (squares.sum - at_next.sum) / expected;
        if gained > 0.0 {
            damping *= (1.0 - (2.0 * gained - 1.0).powi(3)).max(1.0 / 3.0);
            growth = 2.0;
            (curve, squares) = (next, at_next);
            trajectory.push(curve);
        } else {
            damping *= growth;
            growth *= 2.0;
            if damping > LARGEST_DAMPING {
                return (trajectory, true);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn article_slips() -> Vec<f64> {
        (0..=40).map(|i| (f64::from(i) / 40.0).powi(2)).collect()
    }

    const TRUTH: Curve = Curve {
        peak_friction: 0.35,
        critical_slip: 0.15,
    };

    /// A fixed pattern of zero mean in place of noise.
    fn disturbed(slips: &[f64]) -> Vec<f64> {
        slips
            .iter()
            .enumerate()
            .map(|(i, &slip)| TRUTH.friction(slip) + 0.04 * (2.3 * i as f64).sin())
            .collect()
    }

    #[test]
    fn noise_free_points_give_back_their_curve_from_far_away() {
        let slips = article_slips();
        let frictions: Vec<f64> = slips.iter().map(|&slip| TRUTH.friction(slip)).collect();
        for start in [(0.6, 0.2), (1.0, 0.02), (0.1, 0.9)] {
            let start = Curve {
                peak_friction: start.0,
                critical_slip: start.1,
            };
            let fit = fit_curve(&slips, &frictions, start, 100).unwrap();
            assert!(fit.converged);
            assert!((fit.curve.peak_friction - 0.35).abs() < 1e-9, "{fit:?}");
            assert!((fit.curve.critical_slip - 0.15).abs() < 1e-9, "{fit:?}");
        }
    }

    #[test]
    fn the_minimum_agrees_with_a_direct_search() {
        let slips = article_slips();
        let frictions = disturbed(&slips);
        let fit = fit_curve(&slips, &frictions, robust_start(&slips, &frictions), 100).unwrap();
        let cost = |peak_friction: f64, critical_slip: f64| -> f64 {
            let curve = Curve {
                peak_friction,
                critical_slip,
            };
            slips
                .iter()
                .zip(&frictions)
                .map(|(&s, &f)| (f - curve.friction(s)).powi(2))
                .sum()
        };
        let Curve {
            peak_friction: a,
            critical_slip: b,
        } = fit.curve;
        let least = cost(a, b);
        for (da, db) in [
            (1e-4, 0.0),
            (-1e-4, 0.0),
            (0.0, 1e-4),
            (0.0, -1e-4),
            (1e-4, 1e-4),
        ] {
            assert!(cost(a + da, b + db) > least);
        }
        assert!((fit.rmse_friction - (least / 41.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn covariance_is_that_of_the_curvature_of_the_cost() {
        let slips = article_slips();
        let frictions = disturbed(&slips);
        let fit = fit_curve(&slips, &frictions, TRUTH, 100).unwrap();
        // J by differences, independent of the closed forms above.
        let h = 1e-6;
        let c = fit.curve;
        let friction = |peak_friction, critical_slip, s| {
            Curve {
                peak_friction,
                critical_slip,
            }
            .friction(s)
        };
        let (mut j11, mut j12, mut j22) = (0.0, 0.0, 0.0);
        for &s in &slips {
            let a = (friction(c.peak_friction + h, c.critical_slip, s)
                - friction(c.peak_friction - h, c.critical_slip, s))
                / (2.0 * h);
            let b = (friction(c.peak_friction, c.critical_slip + h, s)
                - friction(c.peak_friction, c.critical_slip - h, s))
                / (2.0 * h);
            j11 += a * a;
            j12 += a * b;
            j22 += b * b;
        }
        let s2 = fit.rmse_friction.powi(2) * 41.0 / 39.0;
        let determinant = j11 * j22 - j12 * j12;
        let expected = [
            s2 * j22 / determinant,
            -s2 * j12 / determinant,
            s2 * j11 / determinant,
        ];
        let found = [fit.covariance.0, fit.covariance.1, fit.covariance.2];
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
        }
    }

    #[test]
    fn the_limit_of_iterations_ends_the_fit_where_it_is() {
        let slips = article_slips();
        let frictions = disturbed(&slips);
        let start = Curve {
            peak_friction: 0.6,
            critical_slip: 0.2,
        };
        let whole = fit_curve(&slips, &frictions, start, 100).unwrap();
        assert_eq!(whole.trajectory[0], start);
        assert_eq!(whole.trajectory.len(), whole.iterations + 1);
        for limit in 0..whole.iterations {
            let cut = fit_curve(&slips, &frictions, start, limit).unwrap();
            assert!(!cut.converged);
            assert_eq!(cut.iterations, limit);
            assert_eq!(cut.trajectory[..], whole.trajectory[..=limit]);
            assert_eq!(cut.curve, whole.trajectory[limit]);
        }
    }

    #[test]
    fn points_that_cannot_hold_the_curve_are_refused() {
        let fit = |slips: &[f64], frictions: &[f64]| {
            fit_curve(slips, frictions, robust_start(slips, frictions), 100)
        };
        assert_eq!(
            fit(&[0.1, 0.2], &[0.3, 0.4]),
            Err(FitError::TooFewPoints(2))
        );
        assert!(fit(&[0.1; 9], &[0.3; 9]).is_err());
        assert!(fit(&[0.0, 0.1, 0.2, 0.3], &[0.0; 4]).is_err());
        assert!(fit(&[0.0; 5], &[0.1; 5]).is_err());
        assert!(fit(&[0.1, f64::NAN, 0.3], &[0.1; 3]).is_err());
        assert!(fit(&[0.1, 0.2, 0.3], &[0.1, 1e308, 1e308]).is_err());
        assert!(fit_curve(&[0.1; 3], &[0.1; 2], TRUTH, 9).is_err());
    }
}
