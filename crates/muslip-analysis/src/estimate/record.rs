//! What is kept of a run for pictures: bounded, whatever the length of the recording.

use muslip::filter::mu_slip::Fusion;
use muslip::filter::{FrictionMeasurement, PeakEstimate};

use crate::thin::Thinned;

/// Measurements that are kept.
const KEPT_SAMPLES: usize = 20_000;
/// Frames that are kept: all of the first ones, where most happens, ...
const FIRST_FRAMES: u64 = 60;
/// ... and an even selection of the later ones.
const LATER_FRAMES: usize = 500;

/// One frame: the estimate after a measurement, and what that measurement did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Measurements so far, those refused included; 0 at the start.
    pub sample: u64,
    /// The estimate.
    pub peak: PeakEstimate<f64>,
    /// The measurement; `None` at the start.
    pub update: Option<Update>,
}

/// A measurement and what it did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Update {
    /// Time in s; not finite where there is none.
    pub time_s: f64,
    /// Measured slip.
    pub slip: f64,
    /// Measured friction.
    pub friction: f64,
    /// Measured minus predicted friction.
    pub innovation: f64,
    /// Its variance.
    pub innovation_variance: f64,
    /// Normalised innovation squared.
    pub nis: f64,
    /// Noise variance of the measurement as the filter took it.
    pub noise_variance: f64,
    /// H P H' before the update.
    pub signal_before: f64,
    /// H P H' after it.
    pub signal_after: f64,
}

impl Update {
    /// What a filter says of a measurement at a time.
    pub fn new(time_s: f64, fusion: &Fusion<f64>) -> Self {
        Self {
            time_s,
            slip: fusion.slip_ratio,
            friction: fusion.measured_friction,
            innovation: fusion.innovation,
            innovation_variance: fusion.innovation_variance,
            nis: fusion.nis,
            noise_variance: fusion.noise_variance,
            signal_before: fusion.signal_before,
            signal_after: fusion.signal_after,
        }
    }
}

/// One measurement as the filter took it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Slip.
    pub slip: f64,
    /// Friction.
    pub friction: f64,
    /// Standard deviation of the friction's noise.
    pub friction_std: f64,
}

/// A run's frames and measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// The start, the first frames, an even selection of the later ones, and the last.
    pub frames: Vec<Frame>,
    /// The measurements that the filter was offered, or an even selection of them.
    pub samples: Vec<Sample>,
    /// One of how many measurements was kept.
    pub stride: u64,
}

/// Records a run.
pub(super) struct Recorder {
    offered: u64,
    used: u64,
    first: Vec<Frame>,
    later: Thinned<Frame>,
    last: Frame,
    samples: Thinned<Sample>,
}

impl Recorder {
    pub(super) fn new(start: PeakEstimate<f64>) -> Self {
        let start = Frame {
            sample: 0,
            peak: start,
            update: None,
        };
        Self {
            offered: 0,
            used: 0,
            first: vec![start],
            later: Thinned::new(LATER_FRAMES),
            last: start,
            samples: Thinned::new(KEPT_SAMPLES),
        }
    }

    /// A measurement, before the filter has judged it.
    pub(super) fn offered(&mut self, measurement: &FrictionMeasurement<f64>) {
        self.offered += 1;
        self.samples.offer(|| Sample {
            slip: measurement.slip_ratio,
            friction: measurement.friction,
            friction_std: measurement.friction_std,
        });
    }

    /// The filter has used the measurement that was offered last.
    pub(super) fn used(
        &mut self,
        time_s: f64,
        fusion: &Fusion<f64>,
        peak: impl FnOnce() -> PeakEstimate<f64>,
    ) {
        self.used += 1;
        let frame = Frame {
            sample: self.offered,
            peak: peak(),
            update: Some(Update::new(time_s, fusion)),
        };
        if self.used <= FIRST_FRAMES {
            self.first.push(frame);
        } else {
            self.later.offer(|| frame);
        }
        self.last = frame;
    }

    pub(super) fn finish(self) -> Record {
        let mut frames = self.first;
        frames.extend(self.later.into_items());
        if frames.last().map(|frame| frame.sample) != Some(self.last.sample) {
            frames.push(self.last);
        }
        Record {
            frames,
            stride: self.samples.stride(),
            samples: self.samples.into_items(),
        }
    }
}
