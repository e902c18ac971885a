//! The streams that all estimators are run on.

use muslip::filter::mu_slip::Range;
use muslip_analysis::fit::Curve;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;

pub const SIGMA: f64 = 0.04;

/// How far off an outlier is, in sigmas.
pub const OUTLIER: f64 = 10.0;

pub const PEAKS: [f64; 5] = [0.1, 0.2, 0.35, 0.6, 1.0];

pub const SLIPS: [f64; 5] = [0.10, 0.125, 0.15, 0.175, 0.20];

pub fn article_slips() -> Vec<f64> {
    (0..=40).map(|i| (f64::from(i) / 40.0).powi(2)).collect()
}

/// Ten applications in 10,000 samples: a ramp to skid, then a release.
pub fn rig_slips() -> Vec<f64> {
    (0..10_000)
        .map(|i| {
            let phase = f64::from(i % 1000) / 1000.0;
            if phase < 0.6 {
                (phase / 0.6).powi(3)
            } else if phase < 0.7 {
                1.0
            } else {
                ((1.0 - phase) / 0.3).powi(4)
            }
        })
        .collect()
}

/// A way to disturb a stream.
#[derive(Clone, Copy, Default)]
pub struct Disturbance {
    pub outliers: f64,
    pub slip_std: f64,
}

#[derive(Clone)]
pub struct Stream {
    pub slips: Vec<f64>,
    pub frictions: Vec<f64>,
    /// The frictions before outliers.
    pub clean: Vec<f64>,
}

pub fn stream(truth: Curve, slips: &[f64], disturbance: Disturbance, seed: u64) -> Stream {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let clean: Vec<f64> = slips
        .iter()
        .map(|&slip| truth.friction(slip) + SIGMA * rng.sample::<f64, _>(StandardNormal))
        .collect();
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x5eed_0000_0000);
    let frictions = clean
        .iter()
        .map(|&friction| {
            let (hit, side) = (rng.random::<f64>(), rng.random::<f64>());
            if hit < disturbance.outliers {
                friction + OUTLIER * SIGMA * if side < 0.5 { -1.0 } else { 1.0 }
            } else {
                friction
            }
        })
        .collect();
    let slips = slips
        .iter()
        .map(|&slip| slip + disturbance.slip_std * rng.sample::<f64, _>(StandardNormal))
        .collect();
    Stream {
        slips,
        frictions,
        clean,
    }
}

pub fn range(truth: Curve) -> Range {
    if truth.peak_friction > 0.6 {
        Range::Automotive
    } else {
        Range::Aircraft
    }
}

pub fn grid() -> Vec<Curve> {
    PEAKS
        .iter()
        .flat_map(|&peak_friction| {
            SLIPS.iter().map(move |&critical_slip| Curve {
                peak_friction,
                critical_slip,
            })
        })
        .collect()
}

/// Cramér-Rao bound of both standard deviations.
pub fn bound(truth: Curve, slips: &[f64]) -> [f64; 2] {
    let (mut a, mut b, mut c) = (0.0, 0.0, 0.0);
    for &slip in slips {
        let (h0, h1) = truth.gradient(slip);
        a += h0 * h0;
        b += h0 * h1;
        c += h1 * h1;
    }
    let determinant = a * c - b * b;
    [
        SIGMA * (c / determinant).sqrt(),
        SIGMA * (a / determinant).sqrt(),
    ]
}
