//! What the innovations of one balance say of the model: their mean square and their dependence on the one before,
//! window by window, in two bands.
//!
//! Under the right model the sum of n squares is χ² with n degrees of freedom, and the sum of n products of
//! neighbours over √n has variance 1 and an excess kurtosis of 18/n (a quadratic form with the eigenvalues
//! cos(π j/(n + 2)) of a path). Both limits are quantiles at half the window's probability, so that the two together
//! raise no more false alarms than stated. Their approximations err to the same side: with the usual windows at 1e-6 a
//! window of the fast band raises 93 % of what is stated, one of the slow band 65 %. Windows do not overlap: their
//! verdicts are independent, and the rate of false alarms is the probability times their number.

use muslip::real::Real;

/// Which innovations a window looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Band {
    /// Each one, over a short window: noise larger than stated, a sudden change.
    Fast,
    /// Sums over blocks, over a long window: what pushes a little in one direction for long.
    Slow,
}

/// How the evidence is weighed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detection<T> {
    /// Innovations in a window of the fast band, >= 8.
    pub fast_window: u16,
    /// Innovations summed into one of the slow band, >= 1.
    pub slow_block: u16,
    /// Blocks in a window of the slow band, >= 8.
    pub slow_window: u16,
    /// Probability, under the right model and noise, that one window of one band of one balance is inconsistent;
    /// 1e-12 to 0.1.
    pub false_alarm_probability: T,
}

impl<T: Real> Detection<T> {
    /// 256 innovations, blocks of 32, 64 blocks, a probability of 1e-6.
    ///
    /// At 1 kHz windows of 0.26 s and 2.05 s: three balances close 47,500 in an hour in which all are formed, so one
    /// false alarm in about 21 such hours.
    pub fn usual() -> Self {
        Self {
            fast_window: 256,
            slow_block: 32,
            slow_window: 64,
            false_alarm_probability: T::from_f64(1e-6),
        }
    }

    pub(crate) fn in_range(&self) -> bool {
        self.fast_window >= 8
            && self.slow_window >= 8
            && self.slow_block >= 1
            && self.false_alarm_probability >= T::from_f64(1e-12)
            && self.false_alarm_probability <= T::from_f64(0.1)
    }
}

/// What one window came to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Statistics<T> {
    /// Mean square of the normalised innovations: 1 under the right model, dimensionless.
    pub mean_square: T,
    /// Mean product of neighbouring innovations: 0 under the right model, dimensionless.
    pub lag_one: T,
}

/// The limits that a window's statistics are held against.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits<T> {
    /// Innovations in a window.
    pub window: u16,
    /// Largest mean square that is consistent.
    pub mean_square: T,
    /// Largest mean product of neighbours that is consistent. Only what is too large counts: noise that was stated
    /// larger than it is makes neighbours opposed, and is no error of the model.
    pub lag_one: T,
}

impl<T: Real> Limits<T> {
    /// Quantiles for windows of so many at this probability of a false alarm.
    pub(crate) fn new(window: u16, probability: T) -> Self {
        let n = T::from_f64(f64::from(window));
        let z = upper_quantile(probability * T::HALF);
        // Wilson and Hilferty 1931, Proc. National Academy of Sciences 17: the cube root of χ²/n is nearly normal.
        let spread = T::from_f64(2.0 / 9.0) / n;
        let root = T::ONE - spread + z * spread.sqrt();
        // Cornish and Fisher 1938: a quantile moved by the excess kurtosis over 24.
        let excess = T::from_f64(18.0 / 24.0) / n;
        let moved = z + excess * z * (z.squared() - T::from_f64(3.0));
        Self {
            window,
            mean_square: root * root * root,
            lag_one: moved / n.sqrt(),
        }
    }

    /// The larger of both statistics over their limits: above 1 the window is inconsistent.
    pub fn share(&self, statistics: &Statistics<T>) -> T {
        let square = statistics.mean_square / self.mean_square;
        let neighbours = statistics.lag_one / self.lag_one;
        square.max(neighbours)
    }
}

/// Normal quantile exceeded with this probability, below 1/2; M. Abramowitz and I. A. Stegun, Handbook of
/// Mathematical Functions, 26.2.23: to 4.5e-4.
fn upper_quantile<T: Real>(probability: T) -> T {
    let c = T::from_f64;
    let t = (-T::TWO * probability.ln()).sqrt();
    let above = c(2.515_517) + t * (c(0.802_853) + t * c(0.010_328));
    let below = T::ONE + t * (c(1.432_788) + t * (c(0.189_269) + t * c(0.001_308)));
    t - above / below
}

/// Sums of a window that is filling, and the statistics of the last one that was full.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Window<T> {
    squares: T,
    products: T,
    previous: T,
    count: u16,
    pub(crate) latest: Option<Statistics<T>>,
    pub(crate) alarms: u32,
}

impl<T: Real> Window<T> {
    pub(crate) const fn empty() -> Self {
        Self {
            squares: T::ZERO,
            products: T::ZERO,
            previous: T::ZERO,
            count: 0,
            latest: None,
            alarms: 0,
        }
    }

    fn add(&mut self, innovation: T, limits: &Limits<T>) {
        self.squares += innovation.squared();
        self.products += innovation * self.previous;
        self.previous = innovation;
        self.count = self.count.saturating_add(1);
        if self.count < limits.window {
            return;
        }
        let n = T::from_f64(f64::from(self.count));
        let statistics = Statistics {
            mean_square: self.squares / n,
            lag_one: self.products / n,
        };
        if limits.share(&statistics) > T::ONE {
            self.alarms = self.alarms.saturating_add(1);
        }
        self.latest = Some(statistics);
        (self.squares, self.products, self.count) = (T::ZERO, T::ZERO, 0);
    }
}

