//! Recordings that say little: they may not make the estimator believe what they do not say.

use muslip::filter::{Estimator, FrictionMeasurement, efficient};
use muslip_analysis::fit::Curve;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;

use super::page::{Page, pair};
use super::streams::SIGMA;

const SAMPLES: u32 = 400;
const STREAMS: u64 = 300;

/// Means over the streams: estimates and their deviations, and whether the truth is within two of them.
#[derive(Default)]
struct Means {
    estimate: [f64; 2],
    std: [f64; 2],
    inside: [f64; 2],
}

fn means(truth: Curve, slip: fn(f64) -> f64) -> Means {
    let mut means = Means::default();
    let share = 1.0 / STREAMS as f64;
    for seed in 0..STREAMS {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut filter = efficient::Config::<f32>::default().build().unwrap();
        for i in 0..SAMPLES {
            let slip = slip(f64::from(i) / f64::from(SAMPLES));
            let friction = truth.friction(slip) + SIGMA * rng.sample::<f64, _>(StandardNormal);
            filter
                .update(&FrictionMeasurement {
                    slip_ratio: slip as f32,
                    friction: friction as f32,
                    friction_std: SIGMA as f32,
                })
                .unwrap();
        }
        let peak = filter.peak();
        let estimate = [peak.peak_friction, peak.critical_slip].map(f64::from);
        let std = [peak.peak_friction_std, peak.critical_slip_std].map(f64::from);
        let truth = [truth.peak_friction, truth.critical_slip];
        for i in 0..2 {
            means.estimate[i] += share * estimate[i];
            means.std[i] += share * std[i];
            if (estimate[i] - truth[i]).abs() < 2.0 * std[i] {
                means.inside[i] += share;
            }
        }
    }
    means
}

pub fn sparse(page: &mut Page) {
    page.section("Recordings that say little");
    page.paragraph(format!(
        "mup 0.6, sp 0.15, sigma 0.04, {SAMPLES} samples, means of {STREAMS} streams; start (0.6, 0.2)."
    ));
    page.columns(&[
        "slips",
        "mup, 1-sigma",
        "sp, 1-sigma",
        "truth within 2 sigma, %: mup, sp",
    ]);
    let truth = Curve {
        peak_friction: 0.6,
        critical_slip: 0.15,
    };
    // Slip by the share of the run that is over, and whether it tells sp.
    type Case = (&'static str, fn(f64) -> f64, bool);
    let cases: [Case; 5] = [
        (
            "0 to 0.03, never near the peak",
            |share| 0.03 * share,
            false,
        ),
        (
            "0 to 0.08, half way to the peak",
            |share| 0.08 * share,
            true,
        ),
        ("1 to 0, falling", |share| 1.0 - share, true),
        ("all at 0.1", |_| 0.1, false),
        ("all at 0", |_| 0.0, false),
    ];
    for (name, slip, tells_sp) in cases {
        let Means {
            estimate,
            std,
            inside,
        } = means(truth, slip);
        page.row(&[
            name.to_owned(),
            pair([estimate[0], std[0]], 3),
            pair([estimate[1], std[1]], 3),
            pair(inside.map(|share| 100.0 * share), 0),
        ]);
        // 95.4 % less two standard deviations of 300 streams.
        let honest = inside.iter().all(|&share| share >= 0.93);
        page.bar(
            &format!("slips {name}: truth within 2 sigma, mup, sp"),
            "95.4 %, less 2.4",
            format!("{:.0} %, {:.0} %", 100.0 * inside[0], 100.0 * inside[1]),
            honest,
        );
        if !tells_sp {
            page.bar(
                &format!("slips {name}: 1-sigma of sp, no peak invented"),
                "wide: at least half of sp",
                format!("{:.3} at {:.3}", std[1], estimate[1]),
                std[1] >= 0.5 * estimate[1],
            );
        }
    }
    page.line("");
}
