//! A campaign as it was recorded, its channels shifted until no derivative of one explains anything.

use rayon::prelude::*;

use super::correct::{Lateness, TimingStd};
use super::held::without_holds;
use super::timing::{PASSES, SMALL_SHIFT_S, Timing};
use crate::audit::{Audit, Timing as Late};
use crate::campaign::{Rig, Run};
use crate::constants::{
    AUDIT_REACH, LEAST_RELIABLE, LEAST_STD_S, LEAST_USABLE, MOST_WORSE, VAGUE_S,
};
use crate::data::Data;
use crate::innovations::blocks::blocks;
use crate::innovations::gram::{solve, total};
use crate::innovations::hypothesis::{Effort, Guess, Judged, judge, noise_stride};
use crate::innovations::slip::reconciled;
use crate::law::plain;
use crate::model::Model;
use crate::prepare::REACH_FACTORS;
use crate::series::{Channel, Series};
use crate::split::Split;

/// Shortest step of time that is worth keeping, in s: what is faster cannot be told from the sensors.
const SHORTEST_STEP_S: f64 = 2.4e-3;
/// Most samples of a campaign that are kept where steps get no longer than twice the shortest.
const ENOUGH_SAMPLES: usize = 24_000;

/// By how many samples a campaign is averaged.
#[must_use]
pub fn averaging(runs: &[Run]) -> usize {
    let mut steps: Vec<f64> = runs
        .iter()
        .flat_map(|r| r.time_s.windows(2).map(|w| w[1] - w[0]))
        .filter(|d| *d > 0.0)
        .collect();
    if steps.is_empty() {
        return 1;
    }
    let step = crate::smooth::median_in_place(&mut steps);
    let by_step = (SHORTEST_STEP_S / step).ceil().max(1.0) as usize;
    let samples: usize = runs.iter().map(Run::len).sum::<usize>() / by_step;
    let by_size = samples.div_ceil(ENOUGH_SAMPLES).max(1);
    let most = ((2.0 * SHORTEST_STEP_S) / (step * by_step as f64))
        .floor()
        .max(1.0) as usize;
    by_step * by_size.min(most)
}

/// A campaign as it was recorded, but for what is kept for the proof: what was held is drawn as lines, neighbours are
/// averaged.
pub struct Recorded<'a> {
    rig: &'a Rig,
    runs: Vec<Run>,
    averaged: usize,
    audit: &'a Audit,
    split: &'a Split,
}

impl<'a> Recorded<'a> {
    /// These runs, which the audit was made of, without what this split keeps.
    #[must_use]
    pub fn new(rig: &'a Rig, runs: &[Run], audit: &'a Audit, split: &'a Split) -> Self {
        let averaged = averaging(runs);
        let lines = runs.iter().map(|r| without_holds(r).averaged(averaged));
        Self {
            rig,
            runs: lines.collect(),
            averaged,
            audit,
            split,
        }
    }

    /// The factor on the windows of smoothing by which the law alone, with the channels at the drag's time, leaves least
    /// of the drag: slip that is noisier and slip whose peaks are flattened predict it worse. `usual` stands where it is
    /// hardly worse.
    #[must_use]
    pub fn best_reach(&self, timing: &Timing, usual: f64) -> f64 {
        let corrected = self.corrected(timing.found);
        let left = |reach_factor: &f64| {
            let data = self.without_kept(Data::smoothed(self.rig, &corrected, *reach_factor));
            plain(self.rig, &data.series).left
        };
        let all: Vec<(f64, f64)> = REACH_FACTORS
            .par_iter()
            .map(|factor| (*factor, left(factor)))
            .collect();
        let of_usual = all.iter().find(|factor| factor.0 == usual);
        let usual_left = of_usual.map_or(f64::INFINITY, |factor| factor.1);
        let best = all.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        best.filter(|best| best.1 * MOST_WORSE < usual_left)
            .map_or(usual, |best| best.0)
    }

    /// With its channels at the drag's time and windows of smoothing that are so many times as wide: what the law of a
    /// repaired model is fitted to, by plain least squares as it predicts.
    #[must_use]
    pub fn smoothed(&self, timing: &Timing, reach_factor: f64) -> Data {
        let corrected = self.corrected(timing.late);
        self.without_kept(Data::smoothed(self.rig, &corrected, reach_factor))
    }

    fn without_kept(&self, mut data: Data) -> Data {
        self.split.take_out(&mut data.series);
        data
    }

    /// The runs with their channels brought to the drag's time.
    fn corrected(&self, late: Lateness) -> Vec<Run> {
        let shifted = self
            .runs
            .iter()
            .map(|r| late.shifted(r).only(&late.known(r)));
        shifted.collect()
    }

