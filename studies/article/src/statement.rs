//! The article's statements, ours beside them, and the verdict on each.

use muslip::filter::mu_slip::Estimate;

use super::exact::{
    DirectMeasurement, direct_measurement, equal_sensitivity_slips, gradient, slip_of_extremum,
};
use super::monte_carlo::{ArticleStream, Course, Regression};
use super::statistics::{Band, share, share_below};
use super::stream::{FRICTION_STD, TRUTH};

/// Whether a statement of the article is found again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reproduction {
    /// An equation holds; a figure is our median to the digits that the article gives; what it says of a
    /// stream holds in at least 95 % of ours.
    Reproduced,
    /// A figure lies within our 5 to 95 % band; what it says of a stream holds in 5 to 95 % of ours.
    WithinTheBand,
    /// Neither.
    NotReproduced,
}

impl Reproduction {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Reproduced => "reproduced",
            Self::WithinTheBand => "within the band",
            Self::NotReproduced => "not reproduced",
        }
    }

    fn of_equation(holds: bool) -> Self {
        if holds {
            Self::Reproduced
        } else {
            Self::NotReproduced
        }
    }

    fn of_share(share: f64) -> Self {
        if share >= 0.95 {
            Self::Reproduced
        } else if share >= 0.05 {
            Self::WithinTheBand
        } else {
            Self::NotReproduced
        }
    }
}

/// A figure of the article, with the number of decimals that it is given to.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Printed {
    value: f64,
    decimals: usize,
}

impl Printed {
    fn text(self) -> String {
        format!("{:.*}", self.decimals, self.value)
    }

    fn verdict(self, band: Band) -> Reproduction {
        if format!("{:.*}", self.decimals, band.median) == self.text() {
            Reproduction::Reproduced
        } else if band.holds(self.value) {
            Reproduction::WithinTheBand
        } else {
            Reproduction::NotReproduced
        }
    }
}

/// What we find.
#[derive(Debug, Clone, PartialEq)]
pub enum Ours {
    /// The same whatever the noise; in words.
    Exact(String),
    /// A figure that each stream has, and the share of streams in which it is below the article's.
    Figure {
        /// Over the streams.
        band: Band,
        /// None where the article gives no figure.
        share_below: Option<f64>,
        /// Decimals that are worth printing.
        decimals: usize,
    },
    /// Something that holds in a share of the streams.
    Share(f64),
}

/// One statement.
#[derive(Debug, Clone, PartialEq)]
pub struct Statement {
    /// What it is about.
    pub about: &'static str,
    /// What the article says.
    pub article: String,
    /// What we find.
    pub ours: Ours,
    /// Whether the two agree; none where the article says nothing.
    pub verdict: Option<Reproduction>,
}

impl Statement {
    fn equation(about: &'static str, article: &str, found: Option<(String, bool)>) -> Self {
        let (text, holds) = found.unwrap_or_else(|| ("could not be computed".into(), false));
        Self {
            about,
            article: article.into(),
            ours: Ours::Exact(text),
            verdict: Some(Reproduction::of_equation(holds)),
        }
    }

    fn figure(
        about: &'static str,
        value: f64,
        decimals: usize,
        sample: impl Iterator<Item = f64> + Clone,
    ) -> Self {
        let printed = Printed { value, decimals };
        let band = Band::of(sample.clone());
        Self {
            about,
            article: printed.text(),
            ours: Ours::Figure {
                band,
                share_below: Some(share_below(sample, value)),
                decimals: decimals.clamp(3, 4),
            },
            verdict: Some(printed.verdict(band)),
        }
    }

    /// A figure that the article does not give.
    fn unstated(about: &'static str, decimals: usize, sample: impl Iterator<Item = f64>) -> Self {
        Self {
            about,
            article: "not stated".into(),
            ours: Ours::Figure {
                band: Band::of(sample),
                share_below: None,
                decimals,
            },
            verdict: None,
        }
    }

    fn share(about: &'static str, article: &str, sample: impl Iterator<Item = bool>) -> Self {
        let share = share(sample);
        Self {
            about,
            article: article.into(),
            ours: Ours::Share(share),
            verdict: Some(Reproduction::of_share(share)),
        }
    }
}

/// All statements, in the order of the table.
pub(super) fn all(streams: &[ArticleStream]) -> Vec<Statement> {
    let mut statements = about_equations();
    statements.extend(about_results(streams));
    statements.extend(about_the_course(streams));
    statements.extend(about_the_estimates(streams));
    statements
}

