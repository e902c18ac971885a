//! The efficient estimator under other conditions than the article's.

use muslip_analysis::fit::Curve;

use super::accuracy::Worst;
use super::contenders::{article_run, efficient_run, ungated_run};
use super::page::{Page, signed, with_error};
use super::robust::{Loss, robust_run, told_run};
use super::streams::{Disturbance, article_slips, rig_slips};
use super::summary::{Contender, Ratio, Summary, run};

/// Share of outliers.
const OUTLIERS: f64 = 0.05;

fn row(page: &mut Page, name: &str, worst: &Worst) {
    let at = |(ratio, curve): (Ratio, Curve)| {
        format!(
            "{} at ({}, {})",
            with_error(ratio),
            curve.peak_friction,
            curve.critical_slip
        )
    };
    page.row(&[
        name.to_owned(),
        at(worst.rmse[0]),
        at(worst.rmse[1]),
        format!("{:.3}", worst.mean),
        worst.nees_off(),
    ]);
}

pub fn conditions(page: &mut Page, seeds: u64) {
    // A run of 10,000 samples takes the time of 250 short ones.
    let fewer = (seeds / 5).max(20);
    let long_name = format!("10,000 samples of a rig, {fewer} streams");
    page.section("Under other conditions");
    page.paragraph(format!(
        "RMSE of the efficient estimator (`f32`) over that of ML on the same streams, which are {seeds} a curve where nothing else is said; ML sees no outliers. The worst of the 25 curves with the standard error of its last digits, and the mean of both ratios over them."
    ));
    page.columns(&[
        "condition",
        "mup, worst",
        "sp, worst",
        "mean",
        "NEES off ML's, worst",
    ]);
    let (short, long) = (article_slips(), rig_slips());
    let none = Disturbance::default();
    for (name, declared) in [
        ("noise declared half of what it is", 0.5),
        ("noise declared half as much again", 1.5),
    ] {
        let worst = Worst::over_grid(&short, none, seeds, &|truth, stream| {
            efficient_run(truth, stream, declared)
        });
        row(page, name, &worst);
        worst.bars(page, name);
        worst.innovation_bars(page, name, 20.0, true);
    }
    let efficient: &Contender<'_> = &|truth, stream| efficient_run(truth, stream, 1.0);
    let worst = Worst::over_grid(&long, none, fewer, efficient);
    row(page, &long_name, &worst);
    worst.bars(page, "10,000 samples");
    worst.innovation_bars(page, "10,000 samples", 4999.0, false);
    for (name, slips, seeds, declared) in [
        ("half the noise", &short, seeds, 0.5),
        ("10,000 samples", &long, fewer, 1.0),
    ] {
        let worst = Worst::over_grid(slips, none, seeds, &|truth, stream| {
            ungated_run(truth, stream, declared)
        });
        row(page, &format!("{name}, `nis_gate: None`"), &worst);
    }
    outliers(page, seeds, fewer);
    slip_noise(page, seeds, fewer);
}

/// Rows of the same table, and references for them.
fn outliers(page: &mut Page, seeds: u64, fewer: u64) {
    let outliers = Disturbance {
        outliers: OUTLIERS,
        ..Disturbance::default()
    };
    let (short, long) = (article_slips(), rig_slips());
    let efficient: &Contender<'_> = &|truth, stream| efficient_run(truth, stream, 1.0);
    let some = (seeds / 5).max(20);
    for (name, slips, seeds) in [
        (
            "5 % outliers of 10 sigma, 41 samples".to_owned(),
            &short,
            seeds,
        ),
        (
            format!("5 % outliers of 10 sigma, 10,000 samples, {fewer} streams"),
            &long,
            fewer,
        ),
    ] {
        let worst = Worst::over_grid(slips, outliers, seeds, efficient);
        row(page, &name, &worst);
        let ratio = worst.worst_rmse();
        page.bar(
            &format!(
                "5 % outliers, {} samples: RMSE over clean ML's, worst of 50",
                slips.len()
            ),
            "at most 1.10",
            with_error(ratio),
            ratio.value <= 1.10,
        );
    }
    page.line("");
    page.paragraph(format!(
        "What is attainable with these outliers: batch fits of the 41 samples, {some} streams a curve, beside the same ML of the streams without outliers. But for the second they learn the noise; but for the first two none knows which samples are outliers or how far off they are. The minima are global ones (descents from the eight best of 32 starts)."
    ));
    page.columns(&[
        "batch fit",
        "mup, worst",
        "sp, worst",
        "mean",
        "NEES off ML's, worst",
    ]);
    let told: &Contender<'_> = &told_run;
    let by = |loss: Loss| move |truth: Curve, stream: &_| robust_run(loss, truth, stream);
    let (exact, mixture, tukey, huber) = (
        by(Loss::Exact(OUTLIERS)),
        by(Loss::Mixture(OUTLIERS)),
        by(Loss::Tukey(4.685)),
        by(Loss::Huber(1.345)),
    );
    let references: [(&str, &Contender<'_>); 5] = [
        ("told which samples are outliers, which it leaves out", told),
        (
            "told the exact density: the noise, and that 5 % are 10 sigma off",
            &exact,
        ),
        (
            "mixture likelihood, told that 5 % are ten times as wide",
            &mixture,
        ),
        ("Tukey's biweight, 4.685", &tukey),
        ("Huber's loss, 1.345", &huber),
    ];
    for (name, contender) in references {
        let worst = Worst::over_grid(&short, outliers, some, contender);
        row(page, name, &worst);
    }
    page.line("");
}

fn slip_noise(page: &mut Page, seeds: u64, fewer: u64) {
    page.section("Slip noise");
    page.paragraph(
        "Slip noise is not modelled. Mean error of mup and sp in percent with a slip noise of 0.005 and 0.01 (1-sigma), 41 samples and 10,000, at mup 0.6, sp 0.15: ML takes the noisy slip as known, too.",
    );
    page.columns(&[
        "slip noise",
        "samples",
        "efficient: mup, sp",
        "ML: mup, sp",
        "article: mup, sp",
    ]);
    let truth = Curve {
        peak_friction: 0.6,
        critical_slip: 0.15,
    };
    for slip_std in [0.005, 0.01] {
        for (slips, seeds) in [(article_slips(), seeds), (rig_slips(), fewer)] {
            let disturbance = Disturbance {
                slip_std,
                ..Disturbance::default()
            };
            let (ml, [efficient, article]) = run(
                truth,
                &slips,
                disturbance,
                seeds,
                [
                    &|truth, stream| efficient_run(truth, stream, 1.0),
                    &article_run,
                ],
            );
            let percent = |s: &Summary| {
                [
                    100.0 * s.bias[0] / truth.peak_friction,
                    100.0 * s.bias[1] / truth.critical_slip,
                ]
            };
            let ours = percent(&efficient.summary);
            page.row(&[
                slip_std.to_string(),
                slips.len().to_string(),
                signed(ours, 2),
                signed(percent(&ml), 2),
                signed(percent(&article.summary), 2),
            ]);
            page.bar(
                &format!("slip noise {slip_std}, {} samples", slips.len()),
                "handled, or its bias stated",
                format!("mup {:+.1} %, sp {:+.1} %", ours[0], ours[1]),
                true,
            );
        }
    }
    page.line("");
}