    /// With its channels brought to the drag's time, as the argument takes it.
    fn at_one_time(&self, late: Lateness) -> Data {
        let mut data = self.without_kept(Data::new(self.rig, &self.corrected(late)));
        data.averaged = self.averaged;
        data.blocks = blocks(&data.series);
        data.timing_std = known_to(self.audit);
        data.vehicle_late = late.vehicle;
        data.vehicle_colour = self.audit.vehicle_colour;
        data.vehicle_filtered = self.audit.vehicle_filtered();
        data.context.ripple_unread = self.audit.ripple_unread;
        data
    }

    /// Brings the channels to the drag channel's time and fits the base law to them. `start` is where the search for the
    /// timing starts, where that is known better than from the audit.
    #[must_use]
    pub fn timed(&self, start: Option<&Timing>) -> Option<(Data, Timing, Judged)> {
        let audit = self.audit;
        let mut timing = Timing::default();
        let known = |t: &Late| if t.std.is_finite() { t.value } else { 0.0 };
        match start {
            Some(start) => timing.late = start.found,
            None => {
                timing.late.wheel = known(&audit.wheel_late);
                timing.late.vehicle = known(&audit.vehicle_late);
                timing.late.brake = known(&audit.brake_late);
            }
        }
        let mut model = Model::of_law(self.rig.peak_friction, self.rig.critical_slip);
        let mut guess = None;
        for pass in 0..=PASSES {
            let data = self.at_one_time(timing.late);
            if usable(&data) < LEAST_USABLE {
                return None;
            }
            timing.late.turn = data.context.mean_wheel_speed;
            let last = pass == PASSES;
            let effort = Effort {
                steps: if pass == 0 { 5 } else { 2 },
                noise_steps: if pass == 0 || last { 30 } else { 10 },
                noise_stride: noise_stride(&data),
            };
            let before = guess.as_deref().map_or(Guess::None, Guess::Sizes);
            let judged = judge(&data, &model, &[], before, effort)?;
            let (shift, std) = shifts(&data, &judged)?;
            timing.asked(audit, shift, std);
            model = judged.model.clone();
            let small = shift.iter().all(|s| s.abs() < SMALL_SHIFT_S);
            if last || (small && pass >= 2) {
                return self.left_to_physics(data, judged, timing, start, effort);
            }
            guess = Some(judged.parts);
            timing.moved(audit, shift);
        }
        None
    }

    /// What is left to physics once the timing is found: a drag later than all others, a brake's reading before its
    /// torque, or a wheel speed that alone is early, is to be told apart (delay, lag or what else keeps it back), so the
    /// channels are put back by that much. An argument that starts from another's timing leaves what that did: it is to speak
    /// of the same question.
    fn left_to_physics(
        &self,
        mut data: Data,
        mut judged: Judged,
        mut timing: Timing,
        start: Option<&Timing>,
        effort: Effort,
    ) -> Option<(Data, Timing, Judged)> {
        timing.found = timing.late;
        timing.brake_heard = self.audit.brake_late.std.is_finite();
        let (drag, brake) = timing.leave_to_physics(start, self.audit.shown());
        let wheel = timing.wheel_left > 0.0;
        if drag.is_some() || brake || wheel {
            data = self.at_one_time(timing.late);
            // What is to be explained is not to be explained away: a drag that two others say is late, a brake, or a wheel
            // speed, whose lateness by turn goes with the speed as a relaxation does.
            let both = drag.is_some() && timing.brake.std < VAGUE_S;
            if both || wheel {
                data.timing_std.wheel = LEAST_STD_S;
            }
            if wheel {
                data.timing_std.wheel_by_turn = LEAST_STD_S;
            }
            if both || brake {
                data.timing_std.brake = LEAST_STD_S;
            }
            let like = Guess::Sizes(&judged.parts);
            judged = judge(&data, &judged.model, &[], like, effort)?;
        }
        let data = reconciled(data, &judged);
        let like = Guess::Sizes(&judged.parts);
        let judged = judge(&data, &judged.model, &[], like, effort)?;
        Some((data, timing, judged))
    }
}

/// Samples that enter a balance.
fn usable(data: &Data) -> usize {
    let balances = |s: &Series| [&s.tyre, &s.wheel_balance, &s.vehicle_balance].map(Clone::clone);
    let series = data.series.iter();
    series.flat_map(balances).flatten().map(|s| s.len()).sum()
}

