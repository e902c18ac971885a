//! Is the filter's opinion of its own uncertainty borne out by its innovations?

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Probability of the band, two-sided.
const BAND: f64 = 0.95;
/// The normal distribution's quantile at (1 + BAND)/2.
const NORMAL_QUANTILE: f64 = 1.959_963_984_540_054;
/// From this many samples on, Wilson and Hilferty's formula stands for the exact quantile: its error is
/// then below a millionth.
const EXACT_UP_TO: u64 = 2000;
/// Most lags of the whiteness test.
const LAGS: usize = 10;
/// Fewest innovations that a whiteness test can say anything about.
const FEWEST_FOR_WHITENESS: u64 = 8;

/// What the mean normalised innovation squared says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Inside the band.
    Consistent,
    /// Below: the filter claims more uncertainty than it has.
    Conservative,
    /// Above: the filter claims less uncertainty than it has.
    Overconfident,
}

impl Verdict {
    /// The verdict's word in the JSON.
    pub fn word(self) -> &'static str {
        match self {
            Self::Consistent => "consistent",
            Self::Conservative => "conservative",
            Self::Overconfident => "overconfident",
        }
    }
}

/// The outcome of the two tests.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Consistency {
    /// Mean of the normalised innovation squared, with the filter's own innovation variance.
    pub mean_nis: f64,
    /// Lower end of the 95 % band that a consistent filter's mean falls into.
    pub nis_low: f64,
    /// Upper end of that band.
    pub nis_high: f64,
    /// Probability that white innovations would look at least as correlated as these (Ljung and Box);
    /// 1 where there are too few to tell.
    pub whiteness_p: f64,
    /// What the mean says.
    pub verdict: Verdict,
}

/// Collects innovations one by one.
#[derive(Debug, Clone, Default)]
pub struct ConsistencyTest {
    count: u64,
    nis_sum: f64,
    /// Sums of x(t) x(t - k) over t, for k = 0 ..= LAGS.
    products: [f64; LAGS + 1],
    /// The last innovations, newest first.
    recent: [f64; LAGS],
}

impl ConsistencyTest {
    /// Adds an innovation divided by its standard deviation.
    pub fn add(&mut self, normalised_innovation: f64) {
        let x = normalised_innovation;
        self.count += 1;
        self.nis_sum += x * x;
        self.products[0] += x * x;
        for (product, &before) in self.products[1..].iter_mut().zip(&self.recent) {
            *product += x * before;
        }
        self.recent.rotate_right(1);
        self.recent[0] = x;
    }

    /// The outcome so far; `None` before the first innovation.
    pub fn outcome(&self) -> Option<Consistency> {
        if self.count == 0 {
            return None;
        }
        let mean_nis = (self.nis_sum / self.count as f64).min(f64::MAX);
        let (nis_low, nis_high) = mean_nis_band(self.count);
        let verdict = if mean_nis < nis_low {
            Verdict::Conservative
        } else if mean_nis > nis_high {
            Verdict::Overconfident
        } else {
            Verdict::Consistent
        };
        Some(Consistency {
            mean_nis,
            nis_low,
            nis_high,
            whiteness_p: self.whiteness_p(),
            verdict,
        })
    }

    /// Q = n (n + 2) sum over k of r(k)^2/(n - k), chi-square with as many degrees of freedom as lags
    /// (G. M. Ljung and G. E. P. Box, Biometrika 65 (1978) 297-303). The correlations are taken about
    /// zero, not about the mean: an innovation's expectation is zero, and one that is not is a fault to
    /// be seen (R. K. Mehra, IEEE Trans. Automatic Control 15 (1970) 175-184).
    fn whiteness_p(&self) -> f64 {
        let power = self.products[0];
        if self.count < FEWEST_FOR_WHITENESS || power <= 0.0 {
            return 1.0;
        }
        let n = self.count as f64;
        let lags = LAGS.min((self.count / 4) as usize);
        let q: f64 = self.products[1..=lags]
            .iter()
            .zip(1..)
            .map(|(product, lag)| (product / power).powi(2) / (n - f64::from(lag)))
            .sum::<f64>()
            * n
            * (n + 2.0);
        ChiSquared::new(lags as f64)
            .map(|distribution| distribution.sf(q))
            .ok()
            .filter(|p| p.is_finite())
            .unwrap_or(0.0)
    }
}

