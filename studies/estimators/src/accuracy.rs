//! Accuracy and consistency over a grid of curves, beside batch maximum likelihood.

use muslip_analysis::fit::Curve;

use super::contenders::{article_run, efficient_run};
use super::innovations::Bands;
use super::kalman::{iterated_run, unscented_run};
use super::page::{Page, pair, signed, with_error};
use super::streams::{Disturbance, article_slips, bound, grid};
use super::summary::{Contender, Ratio, Summary, Versus, run};

/// Share of 1-sigma ellipses of two dimensions that hold the truth, 1 - e^-½.
const ELLIPSE: f64 = 39.3;

/// The worst of the curves, each figure with the curve that it is from.
pub struct Worst {
    pub rmse: [(Ratio, Curve); 2],
    /// Of all RMSE ratios.
    pub mean: f64,
    /// |bias| beyond maximum likelihood's, in sigmas of the bound.
    pub bias: f64,
    /// The ratio furthest from one.
    pub nees: (Ratio, Curve),
    /// Coverage in percent furthest from [`ELLIPSE`], as a difference, and its standard error.
    pub ellipse: [f64; 2],
    pub curves: f64,
    /// Shares of runs inside their 95 % bands, over all curves.
    pub inside: [f64; 3],
    pub nis: f64,
    pub lag: f64,
}

impl Worst {
    pub fn none() -> Self {
        let nowhere = Curve {
            peak_friction: 0.0,
            critical_slip: 0.0,
        };
        let ratio = |value| Ratio { value, error: 0.0 };
        Self {
            rmse: [(ratio(0.0), nowhere); 2],
            mean: 0.0,
            bias: f64::MIN,
            nees: (ratio(1.0), nowhere),
            ellipse: [0.0; 2],
            curves: 0.0,
            inside: [0.0; 3],
            nis: 0.0,
            lag: 0.0,
        }
    }

    fn take(&mut self, truth: Curve, limit: [f64; 2], ml: &Summary, versus: &Versus) {
        self.curves += 1.0;
        let running = |mean: &mut f64, value: f64| *mean += (value - *mean) / self.curves;
        for i in 0..2 {
            if versus.rmse[i].value > self.rmse[i].0.value {
                self.rmse[i] = (versus.rmse[i], truth);
            }
            self.bias = self.bias.max(beyond(limit, ml, &versus.summary)[i]);
        }
        running(
            &mut self.mean,
            0.5 * (versus.rmse[0].value + versus.rmse[1].value),
        );
        if (versus.nees.value - 1.0).abs() > (self.nees.0.value - 1.0).abs() {
            self.nees = (versus.nees, truth);
        }
        let Summary {
            coverage, streams, ..
        } = versus.summary;
        let ellipse = 100.0 * coverage - ELLIPSE;
        if ellipse.abs() > self.ellipse[0].abs() {
            let error = 100.0 * (coverage * (1.0 - coverage) / streams).sqrt();
            self.ellipse = [ellipse, error];
        }
        for (inside, share) in self.inside.iter_mut().zip(versus.summary.inside) {
            running(inside, share);
        }
        running(&mut self.nis, versus.summary.nis);
        running(&mut self.lag, versus.summary.lag);
    }

    /// Over the grid of curves.
    pub fn over_grid(
        slips: &[f64],
        disturbance: Disturbance,
        seeds: u64,
        contender: &Contender<'_>,
    ) -> Self {
        let mut worst = Self::none();
        for truth in grid() {
            let (ml, [versus]) = run(truth, slips, disturbance, seeds, [contender]);
            worst.take(truth, bound(truth, slips), &ml, &versus);
        }
        worst
    }

    /// The larger of both RMSE ratios.
    pub fn worst_rmse(&self) -> Ratio {
        let [(a, _), (b, _)] = self.rmse;
        if a.value > b.value { a } else { b }
    }

    /// NEES off maximum likelihood's, in percent, with its standard error.
    pub fn nees_off(&self) -> String {
        let Ratio { value, error } = self.nees.0;
        format!("{:+.1} ± {:.1} %", 100.0 * (value - 1.0), 100.0 * error)
    }

    /// The bars on accuracy and on the covariance.
    pub fn bars(&self, page: &mut Page, name: &str) {
        let ratio = self.worst_rmse();
        page.bar(
            &format!("{name}: RMSE over ML's, worst of 50"),
            "at most 1.03",
            with_error(ratio),
            ratio.value <= 1.03,
        );
        page.bar(
            &format!("{name}: bias beyond ML's, sigmas of the bound, worst of 50"),
            "at most 0.05",
            format!("{:+.3}", self.bias),
            self.bias <= 0.05,
        );
        page.bar(
            &format!("{name}: mean NEES off ML's, worst of 25"),
            "at most 5 %",
            self.nees_off(),
            (self.nees.0.value - 1.0).abs() <= 0.05,
        );
        page.bar(
            &format!("{name}: 1-sigma ellipse holds the truth, furthest of 25"),
            "39.3 ± 2 %",
            format!(
                "{:.1} ± {:.1} %",
                ELLIPSE + self.ellipse[0],
                self.ellipse[1]
            ),
            self.ellipse[0].abs() <= 2.0,
        );
    }