/// How well the audit knows the timing.
fn known_to(audit: &Audit) -> TimingStd {
    let nothing = TimingStd::default();
    let std = |known: &Late, nothing: f64| {
        let own = AUDIT_REACH * known.std;
        if own.is_finite() {
            own.clamp(LEAST_STD_S, nothing)
        } else {
            nothing
        }
    };
    TimingStd {
        wheel: std(&audit.wheel_late, nothing.wheel),
        vehicle: std(&audit.vehicle_late, nothing.vehicle),
        brake: std(&audit.brake_late, nothing.brake),
        ..nothing
    }
}

/// Share of a speed's rate that is the speed's, and not noise of its reading, by mean squares: a shift by a noisy rate
/// comes out smaller by that much.
fn reliability(data: &Data, channel: fn(&Series) -> &Channel) -> f64 {
    let (mut all, mut noise) = (0.0, 0.0);
    for s in &data.series {
        let own = channel(s);
        for k in (0..s.len()).filter(|k| own.rate[*k].is_finite()) {
            all += own.rate[k] * own.rate[k];
            // Slope of a straight line through as many readings as make up the share.
            noise += 12.0 * own.sigma.powi(2) * own.variance_share[k].powi(3) / s.dt[k].powi(2);
        }
    }
    (1.0 - noise / all).max(LEAST_RELIABLE)
}

/// Shifts that are still asked for (wheel, vehicle, brake, wheel by turn), and the standard deviations of the first
/// three from the spread over runs or from the noise, whichever is larger.
fn shifts(data: &Data, judged: &Judged) -> Option<([f64; 4], [f64; 3])> {
    let sum = total(&judged.grams);
    let n = sum.products.nrows();
    let chosen: Vec<usize> = (1..n).collect();
    let first = judged.left.len() - judged.nuisances;
    let prior = |i: usize| judged.prior[i];
    let all = solve(&sum.products, &chosen, &prior)?;
    let together =
        |x: &nalgebra::DVector<f64>| [x[first] + x[first + 3], x[first + 1], x[first + 2]];
    let runs: Vec<[f64; 3]> = judged
        .grams
        .iter()
        .filter_map(|own| {
            let rest = &sum.products - &total(core::slice::from_ref(own)).products;
            Some(together(&solve(&rest, &chosen, &prior)?.coefficients))
        })
        .collect();
    let r = runs.len() as f64;
    let reliable = [
        reliability(data, |s| &s.wheel),
        reliability(data, |s| &s.speed),
        1.0,
    ];
    let std = core::array::from_fn(|i| {
        let mean = runs.iter().map(|x| x[i]).sum::<f64>() / r;
        let jackknife =
            ((r - 1.0) / r * runs.iter().map(|x| (x[i] - mean).powi(2)).sum::<f64>()).sqrt();
        let c = |a: usize, b: usize| all.covariance[(first + a, first + b)];
        let own = match i {
            0 => c(0, 0) + c(3, 3) + 2.0 * c(0, 3),
            _ => c(i, i),
        };
        jackknife.max(own.max(0.0).sqrt()) / reliable[i]
    });
    let of = [reliable[0], reliable[1], reliable[2], reliable[0]];
    let shift = core::array::from_fn(|i| all.coefficients[first + i] / of[i]);
    Some((shift, std))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng as _;
    use rand_distr::Distribution as _;

    /// A wheel that is braked at a held speed, its slip to and fro at so many hertz, whose speed is read with noise.
    fn braked(frequency_hz: f64) -> (Rig, Run) {
        let rig = Rig {
            radius_m: 0.3,
            peak_friction: 0.8,
            critical_slip: 0.12,
            ..Rig::default()
        };
        let mut draw = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut run = Run::default();
        for k in 0..3000 {
            let time = 2.5e-3 * f64::from(k);
            let phase = core::f64::consts::TAU * frequency_hz * time;
            let (slip, speed) = (0.05 + 0.04 * phase.sin(), 20.0);
            let noise: f64 = rand_distr::StandardNormal.sample(&mut draw);
            let x = slip / rig.critical_slip;
            run.time_s.push(time);
            run.wheel_speed_rad_s
                .push((1.0 - slip) * speed / rig.radius_m + 1.5 * noise);
            run.vehicle_speed_m_s.push(speed);
            run.normal_force_n.push(4000.0);
            run.drag_force_n
                .push(4000.0 * rig.peak_friction * 2.0 * x / (1.0 + x * x));
        }
        (rig, run)
    }

    #[test]
    fn windows_are_wide_where_noise_spoils_the_slip_and_narrow_where_they_would_flatten_it() {
        let reach = |frequency_hz: f64| {
            let (rig, run) = braked(frequency_hz);
            let (audit, split) = (Audit::default(), Split::default());
            let recorded = Recorded::new(&rig, core::slice::from_ref(&run), &audit, &split);
            recorded.best_reach(&Timing::default(), 1.0)
        };
        assert!(reach(0.5) > reach(10.0));
    }
}
