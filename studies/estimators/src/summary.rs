//! What many streams have in common.

use muslip_analysis::fit::Curve;
use rayon::prelude::*;

use super::contenders::{Outcome, batch};
use super::innovations::Bands;
use super::streams::{Disturbance, Stream, stream};

/// Runs one estimator over one stream.
pub type Contender<'a> = dyn Fn(Curve, &Stream) -> Outcome + Sync + 'a;

/// Means over streams.
pub struct Summary {
    pub streams: f64,
    pub rmse: [f64; 2],
    pub bias: [f64; 2],
    pub nees: f64,
    /// Share of 1-sigma ellipses that hold the truth.
    pub coverage: f64,
    pub nis: f64,
    pub lag: f64,
    /// Shares of runs inside their own 95 % bands: sum of squares, of scores by Student's t, lag-1 correlation.
    pub inside: [f64; 3],
}

/// A ratio of two means over the same streams, and its standard error.
#[derive(Clone, Copy)]
pub struct Ratio {
    pub value: f64,
    pub error: f64,
}

/// An estimator beside batch maximum likelihood on the same streams.
pub struct Versus {
    pub summary: Summary,
    /// RMSE over that of maximum likelihood.
    pub rmse: [Ratio; 2],
    /// Mean NEES over that of maximum likelihood.
    pub nees: Ratio,
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += value;
        count += 1.0;
    }
    sum / count
}

/// Ratio of means of pairs; the error by propagation of the pairs' scatter.
fn ratio(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> Ratio {
    let over = mean(pairs.clone().map(|(over, _)| over));
    let under = mean(pairs.clone().map(|(_, under)| under));
    let scatter = mean(pairs.clone().map(|(a, b)| (a / over - b / under).powi(2)));
    Ratio {
        value: over / under,
        error: over / under * (scatter / pairs.count() as f64).sqrt(),
    }
}

impl Ratio {
    /// Of roots.
    fn sqrt(self) -> Self {
        let value = self.value.sqrt();
        Self {
            value,
            error: 0.5 * self.error / value,
        }
    }
}

fn summary<'a>(outcomes: impl Iterator<Item = &'a Outcome> + Clone) -> Summary {
    let each = |of: &dyn Fn(&Outcome) -> f64| mean(outcomes.clone().map(of));
    let share = |of: &dyn Fn(&Outcome) -> bool| each(&|o| f64::from(u8::from(of(o))));
    let bands = Bands::of(
        outcomes
            .clone()
            .next()
            .map_or(1.0, |o| o.innovations.count)
            .max(2.0),
    );
    Summary {
        streams: outcomes.clone().count() as f64,
        rmse: [0, 1].map(|i| each(&|o| o.error[i].powi(2)).sqrt()),
        bias: [0, 1].map(|i| each(&|o| o.error[i])),
        nees: each(&|o| o.nees),
        coverage: share(&|o| o.nees < 1.0),
        nis: each(&|o| o.innovations.squares / o.innovations.count),
        lag: each(&|o| o.innovations.lag),
        inside: [
            share(&|o| bands.hold(o.innovations.squares)),
            share(&|o| bands.hold(o.innovations.scores)),
            share(&|o| o.innovations.lag.abs() < bands.lag),
        ],
    }
}

/// Batch maximum likelihood and the contenders, on the same streams.
pub fn run<const N: usize>(
    truth: Curve,
    slips: &[f64],
    disturbance: Disturbance,
    seeds: u64,
    contenders: [&Contender<'_>; N],
) -> (Summary, [Versus; N]) {
    let outcomes: Vec<(Outcome, [Outcome; N])> = (0..seeds)
        .into_par_iter()
        .filter_map(|seed| {
            let stream = stream(truth, slips, disturbance, seed);
            // Streams on which the likelihood has no peak count for nobody.
            let batch = batch(truth, &stream)?;
            Some((batch, contenders.map(|contender| contender(truth, &stream))))
        })
        .collect();
    let versus = std::array::from_fn(|which| {
        let pairs = outcomes.iter().map(|(batch, all)| (&all[which], batch));
        Versus {
            summary: summary(outcomes.iter().map(|(_, all)| &all[which])),
            rmse: [0, 1].map(|i| {
                ratio(
                    pairs
                        .clone()
                        .map(|(a, b)| (a.error[i].powi(2), b.error[i].powi(2))),
                )
                .sqrt()
            }),
            nees: ratio(pairs.map(|(a, b)| (a.nees, b.nees))),
        }
    });
    (summary(outcomes.iter().map(|(batch, _)| batch)), versus)
}

#[cfg(test)]
mod tests {
    use super::ratio;
    use rand::RngExt;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::StandardNormal;

    #[test]
    fn the_stated_error_of_a_ratio_is_the_scatter_of_repeated_ones() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let (mut sum, mut squares, mut stated) = (0.0, 0.0, 0.0);
        for _ in 0..400 {
            let pairs: Vec<(f64, f64)> = (0..200)
                .map(|_| {
                    let (a, b) = (normal(), normal());
                    ((a + 0.3 * b).powi(2), a * a)
                })
                .collect();
            let ratio = ratio(pairs.into_iter()).sqrt();
            sum += ratio.value / 400.0;
            squares += ratio.value.powi(2) / 400.0;
            stated += ratio.error / 400.0;
        }
        assert!((sum - 1.09_f64.sqrt()).abs() < 0.005);
        let scatter = (squares - sum * sum).sqrt();
        assert!((stated / scatter - 1.0).abs() < 0.15, "{stated} {scatter}");
    }
}
