//! The prepared campaign: all runs, what they have in common, and the catalogue in the numbers needed.

use std::sync::Arc;

use rayon::prelude::*;

use crate::audit::colour::Colour;
use crate::campaign::{Rig, Run};
use crate::chain::correct::TimingStd;
use crate::constants::LEAST_GAIN_OF_LAW;
use crate::innovations::blocks::Blocks;
use crate::mechanism::{Balance, Before, Context, Id, Mechanism, catalogue};
use crate::number::{Dual, Number, largest_but_for_outliers};
use crate::prepare::{REACH_FACTORS, prepare};
use crate::series::{DataFault, LawProducts, Series};
use crate::slip::brakes;
use crate::smooth::median_in_place;

/// Greatest width of the dual numbers: most parameters differentiated in one pass.
pub const WIDTH: usize = 8;

/// The catalogue in plain and in dual numbers, in the same order.
pub struct Catalogue {
    plain: Vec<Box<dyn Mechanism<f64>>>,
    /// In numbers with so many derivatives: what is wider than need be costs as much more.
    two: Vec<Box<dyn Mechanism<Dual<2>>>>,
    four: Vec<Box<dyn Mechanism<Dual<4>>>>,
    all: Vec<Box<dyn Mechanism<Dual<WIDTH>>>>,
}

impl Default for Catalogue {
    fn default() -> Self {
        Self {
            plain: catalogue(),
            two: catalogue(),
            four: catalogue(),
            all: catalogue(),
        }
    }
}

impl Catalogue {
    /// All entries in plain numbers.
    #[must_use]
    pub fn entries(&self) -> &[Box<dyn Mechanism<f64>>] {
        &self.plain
    }
    /// The first entry of this mechanism.
    #[must_use]
    pub fn of(&self, id: Id) -> Option<&dyn Mechanism<f64>> {
        let mut entries = self.plain.iter();
        entries.find(|m| m.id() == id).map(AsRef::as_ref)
    }
    /// Mechanisms that are the lateness of a speed.
    #[must_use]
    pub fn delays(&self) -> Vec<Id> {
        let late = self.plain.iter().filter(|m| m.facts().late.is_some());
        late.map(|m| m.id()).collect()
    }
    /// One entry in plain numbers.
    #[must_use]
    pub fn get(&self, index: usize) -> &dyn Mechanism<f64> {
        self.plain[index].as_ref()
    }
    /// Whether what enters an entry has all that is fast in the slip.
    #[must_use]
    pub fn is_of_fast_force(&self, index: usize) -> bool {
        self.get(index).facts().of_fast_force
    }
}

/// Numbers for which the catalogue is at hand.
pub trait Listed: Number {
    /// The entry in these numbers.
    fn entry(catalogue: &Catalogue, index: usize) -> &dyn Mechanism<Self>;
}

impl Listed for f64 {
    fn entry(catalogue: &Catalogue, index: usize) -> &dyn Mechanism<Self> {
        catalogue.plain[index].as_ref()
    }
}

impl Listed for Dual<2> {
    fn entry(catalogue: &Catalogue, index: usize) -> &dyn Mechanism<Self> {
        catalogue.two[index].as_ref()
    }
}

impl Listed for Dual<4> {
    fn entry(catalogue: &Catalogue, index: usize) -> &dyn Mechanism<Self> {
        catalogue.four[index].as_ref()
    }
}

impl Listed for Dual<WIDTH> {
    fn entry(catalogue: &Catalogue, index: usize) -> &dyn Mechanism<Self> {
        catalogue.all[index].as_ref()
    }
}

/// A campaign ready to be analysed.
#[derive(Clone)]
pub struct Data {
    /// The rig as declared.
    pub rig: Rig,
    /// Runs in the order given.
    pub series: Vec<Series>,
    /// What they have in common.
    pub context: Context,
    /// Names of the other columns.
    pub extra_names: Vec<String>,
    /// What was wrong with the recordings.
    pub faults: Vec<DataFault>,
    /// Samples that were averaged into one beforehand, at least one.
    pub averaged: usize,
    /// Share of the tyre's readings of all recordings that the argument is made with: less than one where it is made without
    /// what is kept for the proof.
    pub share: f64,
    /// Blocks that the balances are weighed on, by run.
    pub blocks: Vec<[Blocks; 3]>,
    /// Standard deviations in s to which the channels' timing is known.
    pub timing_std: TimingStd,
    /// By how much the vehicle speed came late against the drag as recorded, in s.
    pub vehicle_late: f64,
    /// Slow noise of the vehicle speed, where the audit found one.
    pub vehicle_colour: Option<Colour>,
    /// Whether the vehicle speed passes a filter slower than the other channels'.
    pub vehicle_filtered: bool,
    /// All mechanisms.
    pub catalogue: Arc<Catalogue>,
}

/// Share of slip noise in the tyre residual above which the smoothing windows are widened.
const SLIP_NOISE_SHARE: f64 = 0.08;

