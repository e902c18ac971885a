//! Accuracy over the article's range and under other conditions.

use host_sim::fit::Curve;

use super::contenders::{article_run, efficient_run, iterated_run, unscented_run};
use super::streams::{Disturbance, article_slips, bound, grid, rig_slips};
use super::summary::{Summary, run};

pub fn accuracy(seeds: u64) {
    let slips = article_slips();
    println!("### Over the article's range, 41 samples, sigma 0.04, {seeds} streams a curve\n");
    println!(
        "RMSE over the Cramér-Rao bound (mup, sp) of batch maximum likelihood (ML), the article's filter, an iterated extended and an unscented Kalman filter (both told the true noise); the efficient estimator in `f32` over ML on the same streams; its bias beyond ML's in sigmas of the bound; its mean NEES over ML's; how often its 1-sigma ellipse holds the truth (39.3 %); mean NIS and lag-1 correlation of the second half's innovations.\n"
    );
    println!(
        "| mup | sp | ML / bound | article / bound | iterated / bound | unscented / bound | efficient / ML | bias beyond ML's | NEES / ML's | ellipse, % | NIS | lag 1 |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let mut worst = [0.0_f64; 4];
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
        let over = |s: &Summary| {
            let ratio = |index: usize| {
                let ratio = s.rmse[index] / limit[index];
                if ratio < 100.0 {
                    format!("{ratio:.2}")
                } else {
                    ">100".to_owned()
                }
            };
            format!("{}, {}", ratio(0), ratio(1))
        };
        let ratio = [0, 1].map(|i| efficient.rmse[i] / ml.rmse[i]);
        let beyond = [0, 1].map(|i| (efficient.bias[i].abs() - ml.bias[i].abs()) / limit[i]);
        println!(
            "| {} | {} | {} | {} | {} | {} | {:.3}, {:.3} | {:+.3}, {:+.3} | {:.3} | {:.1} | {:.3} | {:+.3} |",
            truth.peak_friction,
            truth.critical_slip,
            over(&ml),
            over(&article),
            over(&iterated),
            over(&unscented),
            ratio[0],
            ratio[1],
            beyond[0],
            beyond[1],
            efficient.nees / ml.nees,
            100.0 * efficient.coverage,
            efficient.nis,
            efficient.lag
        );
        worst[0] = worst[0].max(ratio[0]).max(ratio[1]);
        worst[1] = worst[1].max(beyond[0]).max(beyond[1]);
        worst[2] = worst[2].max((efficient.nees / ml.nees - 1.0).abs());
        worst[3] = worst[3].max((100.0 * efficient.coverage - 39.3).abs());
    }
    println!(
        "\nWorst, beside the bar: RMSE {:.3} of ML's (1.03); bias {:+.3} sigma beyond ML's (0.05); NEES off ML's by {:.1} % (5); ellipse off 39.3 % by {:.1} (2).\n",
        worst[0],
        worst[1],
        100.0 * worst[2],
        worst[3]
    );
}

/// Worst ratios to batch maximum likelihood on streams without outliers, over the grid.
pub fn worst_over_grid(
    name: &str,
    bar: &str,
    slips: &[f64],
    disturbance: Disturbance,
    seeds: u64,
    declared: f64,
) {
    let mut ratio = [0.0_f64; 2];
    let mut at = [Curve {
        peak_friction: 0.0,
        critical_slip: 0.0,
    }; 2];
    let mut nees = 0.0_f64;
    let mut mean = 0.0;
    for truth in grid() {
        let (ml, [efficient]) = run(
            truth,
            slips,
            disturbance,
            seeds,
            [&|truth, stream| efficient_run(truth, stream, declared)],
        );
        for index in 0..2 {
            let here = efficient.rmse[index] / ml.rmse[index];
            mean += here / 50.0;
            if here > ratio[index] {
                ratio[index] = here;
                at[index] = truth;
            }
        }
        let off = efficient.nees / ml.nees - 1.0;
        if off.abs() > nees.abs() {
            nees = off;
        }
    }
    println!(
        "| {name} | {:.3} at ({}, {}) | {:.3} at ({}, {}) | {mean:.3} | {:+.1} % | {bar} |",
        ratio[0],
        at[0].peak_friction,
        at[0].critical_slip,
        ratio[1],
        at[1].peak_friction,
        at[1].critical_slip,
        100.0 * nees
    );
}

pub fn conditions(seeds: u64) {
    println!("### Under other conditions\n");
    println!(
        "RMSE of the efficient estimator (`f32`) over that of ML on the same streams; ML sees no outliers. The worst of the 25 curves, and the mean of both ratios over them.\n"
    );
    println!(
        "| condition | mup, worst | sp, worst | mean | NEES off ML's, worst | bar |\n| --- | --- | --- | --- | --- | --- |"
    );
    let short = article_slips();
    let long = rig_slips();
    let none = Disturbance::default();
    worst_over_grid(
        "noise declared half of what it is",
        "1.03; 5 %",
        &short,
        none,
        seeds,
        0.5,
    );
    worst_over_grid(
        "noise declared half as much again",
        "1.03; 5 %",
        &short,
        none,
        seeds,
        1.5,
    );
    let fewer = (seeds / 50).max(20);
    worst_over_grid(
        &format!("10,000 samples of a rig, {fewer} streams a curve"),
        "1.03; 5 %",
        &long,
        none,
        fewer,
        1.0,
    );
    let outliers = Disturbance {
        outliers: 0.05,
        ..none
    };
    worst_over_grid(
        "5 % outliers of 10 sigma, 41 samples",
        "1.10",
        &short,
        outliers,
        seeds,
        1.0,
    );
    worst_over_grid(
        &format!("5 % outliers of 10 sigma, 10,000 samples, {fewer} streams"),
        "1.10",
        &long,
        outliers,
        fewer,
        1.0,
    );
    println!();
    println!(
        "Slip noise is not modelled. Mean error of sp and mup in percent with a slip noise of 0.005 and 0.01 (1-sigma), 41 samples and 10,000, at mup 0.6, sp 0.15: ML takes the noisy slip as known, too.\n"
    );
    println!(
        "| slip noise | samples | efficient: mup, sp | ML: mup, sp | article: mup, sp |\n| --- | --- | --- | --- | --- |"
    );
    let truth = Curve {
        peak_friction: 0.6,
        critical_slip: 0.15,
    };
    for slip_std in [0.005, 0.01] {
        for (slips, seeds) in [(&short, seeds), (&long, fewer)] {
            let (ml, [efficient, article]) = run(
                truth,
                slips,
                Disturbance { slip_std, ..none },
                seeds,
                [
                    &|truth, stream| efficient_run(truth, stream, 1.0),
                    &article_run,
                ],
            );
            let percent = |s: &Summary| {
                format!(
                    "{:+.2}, {:+.2}",
                    100.0 * s.bias[0] / 0.6,
                    100.0 * s.bias[1] / 0.15
                )
            };
            println!(
                "| {slip_std} | {} | {} | {} | {} |",
                slips.len(),
                percent(&efficient),
                percent(&ml),
                percent(&article)
            );
        }
    }
    println!();
}