    /// The bars on innovations; `scores`: as the noise is still being learnt, by Student's t.
    pub fn innovation_bars(&self, page: &mut Page, name: &str, count: f64, scores: bool) {
        let bands = Bands::of(count);
        let [low, high] = bands.squares.map(|sum| sum / count);
        let share = |share: f64| format!("{:.1} % of runs", 100.0 * share);
        // One run in twenty is outside its own band if all is as it should be.
        let enough = |share: f64| share >= 0.94;
        page.bar(
            &format!("{name}: mean NIS once the noise has been learnt"),
            &format!("inside one run's 95 % band, {low:.3} to {high:.3}"),
            format!("{:.3}", self.nis),
            (low..=high).contains(&self.nis),
        );
        let (what, inside) = if scores {
            ("NIS as Student's t inside its 95 % band", self.inside[1])
        } else {
            ("NIS inside its 95 % band", self.inside[0])
        };
        page.bar(
            &format!("{name}: {what}"),
            "95 % of runs, less 1",
            share(inside),
            enough(inside),
        );
        page.bar(
            &format!(
                "{name}: innovations white, lag-1 correlation inside ±{:.3}",
                bands.lag
            ),
            "95 % of runs, less 1",
            share(self.inside[2]),
            enough(self.inside[2]),
        );
    }
}

/// |bias| beyond maximum likelihood's, in sigmas of the bound.
fn beyond(limit: [f64; 2], ml: &Summary, summary: &Summary) -> [f64; 2] {
    [0, 1].map(|i| (summary.bias[i].abs() - ml.bias[i].abs()) / limit[i])
}

/// RMSE over the bound, as the page states it.
fn over(limit: [f64; 2], summary: &Summary) -> String {
    let ratio = |i: usize| {
        let ratio = summary.rmse[i] / limit[i];
        if ratio < 100.0 {
            format!("{ratio:.2}")
        } else {
            ">100".to_owned()
        }
    };
    format!("{}, {}", ratio(0), ratio(1))
}

pub fn accuracy(page: &mut Page, seeds: u64) {
    let slips = article_slips();
    page.section(&format!(
        "Over the article's range, 41 samples, sigma 0.04, {seeds} streams a curve"
    ));
    page.paragraph(
        "RMSE over the Cramér-Rao bound (mup, sp) of batch maximum likelihood (ML), the article's filter, an iterated extended and an unscented Kalman filter (both told the true noise); the efficient estimator in `f32` over ML on the same streams, with the standard error of its last digits; its bias beyond ML's in sigmas of the bound.",
    );
    let columns = [
        "mup",
        "sp",
        "ML / bound",
        "article / bound",
        "iterated / bound",
        "unscented / bound",
        "efficient / bound",
        "efficient / ML: mup",
        "sp",
        "bias beyond ML's",
    ];
    page.columns(&columns);
    let mut worst = Worst::none();
    let mut consistency = Vec::new();
    for truth in grid() {
        let limit = bound(truth, &slips);
        let (ml, [efficient, article, iterated, unscented]) = run(
            truth,
            &slips,
            Disturbance::default(),
            seeds,
            [
                &|truth, stream| efficient_run(truth, stream, 1.0),
                &article_run,
                &iterated_run,
                &unscented_run,
            ],
        );
        let names = [truth.peak_friction, truth.critical_slip].map(|value| value.to_string());
        let mut row = names.to_vec();
        row.push(over(limit, &ml));
        row.extend(
            [&article, &iterated, &unscented, &efficient].map(|of| over(limit, &of.summary)),
        );
        row.extend(efficient.rmse.map(with_error));
        row.push(signed(beyond(limit, &ml, &efficient.summary), 3));
        page.row(&row);

        let mut row = names.to_vec();
        let Summary {
            nees,
            coverage,
            nis,
            lag,
            inside,
            ..
        } = efficient.summary;
        row.push(pair([nees, ml.nees], 3));
        row.push(with_error(efficient.nees));
        row.push(format!("{:.1}", 100.0 * coverage));
        row.push(format!("{nis:.3}"));
        row.push(pair([100.0 * inside[0], 100.0 * inside[1]], 1));
        row.push(format!("{lag:+.3}"));
        row.push(format!("{:.1}", 100.0 * inside[2]));
        consistency.push(row);
        worst.take(truth, limit, &ml, &efficient);
    }
    page.line("");
    let [low, high] = Bands::of(20.0).squares;
    page.paragraph(format!(
        "Consistency of the efficient estimator. Mean NEES, its and ML's, and their ratio; how often its 1-sigma ellipse holds the truth (39.3 %); of the second half's 20 innovations: mean normalised square (NIS), share of runs whose sum is inside the 95 % band of chi-squared ({low:.1} to {high:.1}), the same with each innovation taken as Student's t with as many degrees of freedom as samples before it less two; mean lag-1 correlation and share of runs inside its 95 % band (±{:.3}). After 20 to 40 samples the noise is known to 11 to 16 %, so that even perfectly learnt noise makes a mean NIS of ν/(ν - 2), averaged 1.07, and chi-squared too narrow a band: Student's t is the band that belongs to it.",
        Bands::of(20.0).lag
    ));
    page.columns(&[
        "mup",
        "sp",
        "NEES, ML's",
        "NEES / ML's",
        "ellipse, %",
        "NIS",
        "inside, %: chi-squared, Student's t",
        "lag 1",
        "inside, %",
    ]);
    for row in consistency {
        page.row(&row);
    }
    page.line("");
    worst.bars(page, "41 samples");
    worst.innovation_bars(page, "41 samples", 20.0, true);
}