/// The 95 % band of the mean of `count` squares of standard normal numbers.
pub fn mean_nis_band(count: u64) -> (f64, f64) {
    let n = count as f64;
    let exact = (count <= EXACT_UP_TO)
        .then(|| ChiSquared::new(n).ok())
        .flatten();
    match exact {
        Some(distribution) => (
            distribution.inverse_cdf((1.0 - BAND) / 2.0) / n,
            distribution.inverse_cdf((1.0 + BAND) / 2.0) / n,
        ),
        None => (
            wilson_hilferty(n, -NORMAL_QUANTILE),
            wilson_hilferty(n, NORMAL_QUANTILE),
        ),
    }
}

/// Quantile of chi-square/n at the normal quantile z: the cube root is nearly normal (E. B. Wilson and
/// M. M. Hilferty, PNAS 17 (1931) 684-688).
fn wilson_hilferty(n: f64, z: f64) -> f64 {
    let spread = 2.0 / (9.0 * n);
    (1.0 - spread + z * spread.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    fn outcome(innovations: impl Iterator<Item = f64>) -> Consistency {
        let mut test = ConsistencyTest::default();
        innovations.for_each(|x| test.add(x));
        test.outcome().unwrap()
    }

    fn normals(seed: u64, count: usize) -> impl Iterator<Item = f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        (0..count).map(move |_| StandardNormal.sample(&mut random))
    }

    #[test]
    fn the_band_is_that_of_published_chi_square_tables() {
        // Chi-square quantiles at 0.025 and 0.975: 1 degree of freedom 0.000982, 5.024; 40: 24.433, 59.342;
        // 100: 74.222, 129.561.
        for (count, low, high) in [
            (1, 0.000982, 5.024),
            (40, 24.433, 59.342),
            (100, 74.222, 129.561),
        ] {
            let (found_low, found_high) = mean_nis_band(count);
            let n = count as f64;
            assert!(
                (found_low - low / n).abs() < 1e-3 / n,
                "{count}: {found_low}"
            );
            assert!(
                (found_high - high / n).abs() < 1e-3 / n,
                "{count}: {found_high}"
            );
        }
    }

    #[test]
    fn the_formula_for_many_samples_joins_the_exact_quantile() {
        let (low, high) = mean_nis_band(EXACT_UP_TO);
        let n = EXACT_UP_TO as f64;
        assert!((wilson_hilferty(n, -NORMAL_QUANTILE) - low).abs() < 1e-6);
        assert!((wilson_hilferty(n, NORMAL_QUANTILE) - high).abs() < 1e-6);
    }

    #[test]
    fn white_innovations_of_unit_variance_pass_both_tests_at_their_rate() {
        let outcomes: Vec<Consistency> = (0..400).map(|seed| outcome(normals(seed, 300))).collect();
        let consistent = outcomes
            .iter()
            .filter(|o| o.verdict == Verdict::Consistent)
            .count();
        let white = outcomes.iter().filter(|o| o.whiteness_p > 0.05).count();
        // 95 % of 400 is 380; four standard deviations are 17.
        assert!((363..=397).contains(&consistent), "{consistent}");
        assert!((363..=397).contains(&white), "{white}");
    }

    #[test]
    fn scale_moves_the_verdict_and_not_the_whiteness() {
        let plain = outcome(normals(1, 500));
        let small = outcome(normals(1, 500).map(|x| 0.3 * x));
        let large = outcome(normals(1, 500).map(|x| 3.0 * x));
        assert_eq!(small.verdict, Verdict::Conservative);
        assert_eq!(large.verdict, Verdict::Overconfident);
        assert!((small.whiteness_p - plain.whiteness_p).abs() < 1e-9);
    }

    #[test]
    fn coloured_or_biased_innovations_are_not_white() {
        let mut before = 0.0;
        let coloured = outcome(normals(2, 500).map(|x| {
            before = 0.4 * before + x;
            before
        }));
        assert!(coloured.whiteness_p < 1e-6);
        assert!(outcome(normals(3, 500).map(|x| x + 0.5)).whiteness_p < 1e-6);
    }

    #[test]
    fn few_or_vanishing_innovations_give_finite_figures() {
        assert!(ConsistencyTest::default().outcome().is_none());
        for innovations in [vec![0.0], vec![0.0; 50], vec![1e150; 50], vec![1e154; 50]] {
            let o = outcome(innovations.into_iter());
            for figure in [o.mean_nis, o.nis_low, o.nis_high, o.whiteness_p] {
                assert!(figure.is_finite(), "{o:?}");
            }
        }
    }
}
