//! A run as the models use it: cleaned, smoothed, with derived variables.

use core::ops::Range;
use std::sync::Arc;

use crate::balance::Balance;
use crate::context::Context;
use crate::law_error::LawError;
use crate::slip::{self, slip};

/// A step of so many typical ones is a gap, over which nothing is joined.
pub(crate) const GAP_STEPS: f64 = 3.5;

/// Something wrong with the recording itself.
#[derive(Clone, Debug, PartialEq)]
pub struct DataFault {
    /// The run's name.
    pub recording: String,
    /// The column's name.
    pub channel: String,
    /// Start of the affected stretch in s.
    pub start_s: f64,
    /// End of the affected stretch in s.
    pub end_s: f64,
    /// What is wrong, for a reader.
    pub what: String,
}

/// A channel as the models use it.
#[derive(Clone, Debug, Default)]
pub struct Channel {
    /// Cleaned but not smoothed.
    pub raw: Vec<f64>,
    /// Smoothed.
    pub smooth: Vec<f64>,
    /// Smoothed harder, the direction in which residual noise in `smooth` would be removed.
    pub smoother: Vec<f64>,
    /// Time derivative of the smoothed channel.
    pub rate: Vec<f64>,
    /// Its slow part: what a regressor is made of that must not hold the residual's own noise.
    pub slow: Vec<f64>,
    /// Standard deviation of the white noise in `raw`.
    pub sigma: f64,
    /// Variance of `smooth` as a share of that of `raw`.
    pub variance_share: Vec<f64>,
}

/// A run, prepared.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// The run's name.
    pub name: String,
    /// Time in s.
    pub time: Vec<f64>,
    /// Step to the sample from its predecessor in s (for the first: to its successor).
    pub dt: Vec<f64>,
    /// Typical step in s.
    pub typical_dt: f64,
    /// Wheel speed in rad/s.
    pub wheel: Channel,
    /// What the slow part of the wheel speed lacks of the whole, as a share of itself: an inertia in error scales the whole.
    /// Nothing while the timing is sought.
    pub slow_wheel_lacks: f64,
    /// What tells an error of the law from the drag's own noise. Nothing while the timing is sought.
    pub law_error: Option<Arc<LawError>>,
    /// Vehicle speed in m/s.
    pub speed: Channel,
    /// Normal force in N.
    pub load: Channel,
    /// Cleaned drag reading in N; empty where the run has none.
    pub drag: Vec<f64>,
    /// Smoothed drag in N.
    pub drag_smooth: Vec<f64>,
    /// Standard deviation of the drag's sample-to-sample noise in N.
    pub drag_sigma: f64,
    /// By how many N the law at the slip of `wheel` and `speed` and at `load` lies above the law at these channels' own
    /// readings, to first order; empty where they are the readings' own.
    pub beside_law: Vec<f64>,
    /// What of the force by the law in N is faster than the smoother leaves of it: what excites a load cell that rings.
    pub fast_force: Vec<f64>,
    /// Brake torque in N m that enters the wheel balance, where there is a brake column.
    pub torque: Option<Channel>,
    /// Distance run since the first sample in m, but in gaps that begin at a standstill.
    pub distance: Vec<f64>,
    /// Wheel angle since the first sample in rad, as the distance.
    pub angle: Vec<f64>,
    /// By exp(-c f^2) smoothing makes what has the angular frequency f smaller in the wheel speed: c in s^2.
    pub wheel_smoothing: f64,
    /// Whether the sample stands still (slip undefined, no contact force).
    pub still: Vec<bool>,
    /// Whether the wheel rolls fast enough for slip to be defined.
    pub rolling: Vec<bool>,
    /// Stretches of samples usable in the tyre balance.
    pub tyre: Vec<Range<usize>>,
    /// Stretches usable in the wheel balance.
    pub wheel_balance: Vec<Range<usize>>,
    /// Stretches usable in the vehicle balance.
    pub vehicle_balance: Vec<Range<usize>>,
    /// Other columns, cleaned; in the campaign's order, absent ones all `NaN`.
    pub extra: Vec<Vec<f64>>,
    /// Position of the run in the campaign, 0-based, by the order given.
    pub index: usize,
}

