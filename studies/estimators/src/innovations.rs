//! Whether innovations are white and as large as their variance says.

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal, StudentsT};

/// Degrees of freedom from which Student's t is taken for the normal distribution.
const AS_NORMAL: usize = 1000;

/// The second half of a run's normalised innovations: once the noise has been learnt.
#[derive(Debug, Clone, Copy, Default)]
pub struct Innovations {
    pub count: f64,
    /// Their sum of squares: chi-squared, were the noise known.
    pub squares: f64,
    /// The same of their normal scores by Student's t, with as many degrees of freedom as samples before each,
    /// less two: chi-squared if the noise was learnt from those samples as well as can be.
    pub scores: f64,
    /// Correlation of each with the next.
    pub lag: f64,
}

/// Sees one innovation after another.
pub struct Watch {
    samples: usize,
    seen: usize,
    before: Option<f64>,
    products: f64,
    sums: Innovations,
}

impl Watch {
    pub fn over(samples: usize) -> Self {
        Self {
            samples,
            seen: 0,
            before: None,
            products: 0.0,
            sums: Innovations::default(),
        }
    }

    /// The next innovation over its standard deviation.
    pub fn see(&mut self, unit: f64) {
        if 2 * self.seen > self.samples {
            self.sums.count += 1.0;
            self.sums.squares += unit * unit;
            self.sums.scores += normal_score(unit, self.seen - 2).powi(2);
            if let Some(before) = self.before {
                self.products += unit * before;
            }
            self.before = Some(unit);
        }
        self.seen += 1;
    }

    pub fn end(self) -> Innovations {
        Innovations {
            lag: self.products / self.sums.squares,
            ..self.sums
        }
    }
}

/// The normal number that is as likely to be exceeded as this one of Student's t.
fn normal_score(unit: f64, degrees: usize) -> f64 {
    if degrees >= AS_NORMAL {
        return unit;
    }
    // The lower tail is exact where the upper one rounds to 1.
    let tail = StudentsT::new(0.0, 1.0, degrees as f64)
        .unwrap()
        .cdf(-unit.abs());
    Normal::standard().inverse_cdf(tail.max(1e-300))
}

/// 95 % bands of one run.
#[derive(Debug, Clone, Copy)]
pub struct Bands {
    /// Of the sum of squares.
    pub squares: [f64; 2],
    /// Of the lag-1 correlation's size.
    pub lag: f64,
}

impl Bands {
    /// For a run's number of innovations.
    pub fn of(count: f64) -> Self {
        let squares = ChiSquared::new(count).unwrap();
        Self {
            squares: [squares.inverse_cdf(0.025), squares.inverse_cdf(0.975)],
            // The exact variance of Σ uᵢ uᵢ₊₁ / Σ uᵢ² for white normal u.
            lag: 1.959_964 * ((count - 1.0) / (count * (count + 2.0))).sqrt(),
        }
    }

    pub fn hold(&self, sum: f64) -> bool {
        (self.squares[0]..=self.squares[1]).contains(&sum)
    }
}

#[cfg(test)]
mod tests {
    use super::{Bands, Watch, normal_score};
    use rand::RngExt;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::StandardNormal;

    /// NIST/SEMATECH e-Handbook 1.3.6.7.2 and 1.3.6.7.4: t of 10 degrees of freedom exceeds 2.228 and chi-squared of
    /// 20 lies below 9.591 and above 34.170 with 2.5 %.
    #[test]
    fn bands_and_scores_are_the_published_ones() {
        assert!((normal_score(2.228, 10).abs() - 1.95996).abs() < 1e-3);
        assert_eq!(normal_score(1.3, 5000), 1.3);
        let bands = Bands::of(20.0);
        assert!((bands.squares[0] - 9.591).abs() < 1e-3);
        assert!((bands.squares[1] - 34.170).abs() < 1e-3);
    }

    #[test]
    fn white_innovations_are_inside_their_bands_in_95_percent_of_runs() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let (mut squares, mut lags) = (0, 0);
        for _ in 0..4000 {
            let mut watch = Watch::over(41);
            for _ in 0..41 {
                watch.see(rng.sample(StandardNormal));
            }
            let seen = watch.end();
            assert_eq!(seen.count, 20.0);
            let bands = Bands::of(seen.count);
            squares += usize::from(bands.hold(seen.squares));
            lags += usize::from(seen.lag.abs() < bands.lag);
        }
        // 95 % and four standard deviations of it.
        for share in [squares, lags] {
            assert!((f64::from(u32::try_from(share).unwrap()) / 4000.0 - 0.95).abs() < 0.014);
        }
    }
}
