//! Timing between the channels, from all balances at once: shifted until no derivative of a channel explains anything.

use super::correct::Lateness;
use crate::ablation::Ablation;
use crate::audit::Audit;
use crate::campaign::{Rig, Run};
use crate::data::Data;
use crate::innovations::gram::{solve, total};
use crate::innovations::hypothesis::{Effort, Judged, judge};
use crate::model::{Model, TYRE_BASE};

/// How late the channels are against the drag channel, with what is not known of it.
#[derive(Clone, Debug, Default)]
pub struct Timing {
    /// What is taken off.
    pub late: Lateness,
    /// Wheel speed (at its mean), vehicle speed, brake: name, value and standard deviation in s.
    pub estimates: Vec<(&'static str, f64, f64)>,
}

impl Timing {
    /// What the timing of wheel speed and brake was off by, in s: kernels differ by about as much as they delay.
    #[must_use]
    pub fn off_by(&self) -> f64 {
        self.estimates
            .iter()
            .filter(|(name, _, std)| *name != "vehicle" && *std < 0.01)
            .map(|(_, value, _)| value.abs())
            .fold(0.0, f64::max)
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
    // Very long campaigns are averaged as far as memory asks for.
    let huge = samples.div_ceil(20 * ENOUGH_SAMPLES).max(1);
    by_step * by_size.min(most).max(huge)
}

/// Brings the channels to the drag channel's time and fits the base law to them.
#[must_use]
pub fn timed(rig: &Rig, runs: &[Run], audit: &Audit) -> Option<(Data, Timing, Judged)> {
    let averaged = averaging(runs);
    let runs: Vec<Run> = runs.iter().map(|r| r.clone().averaged(averaged)).collect();
    let mut timing = Timing::default();
    let known = |t: &crate::audit::Timing| if t.std.is_finite() { t.value } else { 0.0 };
    timing.late.wheel = known(&audit.wheel_late);
    timing.late.vehicle = known(&audit.vehicle_late);
    timing.late.brake = known(&audit.brake_late);
    let mut model = Model {
        base: vec![0.0; TYRE_BASE],
        terms: Vec::new(),
    };
    model.base[0] = rig.peak_friction.ln();
    model.base[1] = rig.critical_slip.ln();
    let mut guess = None;
    for pass in 0..=PASSES {
        let corrected: Vec<Run> = runs.iter().map(|r| timing.late.corrected(r)).collect();
        let mut data = Data::new(rig, &corrected, Ablation::default());
        data.averaged = averaged;
        timing.late.turn = data.context.mean_wheel_speed;
        let samples: usize = data.series.iter().map(|s| s.len()).sum();
        let last = pass == PASSES;
        let effort = Effort {
            steps: if pass == 0 { 5 } else { 2 },
            sweeps: if pass == 0 || last { 3 } else { 1 },
            stride: (samples / 9000).max(1),
            noise_stride: 2,
        };
        let judged = judge(&data, &model, &[], guess.as_deref(), effort)?;
        let (shift, std) = shifts(&judged)?;
        timing.estimates = vec![
            (
                "wheel",
                timing.late.wheel + timing.late.wheel_by_turn + shift[0] + shift[3],
                std[0],
            ),
            ("vehicle", timing.late.vehicle + shift[1], std[1]),
            ("brake", timing.late.brake + shift[2], std[2]),
        ];
        model = judged.model.clone();
        let small = shift.iter().all(|s| s.abs() < SMALL_SHIFT_S);
        if last || (small && pass >= 2) {
            return Some((data, timing, judged));
        }
        guess = Some(judged.parts);
        let step = |s: f64| {
            if s.is_finite() {
                s.clamp(-MOST_SHIFT_S, MOST_SHIFT_S)
            } else {
                0.0
            }
        };
        timing.late.wheel += step(shift[0]);
        timing.late.vehicle += step(shift[1]);
        timing.late.brake += step(shift[2]);
        timing.late.wheel_by_turn += step(shift[3]);
    }
    None
}

/// Shifts that are still asked for (wheel, vehicle, brake, wheel by turn), and the standard deviations of the first
/// three from the spread over runs or from the noise, whichever is larger.
fn shifts(judged: &Judged) -> Option<([f64; 4], [f64; 3])> {
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
    let std = core::array::from_fn(|i| {
        let mean = runs.iter().map(|x| x[i]).sum::<f64>() / r;
        let jackknife =
            ((r - 1.0) / r * runs.iter().map(|x| (x[i] - mean).powi(2)).sum::<f64>()).sqrt();
        let c = |a: usize, b: usize| all.covariance[(first + a, first + b)];
        let own = match i {
            0 => c(0, 0) + c(3, 3) + 2.0 * c(0, 3),
            _ => c(i, i),
        };
        jackknife.max(own.max(0.0).sqrt())
    });
    Some((core::array::from_fn(|i| all.coefficients[first + i]), std))
}
