//! Timing between the channels, from all balances at once: shifted until no derivative of a channel explains anything.

use rayon::prelude::*;

use super::correct::{Lateness, TimingStd};
use super::held::without_holds;
use crate::audit::{Audit, Shown, Timing as Late};
use crate::campaign::{Rig, Run};
use crate::constants::{
    ALIKE_LATE, ALIKE_LATE_S, AUDIT_REACH, FAR_BETTER, HEARD_S, IN_STEP_S,
    LEAST_BRAKE_EARLY_IN_STEP_S, LEAST_BRAKE_EARLY_S, LEAST_DRAG_LATE_S, LEAST_RELIABLE,
    LEAST_STD_S, LEAST_STDS_TOLD, LEAST_USABLE, LONGEST_TO_EARLY, MOST_WORSE, UNKNOWN_STDS,
    VAGUE_AUDIT_S, VAGUE_S,
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

/// How late the channels are against the drag channel, with what is not known of it.
#[derive(Clone, Debug, Default)]
pub struct Timing {
    /// What is taken off.
    pub late: Lateness,
    /// What was found before any of it was left to be explained.
    found: Lateness,
    /// Of the wheel speed, at its mean.
    pub wheel: Late,
    /// Of the vehicle speed.
    pub vehicle: Late,
    /// Of the brake.
    pub brake: Late,
    /// Whether the audit hears the brake's lateness: the fit alone may come to rest far from it.
    brake_heard: bool,
    /// How late the drag is left, in s.
    drag: f64,
    /// Whether the brake's reading is left as early as it is.
    leaves_brake: bool,
    /// How early the wheel speed is left, in s.
    wheel_left: f64,
}

/// Whether a channel is as late as the drag, as far as is known.
fn in_step(late: Late) -> bool {
    late.value.abs() < IN_STEP_S + 2.0 * late.std
}

impl Timing {
    /// A channel's lateness against the drag as recorded.
    #[must_use]
    pub fn against_drag(&self, late: Late) -> Late {
        Late {
            value: late.value - self.drag,
            ..late
        }
    }

    /// How late the drag is, in s, where a speed and all other channels are early, and alike: by what all of them are,
    /// for what one is early by beyond that is its own. Beside a wheel's speed and a brake that are, a vehicle's that is
    /// late says nothing against it: its receiver is. Of channels that have come through a chain that shows, two have to be
    /// early and none late: there the drag's own filter or logger may be what is late.
    fn drag_late(&self, chain_shows: bool) -> Option<f64> {
        let known = |l: &&Late| l.std < VAGUE_S;
        let early = |l: &Late| known(&l) && l.value < 0.0;
        let late_receiver =
            !chain_shows && early(&self.wheel) && early(&self.brake) && !early(&self.vehicle);
        let all = [self.wheel, self.brake, self.vehicle];
        let asked = &all[..if late_receiver { 2 } else { 3 }];
        // A brake alone says as little of the drag as the drag does of it.
        let speed = [self.wheel, self.vehicle].iter().any(|l| known(&l));
        let told = asked.iter().filter(known).map(|l| -l.value);
        let late = told.fold(f64::INFINITY, f64::min);
        let alike =
            |l: &Late| (-l.value - late).abs() < ALIKE_LATE * late + ALIKE_LATE_S + 2.0 * l.std;
        let heard = |l: &&Late| l.std < HEARD_S;
        if chain_shows && all.iter().filter(known).count() < 2 {
            return None;
        }
        (speed && late > LEAST_DRAG_LATE_S && asked.iter().filter(heard).all(alike)).then_some(late)
    }

    /// Leaves the drag as late as it is against all others.
    fn leave(&mut self, drag: f64) {
        self.drag = drag;
        self.late.wheel += drag;
        self.late.vehicle += drag;
        self.late.brake += drag;
        for late in [&mut self.wheel, &mut self.vehicle, &mut self.brake] {
            late.value += drag;
        }
    }

    /// What is taken off where a fresh run is predicted. Recordings in which the vehicle's speed hardly changes say
    /// nothing of its lateness: it is then taken to be the wheel's, so that a run in which it does change has its slip
    /// as recorded, and a guess moves no speed against the other.
    #[must_use]
    pub fn told(&self) -> Lateness {
        let apart = self.vehicle.value - self.wheel.value;
        let told = apart.abs() > LEAST_STDS_TOLD * self.vehicle.std;
        let wheel = self.late.wheel + self.late.wheel_by_turn;
        Lateness {
            vehicle: if told { self.late.vehicle } else { wheel },
            ..self.late
        }
    }

    /// Whether the wheel speed alone comes before the drag, and nothing shows a chain that would make it: a tyre does.
    fn wheel_early(&self, chain_shows: bool) -> bool {
        let others = self.vehicle.std < VAGUE_S
            && in_step(self.vehicle)
            && (in_step(self.brake) || self.brake.std > HEARD_S);
        let known = self.wheel.std < VAGUE_S;
        !chain_shows && others && known && self.wheel.value < -LEAST_DRAG_LATE_S
    }

    /// Leaves the wheel speed as early as it is.
    fn leave_wheel(&mut self) {
        self.wheel_left = -self.wheel.value;
        self.late.wheel = 0.0;
        self.late.wheel_by_turn = 0.0;
        self.wheel.value = 0.0;
    }

    /// Whether the brake's reading comes before the torque does: by more than a filter or a logger out of step makes it,
    /// or by less where the speeds show that the loggers are in step.
    fn brake_early(&self) -> bool {
        let [wheel, vehicle] = [self.wheel, self.vehicle].map(|late| self.against_drag(late));
        let same_time =
            wheel.std < IN_STEP_S && in_step(wheel) && (in_step(vehicle) || vehicle.std > HEARD_S);
        let least = if same_time {
            LEAST_BRAKE_EARLY_IN_STEP_S
        } else {
            LEAST_BRAKE_EARLY_S
        };
        let Late { value, std } = self.brake;
        // One that is much earlier need not be known as well.
        let known = if std < VAGUE_S {
            0.0
        } else {
            UNKNOWN_STDS * std
        };
        value + known < -least
    }

    /// Leaves the brake's reading as early as it is.
    fn leave_brake(&mut self) {
        self.leaves_brake = true;
        self.late.brake = 0.0;
        self.brake.value = 0.0;
    }

    /// Leaves the drag as late, the brake as early, or else the wheel speed as early, as they are to be explained, or as
    /// another's timing did; by how much the drag, and whether the brake.
    fn leave_to_physics(&mut self, other: Option<&Self>, chain: Shown) -> (Option<f64>, bool) {
        let drag = other.map_or_else(
            || self.drag_late(chain.of_any),
            |other| (other.drag > 0.0).then_some(other.drag),
        );
        self.leave(drag.unwrap_or(0.0));
        let brake = other.map_or_else(|| self.brake_early(), |other| other.leaves_brake);
        let wheel = other.map_or_else(
            || drag.is_none() && !brake && self.wheel_early(chain.of_wheel),
            |other| other.wheel_left > 0.0,
        );
        if brake {
            self.leave_brake();
        }
        if wheel {
            self.leave_wheel();
        }
        (drag, brake)
    }

    /// What the timing does not tell of the chain.
    #[must_use]
    pub fn untold(&self) -> Untold {
        let known = |late: &Late| late.std < HEARD_S;
        let channels_s = [self.wheel, self.brake]
            .into_iter()
            .filter(known)
            .map(|late| late.value.abs() + UNKNOWN_STDS * late.std)
            .fold(0.0, f64::max);
        // A speed that hardly changes tells no lateness, and its own bends no slip.
        let wheel = Late {
            value: self.wheel.value - self.wheel_left,
            ..self.wheel
        };
        let drag_s = [wheel, self.vehicle]
            .into_iter()
            .filter(|late| late.std < VAGUE_S)
            .map(|late| UNKNOWN_STDS * late.std - self.against_drag(late).value)
            .fold(0.0, f64::max);
        // As found, for what is left to physics is early no more; against the drag as it is left.
        let brake_s = if self.brake_heard && self.brake.std < HEARD_S {
            UNKNOWN_STDS * self.brake.std - (self.found.brake + self.drag)
        } else {
            f64::INFINITY
        };
        Untold {
            channels_s,
            drag_s,
            brake_s,
            left: self.drag > 0.0 || self.wheel_left > 0.0,
            by_turn: self.found.wheel_by_turn > SMALL_SHIFT_S,
        }
    }
}

/// What the timing of the channels does not tell, in s: kernels differ by about as much as they delay, and a memory that
/// is shorter cannot be told from them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Untold {
    /// What wheel speed and brake were off by, or are not known by.
    pub channels_s: f64,
    /// How late the drag may be against the wheel's or the vehicle's speed.
    pub drag_s: f64,
    /// How early the brake may be read.
    pub brake_s: f64,
    /// Whether the drag was left late, or the wheel speed early, for want of a chain that would make it so.
    pub left: bool,
    /// Whether the wheel speed is late by turn.
    pub by_turn: bool,
}