fn about_equations() -> Vec<Statement> {
    let h = |slip| gradient(TRUTH, slip).ok();
    let sp = TRUTH.critical_slip;
    let at_peak = h(sp).map(|(by_peak, by_slip)| {
        let holds = (by_peak - 1.0).abs() <= 2.0 * f64::EPSILON && by_slip == 0.0;
        (format!("({by_peak:.12}, {by_slip:.12})"), holds)
    });
    let equal = equal_sensitivity_slips(TRUTH).and_then(|(below, above)| {
        let apart = |slip| h(slip).map(|(a, b)| (a.abs() - b.abs()).abs());
        let holds = apart(below)? < 1e-12 && apart(above)? < 1e-12 && below < sp && sp < above;
        Some((format!("at slips {below:.4} and {above:.4}"), holds))
    });
    let extremum = slip_of_extremum(TRUTH);
    let by_slip = |slip| h(slip).map(|(_, by_slip)| by_slip);
    let dips = by_slip(extremum)
        .zip(by_slip(0.999 * extremum))
        .zip(by_slip(1.001 * extremum))
        .map(|((at, before), after)| {
            let holds = at < before && at < after && (0.05..=0.10).contains(&extremum);
            (format!("at slip {extremum:.4} = (√2 - 1) sp"), holds)
        });
    let turns = by_slip(0.999 * sp)
        .zip(by_slip(1.001 * sp))
        .map(|(before, after)| {
            (
                "negative below it, positive above".to_owned(),
                before < 0.0 && after > 0.0,
            )
        });
    vec![
        Statement::equation("H at the peak", "(1, 0)", at_peak),
        Statement::equation("|∂mu/∂mup| = |∂mu/∂sp|", "either side of the peak", equal),
        Statement::equation("extremum of ∂mu/∂sp", "between 0.05 and 0.10", dips),
        Statement::equation("sign of ∂mu/∂sp", "changes at the peak", turns),
        Statement::equation(
            "gain of a state measured directly",
            "SNR/(1 + SNR)",
            direct(|it| it.gain - it.signal_to_noise / (1.0 + it.signal_to_noise)),
        ),
        Statement::equation(
            "variance of it, after over before",
            "1 - K",
            direct(|it| it.shrinkage - (1.0 - it.gain)),
        ),
    ]
}

/// The largest of a difference that should be zero, over signals from far below to far above the noise.
fn direct(difference: impl Fn(DirectMeasurement) -> f64) -> Option<(String, bool)> {
    let measurement_variance = (3.0 * FRICTION_STD).powi(2);
    let mut largest: f64 = 0.0;
    for std in [0.001, 0.01, 0.1, 0.35, 1.0] {
        let update = direct_measurement(TRUTH, std * std, measurement_variance).ok()?;
        largest = largest.max(difference(update).abs());
    }
    let holds = largest < 1e-12;
    let text = if holds {
        "equal, to rounding".to_owned()
    } else {
        format!("off by up to {largest:.1e}")
    };
    Some((text, holds))
}

fn about_results(streams: &[ArticleStream]) -> Vec<Statement> {
    let filter = |about, value, of: fn(&Estimate<f64>) -> f64| {
        let sample = streams.iter().filter_map(|it| it.first.as_ref().map(of));
        Statement::figure(about, value, 6, sample)
    };
    let fits = |of: fn(&Regression) -> f64| {
        streams
            .iter()
            .filter_map(move |it| it.regression.as_ref().map(of))
    };
    let fit = |about, value, decimals, of| Statement::figure(about, value, decimals, fits(of));
    vec![
        filter("filter's mup", 0.338_894, |it| it.state.peak_friction),
        filter("filter's sp", 0.164_908, |it| it.state.critical_slip),
        fit("regression's mup", 0.348_76, 5, |it| it.curve.peak_friction),
        fit("regression's sp", 0.156_885, 6, |it| it.curve.critical_slip),
        fit("mup after 1 iteration", 0.467_086, 6, |it| {
            it.after_one.peak_friction
        }),
        fit("sp after 1 iteration", 0.1, 1, |it| {
            it.after_one.critical_slip
        }),
        fit("mup after 2 iterations", 0.414_491, 6, |it| {
            it.after_two.peak_friction
        }),
        fit("sp after 2 iterations", 0.135_667, 6, |it| {
            it.after_two.critical_slip
        }),
        Statement::unstated(
            "iterations from (0.6, 0.2)",
            0,
            fits(|it| it.iterations as f64),
        ),
    ]
}