fn slip_noise_share(series: &[Series], context: &Context) -> f64 {
    let (mut slip, mut total) = (0.0, 0.0);
    for s in series {
        for k in s.tyre.iter().flat_map(Clone::clone) {
            let own = s.slip_force_noise(k, context).powi(2);
            if own.is_finite() {
                slip += own;
                total += own + s.drag_sigma * s.drag_sigma;
            }
        }
    }
    if total > 0.0 { slip / total } else { 0.0 }
}

/// Smallest noise of a drag, as a share of its root mean square.
const LEAST_NOISE: f64 = 1e-3;

/// Whether something brakes, and the drag follows the rig file's law, at whatever peak, better than none: a run without
/// braking has nothing to fit a law to.
fn speaks_of_friction(series: &[Series], context: &Context) -> bool {
    let of = |s: &Series| -> Vec<f64> {
        let samples = s.tyre.iter().flat_map(Clone::clone);
        let samples = samples.filter(|&k| s.rolling[k]);
        samples
            .map(|k| s.drag_smooth[k] / s.load.smooth[k])
            .collect()
    };
    if !brakes(series.iter().flat_map(of).collect(), context.nominal[0]) {
        return false;
    }
    let LawProducts { xx, xy, yy, count } =
        LawProducts::of(series, context.radius, context.nominal[1]);
    let least = LEAST_NOISE.powi(2) * yy / count;
    let noise = context.drag_sigma.powi(2).max(least);
    xy > 0.0 && xy * xy / xx > 2.0 * LEAST_GAIN_OF_LAW * noise
}

/// Takes the tyre balance from a run, and says why where that is not that its wheel never rolls.
fn silenced(series: &mut Series) -> Option<DataFault> {
    series.tyre.clear();
    series.rolling.contains(&true).then(|| DataFault {
        recording: series.name.clone(),
        channel: "drag_force_n".to_owned(),
        start_s: series.time.first().copied().unwrap_or(0.0),
        end_s: series.time.last().copied().unwrap_or(0.0),
        what: "drag that says nothing of friction: no braking in the recordings".to_owned(),
    })
}

/// Mean over samples that pass a filter; `fallback` if there are none.
fn mean(values: impl Iterator<Item = f64>, fallback: f64) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for v in values.filter(|v| v.is_finite()) {
        sum += v;
        count += 1.0;
    }
    if count > 0.0 { sum / count } else { fallback }
}

fn median(mut values: Vec<f64>, fallback: f64) -> f64 {
    if values.is_empty() {
        fallback
    } else {
        median_in_place(&mut values)
    }
}

/// Length of a run in s.
fn span(s: &Series) -> f64 {
    match (s.time.first(), s.time.last()) {
        (Some(a), Some(b)) => b - a,
        _ => 0.0,
    }
}

/// The drag in N that one sample of a thousand exceeds.
fn largest_drag(series: &[Series]) -> f64 {
    let drags = series.iter().flat_map(|s| s.drag_smooth.iter().copied());
    largest_but_for_outliers(drags.collect()).unwrap_or(1.0)
}

/// What tyre and brake have done before each run and over the whole campaign.
fn take_up_work(context: &mut Context, series: &[Series]) {
    let mut before = Before::default();
    let mut brake = 0.0;
    for s in series {
        context.before.push(before);
        for k in 0..s.len() {
            before.work += s.nominal_power(k, context) * s.dt[k];
            if let Some(t) = &s.torque {
                let p = t.smooth[k] * s.wheel.smooth[k] * s.dt[k];
                brake += if p.is_finite() { p.max(0.0) } else { 0.0 };
            }
        }
        before.time += span(s);
    }
    context.total_work = before.work;
    context.mean_power = before.work / context.total_time;
    context.mean_brake_power = brake / context.total_time;
}

impl Data {
    /// Makes the wheel speed that an inertia scales so many times its slow part.
    pub fn scale_slow_wheel(&mut self, by: f64) {
        for series in &mut self.series {
            series.slow_wheel_lacks = by - 1.0;
        }
    }

    /// Prepares all runs of a campaign for an argument about what is missing. Noise that is left in the slip looks like
    /// physics: where it is a good part of the residual, the windows of smoothing are widened.
    #[must_use]
    pub fn new(rig: &Rig, runs: &[Run]) -> Self {
        let [narrow, wider @ ..] = REACH_FACTORS;
        let mut data = Self::smoothed(rig, runs, narrow);
        for reach_factor in wider {
            if data.slip_noise_share() <= SLIP_NOISE_SHARE {
                break;
            }
            data = Self::smoothed(rig, runs, reach_factor);
        }
        data
    }

    /// Prepares all runs of a campaign with windows of smoothing that are so many times as wide.
    #[must_use]
    pub fn smoothed(rig: &Rig, runs: &[Run], reach_factor: f64) -> Self {
        let mut extra_names: Vec<String> = Vec::new();
        for run in runs {
            for (column, _) in &run.extra {
                if !extra_names.contains(column) {
                    extra_names.push(column.clone());
                }
            }
        }
        let prepared: Vec<(Series, Vec<DataFault>)> = runs
            .par_iter()
            .enumerate()
            .map(|(index, run)| prepare(rig, run, &extra_names, index, reach_factor))
            .collect();
        let (mut series, faults): (Vec<Series>, Vec<Vec<DataFault>>) = prepared.into_iter().unzip();
        let mut faults = faults.concat();
        let context = Context {
            reach_factor,
            ..Self::context_of(rig, &series)
        };
        if series.iter().any(|s| !s.tyre.is_empty()) && !speaks_of_friction(&series, &context) {
            faults.extend(series.iter_mut().filter_map(silenced));
        }
        Self {
            extra_names,
            faults,
            ..Self::of(rig, series, context)
        }
    }

