//! The posterior of mup and ln sp, by integration over a dense grid.

use muslip::filter::mu_slip::{Covariance, Range, State};

use super::streams::{SIGMA, Stream};

/// The efficient estimator's own prior: mup normal about the start with the start as its deviation, above
/// zero; ln sp normal about the start's with variance ½.
#[derive(Debug, Clone, Copy)]
pub struct Prior {
    start: State<f64>,
}

impl Prior {
    /// Standard deviation of ln sp.
    pub const LOG_SLIP_STD: f64 = std::f64::consts::FRAC_1_SQRT_2;

    pub fn of(range: Range) -> Self {
        Self {
            start: range.initial_state(),
        }
    }

    /// mup and ln sp of two standard normal numbers; mup may be below zero, where the prior has nothing.
    pub fn draw(&self, [a, b]: [f64; 2]) -> [f64; 2] {
        [
            self.start.peak_friction * (1.0 + a),
            self.start.critical_slip.ln() + Self::LOG_SLIP_STD * b,
        ]
    }

    /// But for a constant.
    pub fn log_density(&self, [mup, ln_sp]: [f64; 2]) -> f64 {
        if mup <= 0.0 {
            return f64::NEG_INFINITY;
        }
        let a = mup / self.start.peak_friction - 1.0;
        let b = (ln_sp - self.start.critical_slip.ln()) / Self::LOG_SLIP_STD;
        -0.5 * (a * a + b * b)
    }
}

/// Mean and covariance of (mup, sp).
#[derive(Debug, Clone, Copy)]
pub struct Posterior {
    pub mean: [f64; 2],
    pub covariance: Covariance<f64>,
}

impl Posterior {
    /// Of points with weights, which need not sum to one.
    pub fn of(points: impl Iterator<Item = ([f64; 2], f64)> + Clone) -> Self {
        let (mut total, mut mean) = (0.0, [0.0; 2]);
        for ([a, b], weight) in points.clone() {
            total += weight;
            mean[0] += weight * a;
            mean[1] += weight * b;
        }
        let mean = mean.map(|sum| sum / total);
        let mut covariance = Covariance {
            p00: 0.0,
            p01: 0.0,
            p11: 0.0,
        };
        for ([a, b], weight) in points {
            let (a, b, share) = (a - mean[0], b - mean[1], weight / total);
            covariance.p00 += share * a * a;
            covariance.p01 += share * a * b;
            covariance.p11 += share * b * b;
        }
        Self { mean, covariance }
    }

    pub fn std(&self) -> [f64; 2] {
        [self.covariance.p00.sqrt(), self.covariance.p11.sqrt()]
    }
}

/// Points a side.
const SIDE: u32 = 300;
/// Logarithm of the density, below its peak's, that ends the second grid.
const END: f64 = 32.0;

/// A rectangle of (mup, ln sp).
#[derive(Clone, Copy)]
struct Patch {
    low: [f64; 2],
    high: [f64; 2],
}

impl Patch {
    fn at(&self, axis: usize, index: u32) -> f64 {
        let share = (f64::from(index) + 0.5) / f64::from(SIDE);
        self.low[axis] + share * (self.high[axis] - self.low[axis])
    }
}

/// Posterior of a stream with the true noise: one grid over all that the prior allows finds where the posterior is,
/// a second one over that integrates it.
pub fn dense(prior: Prior, stream: &Stream) -> Posterior {
    let [mup, ln_sp] = prior.draw([7.0, 0.0]);
    let all = Patch {
        low: [0.0, ln_sp - 7.0 * Prior::LOG_SLIP_STD],
        high: [mup, ln_sp + 7.0 * Prior::LOG_SLIP_STD],
    };
    let coarse = log_densities(prior, stream, all);
    let most = coarse.iter().map(|(_, log)| *log).fold(f64::MIN, f64::max);
    let mut patch = Patch {
        low: all.high,
        high: all.low,
    };
    for (point, log) in coarse {
        if most - log < END {
            for (axis, place) in point.into_iter().enumerate() {
                let margin = 1.5 * (all.high[axis] - all.low[axis]) / f64::from(SIDE);
                patch.low[axis] = patch.low[axis].min(place - margin).max(all.low[axis]);
                patch.high[axis] = patch.high[axis].max(place + margin);
            }
        }
    }
    let fine = log_densities(prior, stream, patch);
    let most = fine.iter().map(|(_, log)| *log).fold(f64::MIN, f64::max);
    Posterior::of(
        fine.iter()
            .map(|([mup, ln_sp], log)| ([*mup, ln_sp.exp()], (log - most).exp())),
    )
}