fn about_the_course(streams: &[ArticleStream]) -> Vec<Statement> {
    let courses = || streams.iter().filter_map(|stream| stream.course.as_ref());
    let each = |value: fn(&Course) -> Option<f64>| courses().filter_map(value);
    vec![
        Statement::figure(
            "largest pseudonoise, std",
            0.19,
            2,
            each(|it| Some(it.largest_pseudonoise_std)),
        ),
        Statement::figure(
            "with the measurement's, std",
            0.19,
            2,
            each(|it| Some(it.largest_noise_std)),
        ),
        Statement::figure(
            "slip of the largest pseudonoise",
            0.075,
            3,
            each(|it| Some(it.pseudonoise_peak_slip)),
        ),
        Statement::figure(
            "slip where that has halved",
            0.075,
            3,
            each(|it| it.pseudonoise_half_slip),
        ),
        Statement::share(
            "correlation of the states",
            "positive, then negative",
            courses().map(|it| it.correlation_turns_once),
        ),
        Statement::figure(
            "slip where it changes sign",
            0.25,
            2,
            each(|it| it.correlation_zero_slip),
        ),
        Statement::figure(
            "var sp at slip 0.15 over 0.05",
            1.0,
            1,
            each(|it| Some(it.critical_slip_variance_ratio)),
        ),
    ]
}

fn about_the_estimates(streams: &[ArticleStream]) -> Vec<Statement> {
    let firsts = || streams.iter().filter_map(|stream| stream.first);
    let sigmas = |estimate: Estimate<f64>| {
        let (peak_std, slip_std) = estimate.covariance.std();
        (
            (estimate.state.peak_friction - TRUTH.peak_friction).abs() / peak_std,
            (estimate.state.critical_slip - TRUTH.critical_slip).abs() / slip_std,
        )
    };
    let misses = |estimate: Estimate<f64>| {
        (
            (estimate.state.peak_friction - TRUTH.peak_friction).abs(),
            (estimate.state.critical_slip - TRUTH.critical_slip).abs(),
        )
    };
    let both = || {
        streams
            .iter()
            .filter_map(|stream| Some((misses(stream.first?), misses(stream.second[0]?))))
    };
    vec![
        Statement::unstated(
            "|error| of mup over its sigma",
            3,
            firsts().map(|it| sigmas(it).0),
        ),
        Statement::unstated(
            "|error| of sp over its sigma",
            3,
            firsts().map(|it| sigmas(it).1),
        ),
        Statement::share(
            "both estimates within one sigma",
            "they are",
            firsts().map(|it| sigmas(it).0 <= 1.0 && sigmas(it).1 <= 1.0),
        ),
        Statement::unstated(
            "|error| of mup, second over first",
            3,
            both().map(|(first, second)| second.0 / first.0),
        ),
        Statement::unstated(
            "|error| of sp, second over first",
            3,
            both().map(|(first, second)| second.1 / first.1),
        ),
        Statement::share(
            "a second pass is nearer in mup",
            "it refines",
            both().map(|(first, second)| second.0 < first.0),
        ),
        Statement::share(
            "a second pass is nearer in sp",
            "it refines",
            both().map(|(first, second)| second.1 < first.1),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_is_judged_to_the_digits_that_it_has() {
        let band = Band {
            low: 0.14,
            median: 0.1861,
            high: 0.22,
        };
        let verdict = |value, decimals| Printed { value, decimals }.verdict(band);
        assert_eq!(verdict(0.19, 2), Reproduction::Reproduced);
        assert_eq!(verdict(0.190, 3), Reproduction::WithinTheBand);
        assert_eq!(verdict(0.25, 2), Reproduction::NotReproduced);
    }

    #[test]
    fn a_share_is_judged_by_its_size() {
        assert_eq!(Reproduction::of_share(0.95), Reproduction::Reproduced);
        assert_eq!(Reproduction::of_share(0.5), Reproduction::WithinTheBand);
        assert_eq!(Reproduction::of_share(0.01), Reproduction::NotReproduced);
        assert_eq!(
            Reproduction::of_share(f64::NAN),
            Reproduction::NotReproduced
        );
    }
}