impl Untold {
    /// Shortest memory of the tyre that is told from the chain's: longer than what it leaves of the drag's lateness for
    /// the chain to have caused, for a tyre makes the drag late as well.
    #[must_use]
    pub fn shortest_of_tyre_s(self) -> f64 {
        0.5 * self.drag_s
    }

    /// Longest memory of the brake that may be told: one that delays its torque shows its reading early, and what does
    /// not is how the channels' kernels differ.
    #[must_use]
    pub fn longest_of_brake_s(self) -> f64 {
        (LONGEST_TO_EARLY * self.brake_s).max(0.0)
    }
}

/// Shortest step of time that is worth keeping, in s: what is faster cannot be told from the sensors.
const SHORTEST_STEP_S: f64 = 2.4e-3;
/// Most samples of a campaign that are kept where steps get no longer than twice the shortest.
const ENOUGH_SAMPLES: usize = 24_000;
/// Shifts are refined so often at most.
const PASSES: usize = 5;
/// Largest shift in one pass in s.
const MOST_SHIFT_S: f64 = 0.03;
/// A shift that matters no more, in s.
const SMALL_SHIFT_S: f64 = 1e-4;

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

impl Timing {
    /// Takes over how late the channels are by shifts that are still asked for; a shift by a rate that is mostly noise
    /// says less than the audit does.
    fn asked(&mut self, audit: &Audit, shift: [f64; 4], std: [f64; 3]) {
        let late = self.late;
        let value = |known: &Late, value: f64, std: f64| Late {
            value: within(known, value, std),
            std,
        };
        let wheel = late.wheel + late.wheel_by_turn + shift[0] + shift[3];
        self.wheel = value(&audit.wheel_late, wheel, std[0]);
        self.vehicle = value(&audit.vehicle_late, late.vehicle + shift[1], std[1]);
        self.brake = value(&audit.brake_late, late.brake + shift[2], std[2]);
    }

