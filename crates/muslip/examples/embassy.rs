//! The core in tasks of embassy: one samples a thousand times a second, another waits for the peak of the curve.
//!
//! `cargo run -p muslip --example embassy`. On a chip it is the same with `platform-cortex-m` in place of `platform-std`, a time
//! driver of that chip's, and the four channels in place of `read`; nothing of the core waits or allocates.

use embassy_executor::Spawner;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Ticker};
use muslip::filter::efficient::{Config, EfficientFilter};
use muslip::filter::mu_slip::Range;
use muslip::filter::{Estimator, FrictionMeasurement, PeakEstimate};
use muslip::sample::{SampleLimits, slip_friction};

mod tyre;
use tyre::{DRAG_STD_N, EFFECTIVE_RADIUS_M, LOAD_N, read};

/// The newest peak, for who waits for it.
static PEAK: Signal<CriticalSectionRawMutex, Option<PeakEstimate<f32>>> = Signal::new();

/// A run of a second; none at its end where a sample was refused.
#[embassy_executor::task]
async fn estimate(mut filter: EfficientFilter<f32>) {
    let limits = SampleLimits::for_median_normal_force(LOAD_N);
    let mut ticker = Ticker::every(Duration::from_millis(1));
    let mut random = 1;
    for tick in 0..1000 {
        ticker.next().await;
        let sample = read(tick, &mut random);
        let Ok(point) = slip_friction(&sample, EFFECTIVE_RADIUS_M, &limits) else {
            continue;
        };
        let measurement = FrictionMeasurement {
            slip_ratio: point.slip_ratio,
            friction: point.friction,
            friction_std: DRAG_STD_N / sample.normal_force_n,
        };
        if filter.update(&measurement).is_err() {
            PEAK.signal(None);
            return;
        }
    }
    PEAK.signal(Some(filter.peak()));
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let filter = Config::for_range(Range::Automotive).build();
    let task = filter.ok().and_then(|filter| estimate(filter).ok());
    let Some(task) = task else {
        eprintln!("no estimator");
        std::process::exit(1);
    };
    spawner.spawn(task);
    let Some(peak) = PEAK.wait().await else {
        eprintln!("a sample was refused");
        std::process::exit(1);
    };
    println!(
        "peak friction {:.3} ± {:.3} (true 0.850)",
        peak.peak_friction, peak.peak_friction_std
    );
    println!(
        "at slip       {:.3} ± {:.3} (true 0.130)",
        peak.critical_slip, peak.critical_slip_std
    );
    std::process::exit(0);
}