/// Both bands of one balance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bands<T> {
    pub(crate) fast: Window<T>,
    pub(crate) slow: Window<T>,
    block: T,
    in_block: u16,
}

/// Limits of both bands, and what makes a block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BandLimits<T> {
    pub(crate) fast: Limits<T>,
    pub(crate) slow: Limits<T>,
    block: u16,
    /// One over the root of a block's innovations.
    per_block: T,
}

impl<T: Real> BandLimits<T> {
    pub(crate) fn new(detection: &Detection<T>) -> Self {
        let probability = detection.false_alarm_probability;
        Self {
            fast: Limits::new(detection.fast_window, probability),
            slow: Limits::new(detection.slow_window, probability),
            block: detection.slow_block,
            per_block: T::ONE / T::from_f64(f64::from(detection.slow_block)).sqrt(),
        }
    }
}

impl<T: Real> Bands<T> {
    pub(crate) const fn empty() -> Self {
        Self {
            fast: Window::empty(),
            slow: Window::empty(),
            block: T::ZERO,
            in_block: 0,
        }
    }

    /// Takes a normalised innovation up.
    pub(crate) fn add(&mut self, innovation: T, limits: &BandLimits<T>) {
        self.fast.add(innovation, &limits.fast);
        self.block += innovation;
        self.in_block = self.in_block.saturating_add(1);
        if self.in_block >= limits.block {
            self.slow.add(self.block * limits.per_block, &limits.slow);
            (self.block, self.in_block) = (T::ZERO, 0);
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::{Limits, upper_quantile};

    #[test]
    fn quantiles_are_those_of_the_normal_distribution() {
        // Tables of the normal distribution.
        for (probability, quantile) in [
            (0.025, 1.959_964),
            (1e-3, 3.090_232),
            (5e-7, 4.891_638),
            (5e-13, 7.131_0),
        ] {
            let got: f64 = upper_quantile(probability);
            assert!((got - quantile).abs() < 1e-3, "{got} of {quantile}");
        }
    }

    /// Exact upper tail of χ² with an even number of degrees of freedom.
    fn tail_of_squares(sum: f64, degrees: u16) -> f64 {
        let half = sum / 2.0;
        let mut term = 1.0;
        let terms = (0..degrees / 2).map(|i| {
            if i > 0 {
                term *= half / f64::from(i);
            }
            term
        });
        (-half).exp() * terms.sum::<f64>()
    }

    /// Upper tail of the sum of n products of neighbours, a quadratic form of n + 1 normal numbers, by its saddle point
    /// (R. Lugannani and S. Rice, Advances in Applied Probability 12, 1980).
    fn tail_of_products(sum: f64, n: u16) -> f64 {
        let path = f64::from(n) + 2.0;
        let eigenvalues: Vec<f64> = (1..n + 2)
            .map(|j| (core::f64::consts::PI * f64::from(j) / path).cos())
            .collect();
        let over = |f: &dyn Fn(f64) -> f64| eigenvalues.iter().map(|e| f(*e)).sum::<f64>();
        let (mut low, mut high) = (0.0, 0.5 / eigenvalues[0]);
        for _ in 0..200 {
            let t = 0.5 * (low + high);
            let slope = over(&|e| e / (1.0 - 2.0 * t * e));
            (low, high) = if slope < sum { (t, high) } else { (low, t) };
        }
        let t = low;
        let generating = over(&|e| -0.5 * (1.0 - 2.0 * t * e).ln());
        let bend = over(&|e| 2.0 * (e / (1.0 - 2.0 * t * e)).powi(2));
        let w = (2.0 * (t * sum - generating)).sqrt();
        let u = t * bend.sqrt();
        let density = (-0.5 * w * w).exp() / (2.0 * core::f64::consts::PI).sqrt();
        // Of a normal tail by its continued fraction.
        let tail = (1..60).rev().fold(w, |below, i| w + f64::from(i) / below);
        density / tail + density * (1.0 / u - 1.0 / w)
    }

    #[test]
    fn limits_raise_no_more_false_alarms_than_stated_and_not_far_fewer() {
        for (window, probability, least) in [
            (256, 1e-2, 0.99),
            (64, 1e-2, 0.97),
            (256, 1e-6, 0.92),
            (64, 1e-6, 0.63),
        ] {
            let limits = Limits::new(window, probability);
            let n = f64::from(window);
            let raised = tail_of_squares(limits.mean_square * n, window)
                + tail_of_products(limits.lag_one * n, window);
            let share = raised / probability;
            assert!(
                (least..=1.0).contains(&share),
                "{window} at {probability}: {share}"
            );
        }
    }

    #[test]
    fn limits_of_the_mean_square_are_quantiles_of_chi_square() {
        // χ² tables: 64 degrees of freedom at 0.05 is 83.675, 8 at 0.005 is 21.955.
        let wide = Limits::new(64, 0.1_f64).mean_square * 64.0;
        assert!((wide - 83.675).abs() < 0.05, "{wide}");
        let few = Limits::new(8, 0.01_f64).mean_square * 8.0;
        assert!((few - 21.955).abs() < 0.1, "{few}");
    }
}