    /// Moves the channels by these shifts, as far as one pass may.
    fn moved(&mut self, audit: &Audit, shift: [f64; 4]) {
        let step = |s: f64| {
            if s.is_finite() {
                s.clamp(-MOST_SHIFT_S, MOST_SHIFT_S)
            } else {
                0.0
            }
        };
        let late = &mut self.late;
        late.wheel += step(shift[0]);
        // A speed that hardly changes tells no lateness: each pass would shift it by as much as it may.
        if self.vehicle.std < MOST_SHIFT_S * PASSES as f64 {
            late.vehicle += step(shift[1]);
        }
        late.brake += step(shift[2]);
        // A ring's period delays, never hastens.
        late.wheel_by_turn = (late.wheel_by_turn + step(shift[3])).max(0.0);
        // What the audit knows is not given up for what a law, still wrong, would like.
        let by_turn = late.wheel_by_turn;
        let wheel = late.wheel + by_turn;
        late.wheel = within(&audit.wheel_late, wheel, self.wheel.std) - by_turn;
        late.vehicle = within(&audit.vehicle_late, late.vehicle, self.vehicle.std);
        late.brake = within(&audit.brake_late, late.brake, self.brake.std);
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

/// A lateness fitted with this standard deviation, at most so many of the audit's from what that found; a vague one does not
/// hold a fit that knows it far better.
fn within(known: &Late, value: f64, std: f64) -> f64 {
    let reach = AUDIT_REACH * known.std;
    let holds = known.std < VAGUE_AUDIT_S || std > FAR_BETTER * known.std;
    if reach.is_finite() && holds {
        value.clamp(known.value - reach, known.value + reach)
    } else {
        value
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

    fn timing(wheel: f64, vehicle: f64, brake: f64) -> Timing {
        let late = |value| Late { value, std: 3e-4 };
        Timing {
            wheel: late(wheel),
            vehicle: late(vehicle),
            brake: late(brake),
            ..Timing::default()
        }
    }

    #[test]
    fn a_drag_that_all_channels_precede_alike_is_late_by_what_all_of_them_are_early() {
        let late = timing(-0.010, -0.011, -0.010).drag_late(false);
        assert!((late.unwrap() - 0.010).abs() < 1e-12);
        assert_eq!(timing(0.010, 0.011, 0.010).drag_late(false), None);
        // Each logger out of step by its own: what the others are early by beyond the wheel is theirs.
        assert_eq!(timing(-0.010, -0.013, -0.014).drag_late(false), Some(0.010));
        assert_eq!(timing(-0.010, -0.018, -0.019).drag_late(false), None);
    }

    #[test]
    fn a_vehicle_speed_that_is_late_speaks_against_a_late_drag_however_vague() {
        let mut no_brake = timing(-0.013, 0.032, 0.0);
        (no_brake.vehicle.std, no_brake.brake.std) = (0.003, 0.02);
        assert_eq!(no_brake.drag_late(false), None);
        // As vague as this it says nothing.
        no_brake.vehicle.std = 0.03;
        assert_eq!(no_brake.drag_late(false), Some(0.013));
    }

    #[test]
    fn a_wheel_that_is_early_alone_may_be_so_by_itself_where_a_chain_shows() {
        let mut alone = timing(-0.010, 0.0, 0.0);
        (alone.vehicle.std, alone.brake.std) = (0.03, f64::INFINITY);
        assert_eq!(alone.drag_late(false), Some(0.010));
        assert_eq!(alone.drag_late(true), None);
        // A brake that is early as well bears it out.
        (alone.brake.value, alone.brake.std) = (-0.010, 3e-4);
        assert_eq!(alone.drag_late(true), Some(0.010));
    }

    #[test]
    fn a_wheel_that_alone_precedes_drag_and_vehicle_is_left_to_the_tyre() {
        let mut early = timing(-0.004, 0.001, 0.0);
        assert!(early.wheel_early(false) && !early.wheel_early(true));
        let untold = early.untold();
        (early.late.wheel, early.late.wheel_by_turn) = (-0.005, 0.001);
        assert_eq!(
            early.leave_to_physics(None, Shown::default()),
            (None, false)
        );
        assert_eq!(early.wheel.value, 0.0);
        assert_eq!((early.late.wheel, early.late.wheel_by_turn), (0.0, 0.0));
        assert!(early.untold().left && !untold.left);
        // A tyre's memory is as long as before; the channels' is not.
        assert_eq!(early.untold().drag_s, untold.drag_s);
        assert!(early.untold().channels_s < 1e-3 && untold.channels_s > 4e-3);
        // By less than a logger is out of step, beside others that are, or a vehicle's speed that says nothing.
        assert!(!timing(-0.0015, 0.0, 0.0).wheel_early(false));
        assert!(!timing(-0.004, 0.005, 0.0).wheel_early(false));
        assert!(!timing(-0.004, 0.0, 0.005).wheel_early(false));
        let mut vague = timing(-0.004, 0.0, 0.0);
        vague.vehicle.std = 0.003;
        assert!(!vague.wheel_early(false));
        // Not alone: the brake is.
        let mut with_brake = timing(-0.004, 0.0, -0.025);
        assert_eq!(
            with_brake.leave_to_physics(None, Shown::default()),
            (None, true)
        );
        assert_eq!(with_brake.wheel.value, -0.004);
        // An argument by fewer runs does the same.
        let mut fewer = timing(-0.001, 0.005, 0.0);
        fewer.leave_to_physics(Some(&early), Shown::default());
        assert_eq!((fewer.wheel.value, fewer.vehicle.value), (0.0, 0.005));
    }

    #[test]
    fn a_late_receiver_says_nothing_against_a_late_drag() {
        assert_eq!(timing(-0.010, 0.030, -0.011).drag_late(false), Some(0.010));
        // Unless the drag's logger may be late, too.
        assert_eq!(timing(-0.010, 0.030, -0.011).drag_late(true), None);
        // A filter of the drag's that the brake has, too.
        assert_eq!(timing(-0.010, 0.030, 0.000).drag_late(false), None);
        assert_eq!(timing(0.004, 0.030, -0.011).drag_late(false), None);
        let mut no_brake = timing(-0.010, 0.030, 0.0);
        no_brake.brake.std = 0.02;
        assert_eq!(no_brake.drag_late(false), None);
    }

    #[test]
    fn a_brake_is_early_by_more_than_its_filters_make_it_where_that_is_known() {
        let early = |brake, std| {
            let mut told = timing(0.010, 0.030, brake);
            told.brake.std = std;
            told.brake_early()
        };
        assert!(early(-0.021, 1e-3) && !early(-0.019, 1e-3));
        // Three standard deviations beyond those 20 ms.
        assert!(early(-0.055, 5e-3) && !early(-0.034, 5e-3));
        assert!(!early(-0.055, f64::INFINITY));
    }

    #[test]
    fn a_memory_of_the_tyre_is_longer_than_what_it_leaves_to_a_late_drag() {
        // The drag 10 ms late against both speeds, whether or not it was left so: 3 standard deviations are 0.9 ms.
        let mut left = timing(-0.010, -0.010, -0.010);
        let taken_off = left.untold();
        assert!((taken_off.drag_s - 0.0109).abs() < 1e-9);
        left.leave(0.010);
        assert!((left.untold().drag_s - 0.0109).abs() < 1e-9);
        assert!((left.untold().channels_s - 9e-4).abs() < 1e-9);
        let shortest = taken_off.shortest_of_tyre_s();
        assert!((shortest - (taken_off.drag_s - shortest)).abs() < 1e-12);
        // Nor does a speed that hardly changes, whose lateness is not told.
        let mut held = timing(-0.001, 0.0, -0.001);
        held.vehicle.std = 7e-3;
        assert!((held.untold().drag_s - 0.0019).abs() < 1e-9);
        // Speeds that are late say nothing of the drag.
        assert!(timing(0.010, 0.030, 0.0).untold().drag_s < 1e-9);
    }

    #[test]
    fn a_lateness_of_the_vehicle_that_is_not_told_from_the_wheels_is_the_wheels_on_a_fresh_run() {
        let mut timing = timing(0.010, -0.055, 0.0);
        timing.late = Lateness {
            wheel: 0.010,
            vehicle: -0.055,
            ..Lateness::default()
        };
        assert_eq!(timing.told(), timing.late);
        timing.vehicle.std = 0.09;
        assert_eq!((timing.told().wheel, timing.told().vehicle), (0.010, 0.010));
        // None, and surely so.
        timing.late.vehicle = 1e-4;
        timing.vehicle = Late {
            value: 1e-4,
            std: 5e-4,
        };
        assert_eq!((timing.told().wheel, timing.told().vehicle), (0.010, 1e-4));
    }

    #[test]
    fn a_brake_alone_that_is_read_early_says_nothing_of_the_drag() {
        let mut alone = timing(-0.02, -0.02, -0.035);
        (alone.wheel.std, alone.vehicle.std) = (0.01, f64::INFINITY);
        assert!(alone.drag_late(false).is_none() && alone.brake_early());
    }

    #[test]
    fn a_brake_read_a_little_early_is_the_brake_s_where_the_speeds_are_in_step() {
        assert!(timing(0.0005, -0.001, -0.008).brake_early());
        assert!(!timing(0.0005, -0.001, -0.004).brake_early(), "too little");
        // A logger out of step may be the brake's, too.
        assert!(!timing(0.006, -0.001, -0.008).brake_early());
        assert!(!timing(0.0005, 0.012, -0.008).brake_early());
        // Left late with the drag, the speeds are in step with nothing.
        let mut left = timing(-0.010, -0.010, -0.018);
        left.leave(0.010);
        assert!(!left.brake_early());
    }

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

    #[test]
    fn no_lag_of_the_brake_is_longer_than_its_reading_is_early() {
        let found = |wheel: f64, brake: f64| {
            let mut timing = timing(wheel, wheel, brake);
            timing.found = Lateness {
                wheel,
                vehicle: wheel,
                brake,
                ..Lateness::default()
            };
            timing.brake_heard = true;
            timing
        };
        // Three standard deviations are 0.9 ms.
        let mut early = found(0.0, -0.020);
        early.leave_brake();
        assert!((early.untold().brake_s - 0.0209).abs() < 1e-9);
        let mut late = found(0.0, 0.002);
        assert_eq!(late.untold().longest_of_brake_s(), 0.0);
        late.brake_heard = false;
        assert_eq!(late.untold().longest_of_brake_s(), f64::INFINITY);
        // Early with everything: the drag is late.
        let mut drag = found(-0.012, -0.012);
        drag.leave(0.012);
        assert!((drag.untold().brake_s - 9e-4).abs() < 1e-9);
    }

    #[test]
    fn an_argument_by_fewer_runs_leaves_what_the_one_by_all_runs_does() {
        let mut all = timing(-0.010, -0.011, -0.010);
        assert_eq!(
            all.leave_to_physics(None, Shown::default()),
            (Some(0.010), false)
        );
        // By itself it would give this to the chain.
        let mut fewer = timing(-0.010, -0.018, -0.019);
        assert_eq!(
            fewer.clone().leave_to_physics(None, Shown::default()),
            (None, false)
        );
        assert_eq!(
            fewer.leave_to_physics(Some(&all), Shown::default()),
            (Some(0.010), false)
        );
        assert!((fewer.wheel.value).abs() < 1e-12 && (fewer.vehicle.value + 0.008).abs() < 1e-12);
        // And this to the brake.
        let mut alone = timing(0.0, 0.0, -0.030);
        let mut late = timing(0.010, 0.011, 0.010);
        assert_eq!(late.leave_to_physics(None, Shown::default()), (None, false));
        assert_eq!(
            alone.leave_to_physics(Some(&late), Shown::default()),
            (None, false)
        );
        assert_eq!(alone.leave_to_physics(None, Shown::default()), (None, true));
    }

    #[test]
    fn a_delay_is_told_against_the_drag_as_recorded() {
        let mut timing = timing(-0.004, 0.03, -0.006);
        timing.leave(0.006);
        assert!((timing.vehicle.value - 0.036).abs() < 1e-12);
        assert!((timing.against_drag(timing.vehicle).value - 0.03).abs() < 1e-12);
    }

    #[test]
    fn a_vague_audit_holds_no_fit_that_knows_far_better() {
        let audit = |std: f64| Late { value: 0.037, std };
        assert!((within(&audit(0.001), 0.002, 4e-4) - 0.035).abs() < 1e-12);
        assert!((within(&audit(0.010), 0.002, 4e-4) - 0.002).abs() < 1e-12);
        // Neither knows: the audit, which has no law that may be wrong, is not given up.
        assert!((within(&audit(0.010), 0.002, 0.2) - 0.017).abs() < 1e-12);
        assert!((within(&audit(f64::INFINITY), 0.002, 0.2) - 0.002).abs() < 1e-12);
    }
}