impl Series {
    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.time.len()
    }
    /// Whether there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.time.is_empty()
    }
    /// Forgets the drag, and what was made from it: as if the run had been recorded without.
    pub fn forget_drag(&mut self) {
        self.drag = Vec::new();
        self.drag_smooth = Vec::new();
        self.drag_sigma = 0.0;
        self.tyre = Vec::new();
        self.wheel_balance = Vec::new();
        self.vehicle_balance = Vec::new();
    }

    /// Stretches usable in a balance; none where it cannot be formed.
    #[must_use]
    pub fn segments(&self, balance: Balance) -> &[Range<usize>] {
        match balance {
            Balance::Tyre => &self.tyre,
            Balance::Wheel => &self.wheel_balance,
            Balance::Vehicle => &self.vehicle_balance,
        }
    }
    /// Stretches of the wheel's balance; of the vehicle's where that cannot be formed.
    #[must_use]
    pub fn level_segments(&self) -> &[Range<usize>] {
        if self.wheel_balance.is_empty() {
            &self.vehicle_balance
        } else {
            &self.wheel_balance
        }
    }
    /// Slip from the smoothed speeds and the rig's radius; zero where it is not defined.
    #[must_use]
    pub fn slip(&self, k: usize, radius: f64) -> f64 {
        if self.rolling[k] {
            slip(radius, self.wheel.smooth[k], self.speed.smooth[k])
        } else {
            0.0
        }
    }
    /// Friction power on the nominal curve in W.
    #[must_use]
    pub fn nominal_power(&self, k: usize, context: &Context) -> f64 {
        if !self.rolling[k] {
            return 0.0;
        }
        let slip = self.slip(k, context.radius);
        let power =
            self.load.smooth[k] * context.nominal_friction(slip) * slip * self.speed.smooth[k];
        if power.is_finite() {
            power.max(0.0)
        } else {
            0.0
        }
    }
    /// Standard deviation of the slip as read from the noise of both speeds.
    #[must_use]
    pub fn slip_sigma(&self, k: usize, radius: f64) -> f64 {
        let (wheel, speed) = (&self.wheel, &self.speed);
        let [by_wheel, by_speed] = slip::slopes(radius, wheel.smooth[k], speed.smooth[k]);
        (by_wheel * wheel.sigma).hypot(by_speed * speed.sigma)
    }
    /// Standard deviation of the force on the nominal curve from the noise left in the smoothed slip, in N.
    #[must_use]
    pub fn slip_force_noise(&self, k: usize, context: &Context) -> f64 {
        if !self.rolling[k] {
            return 0.0;
        }
        let (wheel, speed) = (&self.wheel, &self.speed);
        let [by_wheel, by_speed] = slip::slopes(context.radius, wheel.smooth[k], speed.smooth[k]);
        let by_wheel = by_wheel * wheel.sigma * wheel.variance_share[k].sqrt();
        let by_speed = by_speed * speed.sigma * speed.variance_share[k].sqrt();
        let [peak, critical] = context.nominal;
        let x = self.slip(k, context.radius) / critical;
        let slope = 2.0 * peak / critical * (1.0 - x * x) / (1.0 + x * x).powi(2);
        self.load.smooth[k] * slope.abs() * by_wheel.hypot(by_speed)
    }
    /// Sum of squares over the samples usable in the tyre balance; what is not finite does not count.
    #[must_use]
    pub fn tyre_square(&self, left: &[f64]) -> f64 {
        let used = self.tyre.iter().flat_map(Clone::clone);
        let left = used.filter_map(|k| left.get(k));
        left.filter(|e| e.is_finite()).map(|e| e * e).sum()
    }
    /// Number of samples usable in the tyre balance.
    #[must_use]
    pub fn tyre_count(&self) -> usize {
        self.tyre.iter().map(Range::len).sum()
    }
}

/// Sums over the usable samples of drag y in N and force x in N by the law with a peak friction of one.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LawProducts {
    pub(crate) xx: f64,
    pub(crate) xy: f64,
    pub(crate) yy: f64,
    pub(crate) count: f64,
}

impl LawProducts {
    /// Of these runs, for a radius in m and a slip at the peak.
    pub(crate) fn of(series: &[Series], radius: f64, critical: f64) -> Self {
        let mut sums = Self::default();
        for s in series {
            let used = s.tyre.iter().flat_map(Clone::clone);
            for k in used.filter(|k| s.rolling[*k]) {
                let x = s.slip(k, radius) / critical;
                sums.add(s.load.smooth[k], x, s.drag[k]);
            }
        }
        sums
    }

    /// Takes in a reading of the drag in N at a load in N and a slip over that at the peak.
    pub(crate) fn add(&mut self, load: f64, slip: f64, drag: f64) {
        let shape = load * 2.0 * slip / (1.0 + slip * slip);
        if shape.is_finite() && drag.is_finite() {
            self.xx += shape * shape;
            self.xy += shape * drag;
            self.yy += drag * drag;
            self.count += 1.0;
        }
    }
}