    /// Runs that are prepared already, of which nothing more is known.
    #[must_use]
    pub fn of(rig: &Rig, series: Vec<Series>, context: Context) -> Self {
        Self {
            rig: rig.clone(),
            series,
            context,
            extra_names: Vec::new(),
            faults: Vec::new(),
            averaged: 1,
            share: 1.0,
            blocks: Vec::new(),
            timing_std: TimingStd::default(),
            vehicle_late: 0.0,
            vehicle_colour: None,
            vehicle_filtered: false,
            catalogue: Arc::default(),
        }
    }

    /// Whether a balance can be formed on any run.
    #[must_use]
    pub fn forms(&self, balance: Balance) -> bool {
        self.series.iter().any(|s| !s.segments(balance).is_empty())
    }

    /// Share of the tyre residual's noise power that comes from noise left in the smoothed slip, 0..=1.
    #[must_use]
    pub fn slip_noise_share(&self) -> f64 {
        slip_noise_share(&self.series, &self.context)
    }

    fn context_of(rig: &Rig, series: &[Series]) -> Context {
        let rolling = |f: fn(&Series, usize) -> f64| {
            series
                .iter()
                .flat_map(move |s| (0..s.len()).filter(|&k| s.rolling[k]).map(move |k| f(s, k)))
        };
        let finite_max = |values: &mut dyn Iterator<Item = f64>| {
            values.filter(|v| v.is_finite()).fold(0.0, f64::max)
        };
        let steps = series.iter().map(|s| s.typical_dt);
        let sigmas = series.iter().map(|s| s.drag_sigma);
        let slip_sigmas = series.iter().flat_map(|s| {
            let rolling = (0..s.len()).filter(|&k| s.rolling[k]);
            rolling.map(|k| s.slip_sigma(k, rig.radius_m))
        });
        let mut context = Context {
            radius: rig.radius_m,
            inertia: rig.wheel_inertia_kg_m2,
            mass: rig.mass_kg,
            nominal: [rig.peak_friction, rig.critical_slip],
            mean_load: mean(rolling(|s, k| s.load.smooth[k]), 1.0).max(1e-9),
            mean_speed: mean(rolling(|s, k| s.speed.smooth[k]), 1.0).max(1e-3),
            max_speed: finite_max(&mut rolling(|s, k| s.speed.smooth[k])).max(1e-3),
            mean_wheel_speed: mean(rolling(|s, k| s.wheel.smooth[k].abs()), 1.0).max(1e-3),
            dt: median(steps.collect(), 1.0),
            duration: series.iter().map(span).fold(0.0, f64::max).max(1e-3),
            total_time: series.iter().map(span).sum::<f64>().max(1e-3),
            runs: series.len(),
            distance: series
                .iter()
                .filter_map(|s| s.distance.last().copied())
                .fold(0.0, f64::max),
            clock_continues: series.windows(2).all(|w| {
                match (w[0].time.last(), w[1].time.first()) {
                    (Some(a), Some(b)) => b > a,
                    _ => false,
                }
            }) && series.len() > 1,
            first_time: series
                .first()
                .and_then(|s| s.time.first().copied())
                .unwrap_or(0.0),
            drag_sigma: median(sigmas.filter(|s| *s > 0.0).collect(), 0.0),
            slip_sigma: median(slip_sigmas.filter(|s| s.is_finite()).collect(), 0.0),
            max_drag: largest_drag(series).abs().max(1e-9),
            ..Context::default()
        };
        take_up_work(&mut context, series);
        context
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_without_a_wheel_speed_leaves_the_noise_of_the_slip_known() {
        let run = |wheel: f64| {
            let rows = || (0..200).map(f64::from);
            let shaken = |k: f64| 60.0 + 0.2 * (7.0 * k * k).sin();
            Run {
                time_s: rows().map(|k| 0.005 * k).collect(),
                wheel_speed_rad_s: rows().map(|k| wheel * shaken(k)).collect(),
                vehicle_speed_m_s: vec![20.0; 200],
                normal_force_n: vec![4000.0; 200],
                drag_force_n: vec![1000.0; 200],
                ..Run::default()
            }
        };
        let rig = Rig {
            radius_m: 0.3,
            peak_friction: 0.8,
            critical_slip: 0.12,
            ..Rig::default()
        };
        let data = Data::smoothed(&rig, &[run(f64::NAN), run(1.0), run(f64::NAN)], 1.0);
        let sigma = data.context.slip_sigma;
        assert!(sigma > 1e-4 && sigma < 0.01, "{sigma}");
    }
}