/// Logarithm of the posterior's density at each point, but for a constant.
fn log_densities(prior: Prior, stream: &Stream, patch: Patch) -> Vec<([f64; 2], f64)> {
    let mut densities = Vec::with_capacity((SIDE * SIDE) as usize);
    for row in 0..SIDE {
        let ln_sp = patch.at(1, row);
        // Σ z sech and Σ sech² over the samples: the sum of squares is a parabola in mup.
        let (mut crossed, mut squared) = (0.0, 0.0);
        for (slip, friction) in stream.slips.iter().zip(&stream.frictions) {
            if *slip > 0.0 {
                let sech = 1.0 / (slip.ln() - ln_sp).cosh();
                crossed += friction * sech;
                squared += sech * sech;
            }
        }
        for column in 0..SIDE {
            let mup = patch.at(0, column);
            let fit = mup * (crossed - 0.5 * mup * squared) / (SIGMA * SIGMA);
            let point = [mup, ln_sp];
            densities.push((point, fit + prior.log_density(point)));
        }
    }
    densities
}

#[cfg(test)]
mod tests {
    use super::{Prior, dense};
    use crate::streams::Stream;
    use muslip::filter::mu_slip::Range;

    fn of(slips: Vec<f64>, frictions: Vec<f64>) -> Stream {
        Stream {
            clean: frictions.clone(),
            slips,
            frictions,
        }
    }

    /// mup N(0.6, 0.6²) above zero: mean 0.6 + 0.6 φ(1)/Φ(1), variance 0.36 (1 - r (1 + r)) with
    /// r = φ(1)/Φ(1) = 0.287600; sp log-normal: mean 0.2 e^¼, variance 0.04 (e - e^½).
    #[test]
    fn without_samples_it_is_the_prior() {
        let found = dense(Prior::of(Range::Aircraft), &of(vec![0.0], vec![0.1]));
        let r = 0.287_600;
        assert!((found.mean[0] - 0.6 * (1.0 + r)).abs() < 1e-4);
        assert!((found.covariance.p00 - 0.36 * (1.0 - r * (1.0 + r))).abs() < 1e-3);
        assert!((found.mean[1] - 0.2 * 0.25_f64.exp()).abs() < 1e-4);
        let variance = 0.04 * (1.0_f64.exp() - 0.5_f64.exp());
        assert!((found.covariance.p11 - variance).abs() < 2e-3 * variance);
        assert!(found.covariance.p01.abs() < 1e-5);
    }

    /// Enough samples at both sides of the peak leave a normal posterior: the inverse of the information.
    #[test]
    fn many_samples_leave_the_bound() {
        let slips: Vec<f64> = (0..4000).map(|i| 0.05 + 0.1 * f64::from(i % 5)).collect();
        let law = |s: f64| 2.0 * 0.5 * s * 0.15 / (s * s + 0.15 * 0.15);
        let frictions = slips.iter().map(|&s| law(s)).collect();
        let truth = muslip_analysis::fit::Curve {
            peak_friction: 0.5,
            critical_slip: 0.15,
        };
        let limit = crate::streams::bound(truth, &slips);
        let found = dense(Prior::of(Range::Aircraft), &of(slips, frictions));
        for i in 0..2 {
            assert!((found.mean[i] - [0.5, 0.15][i]).abs() < 0.05 * limit[i]);
            assert!((found.std()[i] / limit[i] - 1.0).abs() < 0.01);
        }
    }
}
